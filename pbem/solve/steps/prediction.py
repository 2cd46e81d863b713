"""The modes that are expected of a case by the states of others, which differ from it in a few values.

Tractions and jumps of the nearest cases are continued linearly, as far as these determine that; the modes are those
that the continued state asks for. They are where a search begins, not what it ends with.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Real
from pbem.contact.laws import Memory, ModeState, PairLaws, PairState, follow_leaders
from pbem.contact.modes import update_active_set
from pbem.solve.problem.step import ContactState

# Numbers that do not add up to a place within this part of the spread of them all do not determine it.
ROUNDING = 1e-9
# What is continued from values so large against each other is worth nothing.
MOST_WEIGHT = 4.0


@dataclass(frozen=True)
class Place:
    """Where a case is among others. kind: the values that are no numbers; rank, number (k,): of those that are, their
    places among all values of their key, and the numbers."""

    kind: tuple[str, ...]
    rank: Real
    number: Real


@dataclass(frozen=True)
class History:
    """The states of a case that is finished, by stage and fraction."""

    place: Place
    states: Mapping[tuple[int, float], ContactState]

    @property
    def size(self) -> int:
        """Bytes."""
        return sum(state.mode.nbytes + 4 * state.slip.nbytes for state in self.states.values())


def weigh_histories(histories: Sequence[History], place: Place) -> list[tuple[History, float]]:
    """The nearest histories first, and by what each is multiplied so that the sum continues them to a place.

    Of the nearest ones so many as determine it; without these the nearest alone. None of another kind.
    """
    alike = [each for each in reversed(histories) if each.place.kind == place.kind]
    alike.sort(key=lambda each: float(np.linalg.norm(each.place.rank - place.rank)))
    if not alike:
        return []
    for count in range(2, min(len(alike), len(place.number) + 2) + 1):
        nearest = alike[:count]
        apart = np.array([each.place.number - place.number for each in nearest])
        spread = np.abs(apart).max(axis=0)
        rows = np.vstack([(apart / np.where(spread > 0, spread, 1.0)).T, np.ones(count)])
        wanted = np.zeros(len(rows))
        wanted[-1] = 1.0
        weight = np.linalg.lstsq(rows, wanted, rcond=None)[0]
        if np.abs(rows @ weight - wanted).max() < ROUNDING and np.abs(weight).sum() <= MOST_WEIGHT:
            return list(zip(nearest, weight.tolist(), strict=True))
    return [(alike[0], 1.0)]


def predict_modes(
    weighed: Sequence[tuple[History, float]], laws: PairLaws, stage: int, factor: float, memory: Memory, pressure: Real
) -> ModeState | None:
    """The modes at a fraction of a stage; None where the nearest history has not been there. pressure (m,): of fluid.
    """
    found = [(history.states.get((stage, factor)), weight) for history, weight in weighed]
    nearest = found[0][0] if found else None
    if nearest is None:
        return None
    modes = ModeState(nearest.mode, np.where(nearest.traction_s < 0, -1.0, 1.0))
    if len(found) == 1 or any(state is None for state, _ in found):
        return modes
    state = PairState(*(
        sum(weight * getattr(each, name) for each, weight in found)
        for name in ("traction_n", "traction_s", "opening", "slip")
    ))
    return follow_leaders(laws, update_active_set(laws, modes, state, memory, pressure).modes)
