"""A specimen with a rough joint."""

import math

from pbem.results.reader import Results

TITLE = "A rough joint at three confining pressures: Barton's strength"
SUBJECT = "rock joints"
PROBLEM = """A specimen of granite is cut by a rough joint, JRC = 9, JCS = 120 MPa, residual friction angle 28 degrees,
at an angle of q = 54.5 degrees to the horizontal. It is compressed under the confining pressures p = 1, 3 and 10 MPa,
each time until the joint slides. The stress is uniform in both parts: with the difference D = s1 - p the joint carries
the normal stress s = p + D cos(q)^2 and the shear t = D sin(q) cos(q), and D follows from t = s tan(28 + 9
log10(120/s)) degrees. The friction angle falls from 42.5 degrees to 35.0. The joint closes by v = s/(K + s/V), with
the initial stiffness K = 20 MPa/mm and the largest closure V = 0.2 mm."""
SOURCE = """N. Barton, V. Choubey, The shear strength of rock joints in theory and practice, Rock Mechanics 10 (1977)
1-54; S. C. Bandis, A. C. Lumsden, N. R. Barton, Fundamentals of rock joint deformation, Int. J. Rock Mech. Min. Sci. 20
(1983) 249-268; for the stress on an inclined joint J. C. Jaeger, N. G. W. Cook, R. W. Zimmerman, Fundamentals of Rock
Mechanics (Blackwell, 2007)."""
ANGLE, PRESSURES = math.atan2(70, 50), (1.0, 3.0, 10.0)


def find_difference(pressure: float) -> float:
    """D by bisection: below it the joint holds."""
    low, high = 0.0, 100 * pressure
    for _ in range(100):
        middle = 0.5 * (low + high)
        stress = pressure + middle * math.cos(ANGLE) ** 2
        strength = stress * math.tan(math.radians(28 + 9 * math.log10(120 / stress)))
        low, high = (middle, high) if middle * math.sin(ANGLE) * math.cos(ANGLE) < strength else (low, middle)
    return low


STRESSES = [p + find_difference(p) * math.cos(ANGLE) ** 2 for p in PRESSURES]
EXPECTED = {f"axial stress at {p:g} MPa, MPa": (-p - find_difference(p), 1e-5) for p in PRESSURES} | {
    f"closure of the joint at {p:g} MPa, mm": (s / (20 + s / 0.2), 1e-5)
    for p, s in zip(PRESSURES, STRESSES, strict=True)
}
PICTURES = [("the specimen after sliding", ["plot", "--label", "joint"])]


def compute(results: Results) -> dict[str, float]:
    """The force on the upper plate, over its width, and the mean opening."""
    force, opening = results.reactions["head"][:, 1] / 50, results.contact["joint"].opening.mean(axis=1)
    found = {f"axial stress at {p:g} MPa, MPa": force[number] for number, p in enumerate(PRESSURES)}
    return found | {f"closure of the joint at {p:g} MPa, mm": -opening[number] for number, p in enumerate(PRESSURES)}
