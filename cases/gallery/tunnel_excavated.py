"""A tunnel that is excavated beside a joint."""

import numpy as np

from pbem.results.reader import Results

TITLE = "A tunnel excavated beside a joint, and supported afterwards"
SUBJECT = "tunnels and ground"
PROBLEM = """A tunnel of radius 3 m is excavated in rock under the in-situ stress sxx = -5 and syy = -10 MPa (plane
strain), 1.1 m below a joint with friction 0.3. A stage removes the rock in it and releases its tractions in two steps.
A support of 7.5 MPa follows; it does not reverse the slip of the joint."""
SOURCE = """G. Kirsch, Die Theorie der Elasticitaet und die Beduerfnisse der Festigkeitslehre, Zeitschrift des Vereines
deutscher Ingenieure 42 (1898) 797-807, for the floor, which is far from the joint; Coulomb's law for the rest."""
EXPECTED = {
    "stress along the wall at the floor before support, MPa": (3 * -5.0 + 10.0, 1e-2),
    "slip that is left, of that before support": (1.0, 1e-6),
    "pressure on the wall in the end, MPa": (7.5, 1e-9),
    "what the energy balance lacks, added to 1": (1.0, 1e-4),
}
PICTURES = [
    ("displaced, after the excavation: the rock in the tunnel is gone", ["plot", "--step", "2"]),
    ("larger compression after the excavation",
     ["plot", "--field", "s2", "--step", "2", "--box", "-9", "-8", "9", "8"]),
]


def compute(results: Results) -> dict[str, float]:
    """After the second step the tunnel is free, after the last supported."""
    floor = results.evaluate([[0.0, -3.0]], steps=[1]).stress[0, 0]
    slip, energy = results.contact["joint"].slip, results.energy
    spent = energy.elastic + energy.dissipated + energy.released + energy.removed
    return {
        "stress along the wall at the floor before support, MPa": floor[0],
        "slip that is left, of that before support": float(np.abs(slip[-1]).max() / np.abs(slip[1]).max()),
        "pressure on the wall in the end, MPa": -float(results.contact["wall"].traction_n[-1].mean()),
        "what the energy balance lacks, added to 1": float(spent[-1] / energy.external[-1]),
    }
