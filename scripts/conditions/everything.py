"""All conditions, entered by the modules that make them."""

from __future__ import annotations

from scripts.conditions import joints, misfit, planes, rest, rigid, stages, values
from scripts.conditions.trial import CONDITIONS

__all__ = ["CONDITIONS", "joints", "misfit", "planes", "rest", "rigid", "stages", "values"]
