"""Ends of elements that meet are one number, bit by bit, wherever a model is: they are found by equality."""

from __future__ import annotations

import cmath
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pbem.case.build import read_checked_model
from pbem.mesh.generate import generate_mesh
from scripts.study_places import Move, move_case, write_toml

ROOT = Path(__file__).parents[2]
EPSILON = np.finfo(float).eps
TURNED = cmath.exp(0.127j)
# Polylines, arcs between angles, whole circles, junctions, cracks that are cut, seats that are split, press fits.
CASES = ("cases/two_blocks_thst", "cases/gallery/lined_tunnel", "cases/gallery/pin_in_clearance",
         "cases/gallery/cruciform_crack", "cases/gallery/press_fit_overlap", "tests/defects/shallow_t",
         "scripts/fuzz_seeds/fitted", "scripts/fuzz_seeds/cracked")
MOVES = (Move("still"), Move("turned", turn=TURNED), Move("far", 1e4 * (0.3 - 1j), TURNED, True, 1e-3, 1e6))


@pytest.mark.parametrize("move", MOVES, ids=lambda move: move.name)
@pytest.mark.parametrize("name", CASES)
def test_ends_that_meet_are_equal(name: str, move: Move, tmp_path: Path) -> None:
    case = tomllib.loads((ROOT / f"{name}.toml").read_text(encoding="utf-8"))
    path = tmp_path / "moved.toml"
    moved, chance = move_case(case, move, 1.0), np.random.default_rng(5)
    for table in moved["curves"].values():
        if "points" in table:  # each curve is written with a rounding of its own
            points = np.array(table["points"], dtype=float)
            table["points"] = (points * (1 + EPSILON * chance.integers(-2, 3, points.shape))).tolist()
    path.write_text(write_toml(moved), encoding="utf-8")
    mesh = generate_mesh(read_checked_model(path))
    ends, lengths = np.concatenate([mesh.start, mesh.end]), np.tile(np.abs(mesh.end - mesh.start), 2)
    region = np.tile(mesh.region, 2)
    pairs = cKDTree(np.stack([ends.real, ends.imag], axis=1)).query_pairs(1e-7 * lengths.max(), output_type="ndarray")
    one, other = pairs.T
    near = np.abs(ends[one] - ends[other]) <= 1e-7 * np.minimum(lengths[one], lengths[other])
    # Bodies in contact have ends of their own, whose clearance may be as small as is liked.
    near &= region[one] == region[other]
    assert near.sum() >= 0.9 * mesh.elements
    np.testing.assert_array_equal(ends[one[near]], ends[other[near]])
