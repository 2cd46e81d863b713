"""A cross of two cracks."""

import math

from pbem.results.reader import Results

TITLE = "Crossing cracks: a cross under fluid pressure"
SUBJECT = "fracture"
PROBLEM = """Two cracks of half-length a = 1 m cross at right angles in an infinite plane and are opened by fluid at
the pressure p = 1 MPa. In the case file they are two curves; they are cut where they cross, into flat.1, flat.2,
steep.1 and steep.2. At all four tips KI = 0.8636 p sqrt(pi a), less than that of a single crack, and KII = 0."""
SOURCE = """D. P. Rooke, I. N. Sneddon, The crack energy and the stress intensity factor for a cruciform crack
deformed by internal pressure, International Journal of Engineering Science 7 (1969) 1079-1089."""
EXPECTED = {
    "KI/(p sqrt(pi a))": (0.8636, 1e-3),
    "KI of all tips, largest over smallest": (1.0, 1e-3),
}
PICTURES = [
    ("the opened cross", ["plot", "--field", "s1", "--box", "-1.6", "-1.6", "1.6", "1.6", "--displaced"]),
    ("opening of the flat crack", ["plot", "--curve", "flat", "--field", "opening", "--x", "x"]),
]


def compute(results: Results) -> dict[str, float]:
    """The factor of the right tip, and all four compared."""
    ends = [results.tips[f"{crack}.{arm}"].KI[-1, arm - 1] for crack in ("flat", "steep") for arm in (1, 2)]
    return {
        "KI/(p sqrt(pi a))": ends[1] / math.sqrt(math.pi),
        "KI of all tips, largest over smallest": max(ends) / min(ends),
    }
