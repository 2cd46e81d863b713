"""Whether the bodies of a case, taken to be rigid, could be in balance at all under its loads.

Static admissibility: forces between the bodies that obey each contact's law and balance the loads. Where none exist, no
solution exists, whatever the bodies' elasticity; where they do, one may. A linear programme: the resultant of any
tractions on a straight leg is that of forces at its ends; cohesion and tensile strength of a leg may gather at either.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import linprog

from .history import Loads, evaluate_loads

Tables = Mapping[str, Any]

CIRCLE_POINTS = 120
# Loads on a body count as none below this part of all, and a balance counts as one within it.
SMALL = 1e-9


def weaken(law: Tables) -> Tables:
    """A law without the strength that slip can take from it."""
    lost = {"cohesion": 0.0, "tensile_strength": 0.0} if law.get("cohesion_lost") else {}
    return {**law, **lost, "friction": law.get("friction_dynamic", law.get("friction", 0.0))}


def can_balance(tables: Tables, stage: int, factor: float, weakened: bool = False) -> bool:
    """Whether forces exist that hold all finite bodies at a moment of the load history.

    weakened: without the strength that slip can take from the contacts.
    """
    loads = evaluate_loads(tables, stage, factor)
    bodies = [name for name, table in tables["regions"].items() if not table.get("infinite")]
    given = np.array([_sum_loads(tables, name, loads) for name in bodies])
    scale = np.abs(given).max(initial=0.0)
    if scale == 0:
        return True
    programme = _Programme(len(bodies))
    for name, law in {**tables.get("interfaces", {}), **tables.get("contacts", {})}.items():
        for number, (curve, sides) in enumerate(_find_sides(tables, name)):
            if number == 0:
                _add_contact(programme, tables, bodies, curve, sides, weaken(law) if weakened else law, scale)
    for name, values in loads.boundary.items():
        own = [body for body in bodies if name in tables["regions"][body]["boundary"]]
        for body in own:
            for leg in list_legs(tables, name, body):
                for point in (leg[0], leg[1]):
                    normal = -1j * (leg[1] - leg[0]) / abs(leg[1] - leg[0])
                    held = [d for key, d in (("un", normal), ("us", 1j * normal)) if key in values]
                    for direction in held:
                        programme.add(point, direction, ((bodies.index(body), 1.0),), -np.inf, np.inf)
    return programme.is_feasible(-given / scale)


def find_unloaded(tables: Tables, stage: int, factor: float) -> list[str]:
    """The finite bodies that carry no load and no condition of their own: they may lie loose."""
    loads = evaluate_loads(tables, stage, factor)
    return [
        name
        for name, table in tables["regions"].items()
        if not table.get("infinite")
        and not any(curve in loads.boundary for curve in table["boundary"])
        and not np.abs(_sum_loads(tables, name, loads)).max() > 0
    ]


class _Programme:
    """Forces as unknowns, three rows of balance for each body, and shares of strengths that add up."""

    def __init__(self, bodies: int) -> None:
        self.rows = 3 * bodies
        self.columns: list[np.ndarray] = []
        self.bounds: list[tuple[float, float]] = []
        self.limits: list[tuple[dict[int, float], float]] = []

    def add(
        self, point: complex, direction: complex, on: tuple[tuple[int, float], ...], least: float, most: float
    ) -> int:
        """A force at a point along a direction, on bodies with their signs; returns its number."""
        column = np.zeros(self.rows)
        for body, sign in on:
            column[3 * body:3 * body + 3] = sign * np.array(
                [direction.real, direction.imag, (point.conjugate() * direction).imag]
            )
        self.columns.append(column)
        self.bounds.append((least, most))
        return len(self.columns) - 1

    def limit(self, coefficients: dict[int, float], most: float) -> None:
        """A linear combination of the unknowns is at most this."""
        self.limits.append((coefficients, most))

    def is_feasible(self, wanted: np.ndarray) -> bool:
        """Whether forces in their bounds have these resultants."""
        if not self.columns:
            return bool(np.abs(wanted).max() <= SMALL)
        matrix = np.array(self.columns).T
        above = np.zeros((len(self.limits), len(self.columns)))
        for row, (coefficients, _) in enumerate(self.limits):
            above[row, list(coefficients)] = list(coefficients.values())
        # Slack in the balance is as little as possible: rounding then decides nothing.
        slack = np.eye(self.rows)
        rows = np.concatenate([matrix, slack, -slack], axis=1)
        none = np.zeros((len(self.limits), 2 * self.rows))
        found = linprog(
            np.concatenate([np.zeros(len(self.columns)), np.ones(2 * self.rows)]),
            A_ub=np.concatenate([above, none], axis=1) if self.limits else None,
            b_ub=[most for _, most in self.limits] if self.limits else None,
            A_eq=rows, b_eq=wanted.ravel(),
            bounds=[*self.bounds, *[(0, np.inf)] * (2 * self.rows)], method="highs",
        )  # fmt: skip
        return bool(found.status == 0 and found.fun <= 1e-6)


def _add_contact(
    programme: _Programme, tables: Tables, bodies: list[str], curve: str, sides: tuple[str, str], law: Tables,
    scale: float,
) -> None:
    """Forces at both ends of every leg, pressing, pulling and rubbing, within the law."""
    friction = law.get("friction", 0.0)
    signs = tuple((bodies.index(side), sign) for side, sign in zip(sides, (1.0, -1.0), strict=True) if side in bodies)
    for leg in list_legs(tables, curve, sides[0]):
        normal = -1j * (leg[1] - leg[0]) / abs(leg[1] - leg[0])
        length = abs(leg[1] - leg[0])
        cohesion, tension = (law.get(key, 0.0) * length / scale for key in ("cohesion", "tensile_strength"))
        pulls, shares = [], []
        for point in leg:
            press = programme.add(point, -normal, signs, 0.0, np.inf)
            pull = programme.add(point, normal, signs, 0.0, tension)
            rub = programme.add(point, 1j * normal, signs, -np.inf, np.inf)
            share = programme.add(point, 0j, (), 0.0, cohesion)
            for sign in (1.0, -1.0):
                programme.limit({rub: sign, press: -friction, pull: friction, share: -1.0}, 0.0)
            pulls.append(pull)
            shares.append(share)
        programme.limit(dict.fromkeys(pulls, 1.0), tension)
        programme.limit(dict.fromkeys(shares, 1.0), cohesion)


def _find_sides(tables: Tables, name: str) -> Iterator[tuple[str, tuple[str, str]]]:
    """The curve of an interface or contact, and the bodies on its first and second side; nothing for a crack."""
    curves = tables.get("contacts", {}).get(name, {}).get("between", [name, name])
    owners = [
        [body for body, table in tables["regions"].items() if curve in table["boundary"]] for curve in curves
    ]
    if curves[0] == curves[1] and len(owners[0]) == 2:
        yield curves[0], (owners[0][0], owners[0][1])
    elif curves[0] != curves[1]:
        yield curves[0], (owners[0][0], owners[1][0])


def list_legs(tables: Tables, curve: str, body: str) -> list[tuple[complex, complex]]:
    """The straight legs of a curve, with the body on the left; a circle as a polygon."""
    table = tables["curves"][curve]
    if "radius" in table:
        turns = np.exp(2j * math.pi * np.arange(CIRCLE_POINTS + 1) / CIRCLE_POINTS)
        points = [complex(z) for z in complex(*table["center"]) + table["radius"] * turns]
    else:
        points = [complex(*point) for point in table["points"]]
    legs = list(pairwise(points))
    middle, along = 0.5 * (legs[0][0] + legs[0][1]), legs[0][1] - legs[0][0]
    if _is_inside(tables, body, middle + 1e-4j * along):
        return legs
    return [(end, start) for start, end in reversed(legs)]


def _is_inside(tables: Tables, body: str, point: complex) -> bool:
    """Whether a point lies in a body: how often a ray from it crosses the body's boundary."""
    crossings = 0
    for curve in tables["regions"][body]["boundary"]:
        table = tables["curves"][curve]
        if "radius" in table:
            crossings += abs(point - complex(*table["center"])) < table["radius"]
            continue
        points = [complex(*each) - point for each in table["points"]]
        for start, end in pairwise(points):
            if (start.imag > 0) != (end.imag > 0):
                crossings += start.real - start.imag * (end - start).real / (end - start).imag > 0
    return (crossings % 2 == 1) != bool(tables["regions"][body].get("infinite"))


def _sum_loads(tables: Tables, body: str, loads: Loads) -> np.ndarray:
    """Force and moment about the origin of the given tractions and the weight on a body (3,)."""
    total = np.zeros(3)
    table = tables["regions"][body]
    for curve in table["boundary"]:
        values = loads.boundary.get(curve, {})
        for start, end in list_legs(tables, curve, body) if {"tn", "ts"} & values.keys() else ():
            normal = -1j * (end - start)
            force = normal * complex(values.get("tn", 0.0), values.get("ts", 0.0))
            total += _resultant(0.5 * (start + end), force)
    weight = tables["materials"][table["material"]].get("density", 0.0) * loads.gravity
    if weight:
        for curve in table["boundary"]:
            for start, end in list_legs(tables, curve, body):
                area = 0.5 * (start.conjugate() * end).imag
                total += _resultant((start + end) / 3, weight * area)
    return total


def _resultant(point: complex, force: complex) -> np.ndarray:
    return np.array([force.real, force.imag, (point.conjugate() * force).imag])
