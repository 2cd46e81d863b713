"""A pin pressed by a force into its clearance."""
import math

import numpy as np

SUBJECT = "contact"
TITLE = "Pin pressed by a force into its clearance"
PROBLEM = """A pin of radius R = 10 lies in the middle of a hole of radius 10.01 in a large plate of the same steel,
and is pressed without friction by a force Q = 4000 per unit thickness. Nothing holds it before it touches; the program
moves it into contact. The contact is an arc whose half-angle e depends only on E' c/Q, with the clearance c."""
SOURCE = "A. Persson, 1964; closed form of M. Ciavarella, P. Decuzzi, Int. J. Solids Structures 38, 2001, b = tan(e/2)"
RADIUS, CLEARANCE, FORCE, MODULUS = 10.0, 0.01, 4000.0, 210000.0 / (1 - 0.3**2)


def find_tangent() -> float:
    """b from E' c/Q = (2 - ln(b^2 + 1) - 2 b^4)/(pi b^2 (b^2 + 1)), which falls with b; by halving."""
    low, high = 1e-6, 1.0
    for _ in range(60):
        b = 0.5 * (low + high)
        left = (2 - math.log(b**2 + 1) - 2 * b**4) / (math.pi * b**2 * (b**2 + 1)) - MODULUS * CLEARANCE / FORCE
        low, high = (b, high) if left > 0 else (low, b)
    return low


def evaluate(angle, b: float):
    root, inside = math.sqrt(b**2 + 1), np.sqrt(np.maximum(b**2 - np.tan(0.5 * angle) ** 2, 0.0))
    tail = np.log((root + inside) / (root - inside)) / (2 * math.pi * b**2 * (b**2 + 1))
    return FORCE / RADIUS * (2 * inside / (math.pi * root * (1 + np.tan(0.5 * angle) ** 2)) + tail)


EXPECTED = {"largest error over the largest pressure": (0.0, 1e-2), "force on the pin": (-FORCE, 1e-9)}
PICTURES = [("the stress under the pin", ["plot", "--field", "mises", "--box", "-20", "-25", "20", "15"]),
            ("the pressure along the seat", ["plot", "--curve", "seat", "--field", "traction_n"])]


def compute(results) -> dict[str, float]:
    seat, b = results.contact["seat"], find_tangent()
    angle, exact = np.arctan2(seat.position[:, 0], -seat.position[:, 1]), evaluate(np.zeros(1), b)[0]
    inner = np.abs(angle) < 0.9 * 2 * math.atan(b)
    error = np.abs(-seat.traction_n[-1] - evaluate(angle, b))[inner].max()
    return {"largest error over the largest pressure": error / exact,
            "force on the pin": float(results.rigid["hub"].force[-1, 1])}
