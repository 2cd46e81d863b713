"""A dry joint that opens."""

import numpy as np

from pbem.results.reader import Results

TITLE = "A dry joint in a pier opens under an eccentric load"
SUBJECT = "masonry"
PROBLEM = """A pier of width b = 1 m has a joint without mortar at mid-height and carries a force with an eccentricity
of e = 0.31443 b. The opened part of the joint is an edge crack of depth a that closes smoothly: its KI is zero. With
KI = s sqrt(pi a) F of a strip under tension (F = 2.8246 at a = b/2) and bending (1.4972), the compression s and the
bending stress 6 e/b s cancel at 6 e/b = 2.8246/1.4972: the joint is open over half of its width. Navier's rule for
materials without tension, 3 (b/2 - e) for the closed part, would give an open part of 0.44 b."""
SOURCE = """A. C. Kaya, F. Erdogan, On the solution of integral equations with strongly singular kernels, Quarterly of
Applied Mathematics 45 (1987) 105-122 (factors of strips), superposed."""
EXPECTED = {
    "opened part of the joint, m": (0.5, 2e-3),
    "force through the joint, MN/m": (1.0, 1e-3),
}
PICTURES = [
    ("the pier, with displacements magnified", ["plot", "--field", "syy", "--displaced", "--width", "11"]),
    ("opening and pressure along the joint", ["plot", "--curve", "joint", "--field", "opening,traction_n"]),
]


def compute(results: Results) -> dict[str, float]:
    """Near its end the opening falls with the power 3/2 of the distance to it."""
    joint = results.contact["joint"]
    x, opening = joint.arc_length, joint.opening[-1]
    near = (opening > 0.003 * opening.max()) & (opening < 0.4 * opening.max())
    end = np.polyval(np.polyfit(opening[near] ** (2 / 3), x[near], 3), 0.0)
    return {
        "opened part of the joint, m": float(end),
        "force through the joint, MN/m": -joint.integrate("traction_n")[-1],
    }
