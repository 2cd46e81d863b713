"""A case as plain tables, its text as TOML, and the same case in other units, elsewhere and turned."""

from __future__ import annotations

import cmath
import json
import math
import random
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

Tables = dict[str, Any]

# What a number under a key is: powers of length and of stress.
DIMENSIONS: dict[str, tuple[int, int]] = {
    "young": (0, 1), "cohesion": (0, 1), "tensile_strength": (0, 1), "pressure": (0, 1), "tn": (0, 1), "ts": (0, 1),
    "sxx": (0, 1), "syy": (0, 1), "sxy": (0, 1), "un": (1, 0), "us": (1, 0), "gap": (1, 0), "slip_distance": (1, 0),
    "radius": (1, 0), "kn": (-1, 1), "ks": (-1, 1), "normal_stiffness": (-1, 1), "tangential_stiffness": (-1, 1),
    "gx": (-1, 1), "gy": (-1, 1),
}  # fmt: skip


@dataclass(frozen=True)
class Units:
    """Where and in which units a case is written: factors of length and stress, a turn (degrees), and a shift in the
    case's own unit of length, before the turn."""

    length: float = 1.0
    stress: float = 1.0
    turn: float = 0.0
    shift: complex = 0j

    def place(self, point: complex) -> complex:
        """A point of the case."""
        return (point + self.shift) * self.length * cmath.exp(1j * math.radians(self.turn))


@dataclass
class Draft:
    """A case while it is drawn: the tables of the case file, in units in which moduli and lengths are about 1.

    Conditions are given along and across the curves (un, us, tn, ts), so that a case can be turned.
    """

    title: str
    materials: Tables = field(default_factory=dict)
    curves: Tables = field(default_factory=dict)
    regions: Tables = field(default_factory=dict)
    interfaces: Tables = field(default_factory=dict)
    contacts: Tables = field(default_factory=dict)
    boundary: Tables = field(default_factory=dict)
    remote: Tables = field(default_factory=dict)
    gravity: Tables = field(default_factory=dict)
    stages: list[Tables] = field(default_factory=list)
    analysis: Tables = field(default_factory=dict)

    def add_line(self, name: str, *points: complex, elements: int = 4) -> str:
        """A polyline, with so many elements in all or at least one for each leg; returns its name."""
        counts = max(elements, len(points) - 1)
        self.curves[name] = {"points": [[point.real, point.imag] for point in points], "elements": counts}
        return name

    def add_circle(self, name: str, center: complex, radius: float, elements: int) -> str:
        """A full circle, whose elements turn with the case; returns its name."""
        self.curves[name] = {
            "center": [center.real, center.imag], "radius": radius, "angles": [0.0, 360.0], "elements": elements,
        }  # fmt: skip
        return name

    def tables(self, units: Units | None = None) -> Tables:
        """All tables that are not empty, in the units given."""
        names = (
            "materials", "curves", "regions", "interfaces", "contacts", "boundary", "remote", "gravity", "analysis",
            "stages",
        )  # fmt: skip
        given = {name: getattr(self, name) for name in names if getattr(self, name)}
        tables: Tables = _convert(given, units or Units())
        return tables

    def text(self, units: Units | None = None, remark: str = "") -> str:
        """The case file."""
        tables = self.tables(units)
        stages = tables.pop("stages", [])
        lines = [f"# {line}" for line in remark.splitlines()] + [f"title = {json.dumps(self.title)}"]
        for name, table in tables.items():
            lines += ["", f"[{name}]", *(f"{key} = {_show(value)}" for key, value in table.items())]
        for stage in stages:
            lines += ["", "[[stages]]", *(f"{key} = {_show(value)}" for key, value in stage.items())]
        return "\n".join(lines) + "\n"


def _show(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_show(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_show(each) for each in value) + "]"
    if isinstance(value, bool | str):
        return json.dumps(value)
    return repr(value)


def _convert(value: Any, units: Units, key: str = "") -> Any:
    """A value of the tables in other units; vectors and tensors are turned."""
    if isinstance(value, Mapping):
        turned = _turn(value, units)
        return {name: _convert(turned.get(name, each), units, name) for name, each in {**value, **turned}.items()}
    if key == "points":
        return [_place(point, units) for point in value]
    if key == "center":
        return _place(value, units)
    if key == "angles":
        return [angle + units.turn for angle in value]
    if isinstance(value, list):
        return [_convert(each, units) for each in value]
    if key in DIMENSIONS and not isinstance(value, str):
        length, stress = DIMENSIONS[key]
        return float(value * units.length**length * units.stress**stress)
    return value


def _place(point: list[float], units: Units) -> list[float]:
    placed = units.place(complex(*point))
    return [placed.real, placed.imag]


def _turn(table: Mapping[str, Any], units: Units) -> Tables:
    """What a turn makes of a table's components of stress and gravity."""
    turn = math.radians(units.turn)
    if {"sxx", "syy", "sxy"} & table.keys() and units.turn:
        xx, yy, xy = (table.get(key, 0.0) for key in ("sxx", "syy", "sxy"))
        c, s = math.cos(turn), math.sin(turn)
        return {
            "sxx": c * c * xx + s * s * yy - 2 * c * s * xy,
            "syy": s * s * xx + c * c * yy + 2 * c * s * xy,
            "sxy": c * s * (xx - yy) + (c * c - s * s) * xy,
        }
    if {"gx", "gy"} & table.keys() and units.turn:
        g = complex(table.get("gx", 0.0), table.get("gy", 0.0)) * cmath.exp(1j * turn)
        return {"gx": g.real, "gy": g.imag}
    return {}


def draw_log(rng: random.Random, least: float, largest: float) -> float:
    """A number whose logarithm is uniform."""
    return math.exp(rng.uniform(math.log(least), math.log(largest)))


def draw_law(rng: random.Random, stress: float, slip: float, modulus: float = 1.0) -> Tables:
    """A law of contact; stress, slip: about what the loads make, from which strengths and lengths are drawn."""
    law: Tables = {"law": "coulomb", "friction": 0.0 if rng.random() < 0.15 else rng.uniform(0.02, 1.2)}
    friction = law["friction"]
    if rng.random() < 0.3:
        law["cohesion"] = stress * draw_log(rng, 0.02, 2.0)
        if rng.random() < 0.5:
            apex = law["cohesion"] / friction if friction else stress
            law["tensile_strength"] = min(apex, 2 * stress) * rng.uniform(0.05, 0.95)
        if rng.random() < 0.4:
            law["cohesion_lost"] = True
    elif friction > 0.2 and rng.random() < 0.2:
        law["friction_dynamic"] = friction * rng.uniform(0.3, 0.95)
        law["slip_distance"] = slip * draw_log(rng, 0.05, 10.0)
    if rng.random() < 0.08:
        law["normal_stiffness"] = modulus * draw_log(rng, 3.0, 1e3)
        law["tangential_stiffness"] = law["normal_stiffness"] * rng.uniform(0.2, 1.0)
    return law


def draw_laws(rng: random.Random, names: list[str], stress: float, slip: float) -> Tables:
    """A law for each name: mostly the same for all."""
    common = draw_law(rng, stress, slip)
    return {name: draw_law(rng, stress, slip) if rng.random() < 0.1 else dict(common) for name in names}


def draw_material(rng: random.Random, softest: float = 0.5, hardest: float = 2.0) -> Tables:
    """An elastic material with a modulus of about 1."""
    material: Tables = {"young": draw_log(rng, softest, hardest), "poisson": rng.uniform(0.0, 0.42)}
    if rng.random() < 0.3:
        material["plane"] = "stress"
    return material


def draw_units(rng: random.Random) -> Units:
    """Units of a case: lengths from 1e-6 to 1e7, stresses from 1e-3 to 1e12, turned and shifted now and then."""
    # In parts of a degree that have no rounding, so that circles still close.
    turn = rng.choice((0.0, 0.0, 90.0, round(64 * rng.uniform(-180, 180)) / 64))
    shift = complex(rng.uniform(-20, 20), rng.uniform(-20, 20)) if rng.random() < 0.5 else 0j
    return Units(draw_log(rng, 1e-6, 1e7), draw_log(rng, 1e-3, 1e12), turn, shift)


def local(vector: complex, normal: complex, first: str = "un", second: str = "us") -> Tables:
    """Components of a displacement (or, with tn and ts, a traction) along the outward normal and turned by 90 deg."""
    value = vector * normal.conjugate()
    return {first: value.real, second: value.imag}
