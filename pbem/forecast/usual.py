"""What cannot be counted: constants that were measured, and how often Newton's method and GMRES iterate as a rule.

Seconds are of the machine on which pbem.forecast.calibration.LOOP_SECONDS was measured; the rates of kernels,
factorisations and products are those of the machine at hand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pbem.forecast.calibration import Speed
from pbem.forecast.work import Work
from pbem.model.model import Model

# Bytes of a process that has only started: Python and the libraries.
STARTED = 150e6
# Columns that are formed and solved for at a time (see pbem.solve.tangent), and how many copies of them there are.
AT_ONCE, COPIES = 512, 5.0
# Newton iterations of the first step of a stage and of each further one, where pairs can change their status.
FIRST, FURTHER = 5.0, 2.0
