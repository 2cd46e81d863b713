"""Narrow slots in plates with traction equations on the faces: what lies between slot and face bends as beside a crack.

References: the crack that a slot tends to, and the slot at order 3, with displacement equations.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.mesh.equations import choose_equations
from scripts.study_meshes import HERE, Place, read_lift, solve_slot
from tests.verification.proofs.proof import line, solve_case, write_case

ELSEWHERE = Place(-71.0, 25.4, 1e4, -3 + 60j)


@pytest.mark.parametrize(
    ("width", "order", "place", "allowed"),
    [(1e-1, 1, HERE, 4e-3), (1e-3, 1, ELSEWHERE, 1e-2), (1e-3, 3, HERE, 4e-4), (1e-5, 3, ELSEWHERE, 4e-4)],
)
def test_a_slot_from_the_side_of_a_plate(width: float, order: int, place: Place, allowed: float) -> None:
    # With traction equations on the plate's sides 0.9 and 1.8 % at order 1, 1e-3 and 7e-4 at order 3.
    reference = solve_slot(width if width > 1e-4 else 0.0, "SST", HERE, (40, 40), 3, 24)
    found = read_lift(solve_slot(width, "THST", place, order=order), place)
    assert found == pytest.approx(read_lift(reference, HERE), rel=allowed)


@pytest.mark.parametrize("cracked", [False, True])
def test_one_face_of_a_slot_takes_the_traction_equation_and_the_faces_beside_it_none(cracked: bool) -> None:
    corners = [-1j, 3 - 1j, 3 - 0.001j, 1 - 0.001j, 1 + 0.001j, 3 + 0.001j, 3 + 1j, 1j]
    names = ["bottom", "right_low", "low", "end", "high", "right_high", "top", "left"]
    curves: dict[str, Any] = {
        name: line(start, end, 8) for name, start, end in zip(names, corners, [*corners[1:], corners[0]], strict=True)
    }
    plate = {"material": "rock", "boundary": names}
    if cracked:
        curves["crack"] = line(1.5 + 0.4j, 2.5 + 0.5j, 8)
        plate["cracks"] = ["crack"]
    model = parse_model(write_case({
        "materials": {"rock": {"young": 1000.0, "poisson": 0.2}},
        "curves": curves,
        "regions": {"plate": plate},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"tx": 0.0, "ty": 0.1}},
        "analysis": {"scheme": "THST"},
    }))[1]  # fmt: skip
    equations = choose_equations(model)
    assert {name for name in names if any(equations.traction[0, name])} == {"high"}
    assert "right_low" in " ".join(equations.notes) and "beside" in " ".join(equations.notes)


def test_of_a_thin_part_beside_a_hole_one_face_is_said_to_have_had_a_traction_equation() -> None:
    """Faces of holes have none with any scheme: both faces of the part were said to have it."""
    model = parse_model(write_case({
        "materials": {"rock": {"young": 1000.0, "poisson": 0.2}},
        "curves": {"hole": {"center": [0.93, 0.0], "radius": 1.0, "elements": 32},
                   "outer": {"center": [0.0, 0.0], "radius": 2.0, "elements": 32}},
        "regions": {"ring": {"material": "rock", "boundary": ["hole", "outer"]}},
        "boundary": {"hole": {"pressure": 1.0}},
        "analysis": {"scheme": "THST"},
    }))[1]  # fmt: skip
    (note,) = [text for text in choose_equations(model).notes if "part 0.07" in text]
    assert "on outer, one face" in note and "resists its bending" in note and "both faces" not in note


def solve_slot_within(width: float, scheme: str, order: int, elements: int) -> float:
    """How far the top of a plate of 3 by 2 moves, that is clamped below and pulled at the top, around a slot within."""
    corners = {"bottom": (-1j, 3 - 1j), "right": (3 - 1j, 3 + 1j), "top": (3 + 1j, 1j), "left": (1j, -1j)}
    h = 0.5j * width
    ends = [2.5 - h, 0.9 - h, 0.9 + h, 2.5 + h]
    slot = {name: (ends[k], ends[(k + 1) % 4]) for k, name in enumerate(("low", "end", "high", "begin"))}
    counts = {"low": 2 * elements, "high": 2 * elements + 5, "end": 2, "begin": 2}
    names = [*corners, *slot]
    solved = solve_case(
        materials={"rock": {"young": 1000.0, "poisson": 0.2}},
        curves={name: line(*ends, counts.get(name, elements)) for name, ends in (corners | slot).items()},
        regions={"plate": {"material": "rock", "boundary": names}},
        boundary={"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"tx": 0.0, "ty": 0.1}},
        analysis={"steps": 1, "scheme": scheme, "order": order},
    )
    nodes = solved.nodes("top")
    corner = nodes[np.argmin(np.abs(solved.mesh.position[nodes] + solved.model.origin - (3 + 1j)))]
    return float(solved.last.displacement[corner].imag)


@pytest.mark.parametrize(("width", "order", "allowed"), [(0.05, 1, 4e-3), (1e-3, 1, 0.015), (0.05, 2, 1.5e-3)])
def test_a_slot_within_a_plate(width: float, order: int, allowed: float) -> None:
    # With traction equations on the plate's sides -8.1, -6.7 and +0.28 %: faces of a slot within were not looked for.
    expected = solve_slot_within(width, "SST", 3, 24)
    assert solve_slot_within(width, "THST", order, 12) == pytest.approx(expected, rel=allowed)
