"""Loose bodies with small gaps: stacks, grains, wedges and pins, in balance and with the right forces.

    python scripts/study_stacks.py [--count 60] [--first 0] [--operators dense,hierarchical] [-o TABLE.csv]

Each seed draws a model of one kind with gaps of 1e-6 to 1e-2 of its size, materials, friction, scheme and mesh, presses
it until the gaps are closed and on, and prints what is left over on the worst body at the given mesh and at twice the
elements, and how far the force is from that without gaps and pressed by as much less (stacks, grains and wedges).
Without its gaps a wedge touches two jaws that were moved towards it along the normals of their faces: normals and
partners of faces are those of the bodies as given, whereas a wedge that slides home meets other points of the jaws, by
1.4 times the gap, and its force differs by about 1.5 times the gap (`slid`, for comparison). What is left over is a
sum with signs, which can pass through zero between two meshes: where twice the elements leave more, eight times as many
have to leave FALLS of what four times as many do. (Traction equations leave as much as element lengths to the power of
0.7 to 0.9: the stress at held or pressed corners is infinite.)
"""

from __future__ import annotations

import argparse
import csv
import math
import random
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import pbem
from pbem.errors import PbemError, StopError
from pbem.results.reader import Results

KINDS = ("stack", "grains", "wedge", "pin")
SCHEMES = ("SST", "DBEM", "HST", "THST")
# Parts of the force that may be left over, and by which it may differ.
LEFT_OVER, OFF = 1e-3, 1e-2
# What eight times the elements may leave of what four times as many do, where twice as many leave more than the given
# mesh: more than half a power of the length.
FALLS = 0.7
HALF_ANGLE = math.radians(35)
COLUMNS = ("seed", "kind", "scheme", "operator", "gap", "friction", "left", "finer", "fourfold",
           "finest", "off", "slid", "error")


@dataclass(frozen=True)
class Sample:
    """A model of a kind: gap and approach are lengths, relative to bodies of the size 1; elements on a side."""

    kind: str
    gap: float
    approach: float
    friction: float
    stiffness: float
    scheme: str
    elements: int
    width: float


def draw(seed: int) -> Sample:
    rng = random.Random(f"stack {seed}")
    return Sample(
        kind=KINDS[seed % len(KINDS)], gap=10 ** rng.uniform(-6, -2), approach=10 ** rng.uniform(-4, -2.3),
        friction=rng.choice((0.0, 0.3, 0.6)), stiffness=10 ** rng.uniform(-1, 1), scheme=SCHEMES[seed // 4 % 4],
        elements=rng.choice((8, 10, 12)), width=rng.uniform(0.7, 1.4),
    )  # fmt: skip


class Text:
    """The text of a case, body after body."""

    def __init__(self, sample: Sample) -> None:
        self.lines = [
            "materials.a = { young = 1000.0, poisson = 0.2 }",
            f"materials.b = {{ young = {1000 * sample.stiffness!r}, poisson = 0.3 }}",
            "analysis.steps = 1", f'analysis.scheme = "{sample.scheme}"',
        ]

    def add_body(self, name: str, corners: list[complex], material: str, elements: int) -> None:
        """A polygon, counter-clockwise; its sides are name0, name1, ..."""
        longest = max(abs(b - a) for a, b in zip(corners, [*corners[1:], corners[0]], strict=True))
        for k, (a, b) in enumerate(zip(corners, [*corners[1:], corners[0]], strict=True)):
            count = max(4, round(elements * abs(b - a) / longest))
            points = f"[[{a.real!r}, {a.imag!r}], [{b.real!r}, {b.imag!r}]]"
            self.lines.append(f"curves.{name}{k} = {{ points = {points}, elements = {count} }}")
        sides = ", ".join(f'"{name}{k}"' for k in range(len(corners)))
        self.lines.append(f'regions.{name} = {{ material = "{material}", boundary = [{sides}] }}')

    def add(self, *lines: str) -> None:
        self.lines += lines


def write(sample: Sample, elements: int, operator: str, closed: bool, slid: bool = False) -> str:
    """The case; closed: without gaps, and pressed by as much less. slid: a wedge at its place between the jaws as
    given, not the jaws at the faces of the wedge."""
    text = Text(sample)
    gap, contact = (0.0 if closed else sample.gap), f"friction = {sample.friction!r}"
    if sample.kind == "wedge":
        _write_wedge(sample, text, gap, elements, contact, sample.gap if closed and not slid else 0.0)
    else:
        {"stack": _write_stack, "grains": _write_grains, "pin": _write_pin}[sample.kind](
            sample, text, gap, elements, contact
        )
    text.add(f'solver.operator = "{operator}"')
    return "\n".join(text.lines) + "\n"


def _block(x: float, y: float, width: float, height: float) -> list[complex]:
    return [complex(x, y), complex(x + width, y), complex(x + width, y + height), complex(x, y + height)]


def _write_stack(sample: Sample, text: Text, gap: float, elements: int, contact: str) -> None:
    text.add_body("p", _block(-1, 0, 2 + sample.width, 1), "a", elements)
    text.add_body("q", _block(0, 1 + gap, sample.width, 1), "b", elements)
    text.add_body("s", _block(-0.5, 2 + 2 * gap, 1 + sample.width, 1), "a", elements)
    text.add('contacts.k = { between = ["q0", "p2"], ' + contact + " }",
             'contacts.l = { between = ["q2", "s0"], ' + contact + " }",
             "boundary.p0 = { ux = 0.0, uy = 0.0 }",
             f"boundary.s2 = {{ ux = 0.0, uy = {-(2 * gap + sample.approach)!r} }}")


def _write_grains(sample: Sample, text: Text, gap: float, elements: int, contact: str) -> None:
    """Two columns of two grains between plates."""
    apart = 0.5
    text.add_body("p", _block(-1, -1, 3 + 2 * sample.width, 1), "a", elements)
    for column, x in enumerate((0.0, sample.width + apart)):
        text.add_body(f"m{column}x", _block(x, gap, sample.width, 1), "b", elements)
        text.add_body(f"n{column}x", _block(x, 1 + 2 * gap, sample.width, 0.8), "a", elements)
        text.add(f'contacts.k{column} = {{ between = ["m{column}x2", "n{column}x0"], {contact} }}')
    height = 1.8 + 3 * gap
    # Each grain has a seat of its own on the plates, as a curve has one contact.
    half = sample.width + 0.5 * apart
    text.lines = [line for line in text.lines if not line.startswith(("curves.p", "regions.p"))]
    right = 2 + 2 * sample.width
    for name, y, sign in (("p", 0.0, -1), ("s", height, 1)):
        ends = [-1.0, half, right]
        for k in range(2):
            text.add(f"curves.{name}seat{k} = {{ points = [[{ends[k]!r}, {y!r}], [{ends[k + 1]!r}, {y!r}]], "
                     f"elements = {2 * elements} }}")
            grain = "m" if name == "p" else "n"
            side = 0 if name == "p" else 2
            text.add(f'contacts.{name}{k} = {{ between = ["{grain}{k}x{side}", "{name}seat{k}"], {contact} }}')
        text.add(f"curves.{name}side = {{ points = [[{right!r}, {y!r}], [{right!r}, {y + sign!r}]], elements = 6 }}",
                 f"curves.{name}back = {{ points = [[{right!r}, {y + sign!r}], [-1, {y + sign!r}]], "
                 f"elements = {elements} }}",
                 f"curves.{name}other = {{ points = [[-1, {y + sign!r}], [-1, {y!r}]], elements = 6 }}",
                 f'regions.{name} = {{ material = "a", boundary = ["{name}seat0", "{name}seat1", "{name}side", '
                 f'"{name}back", "{name}other"] }}')
    text.add("boundary.pback = { ux = 0.0, uy = 0.0 }",
             f"boundary.sback = {{ ux = 0.0, uy = {-(3 * gap + sample.approach)!r} }}")


def _write_wedge(sample: Sample, text: Text, gap: float, elements: int, contact: str, moved: float) -> None:
    """A blunt wedge between two jaws, whose faces are a gap apart along their normals; each jaw is held at its base.

    moved: how far the jaws are moved towards the wedge along the normals of their faces.
    """
    lift = (gap + moved) / math.sin(HALF_ANGLE)
    top, foot = 1.0, 0.4
    wide, narrow = top * math.tan(HALF_ANGLE), foot * math.tan(HALF_ANGLE)
    towards = -moved * complex(math.cos(HALF_ANGLE), -math.sin(HALF_ANGLE))
    right = [z + towards for z in (complex(narrow, -1), complex(2, -1), complex(2, 1.2), complex(1.2 * wide, 1.2),
                                   complex(narrow, foot))]
    text.add_body("p", right, "a", 2 * elements)
    text.add_body("o", [-z.conjugate() for z in reversed(right)], "a", 2 * elements)
    # Its edges press between the ends of the jaws' faces: where corners meet, pairs would pass each other.
    low = foot + 0.15
    edge = low * math.tan(HALF_ANGLE)
    text.add_body("q", [
        complex(-edge, low + lift), complex(edge, low + lift),
        complex(wide, top + lift), complex(-wide, top + lift),
    ], "b", elements)  # fmt: skip
    pressed = sample.approach + gap / math.sin(HALF_ANGLE)
    text.add('contacts.k = { between = ["q1", "p3"], ' + contact + " }",
             'contacts.l = { between = ["q3", "o0"], ' + contact + " }",
             "boundary.p0 = { ux = 0.0, uy = 0.0 }",
             "boundary.o3 = { ux = 0.0, uy = 0.0 }",
             f"boundary.q2 = {{ ux = 0.0, uy = {-pressed!r} }}")


def _write_pin(sample: Sample, text: Text, gap: float, elements: int, contact: str) -> None:
    """A pin with a small hole in a plate; it is pulled by the traction on that hole."""
    radius = 0.5
    text.add_body("p", _block(-1.5, -1.5, 3, 3), "a", elements)
    at = [f"[0.0, {radius * gap!r}]", "[0, 0]"]
    text.add(f"curves.u = {{ center = [0, 0], radius = {radius * (1 + gap)!r}, angles = [0, 180], "
             f"elements = {2 * elements} }}",
             f"curves.v = {{ center = [0, 0], radius = {radius * (1 + gap)!r}, angles = [180, 360], "
             f"elements = {2 * elements} }}",
             f"curves.x = {{ center = {at[1]}, radius = {radius!r}, angles = [0, 180], elements = {2 * elements} }}",
             f"curves.y = {{ center = {at[1]}, radius = {radius!r}, angles = [180, 360], elements = {2 * elements} }}",
             f"curves.z = {{ center = {at[1]}, radius = 0.1, elements = {16 * elements // sample.elements} }}",
             'regions.q = { material = "b", boundary = ["x", "y", "z"] }',
             'contacts.k = { between = ["x", "u"], ' + contact + " }",
             'contacts.l = { between = ["y", "v"], ' + contact + " }",
             # Also where twice the elements are too many for ends of contact to be graded without being asked.
             "analysis.grade_contact_ends = true",
             "boundary.p0 = { ux = 0.0, uy = 0.0 }",
             f"boundary.z = {{ ux = 0.0, uy = {-(radius * gap + sample.approach)!r} }}")
    text.lines = [line.replace('["p0", "p1", "p2", "p3"]', '["p0", "p1", "p2", "p3", "u", "v"]') for line in text.lines]


def measure(results: Results) -> tuple[float, float]:
    """The part that is left over on the worst body or on the whole, and the force that presses."""
    balance = results.balance
    assert balance is not None
    left = max(float(balance.relative[-1].max()), float(balance.whole_relative[-1]))
    return left, max(float(np.abs(force[-1]).max()) for force in results.reactions.values())


def study(seed: int, operators: list[str], folder: Path) -> list[dict[str, Any]]:
    """A row for each operator."""
    sample = draw(seed)
    rows = []
    for operator in operators:
        row: dict[str, Any] = {"seed": seed, "kind": sample.kind, "scheme": sample.scheme, "operator": operator,
                               "gap": sample.gap, "friction": sample.friction}
        try:
            def run(elements: int, closed: bool, operator: str = operator, slid: bool = False) -> tuple[float, float]:
                case = folder / "case.toml"
                case.write_text(write(sample, elements, operator, closed, slid), encoding="utf-8")
                return measure(pbem.run(case, folder / "case.h5", force=True))

            row["left"], force = run(sample.elements, False)
            row["finer"] = run(2 * sample.elements, False)[0] if operator == "dense" else math.nan
            row["fourfold"], row["finest"] = (
                run(times * sample.elements, False)[0] if leaves_more(row) else math.nan
                for times in (4, 8)
            )
            row["off"] = math.nan
            if sample.kind != "pin":
                expected = run(sample.elements, True)[1]
                row["off"] = abs(force - expected) / expected
            if sample.kind == "wedge":
                expected = run(sample.elements, True, slid=True)[1]
                row["slid"] = abs(force - expected) / expected
        except StopError:
            raise
        except PbemError as error:
            row["error"] = str(error).split("\n")[-1][:150]
        rows.append(row)
    return rows


def leaves_more(row: dict[str, Any]) -> bool:
    """Whether the finer mesh leaves more."""
    return bool(row["finer"] > max(row["left"], 1e-5))


def is_wrong(row: dict[str, Any]) -> bool:
    """Whether a run failed, is out of balance, does not come closer to it or has another force."""
    if "error" in row or row["left"] > LEFT_OVER or row["off"] > OFF:
        return True
    return leaves_more(row) and not row["finest"] < FALLS * row["fourfold"]


def describe(row: dict[str, Any]) -> str:
    """A line for a run."""
    drawn = "{seed:3d} {kind:7s} {scheme:5s} {operator:13s} gap {gap:.1e} friction {friction:.1f}: ".format(**row)
    found = row.get("error") or "left over {left:.1e}, finer {finer:.1e}, force off {off:.1e}".format(**row)
    if "slid" in row:
        found += ", slid {slid:.1e}".format(**row)
    if row.get("finest", math.nan) > 0:
        found += ", fourfold {fourfold:.1e}, finest {finest:.1e}".format(**row)
    return drawn + found + ("  WRONG" if is_wrong(row) else "")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--operators", default="dense,hierarchical")
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.first, options.first + options.count):
            for row in study(seed, options.operators.split(","), Path(folder)):
                rows.append(row)
                print(describe(row), flush=True)
    wrong = sum(map(is_wrong, rows))
    print(f"{len(rows)} runs, {wrong} wrong")
    if options.output:
        with options.output.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
