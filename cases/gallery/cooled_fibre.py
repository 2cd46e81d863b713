"""A fibre and the stresses of cooling."""

from pbem.results.reader import Results

TITLE = "Cooling stresses around a fibre"
SUBJECT = "composites"
PROBLEM = """A glass fibre (expansion 4.6e-6 per degree) in a polymer (60e-6) cools by 120 degrees, in plane strain.
Without the bond their radii would shrink by (1 + nu) alpha T; the difference e is the misfit of the fibre. It is under
the pressure p = e/(1/(2 G) + (1 - 2 nu)/(2 g)), G of the matrix, g and nu of the fibre; in the matrix the stresses -p
(r/R)^2 across and p (r/R)^2 along the circles fall with the square of the distance R. An infinite region cannot have a
temperature, so the misfit is given as an eigenstrain of the fibre."""
SOURCE = """J. D. Eshelby, The determination of the elastic field of an ellipsoidal inclusion, Proceedings of the
Royal Society A 241 (1957) 376-396; Timoshenko, Goodier, Theory of Elasticity, section 151 (McGraw-Hill, 1970)."""
G, g = 3.5e3 / (2 * 1.35), 72e3 / (2 * 1.22)
FREE = 1.35 * 60e-6 * 120 - 1.22 * 4.6e-6 * 120
PRESSURE = FREE / (1 / (2 * G) + (1 - 2 * 0.22) / (2 * g))
EXPECTED = {
    "pressure on the fibre, MPa": (PRESSURE, 1e-3),
    "hoop stress in the matrix at two radii, MPa": (PRESSURE / 4, 1e-3),
}
PICTURES = [
    ("larger principal stress: the matrix is pulled around the fibre",
     ["plot", "--field", "s1", "--box", "-15", "-12", "15", "12"]),
]


def compute(results: Results) -> dict[str, float]:
    """At the middle, and above the fibre at twice its radius, where the hoop stress is sxx."""
    inside, outside = results.evaluate([[0.0, 0.0], [0.0, 10.0]]).stress[-1]
    return {"pressure on the fibre, MPa": -inside[0], "hoop stress in the matrix at two radii, MPa": outside[0]}
