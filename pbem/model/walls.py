"""Walls: interfaces one of whose regions a stage has taken away, and what acts on the other one from then on."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from pbem.description.case import Case
from pbem.description.schema import StageConditionTable
from pbem.errors import Fault, KeyPath
from pbem.model.given import read_value
from pbem.model.varying import Value

Frame = Literal["global", "local"]
# Key to frame and direction.
KEYS: Mapping[str, tuple[Frame, int]] = {
    "tx": ("global", 0), "ty": ("global", 1), "tn": ("local", 0), "ts": ("local", 1),
}  # fmt: skip


@dataclass(frozen=True)
class Wall:
    """Tractions on the region that is left: along x and y (global), or along its outward normal and the normal turned
    by +90 degrees (local)."""

    frame: Frame
    values: tuple[Value, Value] = (0.0, 0.0)


def check_wall(case: Case, number: int, name: str) -> Iterator[Fault]:
    """What a stage says of a wall and cannot: other than a pressure or tractions, or along other axes than before."""
    loc: KeyPath = ("stages", number, "boundary", name)
    given = _list_given(case.stages[number].boundary[name])
    # Values that are none themselves are told elsewhere, and are not among these.
    if given != {"pressure"} and not (given <= {"tn", "ts"} or given <= {"tx", "ty"}):
        found = f"conditions on '{name}', where a region is gone"
        yield Fault.at(loc, found, "a pressure alone, or tractions tn and ts or tx and ty, and nothing else")
        return
    before = {frame for stage in case.stages[:number] if name in stage.boundary
              for frame in _list_frames(stage.boundary[name])}
    own = set(_list_frames(case.stages[number].boundary[name]))
    if own and before - own:
        yield Fault.at(loc, f"tractions on '{name}' along other axes than in a stage before",
                       "tn and ts in all stages, or tx and ty in all")


def _list_given(table: StageConditionTable) -> set[str]:
    return {key for key in table.model_fields_set if getattr(table, key) is not None}


def _list_frames(table: StageConditionTable) -> list[Frame]:
    return [KEYS[key][0] for key in _list_given(table) if key in KEYS]


def update_wall(walls: dict[str, Wall], name: str, table: StageConditionTable) -> None:
    """Take over what a stage says; a pressure takes the place of tractions."""
    if table.pressure is not None:
        if name in walls:
            walls[name] = Wall(walls[name].frame)
        return
    for key, (frame, direction) in KEYS.items():
        if getattr(table, key) is not None:
            first, second = walls.get(name, Wall(frame)).values
            value = read_value((), getattr(table, key), timed=True)[0] or 0.0
            walls[name] = Wall(frame, (value, second) if direction == 0 else (first, value))
