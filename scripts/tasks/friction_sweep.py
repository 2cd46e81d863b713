"""Slip on three cracks in a plate that is pressed and sheared, against their friction: a table and a figure."""
import sys
from pathlib import Path

import matplotlib.pyplot as plt

import pbem

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
cracks = {"low": [[-2, -1.5], [1, -0.5]], "middle": [[-1, 0.2], [1.5, 0.8]], "high": [[0, 1.5], [2, 2.2]]}
sides = {"bottom": [[-5, -5], [5, -5]], "right": [[5, -5], [5, 5]],
         "top": [[5, 5], [-5, 5]], "left": [[-5, 5], [-5, -5]]}
loads = {"bottom": (-22, 30), "right": (-10, 22), "top": (22, -30), "left": (10, -22)}  # MPa; lengths are m
case = pbem.Case(
    materials={"rock": {"young": 50e3, "poisson": 0.25}},
    curves={name: {"points": points, "elements": 12} for name, points in (cracks | sides).items()},
    regions={"plate": {"material": "rock", "boundary": list(sides), "cracks": list(cracks)}},
    boundary={name: {"tx": tx, "ty": ty} for name, (tx, ty) in loads.items()},
    interfaces={name: {"friction": 0.3} for name in cracks}, analysis={"steps": 2},
)
key, slips = "interfaces.*.friction", {name: f"contact.{name}.slip.largest" for name in cracks}
table = pbem.sweep(case, {key: [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]}, list(slips.values()),
                   out=folder / "friction_sweep.csv", force=True)
figure, axes = plt.subplots(figsize=(5, 3.5), layout="constrained")
for name, column in slips.items():
    axes.plot(table[key], table[column] * 1e3, "o-", label=name)
axes.set(xlabel="friction coefficient", ylabel="largest slip (mm)", xlim=(0, None), ylim=(0, None))
axes.legend(title="crack")
figure.savefig(folder / "friction_sweep.png", dpi=150)
print(table)
