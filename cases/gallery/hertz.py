"""Hertz's contact of two cylinders."""

import math

import numpy as np

from pbem.results.reader import Results

TITLE = "Hertz's contact of two cylinders"
SUBJECT = "contact"
PROBLEM = """Half a cylinder of steel (radius 100 mm) is pressed by the force P = 6000 N/mm on half a cylinder of
bronze (50 mm), in plane strain and without friction. With 1/R the sum of the curvatures and 1/E* the sum of (1 -
nu^2)/E, the half-width of the contact is a = sqrt(4 P R/(pi E*)) = 2.0 mm and the largest pressure 2 P/(pi a).
Hertz's solution is that of half-planes; a/R = 0.06 here."""
SOURCE = """H. Hertz, Ueber die Beruehrung fester elastischer Koerper, Journal fuer die reine und angewandte
Mathematik 92 (1882) 156-171; K. L. Johnson, Contact Mechanics, section 4.2 (Cambridge, 1985)."""
FORCE, CURVATURE = 30.0 * 200, 1 / 100 + 1 / 50
SOFTNESS = (1 - 0.3**2) / 210e3 + (1 - 0.34**2) / 110e3
HALF_WIDTH = math.sqrt(4 * FORCE * SOFTNESS / (math.pi * CURVATURE))
EXPECTED = {
    "largest pressure, MPa": (2 * FORCE / (math.pi * HALF_WIDTH), 4e-3),
    "half-width, mm": (HALF_WIDTH, 5e-3),
    "force across the contact, N/mm": (FORCE, 1e-3),
}
PICTURES = [
    ("von Mises stress below the contact", ["plot", "--field", "mises", "--box", "-5", "-6", "5", "6"]),
    ("pressure along the contact", ["plot", "--curve", "touch", "--field", "traction_n", "--x", "x"]),
]


def compute(results: Results) -> dict[str, float]:
    """The squares of the pressures lie on a parabola: its height and its zeros, from the inner part of the contact."""
    touch = results.contact["touch"]
    x, pressure = touch.position[:, 0], -touch.traction_n[-1]
    inner = pressure > 0.5 * pressure.max()
    curvature, _, height = np.polyfit(x[inner], pressure[inner] ** 2, 2)
    return {
        "largest pressure, MPa": math.sqrt(height),
        "half-width, mm": math.sqrt(height / -curvature),
        "force across the contact, N/mm": -touch.integrate("traction_n")[-1],
    }
