"""The forecast of a run's memory, time and disk, and what is said when there is not the memory for it.

What is stored and computed is counted (pbem.forecast.work), how fast is measured (pbem.forecast.calibration); how often
Newton's method and GMRES iterate cannot be known, and is taken as usual. scripts/study_forecast.py compares forecasts
with runs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pbem.errors import PbemError
from pbem.forecast.calibration import Speed, measure_speed
from pbem.forecast.disk import count_disk
from pbem.forecast.limits import OVERRIDE, Limit
from pbem.forecast.work import Work, count_work
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.model.refinement import coarsen_model
from pbem.forecast.usual import Usual, USUAL


@dataclass(frozen=True)
class Forecast:
    """Of a run on some ranks.

    memory: bytes of all ranks together, by what they are for; rank_memory: of the rank that has most. seconds: of wall
    time on a core for each rank, by piece; disk: bytes of the result file. passes: whether `analysis.accuracy` asks for
    further solutions on finer meshes, which are not forecast. speed: None where it was not measured, and there are no
    seconds.
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

    @property
    def whole_memory(self) -> float:
        """Bytes of all ranks."""
        return sum(self.memory.values())

    def to_plain(self) -> dict[str, Any]:
        """For programs."""
        return {
            "ranks": self.ranks, "unknowns": self.unknowns, "operator": self.operator, "memory": self.whole_memory,
            "memory_by_use": self.memory, "rank_memory": self.rank_memory, "seconds": sum(self.seconds.values()),
            "seconds_by_piece": self.seconds, "disk": self.disk, "first_pass_only": self.passes,
        }  # fmt: skip
