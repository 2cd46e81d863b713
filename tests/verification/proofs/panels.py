"""The square panel with a side crack, closed, with and without friction: bundled cases against finite elements."""

from __future__ import annotations

import csv
import re
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from pbem.contact.laws import SLIP
from pbem.mesh.interpolation import interpolate, interpolate_tips, locate_nodes
from tests.verification.proofs.proof import Outcome, Proof, Real, Solved, largest_error, solve_text

CASES = Path(__file__).resolve().parents[3] / "cases"


class Panel(NamedTuple):
    """A bundled case with the reaction of its upper side (kN/m) and the factor of mode II by finite elements."""

    case: str
    reaction: complex
    KII: float


PANELS = {
    "panel without friction": Panel("panel_frictionless_closing", 0.22256 - 1.06038j, 0.2597),
    "panel with friction": Panel("panel_friction_closing", 12.2832 - 10.6038j, 7.822),
}
MESHES = {16: "16 elements a side", 8: "8 elements a side"}


def solve_panel(name: str, elements: int) -> Solved:
    """A bundled case with so many elements on each curve, and on each half of the left side, which the crack cuts.

    The slip depends most on the left side's elements next to the mouth: 16 on the whole side give 0.5 % there. The
    crack's elements are of equal length: refined towards the mouth, those at the tip are long.
    """
    text = (CASES / f"{PANELS[name].case}.toml").read_text(encoding="utf-8")
    lines = [re.sub(r"elements = \d+", f"elements = {elements}", line) for line in text.splitlines()]
    lines = [line.replace(f"elements = {elements}", f"elements = {2 * elements}") if line.startswith("left") else line
             for line in lines]  # fmt: skip
    lines = [line.replace("elements", 'grading = "none", elements') if line.startswith("crack ") else line
             for line in lines]  # fmt: skip
    solved = solve_text("\n".join(lines))
    assert len(solved.pairs("crack")) == 3 * elements
    assert (solved.last.contact.mode == SLIP).all()
    return solved


def reaction(name: str, elements: int) -> Outcome:
    """Of the upper side, relative to its magnitude."""
    solved = solve_panel(name, elements)
    exact = PANELS[name].reaction
    return Outcome(largest_error(solved.reaction("top"), exact, abs(exact)), solved.unknowns)


def factor(name: str, elements: int) -> Outcome:
    """Factor of mode II at the tip."""
    solved = solve_panel(name, elements)
    return Outcome(largest_error(abs(solved.factors("crack")[1][1]), PANELS[name].KII), solved.unknowns)


def slip(name: str, elements: int) -> Outcome:
    """At the places of the reference, relative to the largest slip; finite elements are off near the tip."""
    solved = solve_panel(name, elements)
    with (CASES / "reference" / f"{PANELS[name].case}.csv").open(encoding="utf-8") as file:
        rows = [(float(row["arc_length"]), float(row["slip"])) for row in csv.DictReader(file)]
    place, exact = np.array(rows).T
    inner = place < 0.99
    found = sample_slip(solved, "crack", place[inner])
    return Outcome(largest_error(found, exact[inner], float(np.abs(exact).max())), solved.unknowns)


def sample_slip(solved: Solved, crack: str, arc_length: Real) -> Real:
    """Slip at any place on a straight crack, by the shapes of its elements."""
    mesh, pairs = solved.mesh, solved.pairs(crack)
    first = mesh.pairs.first[pairs]
    elements = np.unique(mesh.node_element[first])
    origin = mesh.start[elements[0]]
    ends = np.append(np.abs(mesh.start[elements] - origin), abs(mesh.end[elements[-1]] - origin))
    own = np.clip(np.searchsorted(ends, arc_length, side="right") - 1, 0, len(elements) - 1)
    s = (2 * (arc_length - ends[own]) / np.diff(ends)[own] - 1)[:, None]
    local, tip = locate_nodes(mesh)[elements[own]], mesh.tip[elements[own]]
    # Where a tip's shapes have no meaning their values are not taken.
    with np.errstate(invalid="ignore", divide="ignore"):
        shapes = np.where((tip > 0)[:, None, None], _tip_shapes(tip, local, s), interpolate(local, s))
    values = solved.last.contact.slip[pairs].reshape(len(elements), -1)[own]
    return np.asarray(np.einsum("epj,ej->e", shapes, values))


def _tip_shapes(tip: Real, local: Real, s: Real) -> Real:
    return interpolate_tips(np.where(tip > 0, tip, 1), local, s)


FINITE_ELEMENTS = "finite elements, cases/README.md"
TOLERANCES = {16: (5e-5, 5e-4, 1e-3), 8: (3e-4, 5e-3, 5e-3)}
PROOFS = tuple(
    Proof(f"{name}, {text}: {what}", FINITE_ELEMENTS, tolerance, partial(run, name, elements))
    for name in PANELS
    for elements, text in MESHES.items()
    for (what, run), tolerance in zip(
        (("reactions", reaction), ("slip", slip), ("KII", factor)), TOLERANCES[elements], strict=True
    )
)
