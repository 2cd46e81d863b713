"""Which rigid motions are those of a body of several regions as a whole."""

from __future__ import annotations

import pytest

from pbem.model.rigid_body_modes import RigidBodyMode
from pbem.solve.steps.settling import move_as_one


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e7])
def test_regions_whose_velocities_differ_by_rounding_move_as_one(unit: float) -> None:
    """They come from a null space: compared exactly, a second solution was left with another mean motion than the run,
    by a tenth of the displacement, on one machine and not on another."""
    noise, size = 1 + 4e-16, 3 * unit
    for one, other, alike in (
        ((0.7, 0.0), (0.7 * noise, 1e-17 / unit), True),
        ((0.3 + 0.2j, 0.5 / unit), (0.3 + 0.2j * noise, 0.5 * noise / unit), True),
        ((0.7, 0.0), (0.69, 0.0), False),
        ((0.7, 0.0), (0.7, 0.01 / unit), False),
    ):
        motion = RigidBodyMode(("lower", "upper"), {"lower": one, "upper": other}, "")
        assert move_as_one(motion, size) == alike
