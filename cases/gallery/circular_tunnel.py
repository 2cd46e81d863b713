"""A deep circular tunnel."""

from pbem.results.reader import Results

TITLE = "A deep circular tunnel (Kirsch)"
SUBJECT = "tunnels and ground"
PROBLEM = """A circular tunnel of radius a = 3 m in rock under the in-situ stress sxx = -5 and syy = -10 MPa (plane
strain). Along its wall the stress is 3 sxx - syy at the crown and 3 syy - sxx at the sides. Due to the excavation the
crown moves by a ((sxx + syy) - (sxx - syy)(3 - 4 nu))/(4 G), downwards."""
SOURCE = """G. Kirsch, Die Theorie der Elasticitaet und die Beduerfnisse der Festigkeitslehre, Zeitschrift des
Vereines deutscher Ingenieure 42 (1898) 797-807; Jaeger, Cook, Zimmerman, Fundamentals of Rock Mechanics, section
8.5."""
EXPECTED = {
    "stress along the wall at the crown, MPa": (3 * -5.0 + 10.0, 2e-3),
    "stress along the wall at the sides, MPa": (3 * -10.0 + 5.0, 1e-3),
    "displacement of the crown, mm": (1e3 * 3 * (-15.0 - 5.0 * (3 - 4 * 0.25)) / (4 * 20e3 / 2.5), 1e-3),
}
PICTURES = [
    ("larger compression: it flows around the tunnel", ["plot", "--field", "s2", "--box", "-9", "-8", "9", "8"]),
    ("stress along the wall by the angle", ["plot", "--curve", "wall", "--field", "hoop", "--x", "angle"]),
]


def compute(results: Results) -> dict[str, float]:
    """At points of the wall: limits from inside the rock."""
    wall = results.evaluate([[0.0, 3.0], [3.0, 0.0]])
    crown, side = wall.stress[-1]
    return {
        "stress along the wall at the crown, MPa": crown[0],
        "stress along the wall at the sides, MPa": side[1],
        "displacement of the crown, mm": 1e3 * wall.displacement[-1][0, 1],
    }
