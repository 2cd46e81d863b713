"""A case as tables, written about the origin and put to its place, and conditions that a field fulfils."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scripts.conditions.field import Elastic, Field, add, along
from scripts.conditions.place import Place, Real

SCHEMES = ("SST", "DBEM", "HST", "THST")
OPERATORS = ("dense", "hierarchical")


@dataclass(frozen=True)
class Setting:
    """How a condition is tried; seed: of the places of corners and of coefficients."""

    scheme: str = "SST"
    operator: str = "dense"
    order: int = 2
    seed: int = 0
    place: Place = Place()  # noqa: RUF009

    def rng(self, name: str) -> np.random.Generator:
        return np.random.default_rng([self.seed, *name.encode()])


class Draft:
    """Tables of a case. Points are complex numbers about the origin."""

    def __init__(self, setting: Setting, steps: int = 1) -> None:
        self.setting, self.place = setting, setting.place
        self.lines: dict[str, tuple[complex, complex]] = {}
        self.tables: dict[str, Any] = {
            "materials": {}, "curves": {}, "regions": {}, "boundary": {}, "interfaces": {}, "contacts": {},
            "analysis": {"scheme": setting.scheme, "order": setting.order, "steps": steps},
            "solver": {"operator": setting.operator, "tolerance": 1e-10},
        }  # fmt: skip

    def __getitem__(self, name: str) -> dict[str, Any]:
        return dict.setdefault(self.tables, name, {})

    def add_material(self, name: str, material: Elastic, density: float = 0.0) -> None:
        self["materials"][name] = material.table(self.place, density)

    def add_line(self, name: str, *points: complex, elements: int = 3, grading: str = "none") -> str:
        self["curves"][name] = {"points": [self.place.at(z) for z in points], "elements": elements, "grading": grading}
        self.lines[name] = points[0], points[-1]
        return name

    def add_circle(self, name: str, center: complex, radius: float, elements: int = 12) -> str:
        self["curves"][name] = {"center": self.place.at(center), "radius": radius * self.place.size,
                                "elements": elements}  # fmt: skip
        return name

    def add_region(self, name: str, material: str, boundary: Sequence[str], **more: Any) -> None:
        self["regions"][name] = {"material": material, "boundary": list(boundary), **more}

    def add_polygon(self, name: str, material: str, corners: Sequence[complex], elements: int = 3) -> list[str]:
        """A region with sides name0, name1, ..., counter-clockwise."""
        names = [
            self.add_line(f"{name}{k}", corners[k], corners[(k + 1) % len(corners)], elements=elements)
            for k in range(len(corners))
        ]
        self.add_region(name, material, names)
        return names

    def normal(self, name: str) -> complex:
        """The outward normal of a line that runs counter-clockwise about its region."""
        start, end = self.lines[name]
        return -1j * (end - start) / abs(end - start)

    def case(self) -> dict[str, Any]:
        return {name: table for name, table in self.tables.items() if table}

    # -- conditions that a field fulfils ------------------------------------------------------------------------------

    def polynomials(self, field: Field, name: str, what: str) -> tuple[Real, Real]:
        """Both components in the case's axes, in the model's units: what "u" or "t", or "un", "tn" along the normal."""
        normal = self.normal(name)
        x, y = (field.ux, field.uy) if what[0] == "u" else field.traction(normal)
        axis = normal if what[-1] == "n" else self.place.turn.conjugate()
        # Components along the axis and along the axis turned by +90 degrees.
        return add(axis.real * x, axis.imag * y), add(-axis.imag * x, axis.real * y)

    def give(self, name: str, field: Field, what: str, how: str, time: str = "") -> None:
        """A condition on a line: what "u", "t", "un" or "tn" (both components along axes, or along the normal), or one
        of them mixed ("un ts", "tn us"); how "number", "xy", "s" or "table"."""
        parts = {"u": ("ux", "uy"), "t": ("tx", "ty"), "un": ("un", "us"), "tn": ("tn", "ts")}
        condition = self["boundary"].setdefault(name, {})
        if " " in what:
            first, second = what.split()
            pairs = [(first, self.polynomials(field, name, first)[0]),
                     (second, self.polynomials(field, name, second[0] + "n")[1])]
        else:
            pairs = list(zip(parts[what], self.polynomials(field, name, what), strict=True))
        for key, values in pairs:
            condition[key] = self.value(name, values, key[0], how, time)

    def value(self, name: str, values: Real, kind: str, how: str, time: str = "") -> Any:
        """A value of a condition; kind "u" (length), "t" (stress) or "k" (stress per length)."""
        place = self.place
        unit = {"u": place.size, "t": place.stress, "k": place.stress / place.size}[kind]
        start, end = self.lines[name]
        length = abs(end - start)
        on_line = along(values, start, (end - start) / length)
        if how == "number":
            return float(on_line[0]) * unit
        if how == "table":
            return {"table": [[s * place.size * length, float(np.polyval(on_line[::-1], s * length)) * unit]
                              for s in (0.0, 0.3, 1.0)]}  # fmt: skip
        if how == "s":
            text = " + ".join(
                "*".join([f"({float(value) * unit!r})", *[f"(s/{place.size!r})"] * k])
                for k, value in enumerate(on_line)
            )
        else:
            text = place.text(values, unit)
        return {"expression": f"({text})*{time}" if time else text}
