"""Models of infinite planes with cracks, holes and inclusions, and how they are solved."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pbem.geometry.curve import Curve, Leg
from pbem.geometry.loop import Loop, Side
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.material import Material
from pbem.model.model import (
    Analysis,
    Condition,
    Interface,
    Law,
    Model,
    Region,
    SolverOptions,
    Stage,
)
from pbem.parallel import world
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem

ROCK = Material("rock", 1e3, 0.2)
FREE = Law("coulomb")


def make_straight(start: complex, end: complex, elements: int, power: float | None = None) -> Leg:
    """A straight leg; refined towards both ends if a power is given."""
    refined = power is not None
    return Leg(complex(start), complex(end), elements, refined, refined, power or 3.0)


def make_arc(start: complex, sweep: float, elements: int, center: complex = 0j) -> Leg:
    """A circular leg; sweep in radians."""
    return Leg(start, center + (start - center) * np.exp(1j * sweep), elements, center=center, sweep=sweep)


def make_circle(radius: float, elements: int) -> Curve:
    """A full circle about the origin, of four legs."""
    points = [complex(radius * 1j**k) for k in range(4)]
    legs = [Leg(points[k], points[(k + 1) % 4], elements // 4, center=0j, sweep=math.pi / 2) for k in range(4)]
    return Curve("hole", tuple(legs))


def make_plane(
    remote: tuple[float, float, float],
    cracks: Mapping[str, Sequence[Leg]] | None = None,
    law: Law = FREE,
    hole: Curve | None = None,
    inclusion: Material | None = None,
    material: Material = ROCK,
    order: int = 2,
    tips: bool = True,
    stages: tuple[Stage, ...] = (),
    points: Sequence[complex] | NDArray[np.complex128] = (),
    size: float = 2.0,
) -> Model:
    """An infinite plane under a stress at infinity, with cracks in it and a hole that may hold an inclusion.

    Without stages there is one, of one step. points: interior points.
    """
    curves = {name: Curve(name, tuple(legs)) for name, legs in (cracks or {}).items()}
    interfaces = {name: Interface(name, "plane", None, law) for name in curves}
    regions = [Region("plane", material, (), tuple(curves), True)]
    conditions = {}
    if hole is not None:
        curves["hole"] = hole
        regions[0] = replace(regions[0], loops=(Loop((Side("hole", False),), False),))
        if inclusion is None:
            conditions["hole"] = Condition("hole")
        else:
            regions.append(Region("grain", inclusion, (Loop((Side("hole", True),), True),)))
            interfaces["hole"] = Interface("hole", "plane", "grain", Law("bonded"))
    load = Stage("load", 1, {name: (0.0, 0.0) for name in conditions}, {}, remote=remote)
    return Model(
        title="plane", units_length="m", units_stress="MPa", source="", regions=tuple(regions), curves=curves,
        interfaces=interfaces, conditions=conditions, crack_tips={name: (True, True) for name in cracks or {}},
        stages=stages or (load,), analysis=Analysis("SST", order, tips), solver=SolverOptions(), output_every=1,
        size=size, interior_points=tuple(complex(point) for point in points),
    )  # fmt: skip


def solve(model: Model) -> tuple[Mesh, list[Step]]:
    """The mesh and all converged steps."""
    mesh = generate_mesh(model)
    return mesh, list(march(assemble_problem(model, mesh, world), SilentReporter()))
