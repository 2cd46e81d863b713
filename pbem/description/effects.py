"""Which keys of a law's table have an effect, by the kind of law, and how two tables make one."""

from __future__ import annotations

from typing import Any, Literal

from pbem.description.schema import LawTable

Kind = Literal["bonded", "coulomb", "open", "frictionless", "rate_and_state", "cohesive", "barton_bandis", "custom"]

_FRICTION = ("friction", "friction_angle", "cohesion")
_STRENGTH = (*_FRICTION, "tensile_strength")
_WEAKENING = ("friction_dynamic", "slip_distance")
_DILATION = ("dilation_angle", "dilation_slip")
_JOINT = ("normal_stiffness", "tangential_stiffness")
_FILE = ("file", "parameters")
# Keys of further laws that all have to be there, friction as `friction` or `friction_angle`; and those that need not.
NEEDED: dict[Kind, tuple[str, ...]] = {
    "rate_and_state": ("friction", "rate_effect", "state_effect", "reference_rate", "slip_distance"),
    "cohesive": ("tensile_strength", "fracture_energy"),
    "barton_bandis": ("residual_friction_angle", "jrc", "jcs"),
}
OPTIONAL: dict[Kind, tuple[str, ...]] = {
    "rate_and_state": ("initial_state",),
    "cohesive": ("cohesion", "fracture_energy_shear", "softening", "friction"),
    "barton_bandis": ("closure", "dilation_part", "peak_slip"),
}
# The laws that depend on time.
TIMED: tuple[Kind, ...] = ("rate_and_state",)
# Of these the keys that no other law has.
OWN_KEYS: dict[Kind, tuple[str, ...]] = {
    kind: tuple(key for key in (*NEEDED[kind], *OPTIONAL[kind]) if key not in (*_STRENGTH, *_WEAKENING))
    for kind in NEEDED
}
_FURTHER = tuple(key for keys in OWN_KEYS.values() for key in keys)
_COHESIVE, _ROUGH = OWN_KEYS["cohesive"], OWN_KEYS["barton_bandis"]
# Keys of a law's table that would change nothing, by the kind of law.
WITHOUT_EFFECT: dict[Kind, tuple[str, ...]] = {
    "bonded": (*_FRICTION, "tensile_strength", "cohesion_lost", *_WEAKENING, *_DILATION, "gap", "pressure", *_FILE,
               *_FURTHER),
    "open": (*_FRICTION, "tensile_strength", "cohesion_lost", *_WEAKENING, *_DILATION, *_JOINT, *_FILE, *_FURTHER),
    "coulomb": (*_FILE, *_FURTHER),
    "frictionless": (*_FRICTION, *_WEAKENING, *_DILATION, *_FILE, *_FURTHER),
    "rate_and_state": (
        "cohesion", "tensile_strength", "cohesion_lost", "friction_dynamic", *_DILATION, *_FILE, *_COHESIVE, *_ROUGH,
    ),
    "cohesive": ("cohesion_lost", *_WEAKENING, *_DILATION, "gap", *_FILE, *OWN_KEYS["rate_and_state"], *_ROUGH),
    "barton_bandis": (
        *_STRENGTH, "cohesion_lost", *_WEAKENING, *_DILATION, *_FILE, *OWN_KEYS["rate_and_state"], *_COHESIVE,
    ),
    "custom": (*_FRICTION, *_WEAKENING, *_DILATION, *_FURTHER),
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
        for key in WITHOUT_EFFECT[own.law]:
            keys.pop(key, None)
        if own.law != family.law and (own.law in NEEDED or family.law in NEEDED):
            keys.pop("slip_distance", None)  # of another law it is another one
    for key in named:
        keys.pop(_EITHER.get(key, key), None)
    return LawTable.model_construct(**{**keys, **named})
