"""A model made by calls alone gives the result file of its case file: every dataset and attribute, bit by bit."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import pbem

BLOCKS = """
title = "Two blocks"

[materials.soft]
young = 2000.0
poisson = 0.3

[materials.stiff]
young = 3000.0
poisson = 0.2

[curves]
bottom      = { points = [[0, 0], [2, 0]], elements = 4 }
right_lower = { points = [[2, 0], [2, 1]], elements = 4 }
joint       = { points = [[0, 1], [2, 1]], elements = 8 }
left_lower  = { points = [[0, 1], [0, 0]], elements = 4 }
right_upper = { points = [[2, 1], [2, 2]], elements = 4 }
top         = { points = [[2, 2], [0, 2]], elements = 4 }
left_upper  = { points = [[0, 2], [0, 1]], elements = 4 }

[regions.lower]
material = "stiff"
boundary = ["bottom", "right_lower", "joint", "left_lower"]

[regions.upper]
material = "soft"
boundary = ["joint", "right_upper", "top", "left_upper"]

[boundary.bottom]
ux = 0.0
uy = 0.0

[boundary.top]
ux = 0.005
uy = -0.001

[interfaces.joint]
law = "coulomb"
friction = 0.5
normal_stiffness = 1e5
tangential_stiffness = 5e4

[analysis]
steps = 3
"""


def make_blocks() -> pbem.Case:
    """Two blocks with an elastic Coulomb joint between them, pressed together and sheared."""
    sides = {
        "bottom": ((0, 0), (2, 0)), "right_lower": ((2, 0), (2, 1)), "joint": ((0, 1), (2, 1)),
        "left_lower": ((0, 1), (0, 0)), "right_upper": ((2, 1), (2, 2)), "top": ((2, 2), (0, 2)),
        "left_upper": ((0, 2), (0, 1)),
    }
    return pbem.Case(
        title="Two blocks",
        materials={"soft": {"young": 2000.0, "poisson": 0.3}, "stiff": {"young": 3000.0, "poisson": 0.2}},
        curves={name: {"points": ends, "elements": 8 if name == "joint" else 4} for name, ends in sides.items()},
        regions={
            "lower": {"material": "stiff", "boundary": ("bottom", "right_lower", "joint", "left_lower")},
            "upper": {"material": "soft", "boundary": ("joint", "right_upper", "top", "left_upper")},
        },
        boundary={"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"ux": 0.005, "uy": -0.001}},
        interfaces={"joint": {
            "law": "coulomb", "friction": 0.5, "normal_stiffness": 1e5, "tangential_stiffness": 5e4,
        }},
        analysis={"steps": 3},
    )  # fmt: skip


CRACK = """
title = "A crack under pressure"

[materials.rock]
young = 1000.0
poisson = 0.25
plane = "stress"

[curves.crack]
points = [[-1.0, -0.5], [0.0, 0.0], [1.0, 0.25]]
elements = [6, 5]

[regions.plane]
material = "rock"
infinite = true
cracks = ["crack"]

[interfaces.crack]
friction_angle = 30.0
cohesion = 0.01
pressurised = "all"

[remote]
sxx = -0.5

[[stages]]
name = "compression"
steps = 2
remote = { syy = -1.0 }

[[stages]]
name = "injection"
steps = 3
interfaces = { crack = { pressure = 0.9 } }

[output]
interior = { box = [-1.5, 0.5, 1.5, 1.5], shape = [3, 2] }
points = [[0.0, -0.75]]
every = 2
"""


def make_crack() -> pbem.Case:
    """A kinked crack in an infinite plane, pressed and then filled with a fluid, in two stages."""
    return pbem.Case(
        title="A crack under pressure",
        materials={"rock": {"young": 1000.0, "poisson": 0.25, "plane": "stress"}},
        curves={"crack": {"points": np.array([[-1.0, -0.5], [0.0, 0.0], [1.0, 0.25]]), "elements": (6, 5)}},
        regions={"plane": {"material": "rock", "infinite": True, "cracks": ["crack"]}},
        interfaces={"crack": {"friction_angle": 30.0, "cohesion": 0.01, "pressurised": "all"}},
        remote={"sxx": -0.5},
        stages=[
            {"name": "compression", "steps": 2, "remote": {"syy": -1.0}},
            {"name": "injection", "steps": 3, "interfaces": {"crack": {"pressure": np.float64(0.9)}}},
        ],
        output={
            "interior": {"box": (-1.5, 0.5, 1.5, 1.5), "shape": (3, 2)}, "points": [(0.0, -0.75)], "every": np.int64(2),
        },
    )  # fmt: skip


ARCS = """
[materials.lining]
young = 500.0
poisson = 0.3
density = 0.1

[curves]
outer = { center = [0.0, 0.0], radius = 2.0, angles = [0, 180], elements = 12, grading = "none" }
left  = { points = [[-2.0, 0.0], [-1.5, 0.0]], elements = 3 }
inner = { center = [0.0, 0.0], radius = 1.5, angles = [180.0, 0.0], size = 0.5 }
right = { points = [[1.5, 0.0], [2.0, 0.0]], elements = 3 }

[regions.arch]
material = "lining"
boundary = ["outer", "left", "inner", "right"]

[boundary]
left  = { ux = 0.0, uy = 0.0 }
right = { un = 0.0 }
outer = { pressure = 0.05 }
inner = { spring = { kn = 0.2 } }

[gravity]
gy = -9.81

[analysis]
steps = 1
scheme = "THST"

[solver]
linear = "lu"

[petsc]
ksp_rtol = 1e-11
"""


def make_arch() -> pbem.Case:
    """An arch of two circular arcs under its weight and a pressure."""
    return pbem.Case(
        materials={"lining": {"young": 500.0, "poisson": 0.3, "density": 0.1, "plane": None}},
        curves={
            "outer": {"center": (0.0, 0.0), "radius": 2.0, "angles": (0, 180), "elements": 12, "grading": "none"},
            "left": {"points": [(-2.0, 0.0), (-1.5, 0.0)], "elements": 3},
            "inner": {"center": (0.0, 0.0), "radius": 1.5, "angles": (180.0, 0.0), "size": 0.5},
            "right": {"points": [(1.5, 0.0), (2.0, 0.0)], "elements": 3},
        },
        regions={"arch": {"material": "lining", "boundary": ["outer", "left", "inner", "right"]}},
        boundary={
            "left": {"ux": 0.0, "uy": 0.0}, "right": {"un": 0.0}, "outer": {"pressure": 0.05},
            "inner": {"spring": {"kn": 0.2}},
        },
        gravity={"gy": -9.81},
        analysis={"steps": 1, "scheme": "THST"}, solver={"linear": "lu"}, petsc={"ksp_rtol": 1e-11},
    )  # fmt: skip


CRACKS = """
[materials]
rock = { young = 1000.0, poisson = 0.2 }

[regions]
plane = { material = "rock", infinite = true }

[[generate]]
kind = "cracks"
name = "joint"
region = "plane"
count = 12
elements = 4
half_length = 1.0
distribution = "lognormal"
spread = 0.3
density = 0.1
distance = 0.2
friction = 0.4
seed = 7

[interfaces."joint_3"]
friction = 0.1

[remote]
sxx = -0.2
syy = -1.0
sxy = 0.3

[analysis]
steps = 2
"""


def make_cracks() -> pbem.Case:
    """Twelve random cracks, one of them smoother than the others."""
    return pbem.Case(
        materials={"rock": {"young": 1000.0, "poisson": 0.2}},
        regions={"plane": {"material": "rock", "infinite": True}},
        generate=[{
            "kind": "cracks", "name": "joint", "region": "plane", "count": 12, "elements": 4, "half_length": 1.0,
            "distribution": "lognormal", "spread": 0.3, "density": 0.1, "distance": 0.2, "friction": 0.4, "seed": 7,
        }],
        interfaces={"joint_3": {"friction": 0.1}},
        remote={"sxx": -0.2, "syy": -1.0, "sxy": 0.3},
        analysis={"steps": 2},
    )  # fmt: skip


MODELS = {"blocks": (BLOCKS, make_blocks), "crack": (CRACK, make_crack), "arch": (ARCS, make_arch),
          "cracks": (CRACKS, make_cracks)}


def read_everything(path: Path) -> dict[str, Any]:
    """All datasets and attributes of a result file, but the text of the case and seconds."""
    found: dict[str, Any] = {}

    def take(name: str, item: h5py.Group | h5py.Dataset) -> None:
        found.update({f"{name}@{key}": value for key, value in item.attrs.items() if (name, key) != ("", "case")})
        if isinstance(item, h5py.Dataset):
            value = item[()]
            fields = value.dtype.names or ()
            found[name] = value[[field for field in fields if field != "seconds"]] if fields else value

    with h5py.File(path) as file:
        take("", file)
        file.visititems(take)
    return found


@pytest.mark.parametrize("name", MODELS)
def test_a_model_by_calls_gives_the_results_of_its_file(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text, make = MODELS[name]
    Path("file.toml").write_text(text, encoding="utf-8")
    pbem.run("file.toml")
    with monkeypatch.context() as without_text:
        without_text.setattr(tomllib, "loads", lambda text: pytest.fail("a model by calls needs no TOML"))
        results = pbem.run(make(), "calls.h5")
    expected, found = read_everything(Path("file.h5")), read_everything(Path("calls.h5"))
    assert expected.keys() == found.keys() and len(found) > 50
    for key, value in expected.items():
        assert np.asarray(found[key]).dtype == np.asarray(value).dtype, key
        assert np.asarray(found[key]).tobytes() == np.asarray(value).tobytes() or found[key].tolist() == value.tolist()
    # What the file stores as its case is one that reads back to the same, so that its run can be gone on with.
    Path("stored.toml").write_text(results.case, encoding="utf-8")
    assert pbem.Case.read("stored.toml") == make() == pbem.Case(**make().given)
    assert pbem.run(make(), "calls.h5", resume=True).case == results.case
    assert tomllib.loads(results.case).keys() == tomllib.loads(text).keys()


def test_a_dictionary_and_a_case_that_was_read_are_run_as_well(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("arch.toml").write_text(ARCS, encoding="utf-8")
    read = pbem.Case.read("arch.toml")
    results = pbem.run(read)
    assert Path("arch.h5").exists() and results.case == ARCS
    by_dictionary = pbem.run(make_arch().given)
    assert Path("case.h5").exists()
    assert np.array_equal(by_dictionary.displacement, results.displacement)
