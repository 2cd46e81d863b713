"""Point loads, point supports and growing stress give the same results on one rank and on three."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

import pbem
from tests.parallel.launch import launch_snippet

CASES: dict[str, dict[str, Any]] = {
    "disc": {
        "materials": {"m": {"young": 3e3, "poisson": 0.2}},
        "curves": {"rim": {"center": [5, 1], "radius": 2.0, "elements": 16}},
        "regions": {"disc": {"material": "m", "boundary": ["rim"]}},
        "point_loads": {"top": {"at": [5, 3], "fy": -2.0}, "inside": {"at": [5, 0], "fy": 2.0}},
        "point_supports": {"a": {"at": [3, 1], "ux": 0.0, "uy": 0.0}, "b": {"at": [7, 1], "uy": 0.1}},
    },
    "tunnel": {
        "materials": {"ground": {"young": 200.0, "poisson": 0.3, "density": 2.0}},
        "curves": {"wall": {"center": [0, -9], "radius": 2.0, "elements": 16}},
        "regions": {"ground": {"material": "ground", "infinite": True, "boundary": ["wall"]}},
        "gravity": {"gy": -1.0}, "remote": {"syy": {"expression": "2*y"}, "sxx": {"expression": "y"}},
        "point_loads": {"bolt": {"at": [3, -9], "fx": 1.0}},
    },
}  # fmt: skip
RUN_ALL = """
import json, sys
import pbem
for name, case in json.loads(open(sys.argv[1]).read()).items():
    operator = "dense" if name == "tunnel" else "hierarchical"
    pbem.run(case, f"{sys.argv[2]}/{name}_3.h5", operator=operator)
"""


def test_three_ranks_agree_with_one(tmp_path: Path) -> None:
    cases = {name: {**case, "analysis": {"steps": 1}} for name, case in CASES.items()}
    (tmp_path / "cases.json").write_text(json.dumps(cases), encoding="utf-8")
    run = launch_snippet(3, RUN_ALL, tmp_path / "cases.json", tmp_path, timeout=200)
    assert run.returncode == 0, run.stderr
    for name, case in cases.items():
        alone = pbem.run(case, tmp_path / f"{name}.h5", operator="dense")
        together, accuracy = pbem.open_results(tmp_path / f"{name}_3.h5"), 1e-10 if name == "tunnel" else 1e-6
        for part in ("displacement", "hoop_stress"):
            one, other = getattr(alone, part), getattr(together, part)
            np.testing.assert_allclose(other, one, atol=accuracy * np.abs(one).max())
        for curve, force in alone.reactions.items():
            np.testing.assert_allclose(together.reactions[curve], force, atol=1e-6)
