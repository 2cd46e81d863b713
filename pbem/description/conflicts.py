"""Rules on several keys of one table, checked on the file's own tables whatever else is wrong with them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pbem.description.effects import NEEDED, OWN_KEYS
from pbem.description.finding import Finding
from pbem.description.generated_conflicts import check_generated
from pbem.description.resultant_conflicts import check_resultants
from pbem.errors import KeyPath
from pbem.wording import show

GLOBAL_KEYS = ("ux", "uy", "tx", "ty")
LOCAL_KEYS = ("un", "us", "tn", "ts", "pressure")
# Pairs of keys that both say what happens in one direction.
EXCLUSIVE = (
    ("ux", "tx"), ("uy", "ty"), ("un", "tn"), ("us", "ts"),
    ("un", "pressure"), ("us", "pressure"), ("tn", "pressure"), ("ts", "pressure"),
)
ONE_FAMILY = f"either global ({', '.join(GLOBAL_KEYS)}) or local ({', '.join(LOCAL_KEYS)}) conditions on one curve"


def find_conflicts(raw: Mapping[str, Any]) -> list[Finding]:
    """Every rule broken by keys that are each right by themselves."""
    findings: list[Finding] = []
    for loc, table in _tables(raw, ("curves",)):
        findings += _check_curve(loc, table)
    for loc, table in _tables(raw, ("regions",)):
        findings += _check_region(loc, table)
    for loc, table in _tables(raw, ("boundary",)):
        findings += _check_condition(loc, table)
    for name in ("interfaces", "contacts"):
        for loc, table in _tables(raw, (name,)):
            findings += _check_law(loc, table, _find_shared_law(raw, str(loc[-1])) if name == "interfaces" else {})
    for loc, table in _tables(raw, ("tools",)):
        findings += _check_rigid(loc, table)
    findings += check_resultants(raw)
    findings += _check_generate(raw)
    findings += _check_stages(raw)
    findings += _check_solver(raw)
    findings += _check_options(raw)
    findings += _check_passes(raw)
    for name in ("materials", "curves", "regions", "contacts", "tools", "point_loads", "point_supports"):
        findings += [_check for loc, _ in _tables(raw, (name,)) for _check in _check_name(loc, str(loc[-1]))]
    return findings


def _tables(parent: Mapping[str, Any], loc: KeyPath) -> Iterator[tuple[KeyPath, Mapping[str, Any]]]:
    """The tables of a table of tables, past anything that is none (the schema reports that)."""
    entries = parent.get(str(loc[-1]))
    if isinstance(entries, dict):
        for name, table in entries.items():
            if isinstance(table, dict):
                yield (*loc, name), table


def _check_name(loc: KeyPath, name: str) -> list[Finding]:
    if name.strip() == name and name not in ("", ".", "..") and "/" not in name and name.isprintable():
        return []
    expected = "a name of printable characters without '/' and without spaces around it"
    return [Finding(loc, f"the name {show(name)}", expected)]


# A circle's points differ from its center by so many of the center's own rounding errors at least.
ROUNDING = 1e-12


def _check_roundness(loc: KeyPath, table: Mapping[str, Any]) -> list[Finding]:
    """A radius that is lost in the rounding of the center's coordinates makes no circle."""
    center, radius = table.get("center"), table.get("radius")
    if not isinstance(center, list) or not isinstance(radius, int | float):
        return []
    if not all(isinstance(each, int | float) for each in center):
        return []
    farthest = max((abs(each) for each in center), default=0)
    if not 0 < radius < ROUNDING * min(farthest, 1e300):
        return []
    found = f"{show(radius)}, which is lost in the rounding of the center's coordinates"
    return [Finding((*loc, "radius"), found, f"more than {ROUNDING:g} of the center's coordinates")]


def _check_curve(loc: KeyPath, table: Mapping[str, Any]) -> list[Finding]:
    findings = []
    shapes = "points, or center and radius (with angles for an arc), or expression"
    given = [key for key in ("points", "center", "expression") if key in table]
    if len(given) != 1 and not (not given and ("radius" in table or "angles" in table)):
        found = "no shape" if not given else " and ".join(given)
        findings.append(Finding(loc, found, f"one shape: {shapes}"))
    elif not given or "center" in given:
        findings += [
            Finding(loc, f"no {key}", "center and radius, and angles for an arc")
            for key in ("center", "radius") if key not in table
        ]
        findings += _check_roundness(loc, table)
    else:
        findings += [
            Finding((*loc, key), f"{key} with {given[0]}", f"one shape: {shapes}")
            for key in ("radius", "angles") if key in table
        ]
    if "elements" in table and "size" in table:
        findings.append(Finding((*loc, "size"), "both elements and size", "only one of them"))
    elif "expression" in table and "elements" not in table:
        place = (*loc, "size") if "size" in table else loc
        found = "size with expression" if "size" in table else "an expression without elements"
        findings.append(Finding(place, found, "elements = a number: straight elements between points of the curve"))
    elif "elements" not in table and "size" not in table:
        findings.append(Finding(loc, "neither elements nor size", "elements = a number, or size = a length"))
    return findings + _check_shape(loc, table)


def _check_shape(loc: KeyPath, table: Mapping[str, Any]) -> list[Finding]:
    findings = []
    points, elements, angles = table.get("points"), table.get("elements"), table.get("angles")
    if isinstance(elements, list) and elements:
        if isinstance(points, list) and len(points) >= 2 and len(elements) != len(points) - 1:
            found = f"{len(elements)} numbers of elements for {len(points) - 1} legs"
            findings.append(Finding((*loc, "elements"), found, "one number for each leg, or one total"))
        if "expression" in table and len(elements) != 1:
            findings.append(Finding((*loc, "elements"), f"{len(elements)} numbers of elements", "one number"))
        if "center" in table and len(elements) != 1:
            found = f"{len(elements)} numbers of elements"
            findings.append(Finding((*loc, "elements"), found, "one number: a circle or an arc is one leg"))
    if isinstance(elements, int) and isinstance(points, list) and 0 < elements < len(points) - 1:
        found = f"{elements} elements for {len(points) - 1} legs"
        findings.append(Finding((*loc, "elements"), found, "at least one element for each leg"))
    if isinstance(angles, list) and len(angles) == 2 and all(
        type(angle) in (int, float) and abs(angle) <= 3600 for angle in angles
    ):
        sweep = abs(angles[1] - angles[0])
        if sweep == 0 or sweep > 360:
            found = f"an arc of {sweep:g} degrees"
            findings.append(Finding((*loc, "angles"), found, "two angles that differ by more than 0 and at most 360"))
    return findings


def _check_region(loc: KeyPath, table: Mapping[str, Any]) -> list[Finding]:
    if table.get("infinite") is True or table.get("boundary"):
        return []
    expected = "boundary = [...], the names of the curves around the region"
    return [Finding((*loc, "boundary") if "boundary" in table else loc, "no boundary", expected)]


def _check_condition(loc: KeyPath, table: Mapping[str, Any]) -> list[Finding]:
    findings = [
        Finding((*loc, second), f"both {first} and {second}", "one condition in one direction")
        for first, second in EXCLUSIVE if first in table and second in table
    ]
    in_axes = [key for key in GLOBAL_KEYS if key in table]
    local = [key for key in LOCAL_KEYS if key in table]
    if in_axes and local:
        findings.append(Finding((*loc, local[0]), f"{in_axes[0]} together with {local[0]}", ONE_FAMILY))
    resultants = [key for key in ("rigid", "force") if key in table]
    others = [*in_axes, *local, *(["spring"] if "spring" in table else [])]
    if resultants and (others or len(resultants) > 1):
        other = (others or resultants)[0]
        findings.append(Finding((*loc, resultants[-1]), f"{other} together with {resultants[-1]}",
                                "rigid, force, or conditions in two directions: one of them on a curve"))
    if isinstance(table.get("rigid"), dict):
        findings += _check_rigid((*loc, "rigid"), table["rigid"])
    force = table.get("force")
    if isinstance(force, dict) and "moment" in force and force.get("how", "uniform") == "uniform" and (
        loc[0] != "stages"
    ):
        findings.append(Finding((*loc, "force", "moment"), 'a moment with how = "uniform"',
                                'how = "linear", or no moment: a uniform traction has that of its force'))
    return findings + _check_spring(loc, table, in_axes)


# Pairs of keys of what is rigid that belong to one direction.
FORCE_OR_MOTION = (("fx", "ux"), ("fy", "uy"), ("moment", "rotation"))


def _check_rigid(loc: KeyPath, table: Mapping[str, Any]) -> list[Finding]:
    return [
        Finding((*loc, motion), f"both {force} and {motion}", "a force or a motion in each direction")
        for force, motion in FORCE_OR_MOTION if force in table and motion in table
    ]


def _check_spring(loc: KeyPath, table: Mapping[str, Any], in_axes: Sequence[str]) -> list[Finding]:
    """A spring acts along the normal and the curve, where nothing else says what moves."""
    spring = table.get("spring")
    if not isinstance(spring, dict):
        return []
    findings = []
    moved = [key for key in in_axes if key in ("ux", "uy")]
    if moved:
        expected = "tractions beside a spring, or un or us where it has no stiffness"
        findings.append(Finding((*loc, "spring"), f"{moved[0]} together with spring", expected))
    if all(type(value) in (int, float) and value == 0 for value in (spring.get("kn", 0), spring.get("ks", 0))):
        findings.append(Finding((*loc, "spring"), "a spring without stiffness", "kn > 0 or ks > 0"))
    for key, displacement in (("kn", "un"), ("ks", "us")):
        if displacement in table and spring.get(key):
            expected = f"only one of them; end_{key[-1]} is the displacement of the spring's far end"
            findings.append(Finding((*loc, displacement), f"both spring.{key} and {displacement}", expected))
    return findings


def _find_shared_law(raw: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """The table of the law of all pieces of a trace, or of all that a table [[generate]] makes, of which a name is one:
    its own table changes single keys of it."""
    trace, _, number = name.rpartition(".")
    table = raw["interfaces"].get(trace)
    if number.isdecimal() and isinstance(table, dict):
        return table
    group, _, number = name.rpartition("_")
    made = raw.get("generate")
    for table in made if number.isdecimal() and isinstance(made, list) else ():
        if isinstance(table, dict) and table.get("name") == group:
            return table
    return {}


def _check_law(loc: KeyPath, table: Mapping[str, Any], shared: Mapping[str, Any] | None = None) -> list[Finding]:
    """shared: the law that the table changes single keys of."""
    findings = []
    if "friction" in table and "friction_angle" in table:
        findings.append(Finding((*loc, "friction_angle"), "both friction and friction_angle", "only one of them"))
    whole = {**(shared or {}), **table}
    laws = [each.get("law") for each in (shared or {}, table)]
    if "law" in table and laws[0] != laws[1] and any(law in list(NEEDED) for law in laws):
        whole = dict(table)  # nothing of another law weakens this one
    further = whole.get("law") in list(NEEDED) or any(key in whole for keys in OWN_KEYS.values() for key in keys)
    weakens = whole.get("law") != "frictionless" and not further
    given = [key for key in ("friction_dynamic", "slip_distance") if key in table]
    if weakens and given and ("friction_dynamic" in whole) != ("slip_distance" in whole):
        findings.append(Finding((*loc, given[0]), f"only {given[0]}", "friction_dynamic and slip_distance together"))
    if table.get("law") == "frictionless":
        findings += [
            Finding((*loc, key), f"{key} = {show(table[key])} with law \"frictionless\"", 'law = "coulomb", or 0')
            for key in ("friction", "friction_angle", "cohesion", "friction_dynamic", "slip_distance")
            if table.get(key)
        ]
    return findings


def _check_generate(raw: Mapping[str, Any]) -> list[Finding]:
    tables = raw.get("generate")
    if "curves" not in raw and not tables:
        return [Finding(("curves",), "no curves", "the [table] `curves`, or a table [[generate]]")]
    if raw.get("curves") == {} and not tables:
        return [Finding(("curves",), "an empty table", "at least 1 entry, or a table [[generate]]")]
    findings: list[Finding] = []
    for number, table in enumerate(tables if isinstance(tables, list) else []):
        if isinstance(table, dict):
            loc = ("generate", number)
            findings += check_generated(loc, table) + _check_law(loc, table)
            if isinstance(table.get("name"), str):
                findings += _check_name((*loc, "name"), table["name"])
    return findings


def _check_stages(raw: Mapping[str, Any]) -> list[Finding]:
    stages = raw.get("stages")
    if not isinstance(stages, list):
        return []
    findings: list[Finding] = []
    names: dict[str, int] = {}
    for number, stage in enumerate(stages):
        if not isinstance(stage, dict):
            continue
        for loc, table in _tables(stage, ("stages", number, "boundary")):
            findings += _check_condition(loc, table)
        for loc, table in _tables(stage, ("stages", number, "tools")):
            findings += _check_rigid(loc, table)
        name = stage.get("name")
        if isinstance(name, str) and name in names:
            found = f"the name {show(name)} of stage {names[name] + 1} again"
            findings.append(Finding(("stages", number, "name"), found, "a name of its own for each stage"))
        elif isinstance(name, str):
            names[name] = number
    return findings


def _check_solver(raw: Mapping[str, Any]) -> list[Finding]:
    solver = raw.get("solver")
    if not isinstance(solver, dict) or solver.get("operator") != "hierarchical":
        return []
    linear = solver.get("linear", "auto")
    if linear not in ("lu", "mumps"):
        return []
    found = f"{show(linear)} with operator = \"hierarchical\", which stores no matrix to factor"
    return [Finding(("solver", "linear"), found, "\"auto\" or \"gmres\", or operator = \"dense\"")]


# Options of the iterations that PETSc refuses outside of these bounds, when it solves the first system: least, most,
# and whether they count something.
OPTION_BOUNDS: Mapping[str, tuple[float, float, bool]] = {
    "ksp_rtol": (0.0, 1.0, False), "ksp_atol": (0.0, math.inf, False), "ksp_divtol": (0.0, math.inf, False),
    "ksp_max_it": (0, 2**31 - 1, True), "ksp_gmres_restart": (1, 2**31 - 1, True),
}  # fmt: skip


def _check_options(raw: Mapping[str, Any]) -> list[Finding]:
    options = raw.get("petsc")
    if not isinstance(options, dict):
        return []
    findings = []
    for name, value in options.items():
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            expected = "the option's name without the leading dash, of letters, digits and _"
            findings.append(Finding(("petsc", name), f"the option {show(name)}", expected))
        elif name in OPTION_BOUNDS and isinstance(value, str | int | float):
            findings += _check_bounds(name, value)
    return findings


def _check_passes(raw: Mapping[str, Any]) -> list[Finding]:
    """Refinement to an accuracy shortens the elements that need it by itself, also at ends of contact."""
    analysis = raw.get("analysis")
    if not isinstance(analysis, dict) or "accuracy" not in analysis or analysis.get("grade_contact_ends") is not True:
        return []
    return [Finding(("analysis", "grade_contact_ends"), "true beside accuracy", "one of both")]


def _check_bounds(name: str, value: str | int | float) -> list[Finding]:
    least, most, whole = OPTION_BOUNDS[name]
    if isinstance(value, str) and value.lower().removeprefix("petsc_") in ("default", "decide"):
        return []
    try:
        number = int(str(value)) if whole else float(value)
        right = least <= number <= most and not (name == "ksp_rtol" and number == most)
    except (ValueError, OverflowError):
        right = False
    if isinstance(value, float) and not math.isfinite(value):
        return []  # the schema reports it
    if right and not isinstance(value, bool):
        return []
    kind = "whole number" if whole else "number"
    below = {"ksp_rtol": " and < 1"}.get(name, "")
    return [Finding(("petsc", name), show(value), f"a {kind} >= {least:g}{below}")]
