"""A stiff fibre in a matrix."""

from pbem.results.reader import Results

TITLE = "A stiff fibre in a matrix under tension"
SUBJECT = "composites"
PROBLEM = """A glass fibre of shear modulus g is bonded to a polymer of shear modulus G, under the tension s across the
fibre (plane strain). With k = 3 - 4 nu of the fibre and K of the matrix, the stress in the fibre is uniform: its sum
sxx + syy is s (K + 1) g/(2 g + (k - 1) G), and its difference sxx - syy is s (K + 1) g/(G + K g)."""
SOURCE = """J. N. Goodier, Concentration of stress around spherical and cylindrical inclusions and flaws, Journal of
Applied Mechanics 1 (1933) 39-44; J. D. Eshelby, Proceedings of the Royal Society A 241 (1957) 376-396."""
G, K = 3.5e3 / (2 * 1.35), 3 - 4 * 0.35
g, k = 72e3 / (2 * 1.22), 3 - 4 * 0.22
SUM, DIFFERENCE = 10 * (K + 1) * g / (2 * g + (k - 1) * G), 10 * (K + 1) * g / (G + K * g)
EXPECTED = {
    "sxx in the fibre, MPa": (0.5 * (SUM + DIFFERENCE), 2e-4),
    "syy in the fibre, MPa": (0.5 * (SUM - DIFFERENCE), 1e-3),
}
PICTURES = [
    ("stress along the load", ["plot", "--field", "sxx", "--box", "-15", "-12", "15", "12"]),
    ("tractions around the fibre", ["plot", "--curve", "fibre", "--field", "traction_n,traction_s", "--x", "angle"]),
]


def compute(results: Results) -> dict[str, float]:
    """At a point inside, which may be any."""
    sxx, syy, _ = results.evaluate([[1.5, -2.0]]).stress[-1][0]
    return {"sxx in the fibre, MPa": sxx, "syy in the fibre, MPa": syy}
