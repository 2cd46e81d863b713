"""Arrays whose values are all alike, or those of another one, stored once: most of a simple model is of these."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import DTypeLike, NDArray

Scalar = TypeVar("Scalar", bound=np.generic)


def repeat_value(value: Any, shape: int | tuple[int, ...], dtype: DTypeLike = float) -> NDArray[Any]:
    """An array of one value, which takes no room and cannot be written to."""
    return np.broadcast_to(np.asarray(value, dtype=dtype), shape)


def is_nothing(values: NDArray[Any]) -> bool:
    """Whether values are a single zero that stands for all of them, as repeat_value makes it."""
    return not any(values.strides) and not np.any(values[:1])


def fold_uniform(values: NDArray[Scalar]) -> NDArray[Scalar]:
    """The same values; where all are alike, to the bit, in an array that takes no room and cannot be written to."""
    if values.size < 2:
        return values
    # By bits: numbers that are equal can differ in the sign of zero, and NaN is like nothing.
    bits = np.ascontiguousarray(values).reshape(-1).view(np.uint8).reshape(values.size, -1)
    return np.broadcast_to(values.reshape(-1)[0], values.shape) if (bits == bits[0]).all() else values


def share_equal(values: NDArray[Scalar], *others: NDArray[Scalar]) -> NDArray[Scalar]:
    """The first of the others that has the same values, to the bit, so that one of the two is enough; else the values.

    Whoever writes to the one that is returned writes to the other.
    """
    for other in others:
        if (values.dtype, values.shape) == (other.dtype, other.shape):
            bits, their_bits = (np.ascontiguousarray(each).reshape(-1).view(np.uint8) for each in (values, other))
            if np.array_equal(bits, their_bits):
                return other
    return values
