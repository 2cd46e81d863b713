"""Blocks that nothing holds: whether they fit into the space around them, what drives them, and what is said of them.

Openings, weights and pressures are known exactly, with the sense of their normals.
"""

from __future__ import annotations

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.cut_parts import CutParts
from pbem.contact.floating import measure_space
from pbem.contact.laws import OPEN, STICK, ModeState, PairState, start_memory
from pbem.contact.loads import collect_outer_nodes, evaluate_load
from pbem.errors import ConvergenceError
from pbem.mesh.generate import generate_mesh
from pbem.mesh.parts import find_parts
from pbem.parallel import world
from pbem.solve.nonlinear.blocks import measure_drive
from pbem.solve.nonlinear.hold import Hold
from pbem.solve.problem.problem import Problem
from pbem.solve.system.assembly import assemble_problem

RING = """
materials.m = { young = 1000.0, poisson = 0.2 }
curves.c = { points = [[0, 0], [2, 0], [2, 1], [0, 1], [0, 0]], elements = 12 }
curves.d = { points = [[0, 1], [-1, 2]], elements = 4 }
regions.p = { material = "m", infinite = true, cracks = ["c", "d"] }
remote = { sxx = 1.0 }
"""
TURNED = RING.replace("[[0, 0], [2, 0], [2, 1], [0, 1], [0, 0]]", "[[0, 0], [0, 1], [2, 1], [2, 0], [0, 0]]")


@pytest.mark.parametrize("text", [RING, TURNED], ids=["counter-clockwise", "clockwise"])
def test_a_block_in_a_wider_hole_has_its_play_wherever_it_is(text: str) -> None:
    _, model = parse_model(text)
    mesh = generate_mesh(model)
    parts = find_parts(mesh)
    (block,) = np.flatnonzero(parts.block)
    own, normal = CutParts(model, mesh, collect_outer_nodes(model, mesh), parts).find_around(int(block))
    at, shift, play = mesh.pairs.position[own], 0.02 - 0.05j, 0.1
    assert set(np.unique(mesh.pairs.interface[own])) == {mesh.interface_names.index("c")}
    # The normal leads into the block: away from the faces around it.
    middle = 1 + 0.5j
    assert ((np.conj(normal) * (middle - at)).real > 0).all()
    moved = play + (np.conj(normal) * shift).real
    space = measure_space(at, normal, moved)
    assert space.margin == pytest.approx(play, rel=1e-9) and space.is_wide
    # Squeezed between two sides by more than the play it has none.
    tight = measure_space(at, normal, np.where(np.abs(normal.imag) > 0.9, moved - 0.15, moved))
    assert tight.margin == pytest.approx(-0.05, rel=1e-9) and not tight.is_wide
    assert (np.abs(normal[tight.nearest].imag) > 0.9).all() and len(tight.nearest) >= 2


PLATE = """
materials.m = { young = 1000.0, poisson = 0.2, density = 2.0 }
curves.o = { points = [[-2, -3], [6, -3], [6, 5], [-2, 5], [-2, -3]], elements = 40 }
curves.lid = { points = [[0, 1], [2, 1]], elements = 6 }
curves.bowl = { points = [[0, 1], [0, 0], [2, 0], [2, 1]], elements = 12 }
regions.p = { material = "m", boundary = ["o"], cracks = ["lid", "bowl"] }
boundary.o = { ux = 0.0, uy = 0.0 }
"""


def assemble(text: str) -> Problem:
    model = parse_model(text)[1]
    return assemble_problem(model, generate_mesh(model), world)


@pytest.mark.parametrize(("loads", "pressure", "expected"), [
    ("gravity = { gx = 0.0, gy = -0.3 }", (0, 0), 2.0 * 0.3 * 2.0 / 6.0),
    ("gravity = { gx = 0.4, gy = -0.3 }", (0, 0), 2.0 * 0.5 * 2.0 / 6.0),
    ("", (7.0, 7.0), 0.0),
    ("", (7.0, 4.0), 3.0 * 2.0 / 6.0),
    ("gravity = { gx = 0.0, gy = -0.3 }", (7.0, 7.6), 0.0),
    ("initial_stress.m = { sxx = -5.0, syy = -9.0, sxy = 1.0 }", (0, 0), 0.0),
    ("point_loads.f = { at = [0.8, 0.6], fy = 0.9 }", (0, 0), 0.9 / 6.0),
])
@pytest.mark.parametrize("turned", [False, True], ids=["plain", "turned"])
def test_loads_of_its_own_drive_a_block(
    loads: str, pressure: tuple[float, float], expected: float, turned: bool
) -> None:
    lid, bowl = (f"{{ friction = 0.5, pressure = {each} }}" for each in pressure)
    text = f"{PLATE}interfaces = {{ lid = {lid}, bowl = {bowl} }}\n{loads}\n"
    if turned:
        text = text.replace("[[0, 1], [2, 1]]", "[[2, 1], [0, 1]]")
    problem = assemble(text)
    load = evaluate_load(problem.model, problem.mesh, problem.outer, 0, 1.0)
    (block,) = np.flatnonzero(problem.parts.block)
    np.testing.assert_allclose(measure_drive(problem, int(block), load), expected, rtol=1e-3, atol=1e-9)


def test_two_blocks_that_move_together_are_both_named() -> None:
    wall = "curves.wall = { points = [[1, 0], [1, 1]], elements = 5 }\n"
    laws = "".join(f"interfaces.{name} = {{ friction = 0.5 }}\n" for name in ("lid", "bowl", "wall"))
    problem = assemble(PLATE.replace('["lid", "bowl"]', '["lid", "bowl", "wall"]') + wall + laws)
    pairs, names = problem.mesh.pairs, problem.mesh.interface_names
    sticks = np.array([name.startswith("wall") for name in names])[pairs.interface]
    modes = ModeState(np.where(sticks, STICK, OPEN).astype(np.int8), np.ones(pairs.count))
    assert {len(each.moving) for each in problem.find_cut_motions(modes)} == {2}
    error = Hold(problem, start_memory(problem.laws)).describe_free_motion(modes)
    assert error is not None and error.reason == "free motion"
    for text in ("block near (0.5", "block near (1.5", "let it touch, or be joined, somewhere"):
        assert text in str(error), str(error)


@pytest.mark.parametrize(("loads", "free"), [("gravity = { gx = 0.0, gy = -0.3 }", False), ("", True)])
def test_a_search_that_does_not_settle_leaves_no_block_to_nothing_that_its_weight_lays_down(
    loads: str, free: bool
) -> None:
    text = PLATE + "".join(f"interfaces.{name} = {{ friction = 0.5 }}\n" for name in ("lid", "bowl")) + loads
    problem = assemble(text)
    count = problem.mesh.pairs.count
    modes = ModeState(np.full(count, OPEN, dtype=np.int8), np.ones(count))
    load = evaluate_load(problem.model, problem.mesh, problem.outer, 0, 1.0)
    hold = Hold(problem, start_memory(problem.laws), load)
    none = np.zeros(count)
    hold.state = PairState(none, none, none + 0.01, none)
    limit = ConvergenceError("iteration limit", "modes that change")
    if free:
        with pytest.raises(ConvergenceError, match="is held by nothing"):
            hold.doubt_free_motion(modes, limit)
    else:
        hold.doubt_free_motion(modes, limit)
    # Once no mode changes, it is free in them, whatever drives it.
    error = hold.describe_free_motion(modes)
    assert error is not None and "is held by nothing" in str(error)
