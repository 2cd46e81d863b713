"""Quantities that vary along a curve, and in time: an expression of x, y, s and t, or a table of values over s."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.geometry.expression import evaluate_expression, list_names


@dataclass(frozen=True)
class Varying:
    """An expression of x, y (the user's coordinates), s (length from the curve's first point) and t (time), or a table
    of (s, value) with rising s: linear in between, and with its first and last value beyond its ends.

    sign: what it is multiplied by, 1 or -1.
    """

    expression: str = ""
    table: tuple[tuple[float, float], ...] = ()
    sign: float = 1.0

    def __bool__(self) -> bool:
        """False for a table of zeros."""
        return bool(self.expression) or any(value for _, value in self.table)

    @property
    def timed(self) -> bool:
        """Whether it depends on time by itself."""
        return "t" in list_names(self.expression) if self.expression else False

    @property
    def breaks(self) -> Real:
        """The lengths s at which a table has kinks."""
        return np.array([s for s, _ in self.table])

    def evaluate(self, places: Places, time: float = 0.0) -> Real:
        """The values (k,) at places of the curve; not finite where an expression has none."""
        if self.table:
            s, values = np.array(self.table).T
            return np.asarray(self.sign * np.interp(places.along, s, values))
        point = places.point
        return self.sign * evaluate_expression(self.expression, x=point.real, y=point.imag, s=places.along, t=time)

    def __format__(self, form: str) -> str:
        """The expression in quotes, or the ends of the table, its numbers in the given form."""
        sign = "-" if self.sign < 0 else ""
        if not self.table:
            return f'{sign}"{self.expression}"'
        (first, start), (last, end) = self.table[0], self.table[-1]
        ends = f"{start:{form}} at s = {first:{form}} to {end:{form}} at s = {last:{form}}"
        return f"{sign}table of {len(self.table)} ({ends})"


# A number stands for the same value everywhere.
Value = float | Varying


@dataclass(frozen=True)
class Places:
    """Points (k,) of a curve in the user's coordinates (complex), and the length (k,) from its first point to them."""

    point: Complex
    along: Real

    def take(self, which: np.ndarray) -> Places:
        """Some of the places."""
        return Places(self.point[which], self.along[which])


def evaluate(value: Value, places: Places, time: float = 0.0) -> Real:
    """The value at places (k,)."""
    return value.evaluate(places, time) if isinstance(value, Varying) else np.full(places.point.shape, float(value))


def find_kinks(values: Sequence[Value]) -> Real:
    """The lengths along a curve at which tables of values on it have kinks."""
    return np.concatenate([np.zeros(0), *(value.breaks for value in values if isinstance(value, Varying))])


def to_plain(value: Value | None) -> Any:
    """As it is written in a case."""
    if not isinstance(value, Varying):
        return value
    if value.expression:
        return {"expression": value.expression if value.sign > 0 else f"-({value.expression})"}
    return {"table": [[s, value.sign * each] for s, each in value.table]}


def negate(value: Value) -> Value:
    """The value with the other sign."""
    return replace(value, sign=-value.sign) if isinstance(value, Varying) else -value


@dataclass(frozen=True)
class Moment:
    """A time within the load history: fraction `factor` of a stage; start: the time at the stage's beginning."""

    start: float
    now: float
    factor: float


def blend(before: Value, after: Value, places: Places, moment: Moment) -> Real:
    """The values (k,) at a moment of a stage that leads from `before` to `after`: linear between both, but for what
    depends on time by itself."""
    if isinstance(after, Varying) and after.timed:
        return after.evaluate(places, moment.now)
    first = evaluate(before, places, moment.start)
    return first + moment.factor * (evaluate(after, places, moment.now) - first)


def spread_values(values: Sequence[Value], owner: Integer, places: Places) -> Real:
    """The values of owners, such as interfaces, at places (k,) that each have one."""
    numbers = np.array([0.0 if isinstance(value, Varying) else value for value in values] or [0.0], dtype=float)
    owner = np.asarray(owner)  # formed once, not for each value
    result = np.asarray(numbers[owner])
    for value in {value for value in values if isinstance(value, Varying)}:
        own = np.flatnonzero(np.array([each == value for each in values])[owner])
        result[own] = value.evaluate(places.take(own))
    return result
