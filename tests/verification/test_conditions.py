"""Conditions and loads of every kind against exact answers, each in one setting; all: scripts/study_conditions.py."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.solve.problem.step import SilentReporter
from scripts.conditions.draft import SCHEMES
from scripts.conditions.everything import CONDITIONS
from scripts.conditions.stages import add_stages, lay_stack
from scripts.conditions.trial import Figure, Trial
from scripts.study_conditions import judge, main, make_setting

# The search for the modes of a pin that lies along a node asks for the answers of many pairs: with products, for long.
SLOW = "pin along a node"
# Of each condition one setting, so that all schemes, both operators and models elsewhere have their turn.
SETTINGS = [
    pytest.param(name, SCHEMES[k % 4], "hierarchical" if k % 7 == 3 and name != SLOW else "dense", k % 3,
                 id=name.replace(" ", "_"))
    for k, name in enumerate(CONDITIONS)
]


@pytest.mark.parametrize(("name", "scheme", "operator", "seed"), SETTINGS)
def test_conditions_give_their_exact_answers(
    name: str, scheme: str, operator: str, seed: int, tmp_path: Path
) -> None:
    cell = judge(name, make_setting(scheme, operator, 2, seed), tmp_path)
    assert cell.word in ("ok", "refused"), cell


@pytest.mark.parametrize("name", ["pin along an axis, with friction", "pin of many elements along a node"])
def test_a_pin_under_a_force_along_the_axis_of_its_mesh(name: str, tmp_path: Path) -> None:
    """Friction of both senses is in balance, and the place where it changes lies between two pairs."""
    assert judge(name, make_setting("SST", "dense", 2, 0), tmp_path).word == "ok"


@pytest.mark.parametrize("order", [0, 1, 3])
def test_a_flat_tool_of_one_element_presses_evenly(order: int, tmp_path: Path) -> None:
    """Its nodes have to know a rotation, on the coarser mesh of the estimate too."""
    case = CONDITIONS["flat tool of one element"](make_setting("SST", "dense", order, 0)).case
    case["tools"]["press"]["moment"] = 0.0
    results = pbem.run(case, tmp_path / "press.h5")
    np.testing.assert_allclose(results.rigid["press"].force[-1], [0.0, -3.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(results.rigid["press"].motion[-1], [0.0, -6e-3, 0.0], atol=1e-9 if order else 5e-4)


def test_an_interference_that_a_stage_opens_leaves_nothing(tmp_path: Path) -> None:
    """Forces of rounding do not end the run as forces that do not balance."""
    setting = make_setting("SST", "dense", 2, 0)
    draft = lay_stack(setting, law={"law": "coulomb", "friction": 0.5, "gap": -0.002})
    draft["boundary"].update({"foot": {"ux": 0.0, "uy": 0.0}, "head": {"ux": 0.0, "uy": 0.0}})
    add_stages(draft, {}, {"open": ["j1"], "steps": 2})
    results = pbem.run(draft.case(), tmp_path / "opened.h5")
    np.testing.assert_allclose(results.contact["j1"].traction_n[:, 0], [-1.0, -0.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(results.energy.removed, [0.0, 1.5e-3, 2e-3], atol=1e-9)


class Listener(SilentReporter):
    """Keeps what is told."""

    def __init__(self) -> None:
        self.told: list[str] = []

    def note(self, text: str) -> None:
        self.told.append(text)


@pytest.mark.parametrize(("name", "words"), [
    ("fluid in an open crack", "J and"), ("stages: tension after an opening elsewhere", "between the nodes"),
    ("stages: release a weld", "between the nodes"), ("round tool of one element under a force", "moved unstably"),
    ("heat and stress at rest that balance", "balance"),
])
def test_nothing_is_told_that_is_not_so(name: str, words: str, tmp_path: Path) -> None:
    """K and J of rounding agree; faces that a stage has joined bear any tension; tools that touch more and more push
    along a path of equilibria."""
    listener = Listener()
    pbem.run(CONDITIONS[name](make_setting("SST", "dense", 2, 0)).case, tmp_path / "told.h5", reporter=listener)
    assert not [told for told in listener.told if words in told]


def test_faults_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """A figure that is off, one that is no number, a message that is not the one, and a case that should be refused."""
    name = next(iter(CONDITIONS))
    trial = CONDITIONS[name](make_setting("SST", "dense", 2, 0))
    empty = Trial({"title": "nothing"}, trial.check)
    wrong = {
        "off": Trial(trial.case, lambda _: iter([Figure("good", 0.0, 1.0), Figure("bad", 2.0, 1.0)])),
        "no number": Trial(trial.case, lambda _: iter([Figure("bad", float("nan"), 1.0)])),
        "nothing": Trial(trial.case, lambda _: iter([])),
        "stopped": empty, "other words": Trial(empty.case, trial.check, "some words"),
        "not refused": Trial(trial.case, trial.check, "materials"),
    }  # fmt: skip
    monkeypatch.setattr("scripts.study_conditions.CONDITIONS", {key: lambda _, each=each: each
                                                                for key, each in wrong.items()})
    for key in wrong:
        assert judge(key, make_setting("SST", "dense", 2, 0), tmp_path).word == "FAULT", key
    monkeypatch.setattr("sys.argv", ["study", "--schemes", "SST", "--operators", "dense", "--names", "off"])
    assert main() == 1
    assert "FAULT 2e+00" in capsys.readouterr().out
