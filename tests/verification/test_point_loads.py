"""Forces and moments at single points against exact solutions: Kelvin, Flamant, a wedge, a disc pressed by two."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import pbem
from pbem.arrays import Complex, Real
from pbem.errors import ResultFileError
from pbem.geometry.curve import Leg
from pbem.model.build import build_model
from pbem.model.point_loads import find_acted_on
from pbem.results.reader import Results

pytestmark = pytest.mark.usefixtures("without_errors")

MATERIAL = {"young": 3e3, "poisson": 0.2}
# Shifted, turned, and in other units of length.
PLACES = [(0j, 1 + 0j), (1e6 - 2e5j, 40 * np.exp(0.7j))]


def combine(total: Real, difference: Complex) -> Real:
    """sxx, syy, sxy from sxx + syy and syy - sxx + 2 i sxy."""
    return np.stack([0.5 * (total - difference.real), 0.5 * (total + difference.real), 0.5 * difference.imag], -1)


def kelvin(force: complex, moment: float, away: Complex, kappa: float = 2.2) -> Real:
    """Of a force and a moment in a plane (Timoshenko and Goodier, articles 42 and 45)."""
    r = np.abs(away)
    e = away / r
    along, across = (np.conj(e) * force).real, (np.conj(e) * force).imag
    # Radial, hoop and shear stress in polar coordinates.
    rr, tt = -(3 + kappa) * along / (2 * np.pi * (1 + kappa) * r), (kappa - 1) * along / (2 * np.pi * (1 + kappa) * r)
    rt = -(kappa - 1) * across / (2 * np.pi * (1 + kappa) * r) - moment / (2 * np.pi * r**2)
    return combine(rr + tt, (tt - rr + 2j * rt) * np.conj(e) ** 2)


def wedge(force: complex, inward: complex, half_angle: float, away: Complex) -> Real:
    """Radial stress of a force at the apex of a wedge (Michell; Flamant for half_angle pi/2)."""
    r = np.abs(away)
    e, sine = away / r, 0.5 * np.sin(2 * half_angle)
    cosine, tangent = (np.conj(inward) * e).real, (np.conj(inward) * e).imag
    along, across = (np.conj(inward) * force).real, (np.conj(inward) * force).imag
    rr = -(along * cosine / (half_angle + sine) + across * tangent / (half_angle - sine)) / r
    return combine(rr, -rr * np.conj(e) ** 2)


def to_pairs(points: Any) -> list[list[float]]:
    return [[float(point.real), float(point.imag)] for point in np.asarray(points)]


@pytest.mark.parametrize(("place", "scheme", "operator"), [
    (0, "SST", "dense"), (1, "DBEM", "dense"), (0, "HST", "hierarchical"), (1, "THST", "hierarchical"),
])
def test_kelvin_in_a_plane(place: int, scheme: str, operator: str, tmp_path: Path) -> None:
    """A force and a moment within a circle that two regions of one material share: nothing is seen of the circle."""
    center, turn = PLACES[place]
    at, other = center + (0.1 - 0.4j) * turn, center + (1.7 + 0.3j) * turn
    force = (2 + 1j) * turn
    size = abs(turn)
    points = center + np.array([0.3 + 0.2j, -0.5 - 0.1j, 0.11 - 0.4j, 2.5 + 0.5j, 3j]) * turn
    case = {
        "materials": {"m": MATERIAL},
        "curves": {"circle": {"center": to_pairs([center])[0], "radius": size, "elements": 24}},
        "regions": {"plane": {"material": "m", "infinite": True, "boundary": ["circle"]},
                    "core": {"material": "m", "boundary": ["circle"]}},
        "point_loads": {
            "inside": {"at": to_pairs([at])[0], "fx": force.real, "fy": force.imag, "moment": 0.3 * size**2},
            "outside": {"at": to_pairs([other])[0], "fx": -force.real, "fy": -force.imag},
        },
        "interfaces": {"circle": {"cohesion": 1e3, "tensile_strength": 1e3, "friction": 0.3, "law": "coulomb"}},
        "analysis": {"steps": 1, "scheme": scheme}, "output": {"points": to_pairs(points)},
        "solver": {"operator": operator},
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "kelvin.h5")
    exact = kelvin(force, 0.3 * size**2, points - at) + kelvin(-force, 0.0, points - other)
    accuracy = 1e-3 * np.abs(exact).max(axis=1, keepdims=True)
    assert (np.abs(results.interior.stress[-1] - exact) < accuracy).all()
    np.testing.assert_allclose(results.evaluate(to_pairs(points)).stress[-1], exact, atol=1e-3 * np.abs(exact[3]).max())
    # The forces turn the plane by a moment, and balance otherwise; nothing moves far away.
    far = results.evaluate(to_pairs([center + 1e4 * turn])).displacement[-1]
    assert np.abs(far).max() < 1e-3 * abs(force) / 3e3
    assert results.balance.relative[-1].max() < 1e-3


def make_half_disc(center: complex, turn: complex, load: complex, along: complex, **more: Any) -> dict[str, Any]:
    """A half-disc below a straight side, with Flamant's tractions on its arc."""
    size = abs(turn)
    degrees = float(np.degrees(np.angle(turn)))
    place = to_pairs([center + along * turn])[0]
    # Radial: the traction on the arc about the load, if that is the centre of the disc.
    x, y = f"(x - ({float(place[0])!r}))", f"(y - ({float(place[1])!r}))"
    factor = f"(-2/pi*({float(load.real)!r}*{x} + {float(load.imag)!r}*{y})/({x}**2 + {y}**2)**1.5)"
    outward = f"(({x})*(x - ({float(center.real)!r})) + ({y})*(y - ({float(center.imag)!r})))/{float(size)!r}"
    normal = f"{outward}/({x}**2 + {y}**2)**0.5"
    return {
        "materials": {"m": MATERIAL},
        "curves": {"side": {"points": to_pairs(center + np.array([-1, 1]) * turn), "elements": 8},
                   "arc": {"center": to_pairs([center])[0], "radius": size, "angles": [degrees - 180, degrees],
                           "elements": 12}},
        "regions": {"half": {"material": "m", "boundary": ["side", "arc"]}},
        "boundary": {"arc": {"tx": {"expression": f"{factor}*{normal}*{x}"},
                             "ty": {"expression": f"{factor}*{normal}*{y}"}}},
        "point_loads": {"p": {"at": place, "fx": load.real, "fy": load.imag}},
        "analysis": {"steps": 2}, **more,
    }  # fmt: skip


@pytest.mark.parametrize(("place", "along"), [(0, 0j), (1, 0.3 + 0j)])
def test_flamant_on_a_half_disc(place: int, along: complex, tmp_path: Path) -> None:
    """A force at a smooth point of a boundary: exact stress, however near to the load."""
    center, turn = PLACES[place]
    load = (0.4 - 1j) * turn
    away = np.array([1e-6 - 2e-6j, 0.02 - 0.03j, 0.1 - 0.5j, -0.3 - 0.1j]) * turn
    at = center + along * turn
    case = make_half_disc(center, turn, load, along, output={"points": to_pairs(at + away)})
    results = pbem.run(case, tmp_path / "flamant.h5")
    where = results.interior.position[:, 0] + 1j * results.interior.position[:, 1]
    exact = wedge(load, -1j * turn / abs(turn), 0.5 * np.pi, where - at)
    accuracy = 1e-5 * np.abs(exact).max(axis=1, keepdims=True)
    rounding = 64 * np.finfo(float).eps * abs(center) / np.abs(where - at)[:, None]
    accuracy = accuracy + rounding * np.abs(exact).max(axis=1, keepdims=True)
    assert (np.abs(results.interior.stress[-1] - exact) < accuracy).all()
    assert (np.abs(results.interior.stress[0] - 0.5 * exact) < accuracy).all()
    # On the straight side beside it: -2 Q/(pi r) along the side, and no traction.
    on = center + (along + 0.2) * turn
    beside = results.evaluate(to_pairs([on])).stress[-1][0]
    np.testing.assert_allclose(
        beside, wedge(load, -1j * turn / abs(turn), 0.5 * np.pi, np.array([0.2 * turn]))[0], atol=1e-4)
    arc = results.reactions["arc"][-1] @ np.array([1, 1j])
    assert abs(arc + load) < 1e-4 * abs(load)
    assert results.balance.relative[-1].max() < 1e-4
    assert results.energy.external[-1] == pytest.approx(results.energy.elastic[-1], rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_a_disc_pressed_by_two_forces(order: int, tmp_path: Path) -> None:
    """Hertz: two Flamant fields and a uniform stress, near the loads too; the forces grow in a second stage."""
    case = {
        "materials": {"m": {**MATERIAL, "plane": "stress"}},
        "curves": {"rim": {"center": [5, 1], "radius": 2.0, "elements": 16}},
        "regions": {"disc": {"material": "m", "boundary": ["rim"]}},
        "point_loads": {"top": {"at": [5, 3], "fy": -2.0}, "bottom": {"at": [5, -1], "fy": 2.0}},
        "analysis": {"order": order}, "output": {"points": [[5, 1], [5.5, 2.0], [5.001, 2.999]]},
        "stages": [{"steps": 1}, {"steps": 1, "point_loads": {"top": {"fy": -3.0}, "bottom": {"fy": 3.0}}}],
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "disc.h5")
    z = results.interior.position[:, 0] + 1j * results.interior.position[:, 1]
    exact = wedge(-2j, -1j, 0.5 * np.pi, z - 5 - 3j) + wedge(2j, 1j, 0.5 * np.pi, z - 5 + 1j)
    exact += np.array([1 / np.pi, 1 / np.pi, 0])
    scale = np.abs(exact).max(axis=1, keepdims=True)
    np.testing.assert_allclose(exact[0], [2 * 2 / (np.pi * 4), -6 * 2 / (np.pi * 4), 0], atol=1e-12)
    accuracy = {1: 2e-3, 2: 2e-4, 3: 1e-5}[order]
    assert (np.abs(results.interior.stress[0] - exact) < accuracy * scale).all()
    assert (np.abs(results.interior.stress[1] - 1.5 * exact) < 1.5 * accuracy * scale).all()
    # No traction is left on the rim but at the two points; energies grow with the square.
    assert np.abs(results.traction).max() == 0
    np.testing.assert_allclose(results.energy.external, results.energy.elastic, rtol=1e-6)
    assert results.energy.elastic[1] == pytest.approx(2.25 * results.energy.elastic[0])


@pytest.mark.parametrize("half_angle", [0.25 * np.pi, 0.75 * np.pi])
def test_a_force_in_a_corner(half_angle: float, tmp_path: Path) -> None:
    """The sector of a disc under a force at its apex, with the tractions of the exact field on its arc."""
    degrees = np.degrees(half_angle)
    ends = np.exp(1j * half_angle * np.array([-1, 1]))
    force = 1.0 + 0.6j
    sine = 0.5 * np.sin(2 * half_angle)
    rr = f"-(1.0*x/{float(half_angle + sine)!r} + 0.6*y/{float(half_angle - sine)!r})"
    points = np.array([1e-4 + 2e-5j, 0.3 - 0.2j])
    case = {
        "materials": {"m": MATERIAL},
        "curves": {"a": {"points": [[0, 0], *to_pairs(ends[:1])], "elements": 6},
                   "b": {"points": [*to_pairs(ends[1:]), [0, 0]], "elements": 6},
                   "arc": {"center": [0, 0], "radius": 1.0, "angles": [-degrees, degrees], "elements": 24}},
        "regions": {"sector": {"material": "m", "boundary": ["a", "arc", "b"]}},
        "boundary": {"arc": {"tn": {"expression": rr}}},
        "point_loads": {"apex": {"at": [0, 0], "fx": 1.0, "fy": 0.6}},
        "analysis": {"steps": 1}, "output": {"points": to_pairs(points)},
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "corner.h5")
    exact = wedge(force, 1 + 0j, half_angle, points)
    assert (np.abs(results.interior.stress[-1] - exact) < 1e-4 * np.abs(exact).max(axis=1, keepdims=True)).all()


@pytest.mark.parametrize("infinite", [True, False])
def test_forces_on_the_edge_of_a_hole(infinite: bool, tmp_path: Path) -> None:
    """The displacement goes around the hole without a jump, in a plane and in a ring; stress balances the forces.

    A force on the edge against a uniform traction on the rest of it, and the same with the force spread over an arc.
    """
    def run(spread: bool) -> pbem.Results:
        half = 0.02
        arcs = {"lump": [-half, half], "rest": [half, 360 - half]}
        hole = {name: {"center": [1, 2], "radius": 1.0, "angles": at, "elements": 3 if name == "lump" else 32}
                for name, at in arcs.items()} if spread else {"rest": {"center": [1, 2], "radius": 1.0, "elements": 32}}
        length = 2 * np.radians(half)
        boundary: dict[str, Any] = {"rest": {"tx": -1.0 / (2 * np.pi - (length if spread else 0.0))}}
        loads: dict[str, Any] = {"lump": {"at": [2, 2], "fx": 1.0, "fy": 0.0}}
        if spread:
            boundary["lump"], loads = {"tx": 1.0 / length}, {}
        outer = {} if infinite else {"outer": {"center": [1, 2], "radius": 4.0, "elements": 16}}
        return pbem.run({
            "materials": {"m": MATERIAL}, "curves": {**hole, **outer},
            "regions": {"body": {"material": "m", "infinite": infinite, "boundary": [*hole, *outer]}},
            "boundary": boundary, "point_loads": loads, "analysis": {"steps": 1},
            "output": {"points": [[2.5, 2.2], [-0.5, 2.0], [1, 3.2], [1.0, 0.7]]},
        }, tmp_path / f"hole_{spread}.h5")  # fmt: skip

    point, spread = run(False), run(True)
    scale = np.abs(spread.interior.stress[-1]).max()
    np.testing.assert_allclose(point.interior.stress[-1], spread.interior.stress[-1], atol=1e-3 * scale)
    moved = np.abs(spread.interior.displacement[-1]).max()
    np.testing.assert_allclose(point.interior.displacement[-1], spread.interior.displacement[-1], atol=2e-3 * moved)
    assert point.balance.relative[-1].max() < 1e-3


def test_loads_with_weights_springs_and_cracks_keep_energy(tmp_path: Path) -> None:
    """Energies of forces beside weight, springs, a heated body and a crack: work is stored, over several steps."""
    case = {
        "materials": {"m": {**MATERIAL, "density": 1.0, "expansion": 1e-5}},
        "curves": {"bottom": {"points": [[0, 0], [3, 0]], "elements": 8},
                   "rest": {"points": [[3, 0], [3, 2], [0, 2], [0, 0]], "elements": 24},
                   "crack": {"points": [[1, 1.2], [2, 1.4]], "elements": 8}},
        "regions": {"block": {"material": "m", "boundary": ["bottom", "rest"], "cracks": ["crack"]}},
        "interfaces": {"crack": {"law": "open"}},
        "boundary": {"bottom": {"spring": {"kn": 1e4, "ks": 1e4}}},
        "gravity": {"gy": -1.0}, "temperature": {"block": 30.0},
        "point_loads": {"a": {"at": [1.5, 0.7], "fx": 1.0, "fy": 2.0, "moment": 0.4}, "b": {"at": [2.2, 2], "fy": 3.0}},
        "analysis": {"steps": 3},
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "energy.h5")
    np.testing.assert_allclose(results.energy.external, results.energy.elastic, rtol=2e-4)
    one = pbem.run(case, tmp_path / "one.h5", set={"analysis.steps": 1})
    assert one.energy.elastic[-1] == pytest.approx(results.energy.elastic[-1], rel=1e-8)
    reaction = results.reactions["bottom"][-1]
    np.testing.assert_allclose(reaction, [-1.0, 6 - 5.0], atol=1e-3)
    stored = json.loads(results.configuration)["point_loads"]
    assert stored["b"]["half_angle"] == pytest.approx(0.5 * np.pi)


def test_energy_is_the_work_on_what_the_other_loads_do(tmp_path: Path) -> None:
    """The displacement around each load, in the mean of a small circle, less that of Kelvin's field of it alone."""
    loads = {"a": (1.2 + 0.7j, 1.0 - 2.0j), "b": (2.1 + 1.3j, 0.5 + 3.0j)}
    results = pbem.run({
        "materials": {"m": MATERIAL},
        "curves": {"bottom": {"points": [[0, 0], [3, 0]], "elements": 8},
                   "rest": {"points": [[3, 0], [3, 2], [0, 2], [0, 0]], "elements": 24}},
        "regions": {"block": {"material": "m", "boundary": ["bottom", "rest"]}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}}, "analysis": {"steps": 1},
        "point_loads": {name: {"at": to_pairs([place])[0], "fx": force.real, "fy": force.imag}
                        for name, (place, force) in loads.items()},
    }, tmp_path / "two.h5")  # fmt: skip
    shear, kappa, radius = 3e3 / 2.4, 2.2, 1e-3
    unit = 10 / np.pi  # what is around the block, over pi
    work = 0.0
    for place, force in loads.values():
        around = place + radius * np.exp(2j * np.pi * np.arange(8) / 8)
        mean = (results.evaluate(to_pairs(around)).displacement[-1] @ [1, 1j]).mean()
        alone = -kappa * force / (2 * np.pi * (1 + kappa)) * np.log(radius / unit) / shear
        work += 0.5 * (np.conj(force) * (mean - alone)).real
    assert results.energy.external[-1] == pytest.approx(work, rel=5e-4)
    assert results.energy.elastic[-1] == pytest.approx(work, rel=5e-4)


def solve_sheet(
    folder: Path, place: tuple[float, float], elements: tuple[int, int, int] = (12, 8, 12), depth: float = 0.0
) -> Results:
    """A block that stands on its bottom under one force, with so many elements and a crack in its side so deep."""
    bottom, right, top = elements
    crack = {"crack": {"points": [[3, 1.1], [3 - depth, 1.1]], "elements": 8}} if depth else {}
    return pbem.run({
        "materials": {"m": MATERIAL},
        "curves": {"bottom": {"points": [[0, 0], [3, 0]], "elements": bottom, "grading": "none"},
                   "right": {"points": [[3, 0], [3, 2]], "elements": right, "grading": "none"},
                   "top": {"points": [[3, 2], [0, 2]], "elements": top, "grading": "none"},
                   "left": {"points": [[0, 2], [0, 0]], "elements": 8, "grading": "none"}, **crack},
        "regions": {"block": {"material": "m", "boundary": ["bottom", "right", "top", "left"], "cracks": [*crack]}},
        "interfaces": {name: {"law": "open"} for name in crack},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}}, "analysis": {"steps": 1},
        "point_loads": {"a": {"at": list(place), "fx": 1.0, "fy": 3.0}},
    }, folder / "sheet.h5", force=True)  # fmt: skip


@pytest.mark.parametrize("place", [(1.2, 0.7), (1.2, 2.0)])
def test_energies_of_a_load_do_not_depend_on_the_mesh_and_grow_by_j(
    place: tuple[float, float], tmp_path: Path
) -> None:
    """Elements of other lengths change nothing. A crack that grows under a dead load stores J per length: dU/da = J."""
    reached = [solve_sheet(tmp_path, place, elements).energy for elements in ((12, 8, 12), (12, 8, 40), (60, 8, 12))]
    scale = 10 / (3e3 / 2.4)  # force squared over the shear modulus
    for energy in reached[1:]:
        assert abs(energy.elastic[-1] - reached[0].elastic[-1]) < 3e-4 * scale
    short, middle, long = (solve_sheet(tmp_path, place, depth=depth) for depth in (0.98, 1.0, 1.02))
    grown = (long.energy.elastic[-1] - short.energy.elastic[-1]) / 0.04
    assert grown == pytest.approx(np.nanmax(middle.tips["crack"].J[-1]), rel=1e-2)


def test_energies_of_two_loads_grow_by_j_with_a_crack_alone_in_a_plane(tmp_path: Path) -> None:
    """There is no boundary, and what is left out must not follow the crack: both tips store J."""
    def solve(half_length: float) -> Results:
        return pbem.run({
            "materials": {"m": MATERIAL},
            "curves": {"crack": {"points": [[-half_length, 0], [half_length, 0]], "elements": 20}},
            "regions": {"plane": {"material": "m", "infinite": True, "cracks": ["crack"]}},
            "interfaces": {"crack": {"law": "open"}}, "analysis": {"steps": 1},
            "point_loads": {"a": {"at": [0.2, 0.7], "fy": 1.0}, "b": {"at": [0.2, -0.7], "fy": -1.0}},
        }, tmp_path / "plane.h5", force=True)  # fmt: skip

    short, middle, long = (solve(half_length) for half_length in (0.98, 1.0, 1.02))
    grown = (long.energy.elastic[-1] - short.energy.elastic[-1]) / 0.04
    assert grown == pytest.approx(middle.tips["crack"].J[-1].sum(), rel=1e-2)


def test_files_that_count_other_energies_are_not_gone_on_with(tmp_path: Path) -> None:
    solve_sheet(tmp_path, (1.2, 0.7))
    with h5py.File(tmp_path / "sheet.h5", "r+") as file:
        text = str(file.attrs["case"])
        del file["energy"].attrs["self_energy_lengths"]
    (tmp_path / "sheet.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ResultFileError, match="counted other energies of point loads and of net forces on a plane"):
        pbem.run(tmp_path / "sheet.toml", tmp_path / "sheet.h5", resume=True)


@pytest.mark.parametrize("kind", ["loads", "weight"])
def test_energies_of_a_plane_with_a_net_force_do_not_depend_on_the_mesh(kind: str, tmp_path: Path) -> None:
    """Displacements grow with the logarithm of the distance: the energies are those counted from one length, over
    whose multiple by e they change by what a net force P does on Kelvin's displacement, kappa P^2/(4 pi G (1 + kappa)).
    """
    def solve(hole: int, crack: int, wide: float = 1.0) -> float:
        body = {"body": {"material": "heavy", "boundary": ["hole"]}} if kind == "weight" else {}
        loads = {"a": {"at": [1.5, 0.5], "fx": 1.0, "fy": 2.0}, "b": {"at": [-2, 0], "fx": 1.0, "fy": 1.0}}
        results = pbem.run({
            "materials": {"m": MATERIAL, "heavy": {**MATERIAL, "density": 1.0}},
            "curves": {"hole": {"center": [0, 0], "radius": 1.0, "elements": hole, "grading": "none"},
                       "far": {"center": [1e5, 0], "radius": wide, "elements": 8, "grading": "none"},
                       "crack": {"points": [[2, -1], [2, 1]], "elements": crack, "grading": "none"}},
            "regions": {"plane": {"material": "m", "infinite": True, "boundary": ["hole", "far"], "cracks": ["crack"]},
                        **body},
            "interfaces": {"crack": {"law": "open"}}, "analysis": {"steps": 1},
            **({"point_loads": loads} if kind == "loads" else {"gravity": {"gy": -1.0}}),
        }, tmp_path / "plane.h5", force=True)  # fmt: skip
        assert results.energy.external[-1] == pytest.approx(results.energy.elastic[-1], rel=1e-3, abs=1e-6)
        return float(results.energy.elastic[-1])

    one, other = solve(16, 8), solve(16, 40)
    force, shear, kappa = (13.0 if kind == "loads" else np.pi**2), 3e3 / 2.4, 2.2
    scale = kappa * force / (4 * np.pi * shear * (1 + kappa))
    assert abs(one - other) < 1e-3 * scale
    # A far hole only changes the length: 2 pi (1 + 1) becomes 2 pi (1 + 9). What two loads apart do is as it was, and
    # each load alone is left out up to the same length.
    alone = (5.0 + 2.0) if kind == "loads" else 0.0
    assert solve(16, 8, 9.0) - one == pytest.approx(scale * np.log(5.0) * (force - alone) / force, rel=1e-2)


@pytest.mark.parametrize(("load", "words"), [
    ({"at": [5, 5], "fx": 1.0}, "outside of all regions"),
    ({"at": [0.5, 0], "fx": 1.0}, "prescribed"),
    ({"at": [0.5, 1], "moment": 1.0}, "a moment at a point of a boundary"),
    ({"at": [0.5, 0.9999], "fx": 1.0}, "times the length of its elements"),
    ({"at": [0.5, 0.5], "fz": 1.0}, "fz"),
    ({"fx": 1.0}, "at"),
])
def test_loads_that_have_no_field_are_refused(load: dict[str, Any], words: str) -> None:
    case = {
        "materials": {"m": MATERIAL},
        "curves": {"bottom": {"points": [[0, 0], [1, 0]], "elements": 4},
                   "rest": {"points": [[1, 0], [1, 1], [0, 1], [0, 0]], "elements": 12, "grading": "none"}},
        "regions": {"block": {"material": "m", "boundary": ["bottom", "rest"]}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}}, "point_loads": {"p": load},
    }  # fmt: skip
    with pytest.raises(pbem.CaseError) as caught:
        pbem.run(case, "none.h5")
    assert words in str(caught.value)


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_a_load_is_as_near_to_a_face_as_one_likes_where_the_program_grades(unit: float, tmp_path: Path) -> None:
    """It comes to be the load on the face. Elements of 0.5 there become as short as it takes."""
    def displace(depth: float) -> Any:
        corners = [[0, 0], [4 * unit, 0], [4 * unit, 2 * unit], [0, 2 * unit]]
        curves = {name: {"points": [corners[k], corners[(k + 1) % 4]], "elements": 8 if k % 2 == 0 else 4}
                  for k, name in enumerate(("bottom", "right", "top", "left"))}
        return pbem.run({
            "materials": {"m": MATERIAL}, "curves": curves,
            "regions": {"block": {"material": "m", "boundary": list(curves)}},
            "boundary": {"left": {"ux": 0.0, "uy": 0.0}},
            "point_loads": {"p": {"at": [2.1 * unit, (2 - depth) * unit], "fx": 0.5, "fy": -1.0}},
            "analysis": {"steps": 1}, "output": {"points": [[3 * unit, unit], [unit, unit / 2]]},
        }, tmp_path / f"near{depth}.h5").interior.displacement[-1]  # fmt: skip

    exact = displace(0.0)
    for depth in (0.02, 1e-3, 1e-5):
        np.testing.assert_allclose(displace(depth), exact, rtol=0, atol=(0.5 * depth + 2e-4) * np.abs(exact).max())


@pytest.mark.parametrize(("size", "at", "order", "allowed"), [
    ((8.0, 0.25), 6.6, 2, 1e-3), ((8.0, 0.25), 6.6, 3, 1e-4), ((20.0, 0.5), 7.3, 2, 1e-3), ((8.0, 0.5), 4.0, 3, 1e-4),
])
@pytest.mark.parametrize(("unit", "degrees"), [(1.0, 0.0), (1e-4, 53.0)])
def test_a_slender_beam_under_a_force_on_its_top(
    size: tuple[float, float], at: float, order: int, allowed: float, unit: float, degrees: float, tmp_path: Path
) -> None:
    """Both ends carry what statics says: the face opposite the load follows its distance."""
    (length, height), turn = size, unit * np.exp(1j * np.deg2rad(degrees))
    corners = [0j, length + 0j, length + 1j * height, 1j * height]
    x = [[float((turn * corner).real), float((turn * corner).imag)] for corner in corners]
    force, place = turn / unit * -1j, turn * (at + 1j * height)
    curves = {
        name: {"points": [x[k], x[(k + 1) % 4]], "elements": 4 if k % 2 else 12}
        for k, name in enumerate(("foot", "right", "top", "left"))
    }
    results = pbem.run({
        "materials": {"steel": {"young": 1e4, "poisson": 0.3, "plane": "stress"}},
        "curves": curves,
        "regions": {"beam": {"material": "steel", "boundary": list(curves)}},
        "boundary": {"left": {"us": 0.0}, "right": {"us": 0.0, "tn": 0.0}},
        "point_loads": {"load": {"fx": float(force.real), "fy": float(force.imag),
                                 "at": [float(place.real), float(place.imag)]}},
        "point_supports": {"still": {("ux" if degrees == 0.0 else "uy"): 0.0, "at": x[1]}},
        "analysis": {"steps": 1, "order": order},
    }, tmp_path / "beam.h5")
    for name, part in (("left", 1 - at / length), ("right", at / length)):
        reaction = complex(*results.reactions[name][-1]) * np.conj(turn / unit)
        assert abs(reaction - 1j * part) < allowed, name


@pytest.mark.parametrize(("sides", "center", "turn"), [(48, 0j, 1 + 0j), (60, 3e4 - 2e4j, 40 * np.exp(0.3j))])
def test_nearly_straight_sides_that_are_loaded_at_their_corners(
    sides: int, center: complex, turn: complex, tmp_path: Path
) -> None:
    """A hole of which every corner is pushed outwards keeps its elements; displacements as with four times as many."""
    corners = np.exp(2j * np.pi * np.arange(sides) / sides)
    force = (1 + 0.5 * corners.real**2) * corners * turn * 2 * np.pi / sides

    def make_case(elements: int) -> dict[str, Any]:
        return {
            "materials": {"rock": {"young": 1e3, "poisson": 0.25}},
            "curves": {"hole": {"points": to_pairs(center + turn * np.append(corners, 1.0)), "elements": elements}},
            "regions": {"plane": {"material": "rock", "infinite": True, "boundary": ["hole"]}},
            "point_loads": {f"p{k}": {"at": to_pairs([center + turn * corners[k]])[0], "fx": float(force[k].real),
                                      "fy": float(force[k].imag)} for k in range(sides)},
            "analysis": {"steps": 1},
        }  # fmt: skip

    moved = []
    points = to_pairs(center + turn * np.array([1.2, -2.4 + 3.2j, -1.5j]))
    for elements in (sides, 4 * sides):
        case = make_case(elements)
        hole = build_model(pbem.Case(**case)).curves["hole"]
        assert sum(leg.elements for leg in hole.legs) == elements
        moved.append(pbem.run(case, tmp_path / f"{elements}.h5").evaluate(points).displacement[-1])
    assert np.abs(moved[0] - moved[1]).max() < 3e-4 * np.abs(moved[1]).max()


def test_legs_that_a_load_on_the_boundary_acts_on() -> None:
    """All but those that end there or lead through or past it, however small a long leg beside it looks."""
    at = 2 - 1j
    acted = [Leg(at - 9 - 0.5j, at + 11 - 0.5j, 1), Leg(at + 2 + 0.5j, at + 3 + 0.5j, 1),
             Leg(at + 1 - 1j, at + 1 + 1j, 1, center=at + 1 + 0j, sweep=np.pi),
             Leg(at + 1 + 0j, at + 1 + 0j, 4, center=at + 1 - 1j, sweep=-2 * np.pi)]  # fmt: skip
    free = [Leg(at, at + 1j, 1), Leg(at - 2j, at, 1), Leg(at + 1 + 1j, at + 3 + 3j, 1), Leg(at + 1, at + 2 + 0.1j, 1),
            Leg(at, at + 2, 1, center=at + 1, sweep=np.pi)]  # fmt: skip
    assert find_acted_on([*acted, *free], at).tolist() == [True] * len(acted) + [False] * len(free)


def make_plate(loads: int, grading: str) -> pbem.Case:
    """A plate of 10 by 1 on 10 elements with forces along its top."""
    corners = [[0, 0], [10, 0], [10, 1], [0, 1]]
    curves = {
        name: {"points": [corners[k], corners[(k + 1) % 4]], "elements": 4 if k % 2 else 7, "grading": grading}
        for k, name in enumerate(("foot", "right", "top", "left"))
    }
    return pbem.Case(
        materials={"steel": {"young": 1e4, "poisson": 0.3}}, curves=curves,
        regions={"plate": {"material": "steel", "boundary": list(curves)}},
        boundary={"left": {"ux": 0.0, "uy": 0.0}},
        point_loads={f"p{k}": {"fy": -1.0, "at": [k + 0.5, 1.0]} for k in range(loads)},
    )


def test_loads_along_a_straight_face_add_no_elements_to_it() -> None:
    """Their fields leave it free of traction; the opposite face of a plate as thin as their distance gets more."""
    model = build_model(make_plate(10, "auto"))
    counts = {name: sum(leg.elements for leg in curve.legs) for name, curve in model.curves.items()}
    assert counts["top"] <= 22
    assert counts["foot"] >= 18


def test_long_elements_opposite_a_load_are_told_where_the_grading_is_given() -> None:
    notes = [note for note in build_model(make_plate(2, "none")).notes if "point load" in note]
    assert len(notes) == 2
    assert notes[0].startswith("The point load 'p0' lies 1 from curve 'foot', 0.7 times the length of its elements")
