"""A hollow pin with clearance in a plate with a hole, moved down: the contact pressure against the angle."""
import sys
from pathlib import Path

import matplotlib.pyplot as plt

import pbem

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
circles = {"hole": (10.0, 64), "pin": (9.98, 64), "bore": (4.0, 24), "plate": (60.0, 32)}  # mm; stresses are MPa
case = pbem.Case(
    materials={"steel": {"young": 210e3, "poisson": 0.3}},
    curves={name: {"center": [0, 0], "radius": radius, "elements": elements}
            for name, (radius, elements) in circles.items()},
    regions={"plate": {"material": "steel", "boundary": ["plate", "hole"]},
             "pin": {"material": "steel", "boundary": ["pin", "bore"]}},
    boundary={"plate": {"ux": 0.0, "uy": 0.0}, "bore": {"ux": 0.0, "uy": -0.05}},
    contacts={"fit": {"between": ["pin", "hole"], "friction": 0.15}},
    analysis={"steps": 2},
)
results = pbem.run(case, folder / "pin.h5", force=True)
figure, axes = plt.subplots(figsize=(5, 3.5), layout="constrained")
results.plot(curve="fit", field="traction_n", x="angle", ax=axes)
figure.savefig(folder / "pin.png", dpi=150)
print(f"largest pressure {-results.contact['fit'].traction_n[-1].min():.0f} MPa,",
      f"force {results.reactions['bore'][-1, 1]:.0f} N/mm")
