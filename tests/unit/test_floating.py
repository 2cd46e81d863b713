"""Whether a block fits into the space around it: openings that are known exactly, and the sense of their normals."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.contact.cut_parts import CutParts
from pbem.contact.floating import measure_space
from pbem.contact.loads import collect_outer_nodes
from pbem.mesh.generate import generate_mesh
from pbem.mesh.parts import find_parts

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
