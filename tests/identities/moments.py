"""The moments of the kernels, read back from the compiled rows, and the same moments by quadrature.

c_k = int s^k/(s - w) ds over [-1, 1], d_k and e_k its first two derivatives by w, n_k = int s^k ln|w - s| ds; on tip
elements s^k is replaced by t^(k + 1/2), t = (1 + s)/2 or (1 - s)/2. The compiled integrals are taken over one element
from -1 to 1, on which position and local coordinate are the same number.

The quadratures use no closed form. Near the element the integrand is analytic away from w, so that the path is led
around w at a distance; on the element, principal value and finite part are the mean of the paths on the two sides.
Far from it s and -s are taken together, since one alone loses the digits in which they differ.
"""

from __future__ import annotations

from dataclasses import dataclass
from unittest.mock import patch

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from pbem.bem.rows import Sources, evaluate_rows

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

KAPPA = 2.0
NODES, WEIGHTS = legendre.leggauss(40)
FAR = 3.0  # |w| beyond which the quadrature runs straight along the element
DEEPEST = 1e-11  # smallest panel of a path, next to an end of the element


@dataclass(frozen=True)
class Moments:
    """c, d, bent = d + i y e (e enters the rows only so; y = Im w), n: (order + 1,) each; n is zero on tip elements.

    By quadrature n is complex: its real part counts, its modulus tells the size of what is summed.
    """

    c: Complex
    d: Complex
    bent: Complex
    n: Complex


def read_moments(w: complex, order: int, on_element: bool = False, tip: int = 0) -> Moments:
    """The moments that the compiled rows contain."""
    P, _, P_t, _ = _read_factors(w, None, order, on_element, tip)
    P_x, Q_x, _, _ = _read_factors(w, 1.0, order, on_element, tip)
    P_y = _read_factors(w, 1j, order, on_element, tip)[0]
    return Moments(
        c=-6 * np.pi * P.imag + 2j * np.pi * P.real,
        d=1.5 * np.pi * P_y.real + 1.5j * np.pi * P_x.real,
        bent=1.5 * np.pi * np.conj(-1j * Q_x),
        n=-3 * np.pi * P_t.real + 0j,
    )


def _read_factors(
    w: complex, normal: complex | None, order: int, on_element: bool, tip: int
) -> tuple[Complex, Complex, Complex, Complex]:
    """Factors P, Q of the density powers of the displacement, then of the traction: a -> P a + Q conj(a)."""
    element = Sources(
        np.array([-1 + 0j]), np.array([1 + 0j]), np.array([tip], dtype=np.int8), np.zeros(order + 1), KAPPA, 1.0, 1.0
    )
    one = np.eye(order + 1)
    # In place of shapes the bare powers: combined to shapes the small ones would drown.
    with (
        patch("pbem.bem.rows.interpolate_shapes", lambda local: one),
        patch("pbem.bem.rows.tip_shapes", lambda local: (one, one)),
    ):
        displacement, traction = evaluate_rows(
            element, np.array([w]), np.array([0 if on_element else -1]), None if normal is None else np.array([normal])
        )
    assert traction is not None
    return (*_split_blocks(displacement), *_split_blocks(traction))


def _split_blocks(rows: Real) -> tuple[Complex, Complex]:
    xx, xy, yx, yy = rows[0, 0::2], rows[0, 1::2], rows[1, 0::2], rows[1, 1::2]
    return (xx + yy + 1j * (yx - xy)) / 2, (xx - yy + 1j * (yx + xy)) / 2


def integrate_moments(w: complex, order: int, on_element: bool = False, tip: int = 0) -> Moments:
    """The same moments by quadrature."""
    if tip == 2:  # turn the element around: s -> -s, w -> -w
        turned = integrate_moments(-w, order, on_element, 1)
        return Moments(-turned.c, turned.d, turned.bent, turned.n)
    powers = np.arange(order + 1)
    if on_element:
        above, below = (_integrate_path(complex(w.real), powers, tip, side) for side in (1.0, -1.0))
        c, d, _, n = ((one + other) / 2 for one, other in zip(above, below, strict=True))
        return Moments(c, d, d, n)
    if abs(w) < FAR:
        c, d, e, n = _integrate_path(w, powers, tip, -1.0 if w.imag >= 0 else 1.0)
    elif tip:
        c, d, e, n = _integrate_path(w, powers, tip, 0.0)
    else:
        c, d, e, n = _integrate_folded(w, powers)
    return Moments(c, d, d + 1j * w.imag * e, n)


def _integrate_path(w: complex, powers: NDArray[np.int64], tip: int, side: float) -> tuple[Complex, ...]:
    """c, d, e, n along two straight lines that meet above (side 1) or below (side -1) the middle of the element."""
    if tip:
        # with t = r^2 the densities are polynomials; 2 (t - q) = s - w
        r, weight, from_end, at_end = _lay_path(0.0, 1.0, side)
        q, rest = (1 + w) / 2, (1 - w) / 2
        distance = 2 * np.where(at_end, rest + from_end * (2 + from_end), r * r - q)
        density = r[:, None] ** (2 * powers + 1) * (4 * r * weight)[:, None]
    else:
        s, weight, from_end, at_end = _lay_path(-1.0, 1.0, side)
        distance = np.where(at_end, 1 - w, -1 - w) + from_end
        density = s[:, None] ** powers * weight[:, None]
    c, d, e = ((factor / distance**power) @ density for factor, power in ((1, 1), (1, 2), (2, 3)))
    return c, d, e, np.zeros(len(powers), dtype=complex) if tip else np.log(distance) @ density


def _lay_path(start: float, end: float, side: float) -> tuple[Complex, Complex, Complex, NDArray[np.bool_]]:
    """Points, weights, offset from the nearer end and which end: panels that double in length from both ends."""
    corner = complex((start + end) / 2, side * (end - start) / 2)
    breaks = np.concatenate([[0.0], 2.0 ** np.arange(np.ceil(np.log2(DEEPEST)), 1.0)])
    t = ((breaks[1:] + breaks[:-1])[:, None] / 2 + np.diff(breaks)[:, None] / 2 * NODES).ravel()
    weight = (np.diff(breaks)[:, None] / 2 * WEIGHTS).ravel()
    there, back = corner - start, corner - end
    offset = np.concatenate([there * t, back * t])
    at_end = np.repeat([False, True], len(t))
    return np.where(at_end, end, start) + offset, np.concatenate([there * weight, -back * weight]), offset, at_end


def _integrate_folded(w: complex, powers: NDArray[np.int64]) -> tuple[Complex, ...]:
    """c, d, e, n with the integrands at s and -s added beforehand, over [0, 1]."""
    s, weight = (NODES + 1) / 2, WEIGHTS / 2
    below = s**2 - w**2
    odd = (2 * s / below, 4 * w * s / below**2, 4 * s * (s**2 + 3 * w**2) / below**3, -2 * np.arctanh(s / w))
    even = (
        2 * w / below,
        2 * (s**2 + w**2) / below**2,
        4 * w * (3 * s**2 + w**2) / below**3,
        2 * np.log(abs(w)) + np.log1p(-((s / w) ** 2)),
    )
    pairs = zip(even, odd, strict=True)
    return tuple(np.array([(s**k * (pair[k % 2])) @ weight for k in powers]) + 0j for pair in pairs)
