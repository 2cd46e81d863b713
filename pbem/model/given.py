"""Values of a case that may vary along a curve, from what is given for them."""

from __future__ import annotations

from pbem.description.varying import VaryingTable
from pbem.errors import Fault, KeyPath
from pbem.geometry.expression import ExpressionError, read_expression
from pbem.model.varying import Value, Varying


def read_value(
    loc: KeyPath, given: float | VaryingTable | None, timed: bool
) -> tuple[Value | None, list[Fault]]:
    """A number as it is, what varies as a Varying; 0 with a fault for an expression that is none.

    timed: whether it may depend on the time t.
    """
    if not isinstance(given, VaryingTable):
        return given, []
    if given.expression is None:
        return Varying(table=given.table or ()), []
    try:
        time = {"t": 0.0} if timed else {}
        read_expression(given.expression, x=0.0, y=0.0, s=0.0, **time)
    except ExpressionError as error:
        return 0.0, [Fault.at(loc, error.found, error.expected)]
    return Varying(given.expression), []
