"""Partial slip."""

import math

import numpy as np

from pbem.results.reader import Results

TITLE = "Partial slip of pressed cylinders (Cattaneo, Mindlin)"
SUBJECT = "contact"
PROBLEM = """Two equal cylinders are pressed by P and then pushed by Q, less than f P. The contact of half-width a
slips at its edges, and sticks where |x| < c = a sqrt(1 - Q/(f P)). The shear traction is that of full slip, f p0
sqrt(1 - x^2/a^2), less c/a times the same distribution of width c: in the middle it is f p0 (1 - c/a). P and Q are the
forces at the top; a and p0 follow from P by Hertz's formulas."""
SOURCE = """C. Cattaneo, Rendiconti dell'Accademia nazionale dei Lincei 27 (1938) 342-348, 434-436, 474-478; R. D.
Mindlin, Compliance of elastic bodies in contact, Journal of Applied Mechanics 16 (1949) 259-268."""
SOFTNESS, CURVATURE = 2 * (1 - 0.3**2) / 210e3, 2 / 100
EXPECTED = {
    "shear traction in the middle over f p0 (1 - c/a)": (1.0, 1e-2),
    "half-width that sticks, over c": (1.0, 3e-2),
}
PICTURES = [
    ("shear traction, pressure and slip across the contact",
     ["plot", "--curve", "touch", "--field", "traction_n,traction_s,slip", "--x", "x"]),
    ("largest shear stress", ["plot", "--field", "shear", "--box", "-6", "-5", "6", "5"]),
]


def compute(results: Results) -> dict[str, float]:
    """From the forces at the top, and the tractions and statuses of the contact."""
    push, press = np.abs(results.reactions["top"][-1])
    half_width = math.sqrt(4 * press * SOFTNESS / (math.pi * CURVATURE))
    share = math.sqrt(1 - push / (0.3 * press))
    touch = results.contact["touch"]
    x, shear = touch.position[:, 0], np.abs(touch.traction_s[-1])
    sticks, middle = np.sort(x[touch.mode[-1] == 0]), np.abs(x) < 0.3 * share * half_width
    spacing = np.diff(np.sort(x)).mean()
    height = np.polyval(np.polyfit(x[middle], shear[middle], 2), 0.0)
    peak = 2 * press / (math.pi * half_width)
    return {
        "shear traction in the middle over f p0 (1 - c/a)": height / (0.3 * peak * (1 - share)),
        "half-width that sticks, over c": (sticks[-1] - sticks[0] + spacing) / (2 * share * half_width),
    }
