"""Griffith's crack."""

import math

import numpy as np

from pbem.results.reader import Results

TITLE = "Griffith's crack: stress-intensity factor, opening and T-stress"
SUBJECT = "fracture"
PROBLEM = """A crack of half-length a = 1 m in an infinite plane (plane strain) under the tension s = 2 MPa across it.
The stress-intensity factor is s sqrt(pi a), the opening an ellipse of height 4 s a/E' in its middle, with E' = E/(1 -
nu^2), and the T-stress -s. Eight elements are enough: those at the tips have the square-root shape."""
SOURCE = """A. A. Griffith, The phenomena of rupture and flow in solids, Philosophical Transactions of the Royal
Society A 221 (1921) 163-198; H. Tada, P. C. Paris, G. R. Irwin, The Stress Analysis of Cracks Handbook (ASME,
2000)."""
EXPECTED = {
    "KI, MPa sqrt(m)": (2 * math.sqrt(math.pi), 5e-4),
    "opening in the middle, mm": (4 * 2 / (10e3 / (1 - 0.2**2)) * 1e3, 1e-3),
    "T-stress, MPa": (-2.0, 2e-3),
}
PICTURES = [
    ("normal stress across the crack", ["plot", "--field", "syy", "--box", "-2", "-1.5", "2", "1.5"]),
    ("opening along the crack", ["plot", "--curve", "crack", "--field", "opening"]),
]


def compute(results: Results) -> dict[str, float]:
    """KI and T at the end of the crack, and the largest opening."""
    tips, crack = results.tips["crack"], results.contact["crack"]
    middle = np.interp(0.0, crack.position[:, 0], crack.opening[-1])
    return {
        "KI, MPa sqrt(m)": tips.KI[-1, 1],
        "opening in the middle, mm": 1e3 * middle,
        "T-stress, MPa": tips.T[-1, 1],
    }
