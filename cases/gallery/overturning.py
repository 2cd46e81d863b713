"""A stone that is pushed over."""

from pbem.results.reader import Results

TITLE = "A stone pushed over: rocking on its edge"
SUBJECT = "masonry"
PROBLEM = """A block of b = 1 m and h = 2.5 m stands on a footing without mortar, with friction 0.6, under its weight
W. Its head is pushed to the right by 10 mm. While it rocks, the moments of the weight and the push H about its right
edge balance: H/W = b/(2 h) = 0.2, less than the friction, so that it overturns before it slides. The bed remains
closed only over a small part at the edge, and the pressure there makes H slightly smaller than for a rigid block. A
body force acts at half the height: the block falls at a slope, or a ratio of horizontal acceleration to gravity, of
b/h = 0.4."""
SOURCE = """Statics of a rigid block; G. W. Housner, The behavior of inverted pendulum structures during earthquakes,
Bulletin of the Seismological Society of America 53 (1963) 403-417."""
WEIGHT = 2.6 * 9.81 * 2.5
EXPECTED = {
    "push over weight": (0.2, 2e-3),
    "weight on the bed, kN/m": (WEIGHT, 5e-4),
}
PICTURES = [
    ("the stone rocks on its edge", ["plot"]),
    ("vertical stress: the thrust runs to the edge",
     ["plot", "--field", "syy", "--limits", "-400", "0", "--width", "11"]),
]


def compute(results: Results) -> dict[str, float]:
    """The force at the head, and the force through the bed."""
    return {
        "push over weight": results.reactions["head"][-1, 0] / WEIGHT,
        "weight on the bed, kN/m": -results.contact["bed"].integrate("traction_n")[-1],
    }
