"""A gravity dam."""

from pbem.results.reader import Results

TITLE = "A gravity dam under weight and water"
SUBJECT = "tunnels and ground"
PROBLEM = """A concrete dam, 40 m high, on stiff rock carries its own weight and then 38 m of water, whose pressure is
9.81 kPa times the depth. The resultants are known: the thrust of the water w h^2/2, which the foot carries in shear,
the weight of the dam by its area, and the moment of both about the upstream edge of the foot. The dam is safe if the
resultant meets the foot within its middle third."""
SOURCE = """Hydrostatics; statics of gravity dams, e.g. Design of Gravity Dams (US Bureau of Reclamation, 1976)."""
AREA = 5 * 40 + 0.5 * 27 * 36
EXPECTED = {
    "thrust of the water, kN/m": (0.5 * 9.81 * 38**2, 1e-9),
    "shear through the foot, kN/m": (-0.5 * 9.81 * 38**2, 1e-5),
    "weight through the foot, kN/m": (2.4 * 9.81 * AREA, 1e-4),
}
PICTURES = [
    ("smaller principal stress under full water", ["plot", "--field", "s2", "--displaced"]),
    ("vertical stress along the foot", ["plot", "--curve", "foot", "--field", "normal,shear", "--x", "x"]),
]


def compute(results: Results) -> dict[str, float]:
    """Resultants of the tractions."""
    shear, weight = results.reactions["foot"][-1]
    return {
        "thrust of the water, kN/m": results.reactions["face"][-1, 0],
        "shear through the foot, kN/m": shear,
        "weight through the foot, kN/m": weight,
    }
