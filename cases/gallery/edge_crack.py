"""A strip with an edge crack."""

import math

from pbem.results.reader import Results

TITLE = "An edge crack half-way through a strip"
SUBJECT = "fracture"
PROBLEM = """A strip of width b = 20 mm and length 4 b is cracked from its left edge to the depth a = b/2 and loaded by
the tension s = 100 MPa at its ends, which are free to rotate. KI = 2.8246 s sqrt(pi a): far more than the 1.1215 of a
shallow crack, as the strip bends. Its loads balance, so no supports are needed."""
SOURCE = """A. C. Kaya, F. Erdogan, On the solution of integral equations with strongly singular kernels, Quarterly of
Applied Mathematics 45 (1987) 105-122 (infinite strip)."""
EXPECTED = {"KI/(s sqrt(pi a))": (2.8246, 1e-3)}
PICTURES = [
    ("stress along the strip, on its displaced outline", ["plot", "--field", "syy", "--displaced", "--width", "11"]),
    ("opening of the crack", ["plot", "--curve", "crack", "--field", "opening"]),
]


def compute(results: Results) -> dict[str, float]:
    """The factor of the tip inside, over that of a crack of half-length a in a plane."""
    return {"KI/(s sqrt(pi a))": results.tips["crack"].KI[-1, 1] / (100 * math.sqrt(math.pi * 10))}
