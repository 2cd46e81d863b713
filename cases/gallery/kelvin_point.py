"""A force and a moment at a point of a plane."""

import math

from pbem.results.reader import Results

TITLE = "A force and a moment at a point (Kelvin)"
SUBJECT = "tunnels and ground"
PROBLEM = """A force F = 10 MN/m along x and a moment M = 2 MN at a point of an infinite plane (E = 20 GPa, nu = 0.25,
plane strain), as exerted by a bolt in rock. Ahead of the force at the distance r the stress along it is -(3 + k) F/(2
pi (1 + k) r) with k = 3 - 4 nu, beside it the shear stress is (k - 1) F/(2 pi (1 + k) r) from the force and -M/(2 pi
r^2) from the moment. Only relative displacements are known: ahead of the force, between r and 2 r, 2 k F ln 2/(4 pi G
(1 + k)). The point is 1e-3 m from the load and 3.5 m from it, across the bond."""
SOURCE = """W. Thomson (Lord Kelvin), 1848; S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, articles 42 and
45 (McGraw-Hill, 1970)."""
K, F, M, G = 2.0, 10.0, 2.0, 20e3 / 2.5
EXPECTED = {
    "sxx 1 mm ahead, GPa": (-1e-3 * (3 + K) * F / (2 * math.pi * (1 + K) * 1e-3), 1e-3),
    "sxx 3.5 m ahead, MPa": (-(3 + K) * F / (2 * math.pi * (1 + K) * 3.5), 1e-3),
    "sxy 3.5 m ahead, MPa": (-M / (2 * math.pi * 3.5**2), 1e-3),
    "ux from 7 m to 3.5 m, mm": (1e3 * 2 * K * F * math.log(2) / (4 * math.pi * G * (1 + K)), 1e-3),
}
PICTURES = [("larger compression: ahead of the force", ["plot", "--field", "s2", "--box", "-4", "-4", "4", "4"])]


def compute(results: Results) -> dict[str, float]:
    """At points along x from the load."""
    ahead = results.evaluate([[0.501, 0.0], [4.0, 0.0], [7.5, 0.0]])
    stress, moved = ahead.stress[-1], ahead.displacement[-1]
    return {
        "sxx 1 mm ahead, GPa": 1e-3 * stress[0, 0], "sxx 3.5 m ahead, MPa": stress[1, 0],
        "sxy 3.5 m ahead, MPa": stress[1, 2], "ux from 7 m to 3.5 m, mm": 1e3 * (moved[1, 0] - moved[2, 0]),
    }  # fmt: skip
