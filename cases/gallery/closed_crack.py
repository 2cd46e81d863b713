"""A closed crack with friction."""

import math

import numpy as np

from pbem.results.reader import Results

TITLE = "A closed, inclined crack with friction under compression"
SUBJECT = "fracture"
PROBLEM = """A crack of half-length a = sqrt(2) m at 45 degrees in an infinite plane (plane strain) under the
compression s = 10 MPa along y. Its faces carry s/2 of normal pressure and, by friction f = 0.4, f s/2 of shear. The
rest, (1 - f) s/2, is released: the slip is an ellipse of the height 4 (1 - f) (s/2) a/E', and KII = (1 - f) (s/2)
sqrt(pi a). The crack does not open, and the pressure on it is that without the crack."""
SOURCE = """F. A. McClintock, J. B. Walsh, Friction on Griffith cracks in rocks under pressure, Proceedings of the
Fourth US National Congress of Applied Mechanics (1962) 1015-1021."""
HALF_LENGTH, DRIVING = math.sqrt(2), (1 - 0.4) * 5.0
EXPECTED = {
    "KII, MPa sqrt(m)": (DRIVING * math.sqrt(math.pi * HALF_LENGTH), 5e-4),
    "slip in the middle, mm": (4 * DRIVING * HALF_LENGTH / (20e3 / (1 - 0.25**2)) * 1e3, 1e-3),
    "normal traction, MPa": (-5.0, 1e-6),
    "shear traction, MPa": (2.0, 1e-6),
}
PICTURES = [
    ("largest shear stress around the crack", ["plot", "--field", "shear", "--box", "-2", "-2", "2", "2"]),
    ("slip and tractions along the crack", ["plot", "--curve", "crack", "--field", "slip,traction_n,traction_s"]),
]


def compute(results: Results) -> dict[str, float]:
    """KII at the end; slip in the middle, and the largest tractions, of the crack's faces."""
    crack = results.contact["crack"]
    return {
        "KII, MPa sqrt(m)": abs(results.tips["crack"].KII[-1, 1]),
        "slip in the middle, mm": 1e3 * np.interp(0.0, crack.position[:, 0], np.abs(crack.slip[-1])),
        "normal traction, MPa": crack.traction_n[-1].min(),
        "shear traction, MPa": np.abs(crack.traction_s[-1]).max(),
    }
