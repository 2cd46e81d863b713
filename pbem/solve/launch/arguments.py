"""What `pbem.run` and `pbem.sweep` are called with, checked before anything is read or computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, get_args

from pbem.model.model import Operator
from pbem.solve.petsc.options import check_kind

# What a run calls of its reporter, each of it if it is there.
REPORTED = ("begin", "note", "tell", "start_step", "iterate", "accept", "reject")


def check_arguments(
    operator: object, petsc: object, flags: Mapping[str, object], listener: Callable[..., Any] | None = None,
    reporter: object = None,
) -> None:
    """Raises ValueError for an unknown operator, TypeError for a flag that is neither True nor False, PETSc's options
    that are no dictionary of texts, a listener that cannot be called, or a reporter that takes nothing of what a run
    reports. flags: by name."""
    known = get_args(Operator)
    if operator is not None and not (isinstance(operator, str) and operator in known):
        raise ValueError(f"operator: found {operator!r}; expected one of {', '.join(known)}")
    for name, value in flags.items():
        if not isinstance(value, bool):
            raise TypeError(f"{name}: found {value!r}; expected True or False")
    check_kind(petsc)
    if listener is not None and not callable(listener):
        raise TypeError(f"listener: found {listener!r}; expected a function")
    if reporter is not None and not any(callable(getattr(reporter, name, None)) for name in REPORTED):
        raise TypeError(f"reporter: found {reporter!r}; expected an object with at least one of the methods "
                        f"{', '.join(REPORTED)}")
