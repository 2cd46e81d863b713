"""A slit in a sheet that yields in strips."""

import math

from pbem.results.reader import Results

TITLE = "Strength of a cracked sheet by its size: Dugdale's strips"
SUBJECT = "fracture"
PROBLEM = """A slit of half-length a = 50 mm in a large steel sheet under tension, E = 200 GPa, plane stress. Strips
ahead of it carry the yield stress s = 300 MPa until they tear at the opening d = 0.1 mm: bonds of constant traction
with the fracture energy s d. Strips of length a (1/cos(pi p/2 s) - 1) open at a tension p by 8 s a/(pi E) ln(1/cos(pi
p/2 s)) at the end of the slit. When this reaches d, at p = (2 s/pi) acos exp(-pi E d/(8 s a)), the slit propagates:
the next step is not an equilibrium, and energy is released."""
SOURCE = """D. S. Dugdale, Yielding of steel sheets containing slits, J. Mech. Phys. Solids 8 (1960);
B. A. Bilby, A. H. Cottrell, K. H. Swinden, Proc. R. Soc. A 272 (1963), for the opening."""
HALF, YIELD, YOUNG = 0.05, 300.0, 200e3
TORN = 2 * YIELD / math.pi * math.acos(math.exp(-math.pi * YOUNG * 1e-4 / (8 * YIELD * HALF)))
SECANT = 1 / math.cos(math.pi * 150.0 / (2 * YIELD))
EXPECTED = {
    "strength, MPa": (TORN, 1e-2),
    "length of the strips at 150 MPa, mm": (1e3 * HALF * (SECANT - 1), 5e-2),
    "opening of the slit at 150 MPa, mm": (8e3 * YIELD * HALF / (math.pi * YOUNG) * math.acosh(SECANT), 1e-2),
}
PICTURES = [
    ("traction and opening along a strip at 150 MPa", ["plot", "--curve", "right", "--field", "traction_n,opening",
                                                      "--step", "2"]),
    ("stress around the slit and its strips at 150 MPa", ["plot", "--field", "syy", "--step", "2"]),
]


def compute(results: Results) -> dict[str, float]:
    """The last equilibrium; at 150 MPa the middle between the last pair that has parted and the next, and the opening.
    """
    strip, slit = results.contact["right"], results.contact["slit"]
    last = int((results.energy.released == 0).sum()) - 1
    held = 150.0 + 35.0 * results.steps.factor[last]
    parted = strip.mode[1] == 2
    length = 0.5 * (strip.arc_length[parted].max() + strip.arc_length[~parted].min())
    return {"strength, MPa": held, "length of the strips at 150 MPa, mm": 1e3 * length,
            "opening of the slit at 150 MPa, mm": 1e3 * slit.opening[1].max()}
