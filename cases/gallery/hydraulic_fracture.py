"""A hydraulic fracture."""

import math

from pbem.results.reader import Results

TITLE = "A hydraulic fracture whose fluid lags behind its tips"
SUBJECT = "injection"
PROBLEM = """A fracture of half-length a = 10 m is held open by fluid at p = 8 MPa that fills it up to c = 9 m, against
the stress s = 5 MPa in the rock. KI = sqrt(pi a) ((2/pi) p asin(c/a) - s). Filled to its tips it would have (p - s)
sqrt(pi a), four times as much: the dry ends reduce it. KI = 0 would be the case of rock without toughness."""
SOURCE = """S. A. Khristianovic, Y. P. Zheltov, Formation of vertical fractures by means of highly viscous fluid,
Proceedings of the Fourth World Petroleum Congress 2 (1955) 579-586; Tada, Paris, Irwin, The Stress Analysis of Cracks
Handbook (ASME, 2000)."""
EXPECTED = {
    "KI, MPa sqrt(m)": (math.sqrt(math.pi * 10) * (2 / math.pi * 8 * math.asin(0.9) - 5), 2e-3),
    "open part of the fracture": (1.0, 1e-9),
}
PICTURES = [
    ("stress across the fracture", ["plot", "--field", "syy", "--box", "-15", "-8", "15", "8"]),
    ("opening of the wet part and of the dry one on the right",
     ["plot", "--curve", "wet", "dry_right", "--field", "opening", "--x", "x"]),
]


def compute(results: Results) -> dict[str, float]:
    """The factor of the right tip."""
    return {
        "KI, MPa sqrt(m)": results.tips["dry_right"].KI[-1, 1],
        "open part of the fracture": min(float((part.mode[-1] == 2).mean()) for part in results.contact.values()),
    }
