"""Values that vary along a curve: what may be written in the place of a number."""

from __future__ import annotations

import itertools
from typing import Annotated

from pydantic import BeforeValidator, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

from pbem.description.table import Table
from pbem.description.values import LARGEST, FrictionAngle, NotNegative, Number, Point, Text, is_number

LINEAR = '{ expression = "..." }, linear in x and y'
EXAMPLES = '{ expression = "..." } or { table = [[s, value], ...] } with increasing s'


def _check_varying(value: object) -> object:
    """A table has an expression, or a table of pairs of numbers; numbers and unknown keys are left to their types."""
    if isinstance(value, str | list | tuple):
        raise PydanticCustomError("expected", "{expected}", {"expected": f"a number, or {EXAMPLES}"})
    if not isinstance(value, dict) or set(value) == {"expression"} or not set(value) <= {"expression", "table"}:
        return value
    rows = value.get("table")
    if set(value) != {"table"} or not isinstance(rows, list | tuple) or len(rows) < 2:
        raise PydanticCustomError("expected", "{expected}", {"expected": EXAMPLES})
    for row in rows:
        right = isinstance(row, list | tuple) and len(row) == 2 and all(map(is_number, row))
        if not right or not all(-LARGEST <= each <= LARGEST for each in row):
            expected = "a table of at least two [s, value], finite numbers each"
            raise PydanticCustomError("expected", "{expected}", {"expected": expected})
    if any(after[0] <= before[0] for before, after in itertools.pairwise(rows)):
        expected = "a table in which s increases from row to row"
        raise PydanticCustomError("expected", "{expected}", {"expected": expected})
    return value


def _check_strength(value: object) -> object:
    """As above, and nothing negative."""
    value = _check_varying(value)
    if isinstance(value, dict) and any(row[1] < 0 for row in value.get("table", ())):
        raise PydanticCustomError("expected", "{expected}", {"expected": "values >= 0"})
    return value


class VaryingTable(Table):
    """A quantity that varies along a curve: one of both keys."""

    expression: Text | None = Field(
        None, description="a function of `x`, `y`, of the length `s` from the curve's first point and, in loads, of `t`"
    )
    table: tuple[Point, ...] | None = Field(
        None, description="`[s, value]` with rising `s`: linear in between, constant beyond its ends"
    )


class ExpressionTable(Table):
    """A quantity that is linear in the coordinates."""

    expression: Text = Field(description="a linear function of `x` and `y`")


def _check_linear(value: object) -> object:
    """A table has an expression; numbers and unknown keys beside it are left to their types."""
    if isinstance(value, str | list | tuple) or (isinstance(value, dict) and "expression" not in value):
        raise PydanticCustomError("expected", "{expected}", {"expected": f"a number, or {LINEAR}"})
    return value


def _tell_kind(value: object) -> str:
    return VARYING if isinstance(value, dict | Table) else NUMBER


# Which of both a value is, so that it has the faults of that one only.
NUMBER, VARYING = "a number", "what varies"
_Varying = Annotated[VaryingTable, Tag(VARYING)]
# A number, or what varies along the curve; of a strength nothing negative.
Value = Annotated[
    Annotated[Number, Tag(NUMBER)] | _Varying, Discriminator(_tell_kind), BeforeValidator(_check_varying)
]
Strength = Annotated[
    Annotated[NotNegative, Tag(NUMBER)] | _Varying, Discriminator(_tell_kind), BeforeValidator(_check_strength)
]
# An angle (degrees), or what varies along the curve.
Angle = Annotated[
    Annotated[FrictionAngle, Tag(NUMBER)] | _Varying, Discriminator(_tell_kind), BeforeValidator(_check_strength)
]
# A number, or what is linear in x and y.
LinearValue = Annotated[
    Annotated[Number, Tag(NUMBER)] | Annotated[ExpressionTable, Tag(VARYING)], Discriminator(_tell_kind),
    BeforeValidator(_check_linear),
]
