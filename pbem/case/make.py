"""Case files of random cracks or inclusions, as `pbem make` writes them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pbem.case.case import Case, parse_case
from pbem.description.schema import CurveTable
from pbem.wording import show

Value = float | int | str | Sequence[float]


@dataclass(frozen=True)
class Plan:
    """What a made case file says. Stresses, moduli and lengths in any consistent units.

    table: keys of the table [[generate]] but region and box, the law's among them. host, filling: keys of the
    materials, none for cracks. remote: sxx, syy, sxy far away; of a plate, sxx and syy on its right and upper side.
    plate: side of a square plate around what is generated, with so many elements on each side; None: an infinite plane.
    """

    title: str
    table: Mapping[str, Value]
    host: Mapping[str, Value]
    filling: Mapping[str, Value]
    remote: tuple[float, float, float]
    order: int
    steps: int
    plate: float | None = None
    plate_elements: int = 20
    command: str = ""
    law: Mapping[str, Value] = field(default_factory=dict)


def make_case(plan: Plan, explicit: bool) -> str:
    """The text of a case file, which has been read, and its places found.

    explicit: whether every crack or inclusion is written as a curve of its own, or one table stands for them all.
    Raises CaseError with the faults of the plan: of its numbers, or that there is no room for so many.
    """
    compact = _write(plan, _write_table(plan), (), ())
    case = parse_case(compact, "the case to be made")
    if explicit:
        return _write(plan, _write_regions(plan, case), _write_curves(case), _write_laws(plan, case))
    return compact


def _write(plan: Plan, last: Sequence[str], curves: Sequence[str], laws: Sequence[str]) -> str:
    what = "cracks" if plan.table["kind"] == "cracks" else "inclusions"
    lines = [
        f"# {plan.table['count']} random {what}, made by:",
        f"#   {plan.command}",
        "# Any consistent units; angles in degrees; compression is negative.",
        f"title = {show(plan.title)}",
        "",
        *_write_material("host", plan.host),
        *(_write_material("filling", plan.filling) if plan.filling else []),
    ]
    sides = _write_sides(plan)
    if sides or curves:
        lines += ["[curves]", *sides, *curves, ""]
    if not curves:
        lines += [*_write_host(plan, ()), ""]
    lines += [*last, "", *laws, *_write_loads(plan), "[analysis]", f"order = {plan.order}"]
    lines += [f"steps = {plan.steps}                     # the load grows in proportion"]
    return "\n".join(lines) + "\n"


def _write_material(name: str, keys: Mapping[str, Value]) -> list[str]:
    return [f"[materials.{name}]", *_write_keys(keys), ""]


def _write_keys(keys: Mapping[str, Value]) -> list[str]:
    return [f"{key} = {_write_value(value)}" for key, value in keys.items()]


def _write_value(value: Value) -> str:
    """A text in quotes, a number so that it is read back as it is."""
    if isinstance(value, str):
        return show(value)
    if isinstance(value, int | float):
        return repr(value)
    return "[" + ", ".join(repr(each) for each in value) + "]"


def _write_sides(plan: Plan) -> list[str]:
    if plan.plate is None:
        return []
    a, n = repr(float(plan.plate)), plan.plate_elements
    return [
        f"bottom = {{ points = [[0, 0], [{a}, 0]], elements = {n} }}",
        f"right  = {{ points = [[{a}, 0], [{a}, {a}]], elements = {n} }}",
        f"top    = {{ points = [[{a}, {a}], [0, {a}]], elements = {n} }}",
        f"left   = {{ points = [[0, {a}], [0, 0]], elements = {n} }}",
    ]


def _write_host(plan: Plan, names: Sequence[str]) -> list[str]:
    """The region around; names: of the curves in it that the file lists."""
    cracks = names if plan.table["kind"] == "cracks" else ()
    bounds = [] if plan.plate is None else ["bottom", "right", "top", "left"]
    bounds += () if cracks else names
    lines = ["[regions.host]", 'material = "host"']
    if plan.plate is None:
        lines.append("infinite = true             # the whole plane")
    lines += _write_list("boundary", bounds) + _write_list("cracks", cracks)
    return lines


def _write_list(key: str, names: Sequence[str]) -> list[str]:
    if not names:
        return []
    rows = [", ".join(f'"{name}"' for name in names[first : first + 8]) for first in range(0, len(names), 8)]
    return [f"{key} = [{rows[0]}]"] if len(rows) == 1 else [f"{key} = [", *(f"    {row}," for row in rows), "]"]


_COMMENTS = {
    "name": "curves {name}_1, {name}_2, ...",
    "density": "number per unit area: the centres lie in the area that follows",
    "fraction": "part of the area that they take: the centres lie in the area that follows",
    "distance": "least distance of any two",
    "elements": "on each",
    "seed": "the same seed gives the same places everywhere",
}


def _write_table(plan: Plan) -> list[str]:
    lines = ["[[generate]]                # random, the same for the same keys"]
    keys: dict[str, Value] = {**plan.table, "region": "host"}
    if plan.plate is not None:
        keys["box"] = (0.0, 0.0, float(plan.plate), float(plan.plate))
    for key, value in {**keys, **plan.law}.items():
        comment = _COMMENTS.get(key, "").format(name=plan.table["name"])
        text = f"{key} = {_write_value(value)}"
        lines.append(f"{text:27s} # {comment}" if comment else text)
    return lines


def _write_curves(case: Case) -> list[str]:
    return [f"{name} = {{ {_write_shape(case.curves[name])} }}" for name in case.groups[0].members]


def _write_shape(curve: CurveTable) -> str:
    if curve.points is not None:
        keys = "points = [" + ", ".join(_write_value(point) for point in curve.points) + "]"
    else:
        assert curve.center is not None and curve.radius is not None
        keys = f"center = {_write_value(curve.center)}, radius = {curve.radius!r}"
    return f"{keys}, elements = {curve.elements}"


def _write_regions(plan: Plan, case: Case) -> list[str]:
    members = case.groups[0].members
    lines = _write_host(plan, members)
    if case.groups[0].kind == "inclusions":
        for name in members:
            lines += ["", f"[regions.{name}]", 'material = "filling"', f'boundary = ["{name}"]']
    return lines


def _write_laws(plan: Plan, case: Case) -> list[str]:
    law = ", ".join(_write_keys(plan.law))
    return ["[interfaces]", *(f"{name} = {{ {law} }}" for name in case.groups[0].members), ""] if law else []


def _write_loads(plan: Plan) -> list[str]:
    sxx, syy, sxy = plan.remote
    if plan.plate is None:
        comment = "                    # stress far away"
        return [f"[remote]{comment}", f"sxx = {sxx!r}", f"syy = {syy!r}", f"sxy = {sxy!r}", ""]
    return [
        "[boundary]                  # the lower and the left side slide on walls",
        "bottom = { uy = 0.0 }",
        "left   = { ux = 0.0 }",
        f"right  = {{ tx = {sxx!r} }}",
        f"top    = {{ ty = {syy!r} }}",
        "",
    ]
