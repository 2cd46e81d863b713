"""Whether forces balance is measured by all that acts: fluid in cracks, in-situ stress, weight carried by a plane."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.case.build import parse_model
from pbem.contact.laws import OPEN, ModeState
from pbem.errors import ConvergenceError
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.results.reader import Results
from pbem.solve.nonlinear.balance import measure_balance
from pbem.solve.nonlinear.imbalance import describe_imbalance
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import SilentReporter
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem

pytestmark = pytest.mark.usefixtures("without_errors")


def write_bar(length: float, inside: str, unit: float = 1.0) -> str:
    """A bar that is clamped at its right end; inside: "crack" or "inclusion", under pressure, or "swollen"."""
    x = length * unit
    curves = {
        "b": ((0, 0), (x, 0)), "r": ((x, 0), (x, unit)), "t": ((x, unit), (0, unit)), "l": ((0, unit), (0, 0)),
    }  # fmt: skip
    lines = ["materials.m = { young = 1000.0, poisson = 0.2 }", "materials.w = { young = 1000.0, poisson = 0.2 }"]
    for name, points in curves.items():
        count = 4 if name in "rl" else round(5 * length)
        lines.append(f"curves.{name} = {{ points = {[list(point) for point in points]}, elements = {count} }}")
    crack = inside == "crack"
    if crack:
        lines.append(f"curves.c = {{ points = {[[0.4 * unit, 0.4 * unit], [0.7 * unit, 0.6 * unit]]}, elements = 6 }}")
    else:
        lines.append(f"curves.c = {{ center = {[0.5 * unit, 0.5 * unit]}, radius = {0.2 * unit}, elements = 12 }}")
        lines.append('regions.inc = { material = "w", boundary = ["c"] }')
    more = ', cracks = ["c"]' if crack else ""
    boundary = '"b", "r", "t", "l"' + ("" if crack else ', "c"')
    lines += [
        f'regions.bar = {{ material = "m", boundary = [{boundary}]{more} }}', "boundary.r = { ux = 0.0, uy = 0.0 }",
        "analysis.steps = 1",
    ]  # fmt: skip
    if inside == "swollen":
        lines += ["initial_stress.w = { sxx = -10.0, syy = -10.0 }", 'interfaces.c = { law = "bonded" }']
    else:
        lines.append('interfaces.c = { law = "open", pressure = 1.0 }')
    return "\n".join([*lines, ""])


def solve(text: str, folder: Path, name: str = "case") -> Results:
    case = folder / f"{name}.toml"
    case.write_text(text, encoding="utf-8")
    return pbem.run(case, folder / f"{name}.h5", force=True)


@pytest.mark.parametrize("inside", ["crack", "inclusion", "swollen"])
def test_loads_that_balance_by_themselves_far_from_a_clamp(inside: str, tmp_path: Path) -> None:
    # Next to nothing arrives at the clamp, and most of that is the mesh's: no more than that of a shorter bar matters.
    short, long = (solve(write_bar(length, inside), tmp_path, f"bar{length:.0f}") for length in (2.0, 4.0))
    assert long.balance is not None
    assert long.balance.relative[-1].max() < 1e-2
    value = [each.contact["c"].opening[-1] if inside != "swollen" else each.contact["c"].traction_n[-1]
             for each in (short, long)]
    np.testing.assert_allclose(value[1], value[0], rtol=0, atol=1e-3 * np.abs(value[0]).max())


def prepare(text: str) -> Problem:
    model = parse_model(text)[1]
    return assemble_problem(model, generate_mesh(model), world)


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_what_is_left_over_is_measured_by_the_faces_of_cracks_too(unit: float) -> None:
    problem = prepare(write_bar(4.0, "crack", unit))
    mesh, load = problem.mesh, problem.evaluate_load(0, 1.0)
    is_open = ModeState(np.full(mesh.pairs.count, OPEN, dtype=np.int8), np.ones(mesh.pairs.count))
    support = problem.find_free_motions(is_open)
    # One stress everywhere balances on the boundary; fluid on both faces of the crack.
    traction = np.where(mesh.node_crack, -5.0 * mesh.normal, 0.1 * mesh.normal)
    traction = traction + np.where(mesh.node_curve == mesh.curve_names.index("l"), 0.02, 0.0)
    v = np.concatenate([np.zeros(2 * mesh.nodes), np.stack([traction.real, traction.imag], axis=1).ravel()])
    balance = measure_balance(problem, v, load, support)
    crack = np.hypot(0.3, 0.2)
    expected = 0.02 / (0.1 * 9.0 + 0.08 + 2 * 5.0 * crack)
    np.testing.assert_allclose(balance.resultant[0, :2], [0.02 * unit, 0.0], atol=1e-9 * unit)
    assert balance.relative[0] == pytest.approx(expected, rel=1e-9)
    assert balance.whole_relative == pytest.approx(expected, rel=1e-9)
    # A clamp that carries what nothing asks for is refused, however much fluid there is beside it.
    wrong = v.copy()
    at = np.flatnonzero(mesh.node_curve == mesh.curve_names.index("r"))
    wrong[2 * mesh.nodes + 2 * at] += 1.0
    with pytest.raises(ConvergenceError, match="not in balance"):
        describe_imbalance(problem, measure_balance(problem, wrong, load, support))


HEAVY = """
materials.m = {{ young = 1000.0, poisson = 0.2 }}
materials.h = {{ young = 1000.0, poisson = 0.2, density = 2.0 }}
gravity = {{ gx = 0.3, gy = -1.0 }}
curves.a = {{ center = [{x}, {x}], radius = {r}, elements = 20 }}
regions.plane = {{ material = "m", boundary = ["a"], infinite = true }}
analysis.steps = 1
"""
DISC = 'regions.inc = {{ material = "h", boundary = ["a"] }}\n'
HOLLOW = DISC.replace('"a"', '"a", "hole"') + "curves.hole = {{ center = [{x}, {x}], radius = {h}, elements = 20 }}\n"


@pytest.mark.parametrize(("x", "r"), [(0.0, 1.0), (300.0, 20.0)])
@pytest.mark.parametrize(
    "more", ["", 'interfaces.a = {{ law = "coulomb", friction = 0.5 }}\nremote = {{ sxx = {p}, syy = {p} }}\n'],
    ids=["bonded", "friction"],
)  # fmt: skip
def test_a_plane_carries_the_weight_of_what_lies_in_it(more: str, x: float, r: float) -> None:
    problem = prepare((HEAVY + DISC + more).format(x=x, r=r, p=-10.0 * r))
    mesh, (step,) = problem.mesh, tuple(march(problem, SilentReporter()))
    assert step.balance is not None
    weight = 2.0 * np.pi * r**2 * (0.3 - 1j)
    for name, expected in (("plane", weight), ("inc", -weight)):
        own = np.flatnonzero(mesh.node_region == mesh.region_names.index(name))
        assert abs(mesh.weight[own] @ step.traction[own] - expected) < 2e-3 * abs(weight)
    assert step.balance.relative.max() < 2e-3 and step.balance.whole_relative < 2e-3
    assert describe_imbalance(problem, step.balance) is None


def test_weight_of_a_body_that_is_held_leaves_a_net_force_unknown(tmp_path: Path) -> None:
    held = HEAVY + HOLLOW + "boundary.hole = {{ ux = 0.0, uy = 0.0 }}\n"
    with pytest.raises(ConvergenceError, match="net force") as caught:
        solve(held.format(x=0.0, r=1.0, h=0.5), tmp_path)
    assert caught.value.reason == "net force"
    # Where it does not touch the plane, that carries nothing of it.
    results = solve((held + 'interfaces.a = {{ law = "open" }}\n').format(x=0.0, r=1.0, h=0.5), tmp_path)
    assert results.balance is not None and results.balance.relative[-1].max() < 1e-3
