"""Faults in pressed rock whose fluid pressure rises in stages: the moment of each by time, and which of them let go."""
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import pbem

folder, count = Path(sys.argv[1] if len(sys.argv) > 1 else "."), int(sys.argv[2]) if len(sys.argv) > 2 else 500
pressures, shear_modulus = [0.0, 6.0, 9.0, 12.0, 15.0], 12.0  # MPa, GPa; lengths are m
case = pbem.Case(
    materials={"rock": {"young": 30e3, "poisson": 0.25}},
    regions={"rock": {"material": "rock", "infinite": True}},
    generate=[{"kind": "cracks", "name": "fault", "count": count, "half_length": 50.0, "density": 4e-5,
               "distance": 5.0, "elements": 6, "region": "rock", "friction": 0.6, "pressurised": "all"}],
    remote={"sxx": -20.0, "syy": -50.0},
    stages=[{"name": f"p{p:g}", "steps": 1, "interfaces": {"fault": {"pressure": p}}} for p in pressures],
)
results = pbem.run(case, folder / "faults.h5", force=True)
moments = shear_modulus * np.abs([each.integrate("slip") for each in results.contact.values()])  # (faults, steps), GN
events = np.diff(moments, axis=1, prepend=0.0)
for stage, rise in zip(pressures, events.T, strict=True):
    print(f"{stage:4g} MPa: {np.count_nonzero(rise > 0.1)} faults slip by more than 0.1 GN, all by {rise.sum():.3g}")
np.savetxt(folder / "faults.csv", moments, delimiter=",", header=",".join(f"p{p:g}" for p in pressures), comments="")
figure, axes = plt.subplots(figsize=(5, 3.5), layout="constrained")
axes.plot(range(1, count + 1), np.sort(moments, axis=0)[::-1], label=[f"{p:g} MPa" for p in pressures])
axes.set(xlabel="rank of the fault", ylabel="moment (GN)", xlim=(1, None), ylim=(0, None))
axes.legend(title="pressure")
figure.savefig(folder / "faults.png", dpi=150)
