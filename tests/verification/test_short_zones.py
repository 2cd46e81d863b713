"""Estimated errors of slips on so few pairs that the second solution may slip alike by chance."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import pbem
from pbem.geometry.curve import Curve, Leg
from pbem.mesh.carry import list_curve_elements
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.results import accuracy
from pbem.results.short_zones import MOST, PART, bound_short_zones


def make_block(order: int, times: int, unit: float, stress: float) -> dict[str, Any]:
    """A block on a slope of 22 degrees, held by friction: it rests under its weight, is pushed at its lower end and
    let go; one of its corners slips."""
    turn = np.exp(1j * np.deg2rad(22.0))
    high = float(2 * np.tan(np.deg2rad(22.0)))
    sides = {
        "foot": (-2 - 2j, 2 - 2j, 8), "right": (2 - 2j, 2 + high * 1j, 6),
        "slope": (2 + high * 1j, -2 - high * 1j, 16), "left": (-2 - high * 1j, -2 - 2j, 6),
        "seat": (-0.6 * turn, 0.6 * turn, 8), "upper": (0.6 * turn, (0.6 + 0.6j) * turn, 5),
        "top": ((0.6 + 0.6j) * turn, (-0.6 + 0.6j) * turn, 6), "lower": ((-0.6 + 0.6j) * turn, -0.6 * turn, 5),
    }  # fmt: skip
    weight = 1e-3 * stress / unit
    return {
        "materials": {"rock": {"young": stress, "poisson": 0.24, "density": weight},
                      "steel": {"young": 2.7 * stress, "poisson": 0.4, "density": weight}},
        "curves": {name: {"points": [[float((unit * at).real), float((unit * at).imag)] for at in (start, end)],
                          "elements": times * count} for name, (start, end, count) in sides.items()},
        "regions": {"base": {"material": "rock", "boundary": ["foot", "right", "slope", "left"]},
                    "block": {"material": "steel", "boundary": ["seat", "upper", "top", "lower"]}},
        "boundary": {"foot": {"ux": 0.0, "uy": 0.0}, "upper": {"tn": 0.0, "ts": 0.0}},
        "contacts": {"joint": {"between": ["seat", "slope"], "friction": 0.8}},
        "analysis": {"order": order},
        "stages": [{"steps": 1, "gravity": {"gy": -1.0}}, {"steps": 2, "boundary": {"upper": {"tn": -1e-4 * stress}}},
                   {"steps": 1, "boundary": {"upper": {"tn": 0.0}}}],
    }  # fmt: skip


@pytest.mark.parametrize(("order", "unit", "stress"), [(1, 1.0, 1.0), (2, 1e3, 1e7), (3, 1e-6, 1.0)])
def test_a_corner_that_slips(order: int, unit: float, stress: float, tmp_path: Path) -> None:
    """Against four times the elements, while it slips and when it has come to rest with its slip."""
    results = pbem.run(make_block(order, 1, unit, stress), tmp_path / "block.h5")
    finer = pbem.run(make_block(2, 4, unit, stress), tmp_path / "finer.h5")
    slips, true = (np.abs(each.contact["joint"].slip).max(axis=1) for each in (results, finer))
    for step in (2, 3):
        assert np.count_nonzero(results.contact["joint"].slip[step]) <= MOST
        error = abs(slips[step] - true[step])
        assert 0.3 < error / results.errors.slip["joint"][step] < 3.0
        assert 0.3 < error / true[step] / results.errors.relative["jumps"][step] < 3.0


def test_the_accuracy_asked_for_halves_the_elements_that_slip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At the first pass those with pairs that slip, whatever the energies tell; and the slip comes out so well."""
    case, asked = make_block(1, 1, 1.0, 1.0), 0.3
    joint = pbem.run(case, tmp_path / "first.h5").contact["joint"]
    passes: list[tuple[Model, Mesh, dict[str, Any]]] = []
    mark = accuracy.mark_elements

    def record(model: Model, mesh: Mesh, *others: Any) -> dict[str, Any]:
        passes.append((model, mesh, mark(model, mesh, *others)))
        return passes[-1][-1]

    monkeypatch.setattr(accuracy, "mark_elements", record)
    case["analysis"]["accuracy"] = asked
    results = pbem.run(case, tmp_path / "block.h5")
    model, mesh, marked = passes[0]
    halved = np.zeros(mesh.elements, dtype=bool)
    for name, elements in list_curve_elements(model, mesh):
        halved[elements] = marked[name]
    pairs = mesh.pairs.slave
    place = joint.position[joint.slip[2] != 0] @ [1, 1j]
    slips = (np.abs(mesh.position[pairs, None] - place) < 1e-9).any(axis=1)
    assert 0 < np.count_nonzero(slips) <= MOST < len(slips)
    assert halved[pairs[slips] // (mesh.order + 1)].all()
    assert results.errors.relative["jumps"].max() <= asked
    finer = pbem.run(make_block(2, 4, 1.0, 1.0), tmp_path / "finer.h5")
    slip, true = (np.abs(each.contact["joint"].slip[2:]).max() for each in (results, finer))
    assert abs(slip - true) <= asked * true


def make_interfaces(curves: dict[str, tuple[complex, ...]]) -> tuple[Model, dict[str, np.ndarray[Any, Any]]]:
    """Interfaces of nine pairs each along curves through points."""
    model = cast(Model, SimpleNamespace(interfaces=curves, curves={
        name: Curve(name, tuple(Leg(*ends, 3) for ends in pairwise(points))) for name, points in curves.items()}))
    return model, {name: np.arange(9 * k, 9 * k + 9) for k, name in enumerate(curves)}


def test_zones_that_are_short() -> None:
    """Between pairs that stay: not all of an interface; with what goes on on the next one."""
    model, interfaces = make_interfaces(
        {"one": (0j, 1 + 0j), "next": (1 + 0j, 2 + 1j), "far": (5 + 0j, 6 + 0j), "short": (9 + 0j, 10 + 0j)})
    interfaces["short"] = np.arange(27, 30)
    slip, opening = np.zeros(30), np.zeros(30)
    slip[[0, 1]], slip[[7, 8, 9, 10]], slip[20], opening[21], slip[24:27], slip[27:] = -3e-3, 1.0, -2.0, 1e-3, 4.0, 1.0
    slip[10] = 1.5
    least = bound_short_zones(model, interfaces, opening, slip)
    expected = np.zeros((30, 2))
    expected[:2, 1], expected[7:11, 1], expected[24:27, 1] = PART / 2 * 3e-3, PART / 4 * 1.5, PART / 3 * 4
    expected[20:22] = PART / 2 * np.array([1e-3, 2.0])
    np.testing.assert_allclose(least, expected)
    slip[11] = 1.0  # five pairs in all
    expected[7:11] = 0.0
    np.testing.assert_allclose(bound_short_zones(model, interfaces, opening, slip), expected)
    slip[9:12] = 0.0  # the next one stays together
    expected[7:9, 1] = PART / 2
    np.testing.assert_allclose(bound_short_zones(model, interfaces, opening, slip), expected)
    slip[:9], expected[:9] = 1.0, 0.0  # all of one slips, which is more than a few
    np.testing.assert_allclose(bound_short_zones(model, interfaces, opening, slip), expected)
    assert not bound_short_zones(model, interfaces, 0 * opening, 0 * slip).any()


def test_a_short_zone_is_the_same_wherever_curves_begin() -> None:
    """Two pairs on either side of a corner of a square: of one curve, of four, and with the corner as its seam."""
    corners = (0j, 1 + 0j, 1 + 1j, 1j)
    for turn in range(4):
        own = [corners[(turn + k) % 4] for k in range(5)]
        for curves in ({"all": tuple(own)}, {f"side {k}": tuple(own[k : k + 2]) for k in range(4)}):
            model, interfaces = make_interfaces(curves)
            order = {"all": np.arange(36)} if len(curves) == 1 else interfaces
            first = 9 * ((4 - turn) % 4)  # pairs on both sides of the corner at the origin
            slip = np.zeros(36)
            slip[[first - 2, first - 1, first, first + 1]] = [1.0, 2.0, 2.0, 1.0]
            least = bound_short_zones(model, order, 0 * slip, slip)
            expected = np.where(slip > 0, PART / 4 * 2.0, 0.0)
            np.testing.assert_allclose(least[:, 1], expected, err_msg=f"{turn}, {len(curves)} curves")


def test_many_interfaces_take_what_each_takes_alone() -> None:
    """Ten thousand zones on cracks that do not meet, as on maps of fractures."""
    random = np.random.default_rng(5)
    model, interfaces = make_interfaces({f"crack {k}": (complex(k, 0), k + 0.5 + 0.3j) for k in range(5000)})
    slip = np.where(random.uniform(size=(5000, 9)) < 0.3, random.uniform(0.5, 1.0, (5000, 9)), 0.0)
    least = bound_short_zones(model, interfaces, np.zeros(slip.size), slip.ravel()).reshape(5000, 9, 2)
    for k in range(0, 5000, 500):
        alone, own = make_interfaces({"crack": (0j, 1 + 0j)})
        np.testing.assert_array_equal(least[k], bound_short_zones(alone, own, np.zeros(9), slip[k]))
