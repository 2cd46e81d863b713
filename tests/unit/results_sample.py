"""A made-up run of two blocks, a hole and a crack: a real model and mesh, invented but consistent steps."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.loop import Loop, Side
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh, list_faces
from pbem.model.material import Material
from pbem.model.model import (
    Analysis,
    Condition,
    Interface,
    Law,
    Model,
    Quantity,
    Region,
    SolverOptions,
    Stage,
)
from pbem.solve.problem.step import ContactState, Iteration, Step

SOURCE = 'title = "Made-up blocks"\n'


def polyline(name: str, *points: complex, elements: int = 6, refine: bool = False) -> Curve:
    legs = [Leg(a, b, elements, refine, refine) for a, b in pairwise(points)]
    return Curve(name, tuple(legs))


def make_outline(*sides: str) -> Loop:
    return Loop(tuple(Side(side.lstrip("-"), not side.startswith("-")) for side in sides), outer=True)


def make_model(every: int = 1, source: str = SOURCE, cracks: int = 1) -> Model:
    """Blocks "lower" and "upper" (2 x 1 each) that meet in "joint"; a hole in the upper, cracks in the lower one."""
    circle = Leg(1.2 + 1.5j, 1.2 + 1.5j, 16, center=1 + 1.5j, sweep=2 * math.pi)
    names = ["crack"] if cracks == 1 else [f"crack{i}" for i in range(cracks)]
    curves = [
        polyline("bottom", 0j, 2 + 0j),
        polyline("right_lower", 2 + 0j, 2 + 1j),
        polyline("joint", 1j, 2 + 1j, elements=12, refine=True),
        polyline("left_lower", 1j, 0j),
        polyline("right_upper", 2 + 1j, 2 + 2j),
        polyline("top", 2 + 2j, 2j),
        polyline("left_upper", 2j, 1j),
        Curve("hole", (circle,)),
        *(polyline(name, 0.3 + 0.3j + 0.05j * i, 1.5 + 0.01 * i + 0.6j + 0.01j * i) for i, name in enumerate(names)),
    ]
    soft, hard = Material("soft", 2e3, 0.3), Material("hard", 2e4, 0.2)
    lower = make_outline("bottom", "right_lower", "-joint", "left_lower")
    upper = make_outline("joint", "right_upper", "top", "left_upper")
    regions = (
        Region("lower", soft, (lower,), tuple(names)),
        Region("upper", hard, (upper, Loop((Side("hole", False),), False))),
    )
    outer = ["bottom", "right_lower", "left_lower", "right_upper", "top", "left_upper", "hole"]
    held: tuple[Quantity, Quantity] = ("displacement", "displacement")
    conditions = {name: Condition(name) for name in outer} | {name: Condition(name, known=held) for name in outer[:1]}
    conditions["top"] = Condition("top", known=("traction", "displacement"))
    conditions["hole"] = Condition("hole", "local")
    rest = {name: (0.0, 0.0) for name in outer}
    stages = (
        Stage("press", 2, rest | {"top": (0.0, -0.001)}, {}),
        Stage("shear", 4, rest | {"top": (3.0, -0.001), "hole": (-2.0, 0.0)}, {}),
    )
    interfaces = {"joint": Interface("joint", "lower", "upper", Law("coulomb", friction=0.5, cohesion=1.0))}
    interfaces |= {name: Interface(name, "lower", None, Law("coulomb", friction=0.3)) for name in names}
    return Model(
        title="Made-up blocks", units_length="m", units_stress="kN/m^2", source=source, regions=regions,
        curves={curve.name: curve for curve in curves}, interfaces=interfaces, conditions=conditions,
        crack_tips={name: (True, True) for name in names}, stages=stages, analysis=Analysis(), solver=SolverOptions(),
        output_every=every, size=2.0, notes=("joint is refined towards both ends: it meets free sides there.",),
    )


def make_mesh(model: Model) -> Mesh:
    return generate_mesh(model)


def make_steps(model: Model, mesh: Mesh) -> list[Step]:
    """One step per planned step of the stages; friction slips where the joint is closed, its right end opens."""
    fractions = [(i, (j + 1) / stage.steps) for i, stage in enumerate(model.stages) for j in range(stage.steps)]
    return [make_step(mesh, i + 1, *at, load=(i + 1) / len(fractions)) for i, at in enumerate(fractions)]


def make_step(mesh: Mesh, number: int, stage: int, factor: float, load: float) -> Step:
    faces = list_faces(mesh)
    x, y = faces.position.real, faces.position.imag
    upper = faces.region == 1
    displacement = load * 1e-3 * (np.where(upper, 0.6, 0.2) * y - 1j * (0.3 * y + np.where(upper, 0.1 * (x - 2), 0)))
    traction = load * 10 * faces.normal.conjugate() * (1 - 0.5j)
    pairs = mesh.pairs
    along = pairs.arc_length
    mode = np.where(along > 1.6, OPEN, np.where(along > 0.7, SLIP, STICK)).astype(np.int8)
    mode[pairs.crack] = np.where(along[pairs.crack] < 0.4, OPEN, SLIP)
    closed = mode != OPEN
    contact = ContactState(
        mode=mode,
        opening=np.where(closed, 0.0, load * 1e-4 * (0.1 + np.sin(along) ** 2)),
        slip=np.where(mode == STICK, 0.0, load * 2e-4 * (1 + along)),
        traction_n=np.where(closed, -load * (4 - along), 0.0),
        traction_s=np.where(closed, load * (1 + 0.2 * along), 0.0),
        internal={"slip_path": load * 3e-4 * along, "broken": along > 1.0},
    )
    stick, slip, parted = (int((mode == which).sum()) for which in (STICK, SLIP, OPEN))
    iterations = tuple(Iteration(i + 1, 10.0 ** (-5 * i), 7 - 3 * i, stick, slip, parted, 0.01) for i in range(3))
    return Step(number, stage, factor, iterations, 1e-10, displacement, traction, contact)
