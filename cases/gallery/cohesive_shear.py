"""A notched joint whose bond softens in shear."""

import numpy as np

from pbem.results.reader import Results

TITLE = "Shear strength of a notched joint whose bond softens"
SUBJECT = "rock joints"
PROBLEM = """A glued joint in rock, E' = 10 GPa, with a notch of the half-length a = 0.5 m without a bond, under shear. The
bond has the shear strength c = 2 MPa, which falls linearly with slip while the fracture energy G = 0.2 kJ/m2 is spent:
E' G/c^2 = a, so that neither strength of materials (2 MPa) nor fracture mechanics (1.13 MPa) holds. The strength is the
largest shear for which the slip of the softening zone has a solution; beyond it the faces run away. On what has failed
for good the energy that is dissipated is G per unit of length."""
SOURCE = """The integral equation of a crack with cohesive zones at its ends (D. S. Dugdale, 1960; G. I. Barenblatt, 1962),
solved by itself at Gauss points for linear softening: find_strength of tests/verification/test_cohesive.py."""
EXPECTED = {
    "strength, MPa": (0.95557, 1e-2),
    "energy of what has failed, kJ/m2": (0.2, 1e-3),
}
PICTURES = [
    ("part of the fracture energy that is spent, at the end", ["plot", "--curve", "right", "--field", "damage"]),
    ("slip and shear on the right side of the notch", ["plot", "--curve", "right", "--field", "slip,traction_s"]),
]


def compute(results: Results) -> dict[str, float]:
    """The last equilibrium before energy is released; half the critical slip times the strength where all is spent."""
    bond = results.contact["right"]
    last = int((results.energy.released == 0).sum()) - 1
    lost = bond.internal["damage"][-1] == 1.0
    critical = np.abs(bond.slip[-1, lost]) / bond.internal["separation"][-1, lost]
    return {"strength, MPa": 0.86 + 0.14 * float(results.steps.factor[last]),
            "energy of what has failed, kJ/m2": 1e3 * float((0.5 * 2.0 * critical).mean())}
