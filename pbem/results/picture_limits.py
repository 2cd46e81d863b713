"""Ranges of values for axes and colours that a few singular values do not spoil, and what is said of those cut off."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Real

# Values at the ends of a line are left out of its axis if with them it would be so many times as long.
SPOILT = 1.8
# The parts of a line at either end that may hold singular values; and where points are so much closer than elsewhere:
# meshes are graded towards corners and junctions.
END_PART, CLOSE = 0.03, 0.2
# Of a field, the share of the area at either end of the values that may be cut off ...
CUT = 0.005
# ... if the colours would else have to reach so many times the range further.
SINGULAR, REGULAR = 0.25, 3.0


@dataclass(frozen=True)
class Limits:
    """low, high: what is shown. least, largest: what the values reach. All the same number if there is one only."""

    low: float
    high: float
    least: float
    largest: float

    @property
    def cuts_low(self) -> bool:
        return self.least < self.low

    @property
    def cuts_high(self) -> bool:
        return self.largest > self.high

    def describe_cut(self, quantity: str) -> str:
        """What lies beyond the limits; empty if nothing does."""
        ends = [print_number(value) for value, cut in ((self.least, self.cuts_low), (self.largest, self.cuts_high))
                if cut]
        return f"cut off: {quantity} reaches {' and '.join(ends)}" if ends else ""


def limit_line(place: Real, values: Real, closed: bool = False) -> Limits:
    """Limits for values (m,) along a line at `place` (m,): those at its ends, and where points are much closer than
    elsewhere, may be beyond them, others never.

    closed: the line has no ends.
    """
    there = np.isfinite(values)
    place, values = place[there], values[there]
    if not len(values):
        return Limits(0.0, 0.0, 0.0, 0.0)
    least, largest = float(values.min()), float(values.max())
    inner = values[~(find_close(place) if closed else find_ends(place) | find_close(place))]
    if len(inner) >= 4:
        # Zero belongs to what is shown, else a nearly constant value would look spoilt by its ends.
        low, high = min(float(inner.min()), 0.0), max(float(inner.max()), 0.0)
        if high > low and max(largest, 0.0) - min(least, 0.0) > SPOILT * (high - low):
            room = 0.3 * (high - low)
            return Limits(max(least, low - room), min(largest, high + room), least, largest)
    return Limits(least, largest, least, largest)


def find_ends(place: Real) -> Bool:
    """Which of the points (m,) along a line are at its ends: a small part of its length, at least one point each."""
    along = np.abs(place - place[0]) if len(place) else place
    total = along.max(initial=0.0)
    ends = (along <= END_PART * total) | (along >= (1 - END_PART) * total)
    ends[:1] = ends[-1:] = True
    return np.asarray(ends)


def find_close(place: Real) -> Bool:
    """Which of the points (m,) along a line lie much closer to their neighbours than most do."""
    if len(place) < 3:
        return np.zeros(len(place), dtype=bool)
    gaps = np.abs(np.diff(place))
    spacing = 0.5 * (np.r_[gaps[0], gaps] + np.r_[gaps, gaps[-1]])
    return np.asarray(spacing < CLOSE * np.median(spacing))


def limit_field(values: Real, weights: Real, is_singular: Callable[[int], bool]) -> Limits:
    """Limits for the colours of values (q,) that stand for areas `weights` (q,).

    A small part of the area is left out at either end if that spares much of the range, or some of it where the
    outermost value is a singular one; is_singular: tells so of the number of a value.
    """
    there = np.flatnonzero(np.isfinite(values))
    if not len(there):
        return Limits(0.0, 0.0, 0.0, 0.0)
    order = there[np.argsort(values[there])]
    share = np.cumsum(weights[order])
    share = (share - 0.5 * weights[order]) / max(float(share[-1]), 1e-300)
    low, high = (float(each) for each in np.interp([CUT, 1 - CUT], share, values[order]))
    least, largest = float(values[order[0]]), float(values[order[-1]])
    span = high - low
    if low - least <= (SINGULAR if is_singular(int(order[0])) else REGULAR) * span or span <= 0:
        low = least
    if largest - high <= (SINGULAR if is_singular(int(order[-1])) else REGULAR) * span or span <= 0:
        high = largest
    return Limits(low, high, least, largest)


def widen(limits: Limits, share: float = 0.05) -> tuple[float, float]:
    """The ends of an axis with some room beyond what is shown, also of a single value."""
    span = limits.high - limits.low
    scale = max(abs(limits.low), abs(limits.high))
    if span <= 1e-9 * scale:
        room = 0.5 * scale if scale else 1.0
        return limits.low - room, limits.high + room
    return limits.low - share * span, limits.high + share * span


def print_number(value: float, digits: int = 3) -> str:
    """A number for a picture: with a power of ten if it is large or small, and a minus sign as long as others."""
    if not math.isfinite(value):
        return str(value)
    if value == 0 or 1e-3 <= abs(value) < 1e5:
        text = f"{value:.{digits}g}"
        text = f"{value:.0f}" if "e" in text else text
    else:
        mantissa, power = f"{value:.{digits - 1}e}".split("e")
        mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        text = rf"{mantissa}$\times$10$^{{{int(power)}}}$"
    return text.replace("-", "\N{MINUS SIGN}", 1) if value < 0 else text


def join_sentences(sentences: Sequence[str]) -> str:
    """Those that say something, one after the other."""
    return "; ".join(each for each in sentences if each)
