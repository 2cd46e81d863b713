"""The texts of `pbem check` and `pbem info` hold the numbers they should, and stay short."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import pbem
from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.model.in_situ import LinearStress
from pbem.model.model import Condition, Construction
from pbem.results.describe import describe_errors, describe_results
from pbem.results.estimates import list_datasets
from pbem.results.model_text import describe_model
from pbem.results.reader import open_results
from pbem.results.writer import ResultWriter
from tests.unit.results_sample import make_mesh, make_model, make_steps

MODEL = make_model()
MESH = make_mesh(MODEL)
STEPS = make_steps(MODEL, MESH)


def find_row(text: str, section: str, name: str) -> str:
    """The row of a table that begins with the name, single-spaced."""
    body = text.split(f"{section}\n", 1)[1].split("\n\n")[0]
    return next(" ".join(line.split()) for line in body.splitlines() if line.split()[0] == name)


def test_a_model_is_described_with_its_parts_and_sizes() -> None:
    text = describe_model(MODEL, MESH)
    assert "outer loop: bottom, right_lower, joint (reversed), left_lower" in text
    assert "inner loop: hole (reversed)" in text
    assert find_row(text, "curves", "joint") == "joint 1 12 2 both (power 3)"
    assert find_row(text, "conditions", "top") == "top tx = 0, 3 uy = -0.001"
    assert find_row(text, "conditions", "right_lower") == "right_lower free free"
    assert find_row(text, "interfaces", "joint") == "joint lower upper 36 friction 0.5, cohesion 1"
    assert find_row(text, "interfaces", "crack") == "crack lower (crack) 18 friction 0.3"
    assert f"{MESH.elements} elements of order 2, {MESH.nodes} nodes, {2 * MESH.nodes} unknowns" in text
    assert MODEL.notes[0] in text


def test_loads_that_belong_to_no_curve_are_described() -> None:
    stage = replace(MODEL.stages[1], remote=(0.0, -1.5, 0.0), gravity=(0.0, -9.81), pressure={"crack": 0.25})
    spring = dict(MODEL.conditions) | {"bottom": Condition("bottom", stiffness=(0.0, 70.0))}
    at_rest = {"soft": LinearStress((1.0, 2.0, 3.0))}
    model = replace(MODEL, stages=(MODEL.stages[0], stage), conditions=spring, initial_stress=at_rest)
    text = describe_model(model, MESH)
    assert "press: 2 steps\n" in text
    assert ("shear: 4 steps, remote stress sxx, syy, sxy = 0, -1.5, 0, gravity 0, -9.81, "
            "fluid pressure 0.25 in crack") in text
    assert "in-situ stress of soft: sxx, syy, sxy = 1, 2, 3" in text
    assert find_row(text, "conditions", "bottom") == "bottom tx = 0 ty = 0, spring 70"


def test_pressure_on_what_a_removed_region_leaves_is_no_fluid() -> None:
    joint = MODEL.interfaces["joint"]
    gone = Construction(removed=(joint.first,))
    stages = [replace(MODEL.stages[1], pressure={"joint": 0.25}, construction=each) for each in (Construction(), gone)]
    before, after = (describe_model(replace(MODEL, stages=(each,)), MESH) for each in stages)
    assert "fluid pressure 0.25 in joint" in before
    assert "wall pressure 0.25 on joint" in after and "fluid pressure" not in after
    alone = replace(joint, second=None)  # a crack, whose region is gone
    crack = replace(MODEL, stages=stages[1:], interfaces={**MODEL.interfaces, "joint": alone})
    assert "wall pressure" not in describe_model(crack, MESH)


def test_hundreds_of_cracks_do_not_fill_the_screen(tmp_path: Path) -> None:
    model = make_model(cracks=200)
    mesh = make_mesh(model)
    text = describe_model(model, mesh)
    assert "... and 161 more" in text
    assert len(text.splitlines()) < 150
    with ResultWriter(tmp_path / "a.h5", model, mesh, 1, "3.18.5") as writer:
        writer.append(make_steps(model, mesh)[0])
    text = describe_results(open_results(tmp_path / "a.h5"))
    assert "... and 161 more" in text
    assert len(text.splitlines()) < 100


def test_results_are_described_by_their_last_step(tmp_path: Path) -> None:
    with ResultWriter(tmp_path / "a.h5", MODEL, MESH, 3, "3.18.5") as writer:
        for step in STEPS:
            writer.append(step)
    text = describe_results(open_results(tmp_path / "a.h5"))
    assert "status:       finished\n" in text
    assert "pbem 0.1.0, PETSc 3.18.5, 3 ranks" in text
    assert "steps stored: 6 (last: number 6, stage shear, factor 1)" in text
    assert "18 in 6 steps (3.0 a step, at most 3)" in text
    contact = STEPS[-1].contact
    for number, name in enumerate(MESH.interface_names):
        mine = MESH.pairs.interface == number
        counts = [str(((contact.mode == mode) & mine).sum()) for mode in (STICK, SLIP, OPEN)]
        row = find_row(text, "contact at the last step", name).split()
        assert row[1:5] == [str(mine.sum()), *counts]
        np.testing.assert_allclose(float(row[5]), contact.opening[mine].max(), rtol=1e-4)
        np.testing.assert_allclose(float(row[6]), contact.slip[mine].max(), rtol=1e-4)
    assert find_row(text, "reactions at the last step", "top") == "top -10 -20"


def test_a_file_without_steps_is_described(tmp_path: Path) -> None:
    writer = ResultWriter(tmp_path / "a.h5", MODEL, MESH, 1, "3.18.5")
    writer.fail("linear solver", "first step of press")
    text = describe_results(open_results(tmp_path / "a.h5"))
    assert "failed (linear solver: first step of press)" in text
    assert "steps stored: none" in text


def test_tips_are_listed_and_of_many_the_largest(tmp_path: Path) -> None:
    with ResultWriter(tmp_path / "a.h5", MODEL, MESH, 1, "3.18.5") as writer:
        writer.append(STEPS[-1])
    results = open_results(tmp_path / "a.h5")
    lines = describe_results(results).splitlines()
    at = lines.index("stress-intensity factors at the last step")
    for end, line in enumerate(lines[at + 2 : at + 4]):
        cells = line.split()
        assert cells[:2] == ["crack", ("start", "end")[end]]
        np.testing.assert_allclose([float(cells[2]), float(cells[3])],
                                   [results.tips["crack"].KI[-1, end], results.tips["crack"].KII[-1, end]], rtol=1e-4)
    model = make_model(cracks=30)
    mesh = make_mesh(model)
    with ResultWriter(tmp_path / "b.h5", model, mesh, 1, "3.18.5") as writer:
        writer.append(make_steps(model, mesh)[-1])
    text = describe_results(open_results(tmp_path / "b.h5"))
    assert "... and 50 smaller ones" in text
    tips = open_results(tmp_path / "b.h5").tips
    largest = max(tips, key=lambda name: np.hypot(tips[name].KI[-1], tips[name].KII[-1]).max())
    assert find_row(text, "stress-intensity factors at the last step", largest).split()[0] == largest


def test_works_that_are_rounding_are_not_measured_by_each_other(tmp_path: Path) -> None:
    sides = {"bottom": [[0, 0], [1, 0]], "right": [[1, 0], [1, 1]], "top": [[1, 1], [0, 1]], "left": [[0, 1], [0, 0]]}
    case: dict[str, Any] = {
        "materials": {"rock": {"young": 1e3, "poisson": 0.2}},
        "curves": {name: {"points": points, "elements": 2} for name, points in sides.items()},
        "regions": {"body": {"material": "rock", "boundary": list(sides)}},
        "boundary": {"bottom": {"ux": 0.3, "uy": 0.2}}, "analysis": {"steps": 1},
    }
    moved = describe_results(pbem.run(case, tmp_path / "moved.h5"))
    assert "all of them rounding" in moved and "of the largest" not in moved.split("external work")[1].splitlines()[0]
    case["boundary"] = {**case["boundary"], "top": {"ty": 1.0}}
    pulled = describe_results(pbem.run(case, tmp_path / "pulled.h5"))
    assert "of the largest" in pulled.split("external work")[1].splitlines()[0]


def test_errors_that_are_not_known_of_all_steps_are_those_of_the_last(tmp_path: Path) -> None:
    reason = "at step 2 the second solution did not converge (iteration limit)"
    with ResultWriter(tmp_path / "a.h5", MODEL, MESH, 1, "") as writer:
        for number, step in enumerate(STEPS):
            value = np.nan if number == 1 else 0.01 * (len(STEPS) - number)
            writer.append(step, {name: np.full(shape, value) for name, shape in list_datasets(MODEL, MESH).items()})
            if number == 1:
                writer.note_missing(reason)
    said = describe_errors(open_results(tmp_path / "a.h5"))[0]
    assert "slips and openings 1.0e-02" in said and "nan" not in said
    assert said.endswith(f"of the largest in the model, at the last step; not known of all steps: {reason}")
