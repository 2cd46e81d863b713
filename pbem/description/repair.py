"""A wrong file made harmless, so that what is right in it can still be checked."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any

from pbem.description.effects import NEEDED, OWN_KEYS
from pbem.description.finding import Finding
from pbem.description.translation import known_keys
from pbem.errors import KeyPath

# Values that stand in for wrong ones in a draft.
_STAND_INS: Mapping[str, float] = {"young": 1.0, "poisson": 0.25}
# Those of laws with keys of their own; without one of these they cannot be.
_LAW_STAND_IN = 1.0
# Keys of a law, and those that say how it weakens.
_WEAKENED: Mapping[str, tuple[str, ...]] = {
    "friction": ("friction_dynamic", "slip_distance"), "friction_angle": ("friction_dynamic", "slip_distance"),
    "friction_dynamic": ("slip_distance",), "slip_distance": ("friction_dynamic",),
    "cohesion": ("cohesion_lost",), "tensile_strength": ("cohesion_lost",),
}


def repair(raw: Mapping[str, Any], findings: list[Finding]) -> dict[str, Any] | None:
    """The file's tables with every wrong value left out or replaced; None if the rest cannot be judged without it."""
    patched = copy.deepcopy(dict(raw))
    return patched if all([_patch(patched, finding.loc) for finding in findings]) else None


def _patch(raw: dict[str, Any], loc: KeyPath) -> bool:
    """Take the wrong value out; False if the rest cannot be judged without it."""
    if not loc or loc in (("materials",), ("curves",), ("regions",)) or loc[0] == "generate":
        return False
    table, key = str(loc[0]), str(loc[2]) if len(loc) > 2 else ""
    known = known_keys(loc[:2])
    entry = raw[table].get(loc[1]) if len(loc) > 1 and isinstance(raw.get(table), dict) else None
    if table in ("materials", "contacts") and len(loc) == 2 and isinstance(entry, dict):
        return True  # its name is wrong, and is what others know it by
    if table in ("materials", "interfaces", "contacts") and not isinstance(entry, dict):
        return _delete(raw, loc)
    if table in ("curves", "regions") and len(loc) < 3:
        return _patch_elements(raw, loc) if table == "curves" else False
    if table == "regions" and key in known:
        return False
    if table == "curves" and key in ("points", "center", "radius", "angles", "expression"):
        return False
    if table == "curves" and key in ("elements", "size"):
        return _patch_elements(raw, loc[:2])
    if table == "materials" and key in _STAND_INS:
        raw["materials"][loc[1]][key] = _STAND_INS[key]
        return True
    if table == "materials" and key == "density":
        raw.pop("gravity", None)  # what weighs on what is unknown
        for stage in raw.get("stages", ()):
            stage.pop("gravity", None)
    if table in ("point_supports", "point_loads") and key in known and key != "at" and isinstance(entry, dict):
        entry[key] = 0.0  # there is one, whatever it is
        return True
    if table == "stages" and key == "duration":
        raw["stages"][loc[1]][key] = _LAW_STAND_IN
        return True
    if table in ("interfaces", "contacts") and key == "law":
        own = next((kind for kind, keys in OWN_KEYS.items() if set(keys) & set(raw[table][loc[1]])), None)
        raw[table][loc[1]][key] = own or "coulomb"  # the law that all other keys go with
        for needed in NEEDED[own] if own else ():
            raw[table][loc[1]].setdefault(needed, _LAW_STAND_IN)
        return True
    if table in ("interfaces", "contacts") and raw[table][loc[1]].get("law") in list(NEEDED):
        law, key = raw[table][loc[1]], "friction" if key == "friction_angle" else key
        if key not in known:  # it may be one of them
            for needed in NEEDED[law["law"]]:
                law.setdefault(needed, _LAW_STAND_IN)
        if key in NEEDED[law["law"]] or (key == "normal_stiffness" and "closure" in law):
            if key == "friction":
                law.pop("friction_angle", None)
            law[key] = _LAW_STAND_IN
            return True
    if table in ("interfaces", "contacts") and key in ("file", "parameters"):
        raw[table][loc[1]]["law"] = "coulomb"
        _delete(raw, (*loc[:2], "file"))
        _delete(raw, (*loc[:2], "parameters"))
    if table in ("interfaces", "contacts") and key in _WEAKENED:
        for weakening in _WEAKENED[key]:  # nothing is known of what it weakens
            _delete(raw, (*loc[:2], weakening))
    return _delete(raw, loc)


def _patch_elements(raw: dict[str, Any], loc: KeyPath) -> bool:
    """Any sufficient number of elements: topology does not depend on it."""
    curve = raw["curves"].get(loc[1])
    if not isinstance(curve, dict) or len({"points", "center", "expression"} & set(curve)) != 1:
        return False
    if "center" in curve and "radius" not in curve:
        return False
    curve.pop("size", None)
    points = curve.get("points")
    curve["elements"] = 64 + (len(points) if isinstance(points, list) else 0)
    return True


def _delete(raw: dict[str, Any], loc: KeyPath) -> bool:
    """Remove the key, or the list around a list's entry."""
    while isinstance(loc[-1], int) and len(loc) > 1:
        loc = loc[:-1]
    parent: Any = raw
    for part in loc[:-1]:
        try:
            parent = parent[part]
        except (KeyError, IndexError, TypeError):
            return True
    if isinstance(parent, dict):
        parent.pop(str(loc[-1]), None)
    return True
