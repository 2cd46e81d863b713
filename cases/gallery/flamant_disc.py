"""A disc pressed by two forces."""

import math

from pbem.results.reader import Results

TITLE = "A disc compressed by two forces (Brazilian test)"
SUBJECT = "rock joints"
PROBLEM = """A disc of radius R = 25 mm is pressed by two opposite forces P = 0.1 MN/m at points of its rim. The stress
is that of two Flamant fields and a uniform tension P/(pi R): in the middle P/(pi R) across and -3 P/(pi R) along the
forces, and at the distance r below a force -2 P/(pi r) - 2 P/(pi (2 R - r)) + P/(pi R) along it. The diameter across
the forces grows by 2 P/(pi E) (2 - (pi/2) (1 - nu)) in plane stress. Point supports hold the disc at the ends of that
diameter and carry no load."""
SOURCE = """H. Hertz, 1883; A. Flamant, 1892; S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, article 41
(McGraw-Hill, 1970)."""
P, R, E, NU = 0.1, 0.025, 20e3, 0.25
NEAR = 1e-6
EXPECTED = {
    "sxx in the middle, MPa": (P / (math.pi * R), 1e-3),
    "syy in the middle, MPa": (-3 * P / (math.pi * R), 1e-3),
    "syy 1 um below the force, GPa": (
        1e-3 * P / math.pi * (-2 / NEAR - 2 / (2 * R - NEAR) + 1 / R), 1e-3),
    "growth across, um": (1e6 * 2 * P / (math.pi * E) * (2 - 0.5 * math.pi * (1 - NU)), 1e-3),
}
PICTURES = [("tension across: the disc splits along the forces", ["plot", "--field", "sxx", "--limits", "-3", "3"])]


def compute(results: Results) -> dict[str, float]:
    """In the middle, near to the upper force, and at the right support, as the left one does not move."""
    found = results.evaluate([[0.0, 0.0], [0.0, R - NEAR], [R, 0.0]])
    (xx, yy, _), (_, near, _), _ = found.stress[-1]
    return {
        "sxx in the middle, MPa": xx, "syy in the middle, MPa": yy, "syy 1 um below the force, GPa": 1e-3 * near,
        "growth across, um": 1e6 * found.displacement[-1][2, 0],
    }  # fmt: skip
