"""Elements graded towards the ends of contact: pressures of the pairs there, and what runs make of it."""

from __future__ import annotations

import cmath
import math
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem import driver
from pbem.case.build import parse_model
from pbem.errors import CaseError, ConvergenceError, StopError
from pbem.mesh.generate import generate_mesh
from pbem.model.end_grading import ContactEnd, grade_ends
from pbem.passes import MOST_GRADED, STILL_COARSE, plan_graded
from pbem.results import contact_ends
from pbem.results import writer as writer_module
from pbem.results.estimator import Estimator
from pbem.results.reader import Results
from pbem.results.writer import ResultWriter
from pbem.solve.problem.step import SilentReporter
from pbem.solve.steps import march as march_module
from tests.verification.rigid_sample import UNMOVED, Place, compare_pressures, find_persson_force, write_pin


def write(path: Path, *given: Any, **analysis: Any) -> Path:
    """A case file of a pin; see `write_pin`."""
    path.write_text(write_pin(*given, hub=0.002, edge=300.0, **analysis))
    return path


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize(
    ("clearance", "elements", "half_width", "direction", "scheme", "place"),
    [
        (1e-3, 64, 50.0, 20.0, "SST", UNMOVED),
        (1e-5, 32, 37.0, -80.0, "DBEM", Place(0.4, 3 + 1j, 1e3, 1e-3)),
        (1e-6, 96, 66.0, 130.0, "THST", UNMOVED),
        (1e-4, 48, 46.2, 77.0, "HST", Place(0.0, 0j, 1e-4, 2e8)),
    ],
)
def test_pressures_of_a_pin_at_all_pairs(
    tmp_path: Path, clearance: float, elements: int, half_width: float, direction: float, scheme: str, place: Place
) -> None:
    width = math.radians(half_width)
    force = find_persson_force(width, clearance)
    worst = []
    for graded in (False, True):
        case = write(tmp_path / "pin.toml", clearance, force, direction, elements, place, scheme=scheme,
                     grade_contact_ends=graded)
        results = pbem.run(case, tmp_path / "pin.h5", force=True)
        worst.append(np.abs(compare_pressures(results, force, width, direction, place)).max())
    assert worst[1] < 1e-2 < worst[0]


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize(
    ("clearance", "elements", "half_width", "scheme", "order"),
    [(3e-6, 24, 69.3, "DBEM", 1), (2e-4, 24, 39.8, "HST", 2), (3e-5, 32, 12.0, "SST", 2), (7e-3, 48, 78.0, "THST", 3)],
)
def test_pressures_of_a_pin_as_the_file_says_nothing_of_ends(
    tmp_path: Path, clearance: float, elements: int, half_width: float, scheme: str, order: int
) -> None:
    width = math.radians(half_width)
    force = find_persson_force(width, clearance)
    case = write(tmp_path / "pin.toml", clearance, force, 200.0, elements, UNMOVED, scheme=scheme, order=order)
    results = pbem.run(case, tmp_path / "pin.h5")
    assert np.abs(compare_pressures(results, force, width, 200.0)).max() < 1e-2


@pytest.mark.usefixtures("without_errors")
def test_a_large_model_is_solved_again_only_if_that_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pbem.passes.MOST_UNKNOWNS", 100)
    notes = []

    class Listener(SilentReporter):
        def note(self, text: str) -> None:
            notes.append(text)

    results = pbem.run(write_small(tmp_path / "pin.toml", "auto"), tmp_path / "pin.h5", reporter=Listener())
    assert results.fractions is None
    assert sum("unknowns: analysis.grade_contact_ends = true does" in note for note in notes) == 1
    results = pbem.run(write_small(tmp_path / "pin.toml"), tmp_path / "pin.h5", force=True)
    assert results.fractions is not None
    end = ContactEnd("seat", 1 + 0j, ("rim",), 1e-3, 1e-3)
    found = plan_graded(parse_model(write_pin(1e-3, FORCE, 20.0, 32))[1], [end], 0, 0, 401)
    assert found is not None and "the run took 401 iterations" in found.note


@pytest.mark.usefixtures("without_errors")
def test_contact_of_round_bodies_ends_as_wide_as_their_pressures_say(tmp_path: Path) -> None:
    """Two rounds pressed together by P: p = p0 sqrt(1 - (x/a)^2) with P = pi a p0 / 2 (Hertz). As bodies are no
    half-planes, a and p0 are those of the line through p^2 over x^2."""
    load, side = 4.0, math.sqrt(0.5)
    case = pbem.Case(**{
        "materials": {"m": {"young": 1000.0, "poisson": 0.3}},
        "curves": {
            "ball": {"center": [0.0, 1.0], "radius": 1.0, "angles": [225.0, 315.0], "elements": 64},
            "right": {"points": [[side, 1 - side], [side, 1.3]], "elements": 4},
            "roof": {"points": [[side, 1.3], [-side, 1.3]], "elements": 6},
            "left": {"points": [[-side, 1.3], [-side, 1 - side]], "elements": 4},
            "bed": {"center": [0.0, -1.0], "radius": 1.0, "angles": [45.0, 135.0], "elements": 64},
            "sides": {"points": [[-side, side - 1], [-side, -1.3]], "elements": 4},
            "floor": {"points": [[-side, -1.3], [side, -1.3]], "elements": 6},
            "other": {"points": [[side, -1.3], [side, side - 1]], "elements": 4},
        },
        "regions": {"top": {"material": "m", "boundary": ["ball", "right", "roof", "left"]},
                    "bottom": {"material": "m", "boundary": ["bed", "sides", "floor", "other"]}},
        "boundary": {"roof": {"rigid": {"fy": -load, "ux": 0.0, "rotation": 0.0}},
                     "floor": {"ux": 0.0, "uy": 0.0}},
        "contacts": {"touch": {"between": ["ball", "bed"]}},
        "analysis": {"steps": 1, "grade_contact_ends": True},
    })  # fmt: skip
    results = pbem.run(case, tmp_path / "rounds.h5")
    contact = results.contact["touch"]
    x, pressure = contact.position[:, 0], -np.asarray(contact.traction_n[-1])
    held = pressure > 0.2 * pressure.max()
    slope, top = np.polyfit(x[held] ** 2, pressure[held] ** 2, 1)
    assert math.pi * top / math.sqrt(-slope) / 2 == pytest.approx(load, rel=3e-3)
    exact = np.sqrt(np.maximum(top + slope * x**2, 0.0))
    assert np.abs(pressure - exact)[held].max() < 1e-2 * math.sqrt(top)
    # The last pair in contact lies where it ends, far closer than elements of a third of a.
    assert np.abs(x[pressure > 0]).max() == pytest.approx(math.sqrt(-top / slope), rel=5e-3)


FORCE = find_persson_force(math.radians(50.0), 1e-3)


def write_small(path: Path, graded: bool | str = True) -> Path:
    return write(path, 1e-3, FORCE, 20.0, 32, steps=2, grade_contact_ends=graded)


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """The small pin as its elements are; computed once, as nothing disturbs that run."""
    folder = tmp_path_factory.mktemp("plain")
    return pbem.run(write_small(folder / "plain.toml", graded=False), folder / "plain.h5")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """The small pin with graded ends, by a run that nothing disturbs."""
    folder = tmp_path_factory.mktemp("whole")
    return pbem.run(write_small(folder / "whole.toml"), folder / "whole.h5")


def test_a_run_that_was_stopped_on_the_graded_mesh_goes_on_with_it(
    whole: Results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case, tractions = write_small(tmp_path / "pin.toml"), np.asarray(whole.contact["seat"].traction_n)
    assert whole.fractions is not None
    march, marches = driver.march, []

    def stop(*given: Any, **named: Any) -> Iterator[Any]:
        marches.append(given)
        for number, step in enumerate(march(*given, **named)):
            if len(marches) == 2 and number == 1:
                raise KeyboardInterrupt
            yield step

    with monkeypatch.context() as patch:
        patch.setattr(driver, "march", stop)
        with pytest.raises(KeyboardInterrupt):
            pbem.run(case, tmp_path / "part.h5")
    assert len(marches) == 2
    results = pbem.run(case, tmp_path / "part.h5", resume=True)
    assert results.status == "finished"
    np.testing.assert_allclose(np.asarray(results.contact["seat"].traction_n), tractions, rtol=0,
                               atol=1e-9 * np.abs(tractions).max())


def test_a_finished_run_is_left_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where ends of contact were not graded, as an earlier version did not or the further pass was given up; but
    not what was stopped between two passes."""
    case, path = write_small(tmp_path / "pin.toml"), tmp_path / "pin.h5"
    planned = driver.plan_graded
    with monkeypatch.context() as patch:
        patch.setattr(driver, "plan_graded", lambda *_: None)
        assert pbem.run(case, path).fractions is None
    before = path.read_bytes()
    assert pbem.run(case, path, resume=True).status == "finished"
    assert path.read_bytes() == before

    def stop(*given: Any) -> None:
        planned(*given)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(driver, "plan_graded", stop)
        with pytest.raises(KeyboardInterrupt):
            pbem.run(case, path, force=True)
    results = pbem.run(case, path, resume=True)
    assert results.fractions is not None
    again = path.read_bytes()
    assert pbem.run(case, path, resume=True).status == "finished" and path.read_bytes() == again


@pytest.mark.parametrize("graded", [True, False])
def test_stages_that_are_added_say_that_they_keep_the_mesh(graded: bool, tmp_path: Path) -> None:
    """Contact that was graded towards its ends under one force ends elsewhere under the next one."""
    table = tomllib.loads(write_pin(1e-3, FORCE, 20.0, 32, hub=0.002, edge=300.0, grade_contact_ends=graded))
    del table["analysis"]["steps"]
    push = table["boundary"]["hub"]["rigid"]
    stages = [{"name": name, "steps": 1, "boundary": {"hub": {"rigid": {**push, "fx": part * push["fx"]}}}}
              for name, part in (("first", 1.0), ("second", 1.3), ("third", 1.31))]
    said = "in the stages before are kept for those that were added"
    path = tmp_path / "pin.h5"
    results = pbem.run({**table, "stages": stages[:1]}, path)
    assert (results.fractions is not None) == graded and said not in "".join(results.notes)
    both = {**table, "stages": stages[:2]}
    for number in (2, 3):  # what was chosen at the end of the first stage is not said to be of two
        added = pbem.run({**table, "stages": stages[:number]}, path, resume=True)
        assert len(added.steps.factor) == number
        assert sum(said in note for note in added.notes) == graded
    assert said not in "".join(pbem.run(both, path, force=True).notes)


def test_results_before_stand_if_contacts_do_not_settle_on_the_graded_mesh(
    plain: Results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    march, marches = driver.march, []

    def fail(*given: Any, **named: Any) -> Iterator[Any]:
        marches.append(given)
        if len(marches) > 1:
            raise ConvergenceError("mode cycle", "pairs that still change")
        yield from march(*given, **named)

    monkeypatch.setattr(driver, "march", fail)
    results = pbem.run(write_small(tmp_path / "pin.toml"), tmp_path / "pin.h5")
    assert len(marches) == 2 and results.status == "finished"
    np.testing.assert_array_equal(results.contact["seat"].traction_n, plain.contact["seat"].traction_n)
    assert pbem.run(tmp_path / "pin.toml", tmp_path / "pin.h5", resume=True).status == "finished" and len(marches) == 2
    assert not list(tmp_path.glob("pin.h5?*"))


@pytest.mark.parametrize(("place", "ending"), [
    ("march", StopError("SIGTERM", "stopped by SIGTERM", 143)), ("march", MemoryError("no room")),
    ("assemble_problem", StopError("SIGTERM", "stopped by SIGTERM", 143)), ("check_memory", MemoryError("no room")),
])  # fmt: skip
def test_finished_steps_are_stored_when_the_graded_mesh_comes_to_no_end(
    ending: Exception, place: str, plain: Results, whole: Results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever ends it, and with what ended it in the file; resumed, the run goes on from them to the graded mesh."""
    case, path = write_small(tmp_path / "pin.toml"), tmp_path / "pin.h5"
    former, calls = getattr(driver, place), []

    def fail(*given: Any, **named: Any) -> Any:
        calls.append(given)
        if len(calls) > 1:
            raise ending
        return former(*given, **named)

    with monkeypatch.context() as patch:
        patch.setattr(driver, place, fail)
        with pytest.raises(type(ending)):
            pbem.run(case, path)
    kept = pbem.open_results(path)
    assert len(calls) == 2 and kept.status == "stopped" and kept.fractions is None
    assert str(ending).split(": ")[-1] in kept.failure and "on a mesh graded towards ends" in kept.failure
    np.testing.assert_array_equal(kept.contact["seat"].traction_n, plain.contact["seat"].traction_n)
    assert "ended before the second solution" in kept.errors.missing and not list(tmp_path.glob("pin.h5?*"))
    again = pbem.run(case, path, resume=True)
    assert again.status == "finished" and again.fractions is not None and not again.errors.missing
    np.testing.assert_allclose(again.contact["seat"].traction_n, whole.contact["seat"].traction_n, rtol=0,
                               atol=1e-6 * np.abs(whole.contact["seat"].traction_n).max())


@pytest.mark.parametrize(
    ("place", "due", "stored"),
    [("solve_step", 2, 1), ("solve_step", 1, 0), ("find_ends", 2, 1), ("plan_graded", 1, 2), ("make_estimator", 1, 2),
     ("estimate", 2, 2)],
)
def test_steps_that_wait_are_stored_when_memory_runs_out(
    place: str, due: int, stored: int, plain: Results, whole: Results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In that very pass, wherever it is; of those that are known no step has to be computed again."""
    case, path = write_small(tmp_path / "pin.toml"), tmp_path / "pin.h5"
    owner = {"solve_step": march_module, "find_ends": driver, "estimate": Estimator}.get(place, driver)
    name = {"find_ends": "_find_ends"}.get(place, place)
    former, calls = getattr(owner, name), []

    def lack(*given: Any, **named: Any) -> Any:
        calls.append(given)
        if len(calls) >= due:
            raise MemoryError("no room")
        return former(*given, **named)

    with monkeypatch.context() as patch:
        patch.setattr(owner, name, lack)
        if place in ("make_estimator", "estimate"):  # no other pass is to follow, so that this one is stored
            patch.setattr(driver, "plan_graded", lambda *_: None)
        with pytest.raises(MemoryError):
            pbem.run(case, path)
    kept = pbem.open_results(path)
    assert (kept.status, len(kept.steps), kept.fractions) == ("stopped", stored, None) and "no room" in kept.failure
    if stored:
        np.testing.assert_array_equal(kept.contact["seat"].traction_n,
                                      plain.contact["seat"].traction_n[:stored])
        np.testing.assert_array_equal(kept.energy.external, plain.energy.external[:stored])
        assert "ended before the second solution" in kept.errors.missing
    again = pbem.run(case, path, resume=True)
    assert again.status == "finished" and again.fractions is not None and not again.errors.missing
    np.testing.assert_allclose(again.contact["seat"].traction_n, whole.contact["seat"].traction_n, rtol=0,
                               atol=1e-6 * np.abs(whole.contact["seat"].traction_n).max())


def test_only_the_last_pass_is_stored_with_its_errors(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What another pass follows is neither written nor followed by a second solution; its errors are those of a run
    on that mesh alone."""
    estimated, written = [], []
    make, append = driver.make_estimator, ResultWriter.append
    monkeypatch.setattr(driver, "make_estimator", lambda *given: estimated.append(given[1].nodes) or make(*given))
    monkeypatch.setattr(ResultWriter, "append", lambda *given: written.append(given[1].number) or append(*given))
    results = pbem.run(write_small(tmp_path / "pin.toml"), tmp_path / "pin.h5")
    assert results.fractions is not None and results.status == "finished"
    assert estimated == [len(results.nodes.position)] and written == [1, 2]
    assert np.isfinite(np.asarray(results.errors.relative["tractions"])).all()


@pytest.mark.parametrize("most", [1, 5])
def test_steps_that_waited_are_those_of_a_run_that_did_not(
    most: int, whole: Results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where they are too many to wait, or a stop comes between."""
    case = write_small(tmp_path / "pin.toml")
    monkeypatch.setattr("pbem.storing.MOST_WAITING", most)
    found = pbem.run(case, tmp_path / "found.h5")
    assert repr(found.fractions) == repr(whole.fractions)
    size = np.abs(whole.contact["seat"].traction_n).max()
    np.testing.assert_allclose(found.contact["seat"].traction_n, whole.contact["seat"].traction_n, rtol=0,
                               atol=1e-6 * size)
    np.testing.assert_allclose(found.errors.relative["tractions"], whole.errors.relative["tractions"], rtol=1e-4)
    march = driver.march

    def stop(*given: Any, **named: Any) -> Iterator[Any]:
        yield next(march(*given, **named))
        raise StopError("SIGTERM", "stopped by SIGTERM", 143)

    with monkeypatch.context() as patch:
        patch.setattr(driver, "march", stop)
        with pytest.raises(StopError):
            pbem.run(case, tmp_path / "part.h5")
    part = pbem.open_results(tmp_path / "part.h5")
    assert part.status == "stopped" and len(part.steps) == 1
    assert np.isfinite(np.asarray(part.errors.relative["tractions"])).all()
    again = pbem.run(case, tmp_path / "part.h5", resume=True)
    np.testing.assert_allclose(again.contact["seat"].traction_n, whole.contact["seat"].traction_n, rtol=0,
                               atol=1e-6 * size)


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("graded", [True, "auto"])
def test_rows_of_a_sweep_are_those_of_single_runs(tmp_path: Path, graded: bool | str) -> None:
    """With "auto" of runs on the mesh that the cases share: each case for itself took sixteen times as long."""
    case = write_small(tmp_path / "pin.toml", graded)
    table = pbem.sweep(case, {"boundary.hub.rigid.fx": [0.8 * FORCE, FORCE]}, ["contact.seat.traction_n.min"])
    for found, push in zip(table["contact.seat.traction_n.min"], (0.8 * FORCE, FORCE), strict=True):
        own = {"boundary.hub.rigid.fx": push, "analysis.grade_contact_ends": graded is True}
        results = pbem.run(case, tmp_path / "one.h5", force=True, set=own)
        least = float(np.asarray(results.contact["seat"].traction_n)[-1].min())
        assert found == pytest.approx(least, rel=1e-9)


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize(("graded", "degrees"), [(True, 0.1), ("auto", 4.0)])
def test_ends_on_a_curve_of_two_regions_are_graded_if_asked_for(
    graded: bool | str, degrees: float, tmp_path: Path
) -> None:
    """A smooth inclusion of its plane's material under tension touches it within 19.6 degrees of the sides of the
    direction of the tension, whatever the tension (Stippes, Wilson and Krull, 1962)."""
    case = {"materials": {"m": {"young": 210e3, "poisson": 0.3}},
            "curves": {"rim": {"center": [40.0, -7.0], "radius": 5.0, "elements": 24}},
            "regions": {"in": {"material": "m", "boundary": ["rim"]},
                        "out": {"material": "m", "infinite": True, "boundary": ["rim"]}},
            "interfaces": {"rim": {"law": "frictionless"}}, "remote": {"sxx": 15.0},
            "analysis": {"steps": 1, "grade_contact_ends": graded}}  # fmt: skip
    rim = pbem.run(case, output=tmp_path / "rim.h5").contact["rim"]
    x, y = (rim.position - [40.0, -7.0]).T
    closed = rim.mode[-1] != 2
    beside = np.degrees(np.arctan2(np.abs(x), np.abs(y)))[closed]
    assert beside.max() == pytest.approx(19.6, abs=degrees)
    assert (beside.max() > 19.0) == (graded is True)


@pytest.mark.usefixtures("without_errors")
def test_curves_whose_grading_is_given_are_left_alone(tmp_path: Path) -> None:
    text = write_small(tmp_path / "own.toml").read_text().replace("elements = 32", 'elements = 32, grading = "none"')
    (tmp_path / "own.toml").write_text(text)
    assert 'grading = "none"' in text
    results = pbem.run(tmp_path / "own.toml", tmp_path / "own.h5")
    assert results.fractions is None


@pytest.mark.usefixtures("without_errors")
def test_an_end_that_the_openings_do_not_tell_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # As if the faces beyond parted alike everywhere.
    monkeypatch.setattr("pbem.results.contact_ends.np.polyfit", lambda *_: (0.0, 1.0))
    notes = []

    class Listener(SilentReporter):
        def note(self, text: str) -> None:
            notes.append(text)

    results = pbem.run(write_small(tmp_path / "pin.toml"), tmp_path / "pin.h5", reporter=Listener())
    assert results.status == "finished" and results.fractions is None
    assert sum("is not known, they are left as they are" in note for note in notes) == 1


def test_elements_grow_with_the_distance_from_an_end() -> None:
    model = parse_model(write_pin(1e-3, FORCE, 20.0, 32))[1]
    place = cmath.rect(1.0, 6.2)  # beside the joint of the circle's both ends
    long = 2 * math.pi / 32
    # The contact lies behind along the rim.
    end = ContactEnd("seat", place - model.origin, ("rim",), long / 50, 0.05 * long, inward=-1j * place)
    finer = grade_ends(model, [end])
    assert finer.curves["hole"] == model.curves["hole"]
    mesh = generate_mesh(finer)
    rim = np.abs(np.abs(mesh.start + model.origin) - 1.0) < 1e-6
    angle = np.mod(np.angle(mesh.start[rim] + model.origin), 2 * math.pi)
    lengths = mesh.geometry.lengths[rim]
    middle = np.remainder(angle + 0.5 * lengths - 6.2 + math.pi, 2 * math.pi) - math.pi
    apart = np.maximum(np.abs(middle) - 0.5 * lengths, 0.0)
    assert lengths[np.abs(middle).argmin()] <= long / 50 and lengths.max() == pytest.approx(long)
    allowed = long / 50 + np.where(middle < 0, 3.0, 9.0) * apart
    assert (lengths <= 1.01 * allowed).all() and (lengths > 3.1 * apart + long / 50)[middle > 0].any()
    assert len(lengths) <= 32 + 5 + 3 + 3
    assert lengths.sum() == pytest.approx(2 * math.pi)
    fine = replace(end, fall=0.5 * STILL_COARSE)
    assert plan_graded(model, [fine], MOST_GRADED) is None and plan_graded(model, [], 0) is None
    assert plan_graded(finer, [end], 0) is None  # short enough
    lost = replace(end, located=False)
    found = plan_graded(model, [lost], 0)
    assert found is not None and found.model is model and "is not known" in found.note
    both = plan_graded(model, [end, lost], 0)
    assert both is not None and both.model.curves == finer.curves and "is not known" in both.note
    coarse = plan_graded(finer, [end], MOST_GRADED)
    assert coarse is not None and coarse.model is finer and "graded 3 times" in coarse.note
    crowd = [ContactEnd("seat", cmath.rect(1.0, 0.2 * k) - model.origin, ("rim",), long / 5e6, 0.0) for k in range(31)]
    many = plan_graded(model, crowd, 0)
    assert many is not None and many.model is model and "in place of" in many.note


def test_grading_is_refused_beside_accuracy() -> None:
    with pytest.raises(CaseError, match=r"grade_contact_ends.*true beside accuracy"):
        parse_model(write_pin(1e-3, FORCE, 20.0, 32, grade_contact_ends=True, accuracy=1e-2))


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize(("half_width", "again"), [(60.0, False), (60.8, True), (61.2, False), (62.0, True)])
def test_pressures_that_lie_on_the_root_as_they_are_are_not_solved_for_again(
    tmp_path: Path, half_width: float, again: bool
) -> None:
    """Contact ends at another place within elements of 3.75 degrees: what the nodes see of the root depends on it."""
    width = math.radians(half_width)
    force = find_persson_force(width, 1e-4)
    case = write(tmp_path / "pin.toml", 1e-4, force, 0.0, 96, UNMOVED)
    results = pbem.run(case, tmp_path / "pin.h5")
    assert (results.fractions is not None) is again
    assert np.abs(compare_pressures(results, force, width, 0.0)).max() < 1e-2


def test_a_listener_that_fails_after_a_step_was_stored_does_not_have_it_stored_again(
    plain: Results, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Failing(SilentReporter):
        def note(self, text: str) -> None:
            if text == "sparse":
                raise RuntimeError("no room to tell it")

    case = write_small(tmp_path / "pin.toml")
    monkeypatch.setattr(driver, "plan_graded", lambda *_: None)
    monkeypatch.setattr(writer_module.Coverage, "follow", lambda _, step: ("sparse",) * (step.number == 2))
    with pytest.raises(RuntimeError, match="no room to tell it"):
        pbem.run(case, tmp_path / "pin.h5", reporter=Failing())
    kept = pbem.open_results(tmp_path / "pin.h5")
    np.testing.assert_array_equal(kept.steps.factor, plain.steps.factor)
    np.testing.assert_array_equal(kept.energy.external, plain.energy.external)
    assert not kept.errors.missing


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize(("followed", "graded", "count"), [
    ([True, True], "auto", 0), ([True, False], "auto", 2), ([False, False], "auto", 2), ([True, True], True, 2),
])  # fmt: skip
def test_ends_are_left_as_they_are_only_if_the_pressures_lie_on_the_root_at_all_of_them(
    followed: list[bool], graded: bool | str, count: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = write_small(tmp_path / "pin.toml", graded=graded)
    judged, found = iter(100 * followed), []
    monkeypatch.setattr(contact_ends._Pressed, "_is_followed", lambda *_: next(judged))
    monkeypatch.setattr(driver, "plan_graded", lambda _, ends, *__: found.append(ends))
    pbem.run(case, tmp_path / "pin.h5")
    assert {len(ends) for ends in found} == {count}
