"""A joint with teeth."""

import math

import numpy as np

from pbem.results.reader import Results

TITLE = "A joint with teeth rides up: shear strength and dilation"
SUBJECT = "rock joints"
PROBLEM = """Two blocks of rock meet along four teeth with the angle i = 20 degrees; the friction angle of the faces is
b = 30 degrees. Under a constant normal force the upper block is moved to the right: the faces that face left slide and
carry the whole load, and the block is lifted. The shear force is tan(b + i) times the normal force: exactly, by the
equilibrium of the upper block, whatever the stresses. The block rises by tan i times its displacement."""
SOURCE = """F. D. Patton, Multiple modes of shear failure in rock, Proceedings of the First Congress of the
International Society for Rock Mechanics 1 (1966) 509-513."""
EXPECTED = {
    "shear over normal force": (math.tan(math.radians(50)), 1e-4),
    "slope along which the block rises": (math.tan(math.radians(20)), 1e-4),
}
PICTURES = [
    ("the upper block has ridden up the teeth", ["plot", "--field", "syy", "--displaced", "--limits", "-20", "0"]),
    ("openings and slips along the joint", ["plot", "--curve", "joint", "--field", "opening,slip,traction_n"]),
]


def compute(results: Results) -> dict[str, float]:
    """Forces at the head; its way in the last step, when all faces slide."""
    head = results.nodes.curve == results.nodes.curve_names.index("head")
    moved = results.displacement[-1] - results.displacement[-2]
    across, up = np.mean(moved[head], axis=0)
    shear, normal = results.reactions["head"][-1]
    return {"shear over normal force": -shear / normal, "slope along which the block rises": up / across}
