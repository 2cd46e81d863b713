"""Products and divisions within parts of a matrix, in place: SciPy's own calls take whole arrays only, or copies.

The functions of BLAS are those that SciPy offers to compiled code, in `scipy.linalg.cython_blas`. Rows of all arrays
are contiguous; BLAS, which expects columns to be so, has their transposes.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable

import numpy as np
from scipy.linalg import cython_blas

from pbem.arrays import Real

# BLAS has integers of 32 or 64 bits, as SciPy was built. Of 64 bits the lower 32 come first on most machines, and serve
# where it takes those; on the others it takes 32 unless SciPy was built otherwise.
Whole = ctypes.c_int64 if sys.byteorder == "little" else ctypes.c_int32
ONE, MINUS_ONE = ctypes.byref(ctypes.c_double(1.0)), ctypes.byref(ctypes.c_double(-1.0))


def _find(name: str, arguments: int) -> Callable[..., None]:
    """A function of BLAS, all of whose arguments are pointers."""
    capsule = cython_blas.__pyx_capi__[name]
    find_name = ctypes.PYFUNCTYPE(ctypes.c_char_p, ctypes.py_object)(("PyCapsule_GetName", ctypes.pythonapi))
    find_address = ctypes.PYFUNCTYPE(ctypes.c_void_p, ctypes.py_object, ctypes.c_char_p)(
        ("PyCapsule_GetPointer", ctypes.pythonapi))
    address = find_address(capsule, find_name(capsule))
    return ctypes.CFUNCTYPE(None, *arguments * [ctypes.c_void_p])(address)


_dgemm, _dtrsm = _find("dgemm", 13), _find("dtrsm", 11)


def take_off_product(values: Real, left: Real, right: Real, transposed: bool = False) -> None:
    """values (k, r) -= left (k, w) @ right (w, r), or right.T of right (r, w); they do not overlap."""
    (rows, across), inner = values.shape, left.shape[1]
    assert len(left) == rows and right.shape == ((across, inner) if transposed else (inner, across))
    if values.size and left.size:
        _dgemm(
            b"T" if transposed else b"N", b"N", _count(across), _count(rows), _count(inner), MINUS_ONE,
            *_describe(right), *_describe(left), ONE, *_describe(values),
        )  # fmt: skip


def divide_by_triangle(values: Real, triangle: Real, lower: bool, transposed: bool = False) -> None:
    """values (k, w) become X with X T = values, T = triangle (w, w) or triangle.T; triangle.T is unit lower or upper
    triangular.
    """
    rows, across = values.shape
    assert triangle.shape == (across, across)
    if values.size:
        _dtrsm(
            b"L", b"L" if lower else b"U", b"T" if transposed else b"N", b"U" if lower else b"N", _count(across),
            _count(rows), ONE, *_describe(triangle), *_describe(values),
        )  # fmt: skip


def _count(value: int) -> object:
    return ctypes.byref(Whole(value))


def _describe(values: Real) -> tuple[int, object]:
    """Where an array (k, r) begins, and by how many numbers its rows are apart."""
    assert values.dtype == np.float64 and (values.shape[1] == 1 or values.strides[1] == values.itemsize)
    apart = values.strides[0] // values.itemsize if len(values) > 1 else values.shape[1]
    return values.ctypes.data, _count(max(apart, values.shape[1], 1))
