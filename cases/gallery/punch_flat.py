"""A rigid flat punch under a force beside its middle."""

import math

import numpy as np

SUBJECT = "contact"
TITLE = "Flat punch under an eccentric force"
PROBLEM = """A rigid punch with a flat face of width 2 a = 2 is pressed without friction on a large block by a force P
= 1 that acts 0.2 to the right of its middle: force and moment of the tool are given, and its displacement along the
face is zero. The pressure grows without bound towards both edges, and the punch tilts."""
SOURCE = "K. L. Johnson, Contact Mechanics, 1985, section 2.8: p = (P + 2 M x/a^2)/(pi sqrt(a^2 - x^2)), half-plane"
FORCE, MOMENT, HALF, MODULUS = 1.0, 0.2, 1.0, 1000.0 / (1 - 0.3**2)
EXPECTED = {
    "largest error of the pressure within 0.9 a": (0.0, 5e-3),
    "force along y": (-FORCE, 1e-9),
    "tilt, radians": (-4 * MOMENT / (math.pi * MODULUS * HALF**2), 1e-2),
}
PICTURES = [
    ("the block and the punch, displacements magnified", ["plot", "--box", "-3", "-2", "3", "1", "--magnify", "60"]),
    ("the pressure under the punch", ["plot", "--curve", "seat"]),
]


def compute(results) -> dict[str, float]:
    seat, punch = results.contact["seat"], results.rigid["punch"]
    x = seat.position[:, 0]
    inner = np.abs(x) < 0.9 * HALF
    exact = (FORCE + 2 * MOMENT * x[inner] / HALF**2) / (math.pi * np.sqrt(HALF**2 - x[inner] ** 2))
    return {
        "largest error of the pressure within 0.9 a": float(np.abs(-seat.traction_n[-1][inner] / exact - 1).max()),
        "force along y": float(punch.force[-1, 1]),
        "tilt, radians": math.radians(punch.motion[-1, 2]),
    }
