"""The reasons of searches that end: the same for the same law, whatever the search made of its last iterations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.contact.modes import Proposal
from pbem.contact.subset import Settled
from pbem.errors import ConvergenceError
from pbem.solve.nonlinear.unsettled import describe_unsettled, find_friction_under_fluid, find_losing
from tests.unit.test_nearby import draw_modes
from tests.unit.test_sweeps import assemble, write_network

WRONG = np.array([True, False])
ROCK = 'residual_friction_angle = 28.0, jrc = 10.0, jcs = 50.0'
WEAKENING = "friction = 0.4, cohesion = 0.1, friction_dynamic = 0.3, slip_distance = 1e-3"


@pytest.mark.parametrize(("law", "losing"), [
    ("friction = 0.4", False),
    ("friction = 0.4, cohesion = 0.1", True),
    ("friction = 0.4, cohesion = 0.1, tensile_strength = 0.05", True),
    ("friction = 0.4, cohesion = 0.1, cohesion_lost = true", False),
    (WEAKENING, False),  # not as long as they touch
])  # fmt: skip
def test_the_reason_where_strength_is_lost_and_returns(law: str, losing: bool) -> None:
    problem = assemble(write_network(teeth=2, law=law))
    count = problem.mesh.pairs.count
    assert (find_losing(problem.laws) == (losing or law == WEAKENING)).all()
    violation = np.zeros(count)
    violation[[3, 5]] = 1.0, 2.0
    modes = draw_modes(count)
    proposal = Proposal(draw_modes(count), violation)
    group = np.array([3, 5])
    wrong, none = (Settled(None, False, 4, each) for each in (WRONG, ~WRONG & False))
    dry = np.zeros(count)
    found = [
        describe_unsettled(problem, "mode cycle", modes, proposal, group, wrong, dry),
        describe_unsettled(problem, "mode cycle", modes, proposal, group, none, dry),
        describe_unsettled(problem, "mode cycle", modes, proposal, group[:0], None, dry),
        describe_unsettled(problem, "no admissible modes", modes, proposal, group, none, dry),
    ]
    if losing:
        assert {error.reason for error in found} == {"no admissible modes"}
        assert "cohesion_lost = true" in str(found[1]) and len(found[1].places) == 2
    else:
        assert [error.reason for error in found[:3]] == ["unsound mesh", "mode cycle", "mode cycle"]
        assert all("cohesion" not in str(error) for error in found)
    # What the user limits is the user's to change; and laws of slipping pairs may be what does not settle.
    limit = describe_unsettled(problem, "iteration limit", modes, proposal, group[:0], None, dry)
    assert limit.reason == "iteration limit"
    settled = replace(proposal, violation=np.zeros(count))
    assert describe_unsettled(problem, "mode cycle", modes, settled, group, wrong, dry).reason == "mode cycle"


@pytest.mark.parametrize(("law", "reason"), [
    (WEAKENING, "no admissible modes"), (WEAKENING.replace("cohesion = 0.1", "cohesion = 0"), "mode cycle"),
])  # fmt: skip
def test_where_friction_weakens_cohesion_is_blamed_for_pairs_that_part(law: str, reason: str) -> None:
    problem = assemble(write_network(teeth=2, law=law))
    count = problem.mesh.pairs.count
    violation = np.zeros(count)
    violation[3] = 1.0
    modes, next_ones = draw_modes(count), draw_modes(count)
    modes.mode[3], next_ones.mode[3] = STICK, OPEN
    proposal = Proposal(next_ones, violation)
    error = describe_unsettled(problem, "mode cycle", modes, proposal, np.array([], dtype=int), None, np.zeros(count))
    assert error.reason == reason and ("cohesion_lost = true" in str(error)) == (reason == "no admissible modes")


@pytest.mark.parametrize(("law", "fluid", "rough"), [
    ("friction = 0.4", 0.3, True),
    ("friction = 0.4", 0.0, False),
    ("friction = 0.0", 0.3, False),
    ('friction = 0.4, pressurised = "all"', 0.3, False),
    (ROCK, 0.3, True),
    (f'{ROCK}, pressurised = "all"', 0.3, False),
])  # fmt: skip
def test_the_reason_where_friction_is_lost_under_fluid_in_open_parts(law: str, fluid: float, rough: bool) -> None:
    """Faces part at a compression of the pressure, where friction times the pressure holds closed ones."""
    text = write_network(teeth=2, law=law)
    problem = assemble(text.replace('law = "coulomb"', 'law = "barton_bandis"') if "jrc" in law else text)
    count = problem.mesh.pairs.count
    pressure = np.full(count, fluid)
    assert (find_friction_under_fluid(problem.laws, pressure) == rough).all()
    violation = np.zeros(count)
    violation[[3, 5]] = 1.0, 2.0
    group, none = np.array([3, 5]), Settled(None, True, 4, ~WRONG & False)

    def describe(reason: str, before: int, after: int, found: Settled = none) -> ConvergenceError:
        modes, next_ones = draw_modes(count), draw_modes(count)
        modes.mode[group], next_ones.mode[group] = before, after
        return describe_unsettled(problem, reason, modes, Proposal(next_ones, violation), group, found, pressure)

    # Where closed faces pull and open ones overlap, which of the two comes last is chance.
    for before, after in ((STICK, OPEN), (OPEN, STICK)):
        ended, cycled = (describe(reason, before, after) for reason in ("no admissible modes", "mode cycle"))
        assert ended.reason == "no admissible modes"
        assert cycled.reason == ("no admissible modes" if rough else "mode cycle")
        for error in (ended, cycled):
            assert ('pressurised = "all"' in str(error)) == rough
            assert "cohesion" not in str(error)
    # Of a group that has none, whichever of its pairs changes last: one beside an opening, from stick to slip.
    for beside in (OPEN, STICK):
        modes = draw_modes(count)
        modes.mode[group] = beside, STICK
        slides = replace(modes, mode=np.where(np.arange(count) == 5, SLIP, modes.mode).astype(np.int8))
        proposal = Proposal(slides, np.where(np.arange(count) == 5, 1.0, 0.0))
        error = describe_unsettled(problem, "no admissible modes", modes, proposal, group, none, pressure)
        assert ('pressurised = "all"' in str(error)) == (rough and beside == OPEN)
        assert ("shorter elements" in str(error)) == (not (rough and beside == OPEN))
    # Not where pairs that stay closed change between stick and slip, nor where a mesh is unsound.
    assert describe("mode cycle", SLIP, STICK).reason == "mode cycle"
    assert describe("mode cycle", STICK, OPEN, replace(none, wrong=WRONG)).reason == "unsound mesh"


def test_of_many_pairs_those_are_named_that_change() -> None:
    """Where all pairs were tried at last, one of which has no status, the others are not to be looked at."""
    problem = assemble(write_network(teeth=2, law="friction = 0.4, cohesion = 0.1"))
    count = problem.mesh.pairs.count
    violation = np.zeros(count)
    violation[5] = 1.0
    modes = draw_modes(count)
    proposal = Proposal(modes, violation)
    none = Settled(None, False, 4, np.zeros(count, dtype=bool))
    all_pairs, alone = (
        str(describe_unsettled(problem, "no admissible modes", modes, proposal, group, each, np.zeros(count)))
        for group, each in ((np.arange(count), none), (np.array([5]), Settled(None, True, 4, WRONG[1:])))
    )
    place = alone.split("laws of these 1: ")[1].split(";")[0]
    assert f"laws of these {count}, 1 of which changes: {place};" in all_pairs
    assert "other pairs held" in alone and "other pairs" not in all_pairs
    violation[[5, 7, 8]] = 1.0
    several = str(describe_unsettled(problem, "no admissible modes", modes, Proposal(modes, violation),
                                     np.arange(count), none, np.zeros(count)))
    assert f"laws of these {count}, 3 of which change: {place}, " in several
