"""The kernels as the page of theory prints them, integrated by Gauss points, are those of the compiled rows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem.rows import Sources, evaluate_rows
from pbem.mesh.elements import Elements
from pbem.mesh.shapes import place_nodes

Complex = NDArray[np.complex128]

SHEAR_MODULUS, KAPPA, LENGTH = 1.7, 2.1, 40.0
POINTS = np.array([0.3 + 0.8j, -1.2 + 0.5j, 2.0 - 1.0j])
NORMALS = np.exp(1j * np.array([0.3, 2.0, -1.1]))
STRAIGHT = Elements(*(np.array([value]) for value in (-0.4 - 0.3j, 0.6 + 0.1j, 0j, 0.0)))
ARC = Elements(*(np.array([value]) for value in (0.7 - 0.9j, 0.7 * np.exp(1.1j) - 0.9j, -0.9j, 1.1)))


def kernel_u(r: Complex, e: Complex, normal: complex, a: Complex) -> Complex:
    """Formula (9)."""
    factor = -1 / (4 * np.pi * SHEAR_MODULUS * (KAPPA + 1))
    return factor * (2 * KAPPA * np.log(np.abs(r) / LENGTH) * a - r / np.conj(r) * np.conj(a))


def kernel_t(r: Complex, e: Complex, normal: complex, a: Complex) -> Complex:
    """Formula (10)."""
    y = (np.conj(r) * e).imag
    own = (KAPPA + 1) * (e / r).imag + 1j * (1 - KAPPA) * (e / r).real
    return -1 / (2 * np.pi * (KAPPA + 1)) * (own * a + 2 * y / np.conj(r) ** 2 * np.conj(a))


def kernel_s(r: Complex, e: Complex, normal: complex, a: Complex) -> Complex:
    """Formula (11)."""
    y = (np.conj(r) * e).imag
    other = normal * np.conj(e / r**2) + np.conj(normal * (np.conj(e) + 4j * y / r) / r**2)
    own = 2 * (normal * e / r**2).imag
    return -SHEAR_MODULUS / (np.pi * (KAPPA + 1)) * (own * a + 1j * other * np.conj(a))


def kernel_d(r: Complex, e: Complex, normal: complex, a: Complex) -> Complex:
    """Formula (12)."""
    own = normal / r + KAPPA * np.conj(normal / r)
    other = normal / np.conj(r) + np.conj(normal * np.conj(r) / r**2)
    return 1 / (2 * np.pi * (KAPPA + 1)) * (own * a + other * np.conj(a))


@pytest.mark.parametrize("elements", [STRAIGHT, ARC], ids=["straight", "arc"])
@pytest.mark.parametrize(
    ("kernel", "of_traction", "stress", "sign"),
    [(kernel_u, True, False, 1), (kernel_t, False, False, -1), (kernel_s, False, True, -1), (kernel_d, True, True, 1)],
    ids=["U", "T", "S", "D"],
)
def test_printed_kernels_are_those_of_the_rows(
    elements: Elements, kernel: Callable[..., Complex], of_traction: bool, stress: bool, sign: int
) -> None:
    nodes = place_nodes(2)
    sources = Sources(elements.start, elements.end, np.zeros(1, dtype=np.int8), nodes, KAPPA, SHEAR_MODULUS, LENGTH,
                      elements.center, elements.sweep)  # fmt: skip
    rows = evaluate_rows(sources, POINTS, np.full(3, -1), NORMALS if stress else None)[int(of_traction)]
    assert rows is not None
    values = np.array([0.7 - 0.2j, -0.3 + 1.1j, 0.4 + 0.6j])
    found = rows @ np.stack([values.real, values.imag], axis=1).ravel()
    # The element by many points: far more than its kernels need at these distances.
    s, weight = np.polynomial.legendre.leggauss(60)
    shapes = s[:, None] ** np.arange(3) @ sources.shape[0]
    stretch = elements.stretch(s)[0]
    density = shapes @ values
    if of_traction:  # formula (18)
        q = np.tan(elements.sweep[0] / 4)
        density = (1 + (q * s) ** 2) * (shapes @ (values / (1 + (q * nodes) ** 2)))
    zeta, e = elements.place(s)[0], 1j * elements.normals(s)[0]
    expected = [sign * (weight * stretch) @ kernel(zeta - z, e, normal, density)
                for z, normal in zip(POINTS, NORMALS, strict=True)]
    assert found[0::2] + 1j * found[1::2] == pytest.approx(np.array(expected), rel=1e-12, abs=1e-13)
