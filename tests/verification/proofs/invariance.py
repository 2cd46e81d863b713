"""A model with a crack, an interface and a contact of two curves, written down in many ways: always the same result."""

from __future__ import annotations

import cmath
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.mesh.mesh import list_faces
from pbem.results.reader import open_results
from tests.parallel.launch import launch
from tests.verification.proofs.proof import Complex, Outcome, Proof, Real, Solved, solve_case, write_case

LOWER = {"bottom": (0, 2), "right": (2, 2 + 1j), "left": (1j, 0)}
UPPER = {"upper_right": (2 + 1j, 2 + 1.6j), "shelf_right": (2 + 1.6j, 1.5 + 1.6j), "shelf": (1.5 + 1.6j, 0.4 + 1.6j),
         "shelf_left": (0.4 + 1.6j, 1.6j), "upper_left": (1.6j, 1j)}  # fmt: skip
PUNCH = {"foot": (0.6 + 1.6j, 1.3 + 1.6j), "punch_right": (1.3 + 1.6j, 1.4 + 2.2j), "head": (1.4 + 2.2j, 0.5 + 2.2j),
         "punch_left": (0.5 + 2.2j, 0.6 + 1.6j)}  # fmt: skip
LINES = LOWER | UPPER | PUNCH | {"joint": (1j, 2 + 1j), "crack": (0.5 + 0.3j, 1.3 + 0.7j)}
ELEMENTS = {"shelf": 10, "foot": 8, "joint": 8}


@dataclass(frozen=True)
class Writing:
    """How the model is written down.

    Lengths times size, stresses times stress; mirrored at x = 0, then turned by an angle (radians) and shifted.
    reversed: the curves' directions; shuffled: curves, regions and their lists in the opposite order.
    """

    size: float = 1.0
    stress: float = 1.0
    angle: float = 0.0
    shift: complex = 0j
    mirrored: bool = False
    reversed: bool = False
    shuffled: bool = False

    def turn(self, vector: Any) -> Any:
        """A direction, or many."""
        return (-np.conj(vector) if self.mirrored else vector) * cmath.exp(1j * self.angle)

    def place(self, point: Any) -> Any:
        """A point, or many."""
        return self.size * (self.turn(point) + self.shift)

    def order(self, entries: Any) -> Any:
        """A list or a table as it is written."""
        if not self.shuffled:
            return entries
        return dict([*entries.items()][::-1]) if isinstance(entries, Mapping) else entries[::-1]


def make_tables(writing: Writing) -> dict[str, Any]:
    """The case: pressed and pushed aside, so that there is stick, slip and parting, in two stages."""

    def curve(name: str) -> dict[str, Any]:
        ends = [complex(writing.place(complex(end))) for end in LINES[name]]
        ends = ends[::-1] if writing.reversed else ends
        return {"points": ends, "elements": ELEMENTS.get(name, 6), "grading": "both"}

    def move(displacement: complex) -> dict[str, float]:
        moved = writing.size * complex(writing.turn(displacement))
        return {"ux": moved.real, "uy": moved.imag}

    young = {"soft": (2e3, 0.3), "hard": (3e3, 0.2)}
    regions = {
        "lower": {"material": "hard", "boundary": writing.order([*LOWER, "joint"]), "cracks": ["crack"]},
        "upper": {"material": "soft", "boundary": writing.order(["joint", *UPPER])},
        "punch": {"material": "hard", "boundary": writing.order([*PUNCH])},
    }
    head = (-0.004j, 0.006 - 0.004j)
    return {
        "materials": {
            name: {"young": writing.stress * modulus, "poisson": poisson} for name, (modulus, poisson) in young.items()
        },
        "curves": writing.order({name: curve(name) for name in LINES}),
        "regions": writing.order(regions),
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "head": move(head[0])},
        "interfaces": {
            "joint": {"law": "coulomb", "friction": 0.35, "cohesion": 0.02 * writing.stress},
            "crack": {"friction": 0.3, "pressure": 2.0 * writing.stress},
        },
        "contacts": {"seat": {"between": ["foot", "shelf"], "friction": 0.45}},
        "stages": [
            {"name": "press", "steps": 1},
            {"name": "push", "steps": 3, "boundary": {"head": move(head[1])}},
        ],
    }


def compare(one: Complex, other: Complex) -> float:
    """Largest difference, relative to the largest value."""
    return float(np.abs(one - other).max() / np.abs(one).max())


def solve_writing(writing: Writing) -> Solved:
    return solve_case(**make_tables(writing))


def match_nodes(plain: Solved, other: Solved, writing: Writing) -> Real:
    """For every node of the first solution the same node of the second: of place, normal and region."""
    faces = [list_faces(solved.mesh) for solved in (plain, other)]
    place = [writing.place(faces[0].position) / writing.size, faces[1].position / writing.size]
    normal = [writing.turn(faces[0].normal), faces[1].normal]
    names = [
        np.array(solved.mesh.region_names)[face.region] for solved, face in zip((plain, other), faces, strict=True)
    ]
    far = np.abs(np.subtract.outer(place[0], place[1])) + np.abs(np.subtract.outer(normal[0], normal[1]))
    far += names[0][:, None] != names[1]
    match = far.argmin(axis=1)
    assert far.min(axis=1).max() < 1e-9 and len(set(match)) == len(match)
    return match


def same_result(writing: Writing) -> Outcome:
    """Largest difference of displacements and tractions at all nodes and steps, relative to the largest."""
    plain, other = solve_writing(Writing()), solve_writing(writing)
    assert {STICK, SLIP, OPEN} == set(np.concatenate([step.contact.mode for step in plain.steps]))
    match = match_nodes(plain, other, writing)
    errors = []
    for first, second in zip(plain.steps, other.steps, strict=True):
        displacement = writing.size * writing.turn(first.displacement)
        errors.append(compare(displacement, second.displacement[match]))
        errors.append(compare(writing.stress * writing.turn(first.traction), second.traction[match]))
    return Outcome(max(errors), plain.unknowns)


@cache
def run_ranks(ranks: int) -> dict[str, Real]:
    """Fields of the result file of a run on so many ranks."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "mixed.toml").write_text(write_case(make_tables(Writing())), encoding="utf-8")
        run = launch(ranks, "run", "mixed.toml", cwd=folder)
        assert run.returncode == 0, run.stderr
        results = open_results(folder / "mixed.h5")
        modes = np.concatenate([results.contact[joint].mode for joint in ("joint", "crack", "seat")], axis=1)
        return {"displacement": results.displacement, "traction": results.traction, "mode": modes}


def same_on_ranks(ranks: int) -> Outcome:
    """Against the run in this process, all steps; the same modes everywhere."""
    plain, found = solve_writing(Writing()), run_ranks(ranks)
    assert plain.mesh.interface_names == ("joint", "crack", "seat")
    errors = []
    for number, step in enumerate(plain.steps):
        for name in ("displacement", "traction"):
            columns = found[name][number]
            errors.append(compare(getattr(step, name), columns[:, 0] + 1j * columns[:, 1]))
        np.testing.assert_array_equal(found["mode"][number], step.contact.mode)
    return Outcome(max(errors), plain.unknowns)


WRITINGS = {
    "turned": Writing(angle=0.7),
    "mirrored": Writing(mirrored=True),
    "mm and MPa in place of m and Pa": Writing(size=1e3, stress=1e-6),
    "shifted": Writing(shift=7 - 4j),
    "curves in the other direction": Writing(reversed=True),
    "curves and regions in the other order": Writing(shuffled=True),
    "all at once": Writing(25.4, 1e3, -2.0, 1 + 2j, True, True, True),
}
PROOFS = (
    *(Proof(f"mixed model, {name}: displacements, tractions", "invariance", 1e-8, partial(same_result, writing))
      for name, writing in WRITINGS.items()),
    *(Proof(f"mixed model on {ranks} rank{'s' * (ranks > 1)}: displacements, tractions", "invariance", 1e-8,
            partial(same_on_ranks, ranks))
      for ranks in (1, 2, 3, 4)),
)  # fmt: skip
