"""A tunnel in ground at rest under its weight."""

from pbem.results.reader import Results

TITLE = "A tunnel in ground at rest: stress that increases with depth"
SUBJECT = "tunnels and ground"
PROBLEM = """A tunnel of radius a = 3 m, 20 m deep, in ground of unit weight g = 0.02 MN/m^3 with the horizontal stress
K = 0.5 times the vertical one; the surface is assumed to be far away. With p = -20 g at the middle the stress along
the wall is (3 K - 1) p at crown and invert and (3 - K) p at the sides by Kirsch's solution; the increase with depth
adds g a [(K + 1 - 1/(2 (1 - nu))) sin t - (K - 1)  sin 3 t] at the angle t. The weight of the excavated ground is a
net force upward, which a note reports: only relative displacements are known. Crown and invert approach each other by
a ((K + 1) p - (K - 1) p (3 - 4 nu))/(2 G), to which the increase with depth does not contribute."""
SOURCE = """N. I. Muskhelishvili, Some Basic Problems of the Mathematical Theory of Elasticity, chapter 10 (Noordhoff,
1953), with phi = A ln z + c z^-2; G. Kirsch, 1898."""
WEIGHT, K, NU, A = 0.02, 0.5, 0.3, 3.0
P = -20 * WEIGHT
GROWTH = WEIGHT * A * (2 * K - 0.5 / (1 - NU))
EXPECTED = {
    "stress along the wall at the crown, kPa": (1e3 * ((3 * K - 1) * P + GROWTH), 3e-3),
    "stress along the wall at the invert, kPa": (1e3 * ((3 * K - 1) * P - GROWTH), 3e-3),
    "stress along the wall at the sides, kPa": (1e3 * (3 - K) * P, 1e-3),
    "crown against invert, mm": (1e3 * A * ((K + 1) * P - (K - 1) * P * (3 - 4 * NU)) / (2 * 200 / 2.6), 1e-3),
}
PICTURES = [("stress along the wall by the angle", ["plot", "--curve", "wall", "--field", "hoop", "--x", "angle"])]


def compute(results: Results) -> dict[str, float]:
    """At points of the wall: limits from inside of the ground."""
    wall = results.evaluate([[0.0, -17.0], [0.0, -23.0], [3.0, -20.0]])
    (crown, invert, side), moved = wall.stress[-1], wall.displacement[-1]
    return {
        "stress along the wall at the crown, kPa": 1e3 * crown[0],
        "stress along the wall at the invert, kPa": 1e3 * invert[0],
        "stress along the wall at the sides, kPa": 1e3 * side[1],
        "crown against invert, mm": 1e3 * (moved[0, 1] - moved[1, 1]),
    }
