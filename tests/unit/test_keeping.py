"""What a sweep keeps from case to case: parts of the model, the states of neighbours, and groups' inverses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import pbem
from pbem.case.build import make_checked_model
from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.mesh.generate import generate_mesh
from pbem.model import build
from pbem.model.recall import Recall
from pbem.parallel import world
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner
from pbem.solve.problem.step import ContactState
from pbem.solve.steps.prediction import History, Place, predict_modes, weigh_histories
from pbem.solve.system.assembly import assemble_problem
from pbem.sweeps.values import find_place
from tests.unit.test_laws import make_laws, remember

CRACK: dict[str, Any] = {
    "materials": {"rock": {"young": 1e3, "poisson": 0.2}},
    "curves": {"one": {"points": [[-1, 0], [1, 0.2]], "elements": 4}, "two": {"points": [[-0.5, 1], [1, 1]],
                                                                               "elements": 4}},
    "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["one", "two"]}},
    "interfaces": {"one": {"friction": 0.3}, "two": {"friction": 0.1, "pressure": 0.4}},
    "remote": {"syy": -1.0, "sxy": 0.5},
    "solver": {"operator": "hierarchical"},
}


def test_a_part_is_computed_again_where_what_it_is_found_from_has_changed() -> None:
    recall, made = Recall(), []
    for given in (1, 1, 2, 1):
        assert recall.find("part", given, lambda now=given: made.append(now) or now) == given  # type: ignore[misc]
    assert recall.find("other", 1, lambda: 7) == 7 and made == [1, 2, 1]


def test_topology_is_found_once_and_the_model_is_that_of_the_case_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    found, whole = [], build._find_topology
    monkeypatch.setattr(build, "_find_topology", lambda *given: found.append(1) or whole(*given))
    recall = Recall()
    # The last but one cuts the cracks at each other, the last has other elements.
    changes: list[dict[str, Any]] = [
        {}, {"interfaces.one.friction": 0.7}, {"remote.sxy": 0.1, "interfaces.two.pressure": 0.2},
        {"curves.two.points": [[-0.5, 1], [0.5, -1]]}, {"curves.two.elements": 7},
    ]
    for change in changes:
        model = make_checked_model(CRACK, change, recall=recall)
        count = len(found)
        alone = make_checked_model(CRACK, change)
        del found[count:]
        assert model == alone and generate_mesh(model).nodes == generate_mesh(alone).nodes
    assert len(found) == 3


def place(*numbers: float, kind: tuple[str, ...] = ()) -> Place:
    return Place(kind, np.array(numbers), np.array(numbers))


def state(slip: float, traction_n: float = -1.0, mode: int = SLIP) -> ContactState:
    array = np.full(1, slip)
    return ContactState(np.full(1, mode, dtype=np.int8), 0 * array, array, 0 * array + traction_n, 0 * array - 0.3, {})


def history(at: Place, slip: float = 0.0) -> History:
    return History(at, {(0, 1.0): state(slip)})


def test_states_are_continued_from_the_nearest_cases() -> None:
    corner = [history(place(0, 0)), history(place(1, 0)), history(place(0, 1)), history(place(5, 5))]
    found = {tuple(each.place.number): weight for each, weight in weigh_histories(corner, place(1, 1))}
    assert found == pytest.approx({(0, 0): -1, (1, 0): 1, (0, 1): 1})
    line = [history(place(1.0)), history(place(2.0))]
    assert [weight for _, weight in weigh_histories(line, place(3.0))] == pytest.approx([2, -1])
    # One alone, one that is as far as can be, and one of another kind.
    assert weigh_histories(line[:1], place(3.0)) == [(line[0], 1.0)]
    assert weigh_histories(line, place(90.0)) == [(line[1], 1.0)]
    assert weigh_histories(line, place(3.0, kind=("open",))) == []


def test_modes_are_those_that_the_continued_state_asks_for() -> None:
    laws, memory, nothing = make_laws(1, np.full(1, 0.3), np.zeros(1)), remember(0.0, 1), np.zeros(1)

    def predict(*states: ContactState) -> int | None:
        weights = [1.0] if len(states) == 1 else [2.0, -1.0]
        weighed = [(History(place(0.0), {(0, 1.0): each}), weight)
                   for each, weight in zip(states, weights, strict=True)]
        modes = predict_modes(weighed, laws, 0, 1.0, memory, nothing)
        assert predict_modes(weighed, laws, 1, 1.0, memory, nothing) is None
        return None if modes is None else int(modes.mode[0])

    assert predict(state(-0.01)) == SLIP
    assert predict(state(-0.01), state(-0.03)) == STICK  # the slip comes to an end
    assert predict(state(-0.03), state(-0.01)) == SLIP
    assert predict(state(-0.03, -0.2), state(-0.03, -0.6)) == OPEN


def test_a_case_has_its_place_among_all() -> None:
    several: dict[str, list[Any]] = {"a.friction": [0.5, 0.1], "b.law": ["bonded", "coulomb"], "c.elements": [4, 8]}
    found = find_place({"a.friction": 0.5, "b.law": "coulomb", "c.elements": 4}, several)
    assert found.kind == ("coulomb",) and found.rank.tolist() == [1, 0] and found.number.tolist() == [0.5, 4]


def test_inverses_serve_until_the_map_has_drifted_far_enough() -> None:
    def assemble(friction: float) -> Any:
        model = make_checked_model(CRACK, {"interfaces.*.friction": friction, "interfaces.*.cohesion": 0.0})
        return assemble_problem(model, generate_mesh(model), world)

    problem = assemble(0.1)
    tangent = problem.make_tangent()
    preconditioner: SchwarzPreconditioner = tangent.preconditioner

    def update(friction: float) -> int:
        from tests.identities.solving import linearise_pairs
        from tests.unit.test_nearby import draw_modes

        other = assemble(friction)
        modes = draw_modes(other.mesh.pairs.count)
        return preconditioner.update(other.constrain(linearise_pairs(other, modes, -1.0), other.evaluate_load(0, 1.0)))

    count = len(preconditioner.inverses)
    assert update(0.1) == count and update(0.1) == 0 and update(0.2) == count
    preconditioner.most_drift = 0.25
    assert update(0.3) == 0 and update(0.4) == 0 and update(0.5) == count
    tangent.destroy()


def test_quantities_that_need_no_faces_are_those_of_whole_steps() -> None:
    several = {"interfaces.*.friction": [0.1, 0.3], "remote.sxy": [0.5, 0.8]}
    names = ["tips.one.KI", "tips.two.KII", "energy.external", "energy.elastic", "contact.slip.largest"]
    changes = {"initial_stress.rock": {"sxx": -0.4, "syy": -0.2, "sxy": 0.1}}
    short = pbem.sweep(CRACK, several, names, set=changes)
    whole = pbem.sweep(CRACK, several, [*names, "tips.one.T"], set=changes, neighbours=False)
    for name in names:
        size = np.abs(whole[name]).max()
        np.testing.assert_allclose(short[name], whole[name], rtol=0, atol=1e-9 * size, err_msg=name)
    alone = pbem.sweep(CRACK, {key: each[-1:] for key, each in several.items()}, ["tips.one.T"], set=changes)
    np.testing.assert_allclose(whole["tips.one.T"][-1], alone["tips.one.T"][0], rtol=1e-8)


def test_what_varies_along_curves_is_found_anew_where_it_changes_elsewhere() -> None:
    """Elements end at kinks of friction and springs, and opposite the ends of faces with fluid between: a sweep over
    these finds other meshes."""
    recall = Recall()
    case = {
        "materials": {"m": {"young": 1.0, "poisson": 0.3}},
        "curves": {"ring": {"center": [0, 0], "radius": 1, "elements": 16}},
        "regions": {"plane": {"material": "m", "infinite": True, "boundary": ["ring"]},
                    "core": {"material": "m", "boundary": ["ring"]}},
        "remote": {"syy": -1.0},
    }
    for place in (2.0, 3.0):
        law = {"law": "coulomb", "friction": {"table": [[0, 0.2], [place, 0.2], [6, 0.4]]}}
        legs = make_checked_model({**case, "interfaces": {"ring": law}}, recall=recall).curves["ring"].legs
        assert np.abs(np.angle([leg.end for leg in legs]) - place).min() < 1e-9
