"""Construction in stages: a tunnel against Kirsch's solution, faces that open and close, and what a joint remembers."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.driver import Reporter
from pbem.solve.problem.step import SilentReporter

YOUNG, POISSON = 1e4, 0.25
HORIZONTAL, VERTICAL = -5.0, -10.0
IN_SITU = {"rock": {"sxx": HORIZONTAL, "syy": VERTICAL}}
REMOTE = {"sxx": HORIZONTAL, "syy": VERTICAL}


def make_tunnel(
    stages: Sequence[Mapping[str, Any]], unit: float = 1.0, at: tuple[float, float] = (0.0, 0.0), joint: bool = False,
    elements: int = 32, **more: Any,
) -> dict[str, Any]:
    """A tunnel of radius `unit` around a place in an infinite rock, full of the same rock at first."""
    x, y = at
    case: dict[str, Any] = {
        "materials": {"rock": {"young": YOUNG, "poisson": POISSON}},
        "curves": {"wall": {"center": [x, y], "radius": unit, "elements": elements}},
        "regions": {"core": {"material": "rock", "boundary": ["wall"]},
                    "rock": {"material": "rock", "boundary": ["wall"], "infinite": True}},
        "initial_stress": IN_SITU, "stages": [dict(each) for each in stages],
    }
    if joint:
        points = [[x - 1.5 * unit, y + 1.6 * unit], [x + 1.9 * unit, y + 1.1 * unit]]
        case["curves"]["joint"] = {"points": points, "elements": 10}
        case["regions"]["rock"]["cracks"] = ["joint"]
        case["interfaces"] = {"joint": {"friction": 0.3}}
    return case | more


REST = {"name": "rest", "steps": 1}
CUT = {"name": "cut", "steps": 2, "remove": ["core"]}


def find_own(results: pbem.Results, region: str) -> np.ndarray:
    return np.flatnonzero(results.nodes.region == results.nodes.region_names.index(region))


def lacks(results: pbem.Results) -> np.ndarray:
    """What the energy balance lacks after every step, to the largest work."""
    energy = results.energy
    left = energy.external - energy.elastic - energy.dissipated - energy.released - energy.removed
    return np.asarray(np.abs(left) / np.abs(energy.external).max())


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize(
    ("scheme", "operator", "unit", "at"),
    [("SST", "dense", 1.0, (0.0, 0.0)), ("DBEM", "hierarchical", 1e3, (1e6, -2e6)), ("HST", "dense", 1e-3, (0.0, 1.0)),
     ("THST", "hierarchical", 1.0, (0.0, 0.0))],
)  # fmt: skip
def test_an_excavated_tunnel_is_that_of_kirsch(
    scheme: str, operator: Any, unit: float, at: tuple[float, float], tmp_path: Path
) -> None:
    points = [[at[0], at[1] + 0.5 * unit], [at[0] + 2 * unit, at[1]]]
    case = make_tunnel([REST, CUT], unit, at, analysis={"scheme": scheme}, output={"points": points})
    results = pbem.run(case, tmp_path / "tunnel.h5", operator=operator)
    own, gone = find_own(results, "rock"), find_own(results, "core")
    angle = np.angle((results.nodes.position[own] - at) @ [1, 1j])
    # Nothing moves before; then half of the traction is released, then all.
    assert np.abs(results.displacement[0]).max() < 1e-12 * unit
    mean, half = 0.5 * (HORIZONTAL + VERTICAL), 0.5 * (HORIZONTAL - VERTICAL)
    shear = YOUNG / (2 * (1 + POISSON))
    inward = (mean + half * (3 - 4 * POISSON) * np.cos(2 * angle)) / (2 * shear) * unit
    for step, share in ((1, 0.5), (2, 1.0)):
        moved = (results.displacement[step, own] * np.stack([np.cos(angle), np.sin(angle)], axis=1)).sum(axis=1)
        np.testing.assert_allclose(moved, share * inward, atol=1e-4 * np.abs(inward).max())
        hoop = (1 - 0.5 * share) * 0.0 + 2 * mean * share - 4 * half * share * np.cos(2 * angle)
        along = HORIZONTAL * np.sin(angle) ** 2 + VERTICAL * np.cos(angle) ** 2
        np.testing.assert_allclose(
            results.hoop_stress[step, own], hoop + (1 - share) * along, atol=1e-3 * np.abs(hoop).max()
        )
    assert np.isnan(results.displacement[1:, gone]).all() and not np.isnan(results.displacement[0]).any()
    stress, ratio = results.interior.stress[-1], 0.25
    radial = mean * (1 - ratio) + half * (1 - 4 * ratio + 3 * ratio**2)
    assert np.isnan(stress[0]).all() and stress[1, 0] == pytest.approx(radial, abs=1e-4)
    evaluated = results.evaluate(points, steps=[0, -1]).stress
    np.testing.assert_allclose(evaluated[0, 0], [HORIZONTAL, VERTICAL, 0.0], atol=1e-9)
    np.testing.assert_allclose(evaluated[1], stress, atol=1e-8)
    assert np.isnan(results.contact["wall"].opening[-1]).all()
    np.testing.assert_allclose(results.contact["wall"].traction_n[-1], 0.0, atol=1e-12)
    # What is set free by dead tractions is half of their work; a core at rest had stored nothing, one that sinks has.
    assert lacks(results).max() < 1e-9
    assert results.energy.removed[-1] == pytest.approx(results.energy.elastic[-1] / 2, rel=1e-3)


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize(
    ("scheme", "operator", "axes", "swap"),
    [("SST", "dense", "xy", False), ("DBEM", "hierarchical", "ns", True), ("HST", "dense", "xy", True),
     ("THST", "hierarchical", "ns", False)],
)  # fmt: skip
def test_tractions_on_the_wall_replace_what_the_core_carried(
    scheme: str, operator: Any, axes: str, swap: bool, tmp_path: Path
) -> None:
    """Those of the rock at rest leave all where it is; a part of them takes off that part of Kirsch's motion."""
    unit, (x, y) = 25.0, (300.0, -40.0)
    mean, half = 0.5 * (HORIZONTAL + VERTICAL), 0.5 * (HORIZONTAL - VERTICAL)
    along = f"(2*atan2(y - ({y}), x - ({x})))"
    # The rock's own normal points into the tunnel.
    texts = {"tx": f"{-HORIZONTAL / unit}*(x - ({x}))", "ty": f"{-VERTICAL / unit}*(y - ({y}))"} if axes == "xy" else {
        "tn": f"{mean} + ({half})*cos({along})", "ts": f"{-half}*sin({along})"}
    first, second = ({key: {"expression": f"{part}*({text})"} for key, text in texts.items()} for part in (1.0, 0.4))
    stages = [REST, {**CUT, "boundary": {"wall": first}}, {"steps": 1, "boundary": {"wall": second}},
              {"steps": 1, "boundary": {"wall": {"pressure": 0.0}}}]
    case = make_tunnel(stages, unit, (x, y), analysis={"scheme": scheme})
    if swap:
        case["regions"] = dict(reversed(case["regions"].items()))
    results = pbem.run(case, tmp_path / "wall.h5", operator=operator)
    moved = results.displacement[:, find_own(results, "rock")]
    tolerance = {"dense": 1e-9, "hierarchical": 1e-6}[operator] * np.abs(moved[-1]).max()
    for step, part in enumerate((0.0, 0.0, 0.0, 0.6)):
        np.testing.assert_allclose(moved[step], part * moved[-1], atol=tolerance)
    shear = YOUNG / (2 * (1 + POISSON))
    assert np.abs(moved[-1]).max() == pytest.approx(
        unit * (abs(mean) + abs(half) * (3 - 4 * POISSON)) / (2 * shear), rel=1e-3)
    assert lacks(results).max() < 1e-9


@pytest.mark.usefixtures("without_errors")
def test_a_joint_beside_the_tunnel(tmp_path: Path) -> None:
    """It slips as it does where the tunnel is there from the start and the stress comes from far away; but support
    that comes after the slip does not undo it."""
    support = {"boundary": {"wall": {"pressure": 7.5}}}
    stages = [REST, {**CUT, "steps": 3}, {"steps": 2, **support}]
    late = pbem.run(make_tunnel(stages, joint=True, elements=24), tmp_path / "late.h5")
    at_once = make_tunnel([{"steps": 1, "remote": REMOTE}], joint=True, elements=24, initial_stress={})
    del at_once["regions"]["core"]
    loaded = pbem.run(at_once, tmp_path / "loaded.h5").contact["joint"]
    joint = late.contact["joint"]
    assert np.abs(joint.slip[3]).max() > 1e-4
    np.testing.assert_allclose(joint.slip[3], loaded.slip[-1], atol=1e-4 * np.abs(joint.slip[3]).max())
    np.testing.assert_array_equal(joint.mode[3], loaded.mode[-1])
    early = pbem.run(make_tunnel([{**CUT, **support}], joint=True, elements=24), tmp_path / "early.h5")
    for results in (late, early):
        np.testing.assert_allclose(results.contact["wall"].traction_n[-1], -7.5, rtol=1e-9)
        assert lacks(results).max() < 1e-5
    kept, less = (np.abs(results.contact["joint"].slip[-1]).max() for results in (late, early))
    assert less < 0.2 * kept and late.energy.dissipated[3] > 0


def make_seam(stages: Sequence[Mapping[str, Any]], laws: Mapping[str, Any], **more: Any) -> dict[str, Any]:
    """Two blocks on each other, joined along s1 and s2."""
    lines = {"a": [[2, 0], [0, 0]], "ra": [[2, 0], [2, 1]], "la": [[0, 1], [0, 0]], "s1": [[0, 1], [1, 1]],
             "s2": [[1, 1], [2, 1]], "rb": [[2, 1], [2, 2]], "b": [[2, 2], [0, 2]], "lb": [[0, 2], [0, 1]]}
    return {
        "materials": {"m": {"young": 1e3, "poisson": 0.3}},
        "curves": {name: {"points": points, "elements": 4} for name, points in lines.items()},
        "regions": {"lower": {"material": "m", "boundary": ["a", "ra", "s1", "s2", "la"]},
                    "upper": {"material": "m", "boundary": ["b", "rb", "s1", "s2", "lb"]}},
        "boundary": {"a": {"ux": 0.0, "uy": 0.0}}, "interfaces": dict(laws), "stages": [dict(each) for each in stages],
    } | more  # fmt: skip


PULL = {"name": "pull", "steps": 1, "boundary": {"b": {"tx": 0.2, "ty": 1.0}}}
LET_GO = {"name": "let go", "steps": 2, "boundary": {"b": {"tx": 0.0, "ty": 0.0}}}


@pytest.mark.usefixtures("without_errors")
def test_a_seam_that_is_cut_under_load(tmp_path: Path) -> None:
    """The end is as if it had been open from the start; half of the way half of the traction is left."""
    cut = pbem.run(make_seam([PULL, {"name": "cut", "steps": 2, "open": ["s1"]}], {}), tmp_path / "cut.h5")
    open_ = pbem.run(make_seam([PULL], {"s1": {"law": "open"}}), tmp_path / "open.h5")
    scale = np.abs(open_.displacement[-1]).max()
    np.testing.assert_allclose(cut.displacement[-1], open_.displacement[-1], atol=1e-9 * scale)
    mean = 0.5 * (cut.displacement[-1] + cut.displacement[0])
    np.testing.assert_allclose(cut.displacement[1], mean, atol=1e-9 * scale)
    borne = cut.contact["s1"].traction_n
    np.testing.assert_allclose(borne[1], 0.5 * borne[0], rtol=1e-8)
    assert np.abs(borne[2]).max() < 1e-12 < 0.5 < borne[0].min()
    assert lacks(cut).max() < 5e-4 and cut.energy.removed[-1] > 0 and cut.energy.dissipated[-1] == 0


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
def test_a_gap_that_is_bolted_stays(operator: Any, tmp_path: Path) -> None:
    """Welded as it gapes, it keeps its jump without the load, and springs back once it is left to its law."""
    bolt = {"name": "bolt", "steps": 1, "close": ["s1"]}
    case = make_seam([PULL, bolt, LET_GO, {"name": "free", "steps": 1, "release": ["s1"]}], {"s1": {"law": "coulomb"}})
    results = pbem.run(case, tmp_path / "bolt.h5", operator=operator)
    seam = results.contact["s1"]
    assert seam.opening[0].max() > 1e-3 and (seam.mode[1:4] == 0).all()
    np.testing.assert_allclose(seam.opening[1:4], seam.opening[:1].repeat(3, axis=0), rtol=1e-12)
    np.testing.assert_allclose(seam.slip[1:4], seam.slip[:1].repeat(3, axis=0), rtol=1e-12, atol=1e-15)
    assert seam.traction_n[3].min() < -0.5  # what the wedge in the gap bears
    scale = np.abs(results.displacement[0]).max()
    assert np.abs(results.displacement[-1]).max() < 1e-9 * scale
    if operator == "hierarchical":
        return
    # Loads that come back find the state that was bolted.
    again = pbem.run(make_seam([PULL, bolt, LET_GO, {**PULL, "name": "again"}], {"s1": {"law": "coulomb"}}),
                     tmp_path / "again.h5")
    np.testing.assert_allclose(again.displacement[-1], again.displacement[0], atol=1e-9 * scale)


class _Interrupt(SilentReporter):
    def __init__(self, steps: int) -> None:
        self.left = steps

    def start_step(self, stage: int, reached: float, target: float) -> None:
        self.left -= 1
        if self.left < 0:
            raise KeyboardInterrupt


def test_a_construction_is_gone_on_with(tmp_path: Path) -> None:
    """Stopped within the excavation, after it, and after the joint was welded."""
    stages = [{**CUT, "steps": 3}, {"steps": 1, "close": ["joint"], "boundary": {"wall": {"pressure": 4.0}}},
              {"steps": 1, "boundary": {"wall": {"pressure": 0.0}}}]
    case = make_tunnel(stages, joint=True, elements=12)
    whole = pbem.run(case, tmp_path / "whole.h5")
    scale, joint = np.nanmax(np.abs(whole.displacement[-1])), whole.contact["joint"]
    for steps in (1, 4):
        reporter: Reporter = _Interrupt(steps)
        with pytest.raises(KeyboardInterrupt):
            pbem.run(case, tmp_path / "part.h5", reporter=reporter, force=True)
        results = pbem.run(case, tmp_path / "part.h5", resume=True)
        assert len(results.steps) == len(whole.steps) == 5
        np.testing.assert_allclose(results.displacement, whole.displacement, atol=1e-11 * scale)
        for name in ("external", "elastic", "dissipated", "removed"):
            one, other = getattr(results.energy, name), getattr(whole.energy, name)
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(joint.slip[-1], joint.slip[2])
    assert np.abs(joint.slip[2]).max() > 1e-4


@pytest.mark.usefixtures("without_errors")
def test_a_body_that_floats_goes_on_floating(tmp_path: Path) -> None:
    """Nothing holds two blocks that are pulled in balance; without the lower one the upper is as it is alone."""
    pulled = {"rb": {"tx": 1.0}, "lb": {"tx": -1.0}}
    case = make_seam([REST, {"name": "cut", "steps": 2, "remove": ["lower"]}], {}, boundary=pulled)
    results = pbem.run(case, tmp_path / "both.h5")
    alone = copy.deepcopy(case) | {"stages": [REST]}
    del alone["regions"]["lower"], alone["curves"]["a"], alone["curves"]["ra"], alone["curves"]["la"]
    single = pbem.run(alone, tmp_path / "alone.h5")
    own = find_own(results, "upper")
    at = [np.lexsort(each.T.round(9)) for each in (results.nodes.position[own], single.nodes.position)]
    np.testing.assert_allclose(results.displacement[-1, own][at[0]], single.displacement[-1][at[1]], atol=1e-12)


@pytest.mark.usefixtures("without_errors")
def test_a_hanging_block_is_taken_away(tmp_path: Path) -> None:
    """What is left hangs by its own weight, and what the other had stored is gone with it."""
    cut = {"name": "cut", "steps": 2, "remove": ["lower"]}
    case = make_seam([REST, cut], {}, boundary={"b": {"ux": 0.0, "uy": 0.0}}, gravity={"gy": -1.0})
    case["materials"]["m"]["density"] = 1.0
    results = pbem.run(case, tmp_path / "hanging.h5")
    np.testing.assert_allclose(results.reactions["b"][:, 1], [4.0, 3.0, 2.0], rtol=1e-3)
    assert lacks(results).max() < 1e-3
    energy = results.energy
    # The weight of the lower block did work on it, and half of that was stored by it and above it.
    assert 0 < energy.removed[1] < energy.removed[2] and energy.removed[2] > 0.2 * energy.external[0]
    assert results.balance.whole_relative.max() < 1e-3


@pytest.mark.usefixtures("without_errors")
def test_a_block_that_loses_its_hold_is_refused(tmp_path: Path) -> None:
    case = make_seam([REST, {"name": "cut", "open": ["s1", "s2"]}], {}, gravity={"gy": -1.0})
    case["materials"]["m"]["density"] = 1.0
    with pytest.raises(pbem.CaseError, match=r"from stage 'cut' on a free rigid motion .* of 'upper'"):
        pbem.run(case, tmp_path / "loose.h5")
    assert not (tmp_path / "loose.h5").exists()


def test_names_are_checked(tmp_path: Path) -> None:
    stages = [
        {"open": ["s1", "a", "s3"], "close": ["s1", "s2"], "remove": ["lover"]},
        {"release": ["s2"], "open": ["s1"], "boundary": {"s1": {"pressure": 1.0}}},
        {"remove": ["lower"], "open": ["s2"], "boundary": {"s1": {"ux": 1.0}}},
    ]
    with pytest.raises(pbem.CaseError) as raised:
        pbem.run(make_seam(stages, {}), tmp_path / "names.h5")
    said = str(raised.value)
    for text in (
        "stages[1].remove: found unknown region 'lover'; did you mean 'lower'?",
        "stages[1].open: found 'a', a curve of one region",
        "stages[1].open: found unknown interface, crack or contact 's3'",
        "stages[1].close: found 's1', which is in 'open' of this stage too",
        "stages[1].close: found 's2', which is bonded by its law",
        "stages[2].boundary.s1: found conditions on 's1', an interface",
        "stages[3].open: found 's2', a curve of a region that is gone",
        "stages[3].boundary.s1: found conditions on 's1', where a region is gone; expected a pressure alone",
    ):
        assert text in said


@pytest.mark.usefixtures("without_errors")
def test_tractions_on_a_wall_keep_their_axes(tmp_path: Path) -> None:
    mixed = [{"remove": ["lower"], "boundary": {"s1": {"tx": 1.0}, "s2": {"tn": 1.0, "ty": 2.0}}},
             {"boundary": {"s1": {"tn": 1.0}}}]
    with pytest.raises(pbem.CaseError) as raised:
        pbem.run(make_seam(mixed, {}), tmp_path / "axes.h5")
    said = str(raised.value)
    assert "stages[1].boundary.s2.tn: found ty together with tn" in said
    assert "stages[2].boundary.s1: found tractions on 's1' along other axes than in a stage before" in said


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("given", [{"ty": 1.0}, {"tn": {"expression": "-y"}, "ts": {"expression": "-x"}}])
def test_a_net_force_on_a_wall_is_refused(given: dict[str, Any], tmp_path: Path) -> None:
    """That of a unit traction on a circle of radius 1 is its length; the core, which is gone, bears none of it."""
    case = make_tunnel([REST, {**CUT, "boundary": {"wall": given}}])
    with pytest.raises(pbem.CaseError, match=r"stage 'cut' drive it, with resultant \(\S+, 6\.28319\)"):
        pbem.run(case, tmp_path / "net.h5")


@pytest.mark.parametrize("gap", [0.05, 0.5])
def test_the_gap_around_what_was_removed_is_no_jump(gap: float, tmp_path: Path) -> None:
    """Errors are relative to the largest slip and opening that faces have had, whatever was between them at first."""
    case = {
        "materials": {"rock": {"young": 20e3, "poisson": 0.25}, "plug": {"young": 1e3, "poisson": 0.25}},
        "curves": {"wall": {"center": [0, 0], "radius": 3, "elements": 16},
                   "core": {"center": [0, 0], "radius": 3 - gap, "elements": 16},
                   "joint": {"points": [[-4.5, 4.8], [5.7, 3.3]], "elements": 8}},
        "regions": {"plug": {"material": "plug", "boundary": ["core"]},
                    "rock": {"material": "rock", "infinite": True, "boundary": ["wall"], "cracks": ["joint"]}},
        "contacts": {"fit": {"between": ["wall", "core"], "friction": 0.2}}, "interfaces": {"joint": {"friction": 0.3}},
        "initial_stress": {"rock": {"sxx": -5.0, "syy": -10.0}},
        "stages": [{"steps": 1}, {"steps": 1, "remove": ["plug"]}],
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "plug.h5")
    errors, joint, fit = results.errors, results.contact["joint"], results.contact["fit"]
    assert np.isnan(fit.opening[-1]).all()
    largest = max(np.abs(each).max() for each in (joint.slip, joint.opening, fit.opening[0] - gap, fit.slip[0]))
    expected = max(errors.slip["joint"][-1], errors.opening["joint"][-1]) / largest
    assert errors.relative["jumps"][-1] == pytest.approx(expected, rel=0.02)


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("stiffness", [{}, {"normal_stiffness": 1e4, "tangential_stiffness": 1e4}])
@pytest.mark.parametrize("rock_first", [False, True])
def test_what_is_removed_first_may_have_another_stress(
    rock_first: bool, stiffness: dict[str, float], tmp_path: Path
) -> None:
    """The rock gives way in proportion to the part of its own stress that is released, whatever was in the hole."""
    whole = pbem.run(make_tunnel([CUT]), tmp_path / "same.h5")
    case = make_tunnel([CUT], interfaces={"wall": {"law": "bonded", **stiffness}})
    case["materials"]["ore"] = {"young": 3 * YOUNG, "poisson": POISSON}
    case["regions"]["core"]["material"] = "ore"
    case["initial_stress"] = {"rock": IN_SITU["rock"], "ore": {"sxx": 2 * HORIZONTAL}}
    if rock_first:
        case["regions"] = dict(reversed(case["regions"].items()))
    cut = pbem.run(case, tmp_path / "ore.h5")
    expected, found = (each.displacement[:, find_own(each, "rock")] for each in (whole, cut))
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(found[0], 0.5 * found[1], atol=1e-9 * np.abs(expected).max())
    energy = cut.energy
    left = energy.external - energy.elastic - energy.removed
    np.testing.assert_allclose(left, 0.0, atol=1e-6 * np.abs(energy.removed).max())


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("steps", [1, 2])
@pytest.mark.parametrize("stressed", ["rock", "ore"])
def test_what_opens_first_between_different_stresses_releases_the_same_with_a_joint(
    stressed: str, steps: int, tmp_path: Path
) -> None:
    """The faces are free in the end, and go there from the mean of what both sides push with, elastic joint or not."""
    energies = []
    for stiffness in ({}, {"normal_stiffness": 1e4, "tangential_stiffness": 1e4}):
        case = make_tunnel([{"name": "part", "steps": steps, "open": ["wall"]}],
                           interfaces={"wall": {"law": "bonded", **stiffness}})
        case["materials"]["ore"] = {"young": 3 * YOUNG, "poisson": POISSON}
        case["regions"]["core"]["material"] = "ore"
        case["initial_stress"] = {stressed: {"sxx": HORIZONTAL, "syy": VERTICAL}}
        energies.append(pbem.run(case, tmp_path / "parted.h5", force=True).energy)
    rigid, jointed = energies
    assert abs(rigid.removed[-1]) > 0.1 * abs(rigid.elastic[-1])
    for name in ("external", "elastic", "removed"):
        expected, found = (getattr(each, name)[-1] for each in (rigid, jointed))
        assert found == pytest.approx(expected, rel=1e-6), name


@pytest.mark.usefixtures("without_errors")
@pytest.mark.parametrize("turn", [0.0, 30.0])
@pytest.mark.parametrize("tractions_first", [False, True])
def test_a_wall_whose_load_comes_to_be_along_other_axes(tractions_first: bool, turn: float, tmp_path: Path) -> None:
    """A free block under 1 from below: on its wall above a number falls off as what depends on time rises."""
    along = complex(np.exp(1j * np.radians(turn)))
    across = 1j * along

    def place(*points: complex) -> list[list[float]]:
        return [[(along * each).real, (along * each).imag] for each in points]

    def press(tractions: bool, text: str) -> dict[str, Any]:
        """The pressure of an expression of t (or a number) on what is above, as such or as tractions along x and y."""
        parts = {"tx": -across.real, "ty": -across.imag} if tractions else {"pressure": 1.0}
        if "t" in text:
            return {key: {"expression": f"{part}*({text})"} for key, part in parts.items()}
        return {key: part * float(text) for key, part in parts.items()}

    case = {
        "materials": {"m": {"young": 1000.0, "poisson": 0.2}},
        "curves": {name: {"points": place(*points), "elements": 6} for name, points in {
            "foot": (0j, 1 + 0j), "east": (1 + 0j, 1 + 1j), "wall": (1 + 1j, 1j), "west": (1j, 0j)}.items()}
        | {"rim": {"points": place(1 + 1j, 1 + 2j, 2j, 1j), "elements": 12}},
        "regions": {"low": {"material": "m", "boundary": ["foot", "east", "wall", "west"]},
                    "high": {"material": "m", "boundary": ["wall", "rim"]}},
        "stages": [{"steps": 1, "remove": ["high"], "boundary": {
                       "wall": press(tractions_first, "1"), "foot": {"tx": across.real, "ty": across.imag}}},
                   {"steps": 4, "boundary": {"wall": press(not tractions_first, "t - 1")}}],
        "output": {"points": place(0.5 + 0.5j)},
    }  # fmt: skip
    stress = pbem.run(case, tmp_path / "wall.h5").interior.stress[1:, 0]
    sxx, syy, sxy = stress.T
    tractions = sxx * across.real + sxy * across.imag + 1j * (sxy * across.real + syy * across.imag)
    np.testing.assert_allclose(tractions, -across, atol=1e-6)


def dig_out(steps: int, **tables: object) -> dict[str, object]:
    """A heavy inclusion in a plane, which the second stage removes."""
    return {
        "materials": {"rock": {"young": 1000.0, "poisson": 0.25},
                      "ore": {"young": 3000.0, "poisson": 0.25, "density": 1.0}},
        "curves": {"rim": {"center": [0, 0], "radius": 1.0, "elements": 16},
                   "hole": {"center": [5, 0], "radius": 1.0, "elements": 16}},
        "regions": {"plane": {"material": "rock", "infinite": True, "boundary": ["rim", "hole"]},
                    "body": {"material": "ore", "boundary": ["rim"]}},
        "gravity": {"gy": -1.0}, "remote": {"syy": -1.0}, "output": {"points": [[2.0, 0.5], [0.0, -1.5], [3.0, 2.0]]},
        "stages": [{"name": "load", "steps": 1}, {"name": "dig", "steps": steps, "remove": ["body"]}], **tables,
    }


@pytest.mark.usefixtures("without_errors")
def test_half_of_a_heavy_inclusion_removed_from_a_plane_is_half_of_its_weight(tmp_path: Path) -> None:
    results = pbem.run(dig_out(2), tmp_path / "dig.h5")
    stress = results.interior.stress
    assert len(stress) == 3
    np.testing.assert_allclose(stress[1], 0.5 * (stress[0] + stress[2]), atol=1e-9)
    moved = results.interior.displacement - results.interior.displacement[:, :1]
    np.testing.assert_allclose(moved[1], 0.5 * (moved[0] + moved[2]), atol=1e-12)
    assert not [note for note in results.notes if "balance" in note]


def test_what_balances_the_weight_of_a_body_alone_is_refused_once_that_is_gone() -> None:
    # Tractions on the hole carry the body: of 3.14, along its length of 6.28.
    with pytest.raises(pbem.CaseError, match="net force on the infinite region 'plane'.*stage 'dig' drive it, with "
                                             r"resultant \(0, 3.14159\)"):
        pbem.run(dig_out(1, boundary={"hole": {"ty": 0.5}}))
