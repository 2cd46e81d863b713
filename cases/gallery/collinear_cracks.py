"""Two collinear cracks."""

import math

from pbem.exact import collinear_cracks_intensity
from pbem.results.reader import Results

TITLE = "Two collinear cracks that attract each other"
SUBJECT = "fracture"
PROBLEM = """Two cracks of 10 mm lie in line, 1 mm apart, in a plate (plane stress) under the tension s = 10 MPa
across them. With their ends at b and c from the middle between them, KI = s sqrt(pi/b) (c^2 E/K - b^2)/sqrt(c^2 -
b^2) at the inner tips and s sqrt(pi) c^(3/2) (1 - E/K)/sqrt(c^2 - b^2) at the outer ones, where K and E are complete
elliptic integrals of the parameter 1 - b^2/c^2."""
SOURCE = """T. J. Willmore, The distribution of stress in the neighbourhood of a crack, Quarterly Journal of Mechanics
and Applied Mathematics 2 (1949) 53-63; Tada, Paris, Irwin, The Stress Analysis of Cracks Handbook (ASME, 2000)."""
INNER, OUTER = (factor / math.sqrt(1000) for factor in collinear_cracks_intensity(0.5, 10.5, 10.0))
EXPECTED = {
    "KI at the inner tips, MPa sqrt(m)": (INNER, 1e-3),
    "KI at the outer tips, MPa sqrt(m)": (OUTER, 1e-3),
}
PICTURES = [
    ("normal stress across the cracks", ["plot", "--field", "syy", "--box", "-13", "-7", "13", "7"]),
    ("opening of the right crack", ["plot", "--curve", "right", "--field", "opening", "--x", "x"]),
]


def compute(results: Results) -> dict[str, float]:
    """Factors at the start and the end of the right crack; from mm to m."""
    inner, outer = results.tips["right"].KI[-1] / math.sqrt(1000)
    return {"KI at the inner tips, MPa sqrt(m)": inner, "KI at the outer tips, MPa sqrt(m)": outer}
