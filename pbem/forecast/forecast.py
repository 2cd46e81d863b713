"""The forecast of a run's memory, time and disk, and what is said when there is not the memory for it.

What is stored and computed is counted (pbem.forecast.work), how fast is measured (pbem.forecast.calibration); how often
Newton's method and GMRES iterate cannot be known, and is taken as usual. scripts/study_forecast.py compares forecasts
with runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from pbem.bem.operator_choice import choose_operator
from pbem.forecast.calibration import Speed, measure_speed
from pbem.forecast.disk import count_disk
from pbem.forecast.limits import OVERRIDE, Limit
from pbem.forecast.usual import (
    BESIDE,
    SETTLING,
    STARTED,
    expect_changes,
    expect_second_changes,
    list_memory,
    list_overhead,
    list_seconds,
    measure_beside,
    measure_size,
)
from pbem.forecast.work import Work, count_work
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.end_grading import may_be_graded
from pbem.model.model import Model
from pbem.model.refinement import coarsen_model
from pbem.wording import count


@dataclass(frozen=True)
class Forecast:
    """Of a run on some ranks.

    memory: bytes of all ranks together, by what they are for; rank_memory: of the rank that has most. seconds: of wall
    time on a core for each rank, by piece; disk: bytes of the result file. passes: whether `[analysis]` asks for
    further solutions on finer meshes, which are not forecast. speed: None where it was not measured, and there are no
    seconds. cores_here: of the machine at hand, None where they were not counted.
    """

    ranks: int
    unknowns: int
    operator: str
    memory: dict[str, float]
    rank_memory: float
    seconds: dict[str, float]
    disk: float
    passes: bool
    speed: Speed | None = None
    cores_here: float | None = None

    @property
    def turns(self) -> float:
        """Ranks that share a core of the machine at hand; 1 where each has one, or may have one elsewhere."""
        return max(1.0, self.ranks / self.cores_here) if self.cores_here else 1.0

    @property
    def whole_memory(self) -> float:
        """Bytes of all ranks."""
        return sum(self.memory.values())

    def to_plain(self) -> dict[str, Any]:
        """For programs."""
        return {
            "ranks": self.ranks, "unknowns": self.unknowns, "operator": self.operator, "memory": self.whole_memory,
            "memory_by_use": self.memory, "rank_memory": self.rank_memory, "seconds": sum(self.seconds.values()),
            "cores": self.ranks, "cores_here": self.cores_here, "seconds_here": self.turns * sum(self.seconds.values()),
            "seconds_by_piece": self.seconds, "disk": self.disk, "first_pass_only": self.passes,
        }  # fmt: skip


# What a hierarchical run frees with its last step.
OPERATORS = ("operator", "preconditioner", SETTLING)


def make_forecast(
    model: Model, mesh: Mesh, ranks: int, timed: bool = True, cores: float | None = None
) -> Forecast:
    """Forecast a run on so many ranks; timed: with seconds, for which the machine's speed is measured.

    cores: that the ranks could use on the machine at hand.
    """
    size = measure_size(model, mesh.nodes)
    work = count_work(model, mesh)
    coarse = coarsen_model(model)
    second = None
    if coarse is not None:  # with the same operator, though the other one might be chosen for so few unknowns
        eased = replace(coarse.model, solver=choose_operator(model, mesh).ease(coarse.model.solver))
        second = count_work(eased, generate_mesh(eased))
    changes = expect_changes(model, mesh, work.pairs)
    settled = expect_second_changes(model, mesh, size.steps)
    memory = {"programs and libraries": STARTED * ranks, **list_memory(work, ranks, changes.part, size.steps)}
    if second is not None:
        used = list_memory(second, ranks, 0.0, size.steps)
        most = sum(each for name, each in used.items() if name not in (BESIDE, SETTLING))
        # It begins from statuses that are settled; of a run of one step it comes after the run's own storage has gone.
        gone = sum(memory.get(name, 0.0) for name in OPERATORS) if work.hierarchical and size.steps == 1 else 0.0
        memory["second solution, for the estimate"] = max(most - gone, 0.0)
    speed = measure_speed(model, mesh) if timed else None
    seconds: dict[str, float] = {}
    if speed is not None:
        seconds = list_overhead(size, speed) | list_seconds(work, size, ranks, speed, changes)
        if second is not None:
            seconds["estimate"] += sum(list_seconds(second, size, ranks, speed, settled).values())
    return Forecast(
        ranks=ranks, unknowns=work.unknowns, operator="hierarchical" if work.hierarchical else "dense",
        memory=memory, rank_memory=_find_largest(memory, ranks, work), seconds=seconds, disk=count_disk(model, mesh),
        passes=model.analysis.accuracy is not None or may_be_graded(model, work.unknowns), speed=speed,
        cores_here=cores,
    )  # fmt: skip


def _find_largest(memory: dict[str, float], ranks: int, work: Work) -> float:
    """Bytes of the rank that has most."""
    return (sum(memory.values()) - memory.get(BESIDE, 0.0)) / ranks + measure_beside(work)


# Bytes for each squared unknown of the dense operator, and for each unknown of the hierarchical one, that no run takes:
# with bodies, whose factors are those of all of them together, and without (forecasts of fields and maps of cracks at
# orders 0 to 3 on 1 to 8 ranks: up to 13e3 on the rank that has most).
MOST_DENSE, MOST_HIERARCHICAL, MOST_OF_CRACKS = 120.0, 90e3, 30e3


def exceeds_at_most(model: Model, mesh: Mesh, ranks: int, granted: float) -> bool:
    """Whether it takes a forecast to know that a rank has enough; granted: bytes for each rank."""
    unknowns = 2.0 * mesh.nodes
    hierarchical = choose_operator(model, mesh).name == "hierarchical"
    each = MOST_OF_CRACKS if mesh.crack.all() else MOST_HIERARCHICAL
    most = each * unknowns if hierarchical else MOST_DENSE * unknowns**2
    return 2 * STARTED + most > granted


def note_memory(forecast: Forecast, ranks: int, available: float | None) -> str | None:
    """What to tell when the ranks of a node need more than can be had there now; None if it is enough."""
    needed = forecast.whole_memory * ranks / forecast.ranks
    if available is None or needed <= available:
        return None
    return (f"the run will take about {needed / 1e9:.3g} GB on {count(ranks, 'rank')}, but {available / 1e9:.3g} GB "
            "can be had now: others use the rest")


def refuse_memory(forecast: Forecast, ranks: int, limits: Sequence[Limit]) -> str | None:
    """What to say when the ranks of a node need more than it grants; None if it is enough. ranks: of this node.

    limits: of the node, the least first.
    """
    needed = forecast.whole_memory * ranks / forecast.ranks
    if not limits or needed <= limits[0].bytes:
        return None
    where = count(ranks, "rank")
    where += f" of {forecast.ranks}" if ranks != forecast.ranks else ""
    least = limits[0]
    return (
        f"not enough memory: the run would take about {needed / 1e9:.3g} GB on {where}, but {least.source} grants "
        f"{least.bytes / 1e9:.3g} GB.\n  Fewer unknowns than the {forecast.unknowns}, more nodes"
        + ("" if forecast.operator == "hierarchical" else ', or solver.operator = "hierarchical"')
        + f" need less; {OVERRIDE}=1 runs it all the same"
    )
