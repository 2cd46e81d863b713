"""Arrays that take little room on every rank: their values are formed for the places that are asked for."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.typing import NDArray

from pbem.arrays import Bool, Integer

Scalar = TypeVar("Scalar", bound=np.generic)

# Smaller arrays are stored as they are: forming takes time, and there it saves little.
LARGE = 50_000
# Values that are formed, and compared, at a time.
FORMED = 8192
# Runs are kept in place of values if they take this part of their room at most.
WORTH = 0.25


class FormedArray(NDArrayOperatorsMixin):
    """An array (n,) of one axis that cannot be written to; in place of its values it has what forms them.

    With an index it forms the values there alone. All else that arrays do it does as a whole array, made for that
    moment: let what is asked for often be asked for by an index.
    """

    def __init__(self, form: Callable[[Integer], NDArray[Any]], count: int, dtype: np.dtype[Any]) -> None:
        """form: values (k,) of that type at places (k,), which are from 0 to count - 1."""
        self._form, self._count, self._dtype = form, count, dtype
        self._held = getattr(form, "__self__", None)  # for those who count what is held

    @property
    def shape(self) -> tuple[int, ...]:
        return (self._count,)

    @property
    def dtype(self) -> np.dtype[Any]:
        return self._dtype

    @property
    def ndim(self) -> int:
        return 1

    @property
    def size(self) -> int:
        return self._count

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Any]:
        return iter(np.asarray(self))

    def __getitem__(self, key: Any) -> Any:
        if isinstance(key, slice):
            chosen = range(self._count)[key]
            return self._form(np.arange(chosen.start, chosen.stop, chosen.step))
        if isinstance(key, np.ndarray | FormedArray) and key.dtype.kind in "iu":
            return self._take_places(np.asarray(key, dtype=np.int64))
        if isinstance(key, np.ndarray) and key.dtype == bool and key.shape == self.shape:
            return self._form(np.flatnonzero(key))
        if isinstance(key, int | np.integer) and not isinstance(key, bool):
            return self._take_places(np.array([operator.index(key)]))[0]
        return np.asarray(self)[key]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        whole = self._form(np.arange(self._count)) if self._count <= FORMED else self._form_parts()
        return whole if dtype is None else whole.astype(dtype, copy=False)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **named: Any) -> Any:
        written = inputs[:1] if method == "at" else named.get("out", ())
        if any(isinstance(each, FormedArray) for each in written):
            raise TypeError("a FormedArray cannot be written to")
        return getattr(ufunc, method)(*(
            np.asarray(each) if isinstance(each, FormedArray) else each for each in inputs), **named)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):  # of copies and pickles, which have nothing at first
            raise AttributeError(name)
        whole = np.asarray(self)
        whole.flags.writeable = False  # what is written to it would be lost
        return getattr(whole, name)

    def __repr__(self) -> str:
        return f"FormedArray({self._count} values, {self._dtype})"

    def _take_places(self, places: Integer) -> NDArray[Any]:
        """Values at places of any shape; those below zero count from the end."""
        if places.size and not -self._count <= places.min() <= places.max() < self._count:
            raise IndexError(f"places from {places.min()} to {places.max()} in an array of {self._count}")
        if places.size and places.min() < 0:
            places = np.where(places < 0, places + self._count, places)
        return self._form(places.ravel()).reshape(places.shape)[()]

    def _form_parts(self) -> NDArray[Any]:
        whole = np.empty(self._count, dtype=self._dtype)
        for begin in range(0, self._count, FORMED):
            part = np.arange(begin, min(begin + FORMED, self._count))
            whole[part[0] : part[-1] + 1] = self._form(part)
        return whole


def is_large(count: int) -> bool:
    """Whether arrays of so many values are worth to be formed."""
    return count >= LARGE


@dataclass(frozen=True)
class _Except:
    """Values (k,) that are stored, of places (k,) that rise; `others` forms those of all others."""

    place: Integer
    value: NDArray[Any]
    others: Callable[[Integer], NDArray[Any]]

    def form(self, places: Integer) -> NDArray[Any]:
        """Values (p,) at places (p,)."""
        found = self.others(places)
        at = np.minimum(np.searchsorted(self.place, places), len(self.place) - 1)
        stored = self.place[at] == places
        found[stored] = self.value[at[stored]]
        return found


def form_values(
    values: NDArray[Scalar], form: Callable[[Integer], NDArray[Any]], stored: Bool | None = None
) -> NDArray[Scalar]:
    """Large arrays (n,) whose values are formed when they are asked for; as they are if any would be another one.

    form: see FormedArray; it must form the same value of a place whatever other places it is asked for with it. Where
    it does not (stored, (n,)), the values are stored.
    """
    if not (is_large(len(values)) and isinstance(values, np.ndarray) and any(values.strides)):
        return values  # uniform ones take no room as they are
    if stored is not None and stored.any():
        place = np.flatnonzero(stored)
        if len(place) > WORTH * len(values):
            return values
        form = _Except(place, values[place], form).form
    for begin in range(0, len(values), FORMED):
        part = np.arange(begin, min(begin + FORMED, len(values)))
        found, there = np.asarray(form(part)), values[part[0] : part[-1] + 1]
        # By bits: numbers that are equal can differ in the sign of zero.
        if found.dtype != there.dtype or found.tobytes() != there.tobytes():
            return values
    return FormedArray(form, len(values), values.dtype)  # type: ignore[return-value]


@dataclass(frozen=True)
class _Runs:
    """Values that are equal, or rise or fall by one each, from a beginning (r,) to the next.

    value (r,): the first ones. step (r,): from each value to the next; None if all
    runs are of equal values.
    """

    begin: Integer
    value: NDArray[Any]
    step: Integer | None

    def form(self, places: Integer) -> NDArray[Any]:
        """Values (k,) at places (k,)."""
        if len(self.begin) == 1 and self.step is not None:
            return np.asarray(self.value[0] + self.step[0] * places)
        run = np.searchsorted(self.begin, places, side="right") - 1
        value: NDArray[Any] = self.value[run]
        return value if self.step is None else value + self.step[run] * (places - self.begin[run])


def form_runs(values: NDArray[Scalar]) -> NDArray[Scalar]:
    """Large arrays (n,) with equal neighbours, or numbers that follow each other: stored by runs, if these are few."""
    if not (is_large(len(values)) and isinstance(values, np.ndarray) and any(values.strides)):
        return values
    begin = np.concatenate([[0], np.flatnonzero(values[1:] != values[:-1]) + 1])
    if 2 * len(begin) <= WORTH * len(values):
        return form_values(values, _Runs(begin, values[begin], None).form)
    if values.dtype.kind != "i":
        return values
    change = np.diff(values)
    near = np.abs(change) <= 1
    before, turns = np.append(True, near[:-1]), np.diff(change, prepend=change[:1]) != 0
    begin = np.concatenate([[0], np.flatnonzero(~near | (before & turns)) + 1])
    if 3 * len(begin) > WORTH * len(values):
        return values
    second = np.minimum(begin + 1, len(values) - 1)
    step = np.where(np.diff(begin, append=len(values)) > 1, values[second] - values[begin], 0)
    return form_values(values, _Runs(begin, values[begin], step).form)
