"""The types of the values in a case file, with their ranges, and one clear fault for each value that is out of them."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

MOST_ELEMENTS = 100_000
MOST_GENERATED = 1_000_000


def is_number(value: object) -> bool:
    """Whether a value is a number as it is written: whole or not, but not true or false."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _check_number(value: object) -> object:
    """An integer of any length passes pydantic's float; one too long for a float is no number to compute with."""
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) > 10**300:
        raise PydanticCustomError("expected", "{expected}", {"expected": "a number of at most 300 digits"})
    return value


def _check_elements(value: object) -> object:
    """One error in place of one for each member of the union int | list of int."""
    counts = value if isinstance(value, list) else [value]
    expected = f"a whole number from 1 to {MOST_ELEMENTS}, or a list with one such number for each leg"
    if not counts:
        raise PydanticCustomError("expected", "{expected}", {"expected": expected})
    for count in counts:
        if not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= MOST_ELEMENTS:
            raise PydanticCustomError("expected", "{expected}", {"expected": expected})
    return tuple(value) if isinstance(value, list) else value


def check_option(value: object) -> object:
    """A PETSc option's value; the library takes text only."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float) and abs(value) < float("inf"):
        return repr(value)
    raise PydanticCustomError("expected", "{expected}", {"expected": "a text, a finite number, true or false"})


# Numbers beyond this are slips of the pen, and their squares would overflow.
LARGEST = 1e100
_SHORT = BeforeValidator(_check_number)
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST), _SHORT]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=LARGEST), _SHORT]
NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=LARGEST), _SHORT]
Angle = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-3600, le=3600), _SHORT]
Part = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, lt=1), _SHORT]
Spread = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=10), _SHORT]
Poisson = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=-1, lt=0.5), _SHORT]
HalfTurn = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=90), _SHORT]
FrictionAngle = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, lt=90), _SHORT]
RoughnessNumber = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=20), _SHORT]
PartOrWhole = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1), _SHORT]
ResidualAngle = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, lt=70), _SHORT]
Power = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1, le=10), _SHORT]
ProductTolerance = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1e-13, le=1e-2), _SHORT]
Tolerance = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, lt=1), _SHORT]
Fraction = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=1), _SHORT]
Count = Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
Text = Annotated[str, Field(strict=True)]
Flag = Annotated[bool, Field(strict=True)]
Point = tuple[Number, Number]
Elements = Annotated[int | tuple[int, ...], BeforeValidator(_check_elements)]
