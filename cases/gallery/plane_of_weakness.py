"""A specimen with a plane of weakness."""

import math

from pbem.results.reader import Results

TITLE = "A specimen with a plane of weakness under confining pressure"
SUBJECT = "rock joints"
PROBLEM = """A specimen of slate is cut by a joint at an angle of q = 54.5 degrees to the horizontal, with cohesion c =
2 MPa and a friction angle of 30 degrees (f = 0.577), and compressed under the confining pressure p = 5 MPa. It fails
by sliding on the joint, when s1 - p = 2 (c + f p)/((1 - f cot q) sin(2 q)). From then on the stress no longer rises
with the shortening, and is uniform in both parts."""
SOURCE = """J. C. Jaeger, Shear failure of anisotropic rocks, Geological Magazine 97 (1960) 65-72; J. C. Jaeger, N. G.
W. Cook, R. W. Zimmerman, Fundamentals of Rock Mechanics, section 4.9 (Blackwell, 2007)."""
ANGLE, FRICTION = math.atan2(70, 50), math.tan(math.radians(30))
DIFFERENCE = 2 * (2 + FRICTION * 5) / ((1 - FRICTION / math.tan(ANGLE)) * math.sin(2 * ANGLE))
EXPECTED = {
    "axial stress at failure, MPa": (-5 - DIFFERENCE, 1e-3),
    "part of the joint that slides": (1.0, 1e-9),
}
PICTURES = [
    ("the specimen after sliding", ["plot", "--label", "joint"]),
]


def compute(results: Results) -> dict[str, float]:
    """The force on the upper plate, over its width."""
    return {
        "axial stress at failure, MPa": results.reactions["head"][-1, 1] / 50,
        "part of the joint that slides": float((results.contact["joint"].mode[-1] == 1).mean()),
    }
