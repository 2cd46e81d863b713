"""Tries of a load step that failed, kept in the result file: what is decided from them later is as if never stopped."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from pbem.errors import ConvergenceError
from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.results.former import read_ahead, write_former
from pbem.results.unfinished import read_unfinished, write_unfinished
from pbem.solve.nonlinear.checkpoint import describe_error, recall_error
from pbem.solve.nonlinear.unsettled import Unsettled
from pbem.solve.problem.step import Unfinished
from pbem.solve.steps.attempt import describe_ceiling, recall_ceiling
from pbem.solve.steps.ceiling import Ceiling
from tests.unit.results_sample import make_mesh, make_model, make_steps


def make_error() -> ConvergenceError:
    """Free motion in modes of a search that ended for another reason, which dashpots did not bring to rest either."""
    turns = RigidBodyMode(("lid", "a/b"), {"lid": (1e-3 - 2j, 0.25), "a/b": (0j, -1.0)}, "a rotation of 'lid'")
    inner = ConvergenceError("mode cycle", "pairs that still change", (0.5 + 1e5j,), None, True)
    return ConvergenceError("free motion", "'lid' is free", (1 + 2j, -3.5j), Unsettled(inner, (turns,), True), True)


def check_equal(found: ConvergenceError, expected: ConvergenceError) -> None:
    """All that an error tells, and those that it carries."""
    for name in ("reason", "detail", "places", "restless"):
        assert getattr(found, name) == getattr(expected, name)
    if expected.unless is None:
        assert found.unless is None
        return
    assert (found.unless.motions, found.unless.may_stick) == (expected.unless.motions, expected.unless.may_stick)
    check_equal(found.unless.error, expected.unless.error)


def test_an_unfinished_step_keeps_all_of_an_error(tmp_path: Path) -> None:
    error, pairs = make_error(), np.arange(0)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        unfinished = Unfinished(0, 0.5, np.zeros(0, dtype=np.int8), np.ones(0), {"error": describe_error(error)})
        write_unfinished(file, unfinished, pairs)
        found = read_unfinished(file, pairs)
    assert found is not None
    check_equal(recall_error(found.search["error"]), error)


def test_what_is_known_beyond_a_step_keeps_all_of_an_error(tmp_path: Path) -> None:
    error = make_error()
    model = make_model()
    step = make_steps(model, make_mesh(model))[2]
    ceiling = Ceiling(0.75, 0.8, np.inf, 0.75, error)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["steps/number"] = np.zeros(0, dtype=int)
        write_former(file, None, replace(step, ahead=describe_ceiling(ceiling)), np.arange(0), 0)
        found = recall_ceiling(read_ahead(file, step.number))
    assert (found.failed, found.free, found.balanced, found.tried) == (0.75, 0.8, np.inf, 0.75)
    assert found.error is not None
    check_equal(found.error, error)


def test_errors_without_motions_and_of_files_with_less() -> None:
    plain = ConvergenceError("iteration limit", "too many")
    check_equal(recall_error(describe_error(plain)), plain)
    told = {"reason": "mode cycle", "detail": "", "places": np.array([1 + 2j])}
    check_equal(recall_error(told), ConvergenceError("mode cycle", "", (1 + 2j,)))


def test_a_search_that_other_code_kept_begins_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = np.arange(2)
    unfinished = Unfinished(0, 0.5, np.zeros(2, dtype=np.int8), np.ones(2), {"course": 1})
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name in ("LAYOUT", "__version__"):
            write_unfinished(file, unfinished, pairs)
            kept = read_unfinished(file, pairs)
            assert kept is not None and kept.search == {"course": 1}
            with monkeypatch.context() as patch:
                patch.setattr(f"pbem.results.unfinished.{name}", "another")
                other = read_unfinished(file, pairs)
            assert other is not None and other.search == {} and other.factor == 0.5
