"""Delamination by moments."""

from pbem.results.reader import Results

TITLE = "Delamination of two layers by moments"
SUBJECT = "composites"
PROBLEM = """A layer of carbon composite (h = 2 mm) on one of glass composite (3 mm), both taken as isotropic, with a
long crack between them. Opposite moments M = 60 N mm per mm of width open it (plane strain). The bonded part is free
of stress far from the tip, so each arm releases its bending energy: J = 6 M^2/(E' h^3), summed over both arms, with E'
= E/(1 - nu^2). It does not depend on the length of the crack, and is exact up to terms that decrease exponentially
with it. Between two materials there is a J-integral, but no KI and KII in the usual sense."""
SOURCE = """J. R. Rice, A path independent integral and the approximate analysis of strain concentration by notches
and cracks, Journal of Applied Mechanics 35 (1968) 379-386; Z. Suo, J. W. Hutchinson, Interface crack between two
elastic layers, International Journal of Fracture 43 (1990) 1-18."""
CARBON, GLASS = 130e3 / (1 - 0.3**2), 40e3 / (1 - 0.25**2)
EXPECTED = {"J at the tip, N/mm": (6 * 60**2 * (1 / (CARBON * 2**3) + 1 / (GLASS * 3**3)), 1e-3)}
PICTURES = [
    ("displaced layers, and the stress along them",
     ["plot", "--field", "sxx", "--displaced", "--limits", "-100", "100"]),
    ("opening along the crack", ["plot", "--curve", "crack", "--field", "opening"]),
    ("traction across the bond in front of it",
     ["plot", "--curve", "bond", "--field", "traction_n", "--x", "x", "--ylim", "-20", "60"]),
]


def compute(results: Results) -> dict[str, float]:
    """The J-integral at the inner end of the crack."""
    return {"J at the tip, N/mm": results.tips["crack"].J[-1, 1]}
