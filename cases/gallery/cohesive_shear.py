"""A notched joint whose bond softens in shear."""

import numpy as np

from pbem.results.reader import Results

TITLE = "Shear strength of a notched joint whose bond softens"
SUBJECT = "rock joints"
PROBLEM = """A glued joint in rock, E' = 10 GPa, with an unbonded notch of half-length a = 0.5 m, under shear. The bond
has the shear strength c = 2 MPa, which falls linearly with slip until the fracture energy G = 0.2 kJ/m2 is spent: E'
G/c^2 = a, so that neither strength of materials (2 MPa) nor fracture mechanics (1.13 MPa) applies. The strength is the
largest shear for which the slip of the softening zone has a solution; beyond it the faces slip unstably. The
dissipation is G times the spent fraction, integrated along the bond."""
SOURCE = """The integral equation of a crack with cohesive zones at its ends (Dugdale, 1960; Barenblatt, 1962), solved
at Gauss points for linear softening: find_strength in tests/verification/test_cohesive.py."""
EXPECTED = {
    "strength, MPa": (0.95557, 1e-2),
    "energy dissipated before failure, to that of the damage": (1.0, 5e-3),
}
PICTURES = [
    ("part of the fracture energy that is spent, at the end", ["plot", "--curve", "right", "--field", "damage"]),
    ("slip and shear on the right side of the notch", ["plot", "--curve", "right", "--field", "slip,traction_s"]),
]


def compute(results: Results) -> dict[str, float]:
    """At the last equilibrium before energy is released."""
    bond = results.contact["right"]
    last = int((results.energy.released == 0).sum()) - 1
    damage = np.append(bond.internal["damage"][last, 0], bond.internal["damage"][last])
    spent = 2 * 0.2e-3 * 0.5 * (damage[1:] + damage[:-1]) @ np.diff(np.append(0.0, bond.arc_length))
    return {"strength, MPa": 0.86 + 0.14 * float(results.steps.factor[last]),
            "energy dissipated before failure, to that of the damage": float(results.energy.dissipated[last] / spent)}
