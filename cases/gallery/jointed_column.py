"""A column with an elastic joint."""

import math

import numpy as np

from pbem.results.reader import Results

TITLE = "Deformability of a column with an elastic joint"
SUBJECT = "rock joints"
PROBLEM = """A column of height h = 2 m (plane strain) is crossed by a joint that dips at q = 21.8 degrees and has the
stiffness kn = 20 and ks = 5 GPa/m. Under the axial stress s = 10 MPa the joint carries s cos(q)^2 across and s sin(q)
cos(q) along it, below its friction of 35 degrees, and the stress is uniform. The head moves down by s h/E', and
additionally by s cos(q) (cos(q)^2/kn + sin(q)^2/ks), the contribution of the joint."""
SOURCE = """R. E. Goodman, R. L. Taylor, T. L. Brekke, A model for the mechanics of jointed rock, Journal of the Soil
Mechanics and Foundations Division ASCE 94 (1968) 637-659; R. E. Goodman, Introduction to Rock Mechanics, chapter 6
(Wiley, 1989)."""
DIP = math.atan2(0.4, 1.0)
JOINT = 10 * math.cos(DIP) * (math.cos(DIP) ** 2 / 20e3 + math.sin(DIP) ** 2 / 5e3)
EXPECTED = {
    "closure of the joint, mm": (1e3 * 10 * math.cos(DIP) ** 2 / 20e3, 1e-6),
    "settlement of the head, mm": (1e3 * (10 * 2 * (1 - 0.25**2) / 20e3 + JOINT), 1e-6),
}
PICTURES = [
    ("vertical displacement: the joint adds a jump", ["plot", "--field", "uy", "--width", "11"]),
]


def compute(results: Results) -> dict[str, float]:
    """Mean displacement of the head, closure of the joint."""
    head = results.nodes.curve == results.nodes.curve_names.index("head")
    return {
        "closure of the joint, mm": -1e3 * results.contact["joint"].opening[-1].mean(),
        "settlement of the head, mm": -1e3 * np.mean(results.displacement[-1][head, 1]),
    }
