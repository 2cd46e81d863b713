"""A shaft that is turned in rock, with a joint that dilates."""

import math

from pbem.results.reader import Results

TITLE = "A shaft rotated in rock: a joint that dilates and locks"
SUBJECT = "rock joints"
PROBLEM = """A shaft of radius a = 500 mm in infinite rock under the pressure p0 = 5 MPa has a rigid core of radius b =
250 mm, which is rotated by the angle w. The joint around the shaft slides by s, with the friction coefficient f = 0.7.
It is rough: over the first 4 mm of slip it opens by D = s tan(8 degrees). As shaft and rock resist this opening, the
pressure on the joint rises to p = p0 + D/c, with the compliance of both, c = a/(2 G) + a (1 - q)/(2 (l + G) + 2 G q)
with q = b^2/a^2 and Lame's moduli l and G; and the shear on it, f p, leaves the slip s = a w - f p a^3/(2 G b^2).
Without dilation the pressure would remain 5 MPa. With it the shaft carries almost four times the torque, which no
longer rises once the asperities have been overridden."""
SOURCE = """Plane solutions for rings and holes: S. P. Timoshenko, J. N. Goodier, Theory of Elasticity (McGraw-Hill,
third edition, 1970), article 28; for joints that dilate M. E. Plesha, Constitutive models for rock discontinuities with
dilatancy and surface degradation, Int. J. Numer. Anal. Methods Geomech. 11 (1987) 345-362."""
SHEAR, LAME, OUTER, INNER, FRICTION, CLIMB = 8e3, 8e3, 500.0, 250.0, 0.7, math.tan(math.radians(8))
PART = (INNER / OUTER) ** 2
SOFTNESS = OUTER / (2 * SHEAR) + OUTER * (1 - PART) / (2 * (LAME + SHEAR) + 2 * SHEAR * PART)
TAKEN = FRICTION * OUTER**3 / (2 * SHEAR * INNER**2)  # from the slip, by the pressure
EARLY = (8.0 * 4 / 8 - TAKEN * 5) / (1 + TAKEN * CLIMB / SOFTNESS)  # half of the turn
PRESSURE = {"half": 5 + CLIMB * EARLY / SOFTNESS, "end": 5 + CLIMB * 4 / SOFTNESS}
EXPECTED = {
    "slip after half of the turn, mm": (EARLY, 1e-4),
    "slip at the end, mm": (8.0 - TAKEN * PRESSURE["end"], 1e-4),
    "pressure after half of the turn, MPa": (PRESSURE["half"], 1e-4),
    "pressure at the end, MPa": (PRESSURE["end"], 1e-4),
    "torque at the end, kN m per mm": (2 * math.pi * OUTER**2 * FRICTION * PRESSURE["end"] / 1e6, 1e-4),
}
PICTURES = [
    ("larger compression at the end of the turn", ["plot", "--field", "s2", "--box", "-1500", "-1500", "1500", "1500"]),
]


def compute(results: Results) -> dict[str, float]:
    """Means around the joint; the torque by the shear on it."""
    joint, half, end = results.contact["joint"], 3, 7
    way = 2 * math.pi * OUTER
    slip, pressure = (joint.integrate(name) / way for name in ("slip", "traction_n"))
    return {
        "slip after half of the turn, mm": abs(slip[half]),
        "slip at the end, mm": abs(slip[end]),
        "pressure after half of the turn, MPa": -pressure[half],
        "pressure at the end, MPa": -pressure[end],
        "torque at the end, kN m per mm": abs(joint.integrate("traction_s")[end]) * OUTER / 1e6,
    }
