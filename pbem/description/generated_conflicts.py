"""Rules on several keys of a table [[generate]]."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pbem.description.finding import Finding
from pbem.errors import KeyPath
from pbem.wording import show

_AREAS = ("density", "fraction", "box")
# What only the other kind has.
_FOREIGN: Mapping[str, tuple[str, ...]] = {
    "cracks": ("radius", "material", "fraction"),
    "inclusions": ("half_length", "orientation", "orientation_spread"),
}
_SIZE: Mapping[str, str] = {"cracks": "half_length", "inclusions": "radius"}


def check_generated(loc: KeyPath, table: Mapping[str, Any]) -> list[Finding]:
    """Every rule broken by keys that are each right by themselves."""
    kind = table.get("kind")
    findings = [*_check_area(loc, table), *_check_distribution(loc, table)]
    if kind not in ("cracks", "inclusions"):
        return findings
    findings += [
        Finding((*loc, key), f'{key} with kind = "{kind}"', f"no such key, which {kind} do not have")
        for key in _FOREIGN[kind] if key in table
    ]
    size = _SIZE[kind]
    if size not in table:
        findings.append(Finding(loc, f"{kind} without {size}", f"{size} = a length"))
    if kind == "inclusions" and "material" not in table:
        findings.append(Finding(loc, "inclusions without material", "material = the name of a material"))
    if "orientation_spread" in table and "orientation" not in table and kind == "cracks":
        expected = "orientation = an angle, about which they are spread"
        findings.append(Finding((*loc, "orientation_spread"), "orientation_spread without orientation", expected))
    return findings


def _check_area(loc: KeyPath, table: Mapping[str, Any]) -> list[Finding]:
    given = [key for key in _AREAS if key in table]
    expected = "one of density, fraction (of inclusions) and box"
    if not given:
        return [Finding(loc, "neither density nor box", expected)]
    findings = [Finding((*loc, key), f"{key} together with {given[0]}", expected) for key in given[1:]]
    if given == ["box"]:
        findings += [
            Finding((*loc, key), f"{key} together with box", "the area is the box")
            for key in ("shape", "center") if key in table
        ]
        box = table["box"]
        if isinstance(box, list) and len(box) == 4 and all(type(value) in (int, float) for value in box) and (
            box[0] == box[2] or box[1] == box[3]
        ):
            findings.append(Finding((*loc, "box"), f"a box without area, {show(box)}", "two opposite corners"))
    return findings


def _check_distribution(loc: KeyPath, table: Mapping[str, Any]) -> list[Finding]:
    findings = []
    distribution = table.get("distribution", "uniform")
    spread, power = table.get("spread"), distribution == "power"
    for key in ("exponent", "largest"):
        if power and key not in table:
            expected = "exponent and largest: the number decreases as size^-exponent up to the largest size"
            findings.append(Finding(loc, f'distribution = "power" without {key}', expected))
        elif not power and key in table and distribution in ("uniform", "lognormal"):
            expected = 'distribution = "power" with it, or no such key'
            findings.append(Finding((*loc, key), f'{key} with distribution = "{distribution}"', expected))
    if power and "spread" in table:
        expected = "exponent and largest in its place"
        findings.append(Finding((*loc, "spread"), 'spread with distribution = "power"', expected))
    if distribution == "uniform" and isinstance(spread, int | float) and spread >= 1:
        findings.append(Finding((*loc, "spread"), show(spread), "a number below 1: sizes are size (1 +- spread)"))
    least, largest = table.get(_SIZE.get(str(table.get("kind")), "")), table.get("largest")
    if power and isinstance(least, int | float) and isinstance(largest, int | float) and not largest > least > 0:
        expected = f"a size above the least one, {show(least)}"
        findings.append(Finding((*loc, "largest"), show(largest), expected))
    return findings
