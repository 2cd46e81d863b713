"""Which keys of a law's table have an effect, by the kind of law, and how two tables make one."""

from __future__ import annotations

from typing import Any, Literal

from pbem.case.schema import LawTable

Kind = Literal["bonded", "coulomb", "open", "frictionless", "custom"]

_FRICTION = ("friction", "friction_angle", "cohesion")
_WEAKENING = ("friction_dynamic", "slip_distance")
_JOINT = ("normal_stiffness", "tangential_stiffness")
# Keys of a law's table that would change nothing, by the kind of law.
WITHOUT_EFFECT: dict[Kind, tuple[str, ...]] = {
    "bonded": (*_FRICTION, "tensile_strength", "cohesion_lost", *_WEAKENING, "gap", "pressure", "file", "parameters"),
    "open": (*_FRICTION, "tensile_strength", "cohesion_lost", *_WEAKENING, *_JOINT, "file", "parameters"),
    "coulomb": ("file", "parameters"),
    "frictionless": ("file", "parameters"),
    "custom": (*_FRICTION, *_WEAKENING),
}
# Keys that say the same.
_EITHER = {"friction": "friction_angle", "friction_angle": "friction"}


def combine_laws(family: LawTable, own: LawTable) -> LawTable:
    """The law of one member of a family: that of the family, but for the keys that its own table names.

    Keys of the family that have no effect under a law that the member names for itself are left out.
    """
    fields = LawTable.model_fields
    keys: dict[str, Any] = {key: getattr(family, key) for key in fields if key in family.model_fields_set}
    named = {key: getattr(own, key) for key in fields if key in own.model_fields_set}
    if own.law is not None and "law" in named:
        smooth = (*_FRICTION, *_WEAKENING) if own.law == "frictionless" else ()
        for key in (*WITHOUT_EFFECT[own.law], *smooth):
            keys.pop(key, None)
    for key in named:
        keys.pop(_EITHER.get(key, key), None)
    return LawTable.model_construct(**{**keys, **named})
