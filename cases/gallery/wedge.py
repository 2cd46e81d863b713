"""A wedge that locks itself."""

import math

from pbem.results.reader import Results

TITLE = "A self-locking wedge"
SUBJECT = "contact"
PROBLEM = """A steel wedge of half-angle a = 10 degrees is driven into a notch by a force P and then released. While it
is driven, its faces slide, and it pushes each side outwards with P/(2 tan(a + b)), where tan b = 0.3 is the friction.
After release the wedge is held by friction alone: the ratio of shear to normal force on a face is tan a. As this is
less than 0.3, the faces stick and the notch remains under stress."""
SOURCE = """Statics of the wedge: equilibrium of the three forces on it; e.g. J. L. Meriam, L. G. Kraige, Engineering
Mechanics: Statics, section 6/4 (Wiley, 2002)."""
ANGLE, FRICTION = math.atan(3.526539614 / 20), 0.3
FORCE = 200 * 2 * 7.526539614
EXPECTED = {
    "outward force as it is driven, over P": (0.5 / math.tan(ANGLE + math.atan(FRICTION)), 1e-3),
    "shear over normal force as it is driven": (FRICTION, 1e-6),
    "shear over normal force when let go": (math.tan(ANGLE), 1e-3),
}
PICTURES = [
    ("horizontal stress that remains", ["plot", "--field", "sxx", "--limits", "-300", "300"]),
    ("tractions of the left face when let go", ["plot", "--curve", "left", "--field", "traction_n,traction_s"]),
]


def compute(results: Results) -> dict[str, float]:
    """Forces of the left face in stage 1 (step 2) and at the end."""
    left = results.contact["left"]
    normal, shear = -left.integrate("traction_n"), abs(left.integrate("traction_s"))
    driven = 1
    return {
        "outward force as it is driven, over P":
            (normal[driven] * math.cos(ANGLE) - shear[driven] * math.sin(ANGLE)) / FORCE,
        "shear over normal force as it is driven": shear[driven] / normal[driven],
        "shear over normal force when let go": shear[-1] / normal[-1],
    }
