"""A crack along an arc."""

import math

from pbem.exact import arc_crack_intensity
from pbem.results.reader import Results

TITLE = "A crack along an arc of a circle: mixed mode"
SUBJECT = "fracture"
PROBLEM = """A crack along an arc of radius R = 2 m and half-angle b = 60 degrees in an infinite plane under
equibiaxial tension s = 1 MPa. KI = s sqrt(pi R sin b) cos(b/2)/(1 + sin(b/2)^2), and KII has sin(b/2) instead of
cos(b/2). By Irwin's relation the J-integral is (KI^2 + KII^2)/E'."""
SOURCE = """N. I. Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity, section 124
(Noordhoff, 1953); Tada, Paris, Irwin, The Stress Analysis of Cracks Handbook (ASME, 2000)."""
KI, KII = arc_crack_intensity(2.0, math.radians(60), 1.0)
EXPECTED = {
    "KI, MPa sqrt(m)": (KI, 1e-3),
    "KII, MPa sqrt(m)": (KII, 1e-3),
    "J, kN/m": ((KI**2 + KII**2) * (1 - 0.2**2) / 10e3 * 1e3, 2e-3),
}
PICTURES = [
    ("larger principal stress around the opened arc", ["plot", "--field", "s1", "--displaced"]),
    ("opening and slip along the arc", ["plot", "--curve", "arc", "--field", "opening,slip"]),
]


def compute(results: Results) -> dict[str, float]:
    """Magnitudes at the end of the arc."""
    tips = results.tips["arc"]
    return {"KI, MPa sqrt(m)": tips.KI[-1, 1], "KII, MPa sqrt(m)": abs(tips.KII[-1, 1]), "J, kN/m": 1e3 * tips.J[-1, 1]}
