"""A joint in ground at rest."""

import math

import numpy as np

from pbem.results.reader import Results

TITLE = "In-situ stress (K0) on a joint in the ground"
SUBJECT = "rock joints"
PROBLEM = """In 100 m of ground at rest, the vertical stress is the weight above and the horizontal one K0 = 0.5 times
that. A joint that dips by q = 36.87 degrees carries normal stress and shear in the ratio (1 - K0) sin q cos
q/(cos(q)^2 + K0 sin(q)^2) at any depth. As this is less than its friction the state is in equilibrium, and the
displacement is zero: the ground does not settle again under its own weight. With the friction below that ratio (pbem
run joint_at_rest --set interfaces.joint.friction=0.2) the joint slips."""
SOURCE = """Jaeger, Cook, Zimmerman, Fundamentals of Rock Mechanics, sections 2.3 and 13.4 (Blackwell, 2007): stress
on an inclined plane."""
DIP, K0, WEIGHT = math.atan2(60, 80), 0.5, 2.5e-3 * 9.81
EXPECTED = {
    "shear over normal stress on the joint": (
        (1 - K0) * math.sin(DIP) * math.cos(DIP) / (math.cos(DIP) ** 2 + K0 * math.sin(DIP) ** 2), 1e-6),
    "normal stress at 50 m depth, MPa": (-50 * WEIGHT * (math.cos(DIP) ** 2 + K0 * math.sin(DIP) ** 2), 1e-6),
    "largest displacement, over that of settling by the weight": (0.0, 1e-8),
}
PICTURES = [
    ("vertical stress", ["plot", "--field", "syy"]),
    ("tractions along the joint, over the height",
     ["plot", "--curve", "joint", "--field", "traction_n,traction_s", "--x", "y"]),
]


def compute(results: Results) -> dict[str, float]:
    """Tractions of the joint; the ground would settle by w h^2/2 over its oedometric modulus."""
    joint = results.contact["joint"]
    normal, shear = joint.traction_n[-1], joint.traction_s[-1]
    settling = WEIGHT * 100**2 / (2 * 5e3 * 0.7 / (1.3 * 0.4))
    return {
        "shear over normal stress on the joint": np.abs(shear / normal).max(),
        "normal stress at 50 m depth, MPa": np.interp(50.0, joint.position[:, 1], normal),
        "largest displacement, over that of settling by the weight": np.abs(results.displacement[-1]).max() / settling,
    }
