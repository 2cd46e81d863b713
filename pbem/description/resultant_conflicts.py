"""Forces that no value is given for, on curves and at points, and resultants of several curves at once, checked on the
file's own tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from pbem.description.families import find_families
from pbem.description.finding import Finding
from pbem.errors import KeyPath
from pbem.wording import list_names

# What all of a rigid motion is given by.
MOTIONS = ("ux", "uy", "rotation")
# What a table of a force says besides its values.
BESIDES = {"about", "how", "at"}


def check_resultants(raw: Mapping[str, Any]) -> list[Finding]:
    """A fault for every force, on a curve or at a point, without a value in its table and in all stages; for a point
    that nothing is about; and for a resultant by the name of a line, which is several curves."""
    findings = [*_check_lines(raw)]
    told = {finding.loc for finding in findings}
    for loc, table in _list_forces(raw):
        if loc in told:
            continue
        uniform = table.get("how", "uniform") == "uniform"
        point = loc[0] == "point_loads"
        if not any(set(each) - BESIDES for each in (table, *_list_changes(raw, loc))):
            found = "a point load without values" if point else "a force without values"
            keys = "fx or fy" if uniform and not point else "fx, fy or moment"
            findings.append(Finding(loc, found, f"{keys}, here or in a stage"))
        elif uniform and not point and "about" in table and "moment" not in table:
            findings.append(Finding((*loc, "about"), 'a point of the moment with how = "uniform"', 'how = "linear", or '
                                    "no such point: a uniform traction has the moment of its force"))
    return findings


def _check_lines(raw: Mapping[str, Any]) -> Iterator[Finding]:
    """Conditions by the name of a line hold for each of its curves, which would have the whole of a force each, or move
    by itself."""
    stages = raw.get("stages")
    tables: list[tuple[KeyPath, Mapping[str, Any]]] = [(("boundary",), _read(raw, "boundary"))]
    tables += [(("stages", number, "boundary"), _read(stage, "boundary"))
               for number, stage in enumerate(stages if isinstance(stages, list) else [])]
    for loc, conditions in tables:
        wanted = [name for name, table in conditions.items() if isinstance(table, dict)
                  and any(key in table for key in ("force", "rigid"))]
        for name, curves in find_families(wanted, _read(raw, "curves")).items():
            for key in ("force", "rigid") if len(curves) > 1 else ():
                if key in conditions[name]:
                    quoted = [f"'{curve}'" for curve in curves]
                    expected = _expect_motion(raw, name, quoted) if key == "rigid" else (
                        f"a force on each of {list_names(quoted)}, or tractions (tx, ty), which are per area")
                    if expected:
                        found = f"{key} on '{name}', a line of {len(curves)} curves"
                        yield Finding((*loc, name, key), found, expected)


def _expect_motion(raw: Mapping[str, Any], name: str, quoted: list[str]) -> str:
    """What is expected in the place of `rigid` on a line; nothing if all of its curves have one motion, which is given.
    """
    base = _read(_read(_read(raw, "boundary"), name), "rigid")
    tables = [base, *_list_changes(raw, ("boundary", name, "rigid"))]
    given = {key for table in tables for key in table} - {"about"}
    if given != set(MOTIONS):
        return f"rigid on {quoted[0]}, which has the others in its key `curves`"
    turned = any(table.get("rotation", 0) != 0 for table in tables)
    return "about = [x, y], about which all of them turn: each one would about its own middle" if (
        turned and "about" not in base) else ""


def _list_forces(raw: Mapping[str, Any]) -> Iterator[tuple[KeyPath, Mapping[str, Any]]]:
    """The tables of forces on curves and at points, past anything that is none (the schema reports that)."""
    for name, table in _read(raw, "boundary").items():
        if isinstance(table, dict) and isinstance(table.get("force"), dict):
            yield ("boundary", name, "force"), table["force"]
    for name, table in _read(raw, "point_loads").items():
        if isinstance(table, dict):
            yield ("point_loads", name), table


def _list_changes(raw: Mapping[str, Any], loc: KeyPath) -> Iterator[Mapping[str, Any]]:
    """What the stages say of a table."""
    stages = raw.get("stages")
    for stage in stages if isinstance(stages, list) else []:
        table = stage
        for key in loc:
            table = _read(table, str(key))
        yield table


def _read(table: Any, key: str) -> Mapping[str, Any]:
    found = table.get(key) if isinstance(table, dict) else None
    return found if isinstance(found, dict) else {}
