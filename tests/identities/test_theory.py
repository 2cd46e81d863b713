"""The formulas as the page of theory prints them: kernels, moments, arcs and expansions give the compiled rows.

Written from the page, not from the code: with both in step, the page can be trusted.
"""

from __future__ import annotations

from collections.abc import Callable
from math import comb

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem.rows import Sources, evaluate_rows
from pbem.geometry.elements import Elements
from pbem.mesh.shape_functions import place_crack_nodes, place_nodes

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


ORDER = 2
VALUES = np.array([0.7 - 0.2j, -0.3 + 1.1j, 0.4 + 0.6j])
FLAT = np.stack([VALUES.real, VALUES.imag], axis=1).ravel()
Moments = tuple[list[complex], list[complex], list[complex], list[float]]


def integrate_power(k: int) -> float:
    return 2 / (k + 1) if k % 2 == 0 else 0.0


def take_moments(w: complex) -> Moments:
    """c, d, e, n: formulas (21) and (22), or (23) far away."""
    top, d_0 = ORDER + 1, 2 / (w * w - 1)
    c, d, e = [0j] * (top + 1), [d_0], [-w * d_0**2]
    if abs(w) < 2:
        c[0] = 0.5 * np.log(abs(w - 1) ** 2 / abs(w + 1) ** 2) + 1j * np.arctan2(2 * w.imag, abs(w) ** 2 - 1)
        for k in range(top):
            c[k + 1] = w * c[k] + integrate_power(k)
            d.append(w * d[k] + c[k])
            e.append(w * e[k] + 2 * d[k])
    else:
        c[top] = -sum(2 / (top + j + 1) * w ** -(j + 1) for j in range(top % 2, 120, 2))
        for k in reversed(range(top)):
            c[k] = (c[k + 1] - integrate_power(k)) / w
        d = [k * c[k] / w + d_0 * w ** -(k % 2) for k in range(top)]
        e = [k * (k - 1) * c[k] / w**2 - d_0**2 * w ** (1 - k) for k in range(top)]
    ends = [np.log(abs(w * w - 1)), c[0].real]
    return c, d, e, [(ends[k % 2] - c[k + 1].real) / (k + 1) for k in range(top)]


def take_tip_moments(q: complex) -> tuple[list[complex], list[complex], list[complex]]:
    """c, d, e: formula (24), or (25) far away."""
    if abs(q) < 2:
        root = np.sqrt(q)
        log = np.log((root - 1) / (root + 1))
        c, d = [2 + root * log], [log / (2 * root) + 1 / (q - 1)]
        e = [-log / (4 * q * root) + 1 / (2 * q * (q - 1)) - 1 / (q - 1) ** 2]
        for k in range(ORDER):
            c.append(q * c[k] + 1 / (k + 1.5))
            d.append(q * d[k] + c[k])
            e.append(q * e[k] + 2 * d[k])
        return c, d, e
    weight = [1 / (ORDER + j + 1.5) for j in range(200)]
    c = [0j] * ORDER + [-sum(a * q ** -(j + 1) for j, a in enumerate(weight))]
    d = [0j] * ORDER + [sum(a * (j + 1) * q ** -(j + 2) for j, a in enumerate(weight))]
    e = [0j] * ORDER + [-sum(a * (j + 1) * (j + 2) * q ** -(j + 3) for j, a in enumerate(weight))]
    for k in reversed(range(ORDER)):
        c[k] = (c[k + 1] - 1 / (k + 1.5)) / q
        d[k] = (d[k + 1] - c[k]) / q
        e[k] = (e[k + 1] - 2 * d[k]) / q
    return c, d, e


def combine_straight(
    c: complex, d: complex, e: complex, n: float, length: float, seen: complex, half: complex, normal: complex
) -> list[tuple[complex, complex]]:
    """P and Q of -int T u, int U t, -int S u, int D t: formulas (26) to (29); seen: w; half: h times the direction."""
    h, y, direction = abs(half), seen.imag, half / abs(half)
    turned, square = direction * np.conj(normal), direction**2
    g, f = SHEAR_MODULUS / (np.pi * (KAPPA + 1) * h), 1 / (2 * np.pi * (KAPPA + 1))
    conj_c, conj_d, conj_e = np.conj(c), np.conj(d), np.conj(e)
    return [
        (f * ((KAPPA + 1) * c.imag + 1j * (1 - KAPPA) * c.real), y * square * conj_d / (np.pi * (KAPPA + 1))),
        (-KAPPA * h * (n + length * np.log(h / LENGTH)) / (2 * np.pi * SHEAR_MODULUS * (KAPPA + 1)),
         h * square * (length - 2j * y * conj_c) / (4 * np.pi * SHEAR_MODULUS * (KAPPA + 1))),
        (-2 * g * (conj_d * turned).imag,
         2j * g * turned.real * square * conj_d + 2 * y * g * square * turned * conj_e),
        (f * ((KAPPA + 1) * (turned * conj_c).real + 1j * (KAPPA - 1) * (turned * conj_c).imag),
         2 * f * turned.real * square * conj_c - 2j * f * y * square * turned * conj_d),
    ]  # fmt: skip


def take_rows(sources: Sources, point: complex, normal: complex) -> list[complex]:
    """-int T u, int U t, -int S u, int D t of the compiled rows; of the densities with the nodal values."""
    found = []
    for normals in (None, np.array([normal])):
        for rows in evaluate_rows(sources, np.array([point]), np.array([-1]), normals):
            assert rows is not None
            x, y = rows @ FLAT
            found.append(complex(x, y))
    return found


PLACES = list(zip([0.3 + 0.3j, -1.2 + 0.5j, 4.0 - 1.0j], NORMALS.tolist(), strict=True))


@pytest.mark.parametrize(("point", "normal"), PLACES)
@pytest.mark.parametrize("family", [0, 1, 2])
def test_printed_moments_of_straight_elements_give_the_rows(point: complex, normal: complex, family: int) -> None:
    start, end = complex(STRAIGHT.start[0]), complex(STRAIGHT.end[0])
    sources = Sources(STRAIGHT.start, STRAIGHT.end, np.array([family], dtype=np.int8), place_nodes(ORDER), KAPPA,
                      SHEAR_MODULUS, LENGTH, crack_local=place_crack_nodes(ORDER))  # fmt: skip
    half = (end - start) / 2
    w = (point - (start + end) / 2) / half
    if family:
        sign = 1 if family == 1 else -1
        c, d, e = take_tip_moments((1 + sign * w) / 2)
        c, d, e, n = [sign * a for a in c], [a / 2 for a in d], [sign * a / 4 for a in e], [0.0] * (ORDER + 1)
    else:
        c, d, e, n = take_moments(w)
    powers = sources.shape[family] @ VALUES
    total = np.zeros(4, dtype=complex)
    for k, a in enumerate(powers):
        pairs = combine_straight(c[k], d[k], e[k], n[k], integrate_power(k), w, half, normal)
        total += [P * a + Q * np.conj(a) for P, Q in pairs]
    expected = np.array(take_rows(sources, point, normal))
    kept = [0, 2] if family else [0, 1, 2, 3]  # cracks carry no tractions
    assert total[kept] == pytest.approx(expected[kept], rel=1e-12, abs=1e-13)


@pytest.mark.parametrize(("point", "normal"), zip([0.5 - 0.2j, 0.9 - 0.6j, 0.3 - 0.5j], NORMALS.tolist(), strict=True))
def test_printed_closed_form_of_arcs_gives_the_rows(point: complex, normal: complex) -> None:
    center, sweep = complex(ARC.center[0]), float(ARC.sweep[0])
    radius, q = abs(complex(ARC.start[0]) - center), np.tan(sweep / 4)
    a, jacobian, origin, infinity = radius * np.exp(0.5j * sweep), 2 * radius * abs(q), 1j / q, -1j / q
    z = point - center
    w = -1j * (z / a - 1) / (q * (z / a + 1))  # formula (30)
    w_1 = -1j * (1 - 1j * q * w) ** 2 / (2 * q * a)
    w_2 = -w_1 * (1 - 1j * q * w) / a
    at, at_origin, at_infinity = take_moments(w), take_moments(origin), take_moments(infinity)
    b, off = a + z, radius**2 / z - np.conj(z)
    rho, p_1, p_2 = np.conj(b) / b, w - infinity, w - origin
    r_1, r_2 = 2j * w.imag * p_1 / p_2, (np.conj(w) - origin) * (origin - infinity) / p_2
    nodes = place_nodes(ORDER)
    sources = Sources(ARC.start, ARC.end, np.zeros(1, dtype=np.int8), nodes, KAPPA, SHEAR_MODULUS, LENGTH,
                      ARC.center, ARC.sweep)  # fmt: skip
    displacement, traction = sources.shape[0] @ VALUES, sources.shape[0] @ (VALUES / (1 + (q * nodes) ** 2))
    f, g = 1 / (2 * np.pi * (KAPPA + 1)), SHEAR_MODULUS / (np.pi * (KAPPA + 1))
    total = np.zeros(4, dtype=complex)
    for k in range(ORDER + 1):
        c, d, e, n = (moment[k] for moment in at)
        c_o, d_o, c_i = at_origin[0][k], at_origin[1][k], at_infinity[0][k]
        length = integrate_power(k)
        C, C_1, C_2 = c - c_i, d * w_1, e * w_1**2 + d * w_2  # formula (31)
        F = (C - c_o + c_i) / z
        F_1 = (C_1 - F) / z
        V = -(radius**2) * (F + 2j * d_o / (q * a)) / z
        V_1 = -(radius**2 * F_1 + V) / z
        Q = off * C_1 - radius**2 * F / z - V
        Q_1 = off * C_2 - 2 * radius**2 * F_1 / z - V_1
        N = jacobian * (length * np.log(abs(b)) + n - at_infinity[3][k])  # formula (32)
        X = -jacobian / b * (length + p_1 * c)
        S = jacobian * rho * (length + r_1 * c + r_2 * c_o)
        Y = -jacobian * rho / b * (
            length + (p_1 + r_1 + r_2 * p_1 / p_2) * c + r_1 * p_1 * d + r_2 * (1 - p_1 / p_2) * c_o
        )
        pairs = [  # formula (33)
            (f * ((KAPPA + 1) * C.imag + 1j * (1 - KAPPA) * C.real), 1j * f * np.conj(Q), displacement),
            (-KAPPA * f / SHEAR_MODULUS * (N - length * jacobian * np.log(LENGTH)),
             0.5 * f / SHEAR_MODULUS * np.conj(S), traction),
            (2 * g * (C_1 * normal).imag, 1j * g * (np.conj(C_1) * normal + np.conj(Q_1 * normal)), displacement),
            (f * (X * normal + KAPPA * np.conj(X * normal)),
             f * (np.conj(X) * normal + np.conj(Y * normal)), traction),
        ]  # fmt: skip
        total += [P * density[k] + R * np.conj(density[k]) for P, R, density in pairs]
    assert total == pytest.approx(np.array(take_rows(sources, point, normal)), rel=1e-11, abs=1e-12)


TERMS = 40


def expand_element(center: complex, radius: float) -> tuple[Complex, Complex]:
    """Multipole coefficients of the straight element, displacement and traction with the same values: (37), (38)."""
    s, weight = np.polynomial.legendre.leggauss(60)
    half, middle = complex(STRAIGHT.end[0] - STRAIGHT.start[0]) / 2, complex(STRAIGHT.end[0] + STRAIGHT.start[0]) / 2
    density = s[:, None] ** np.arange(3) @ np.linalg.inv(place_nodes(2)[:, None] ** np.arange(3)) @ VALUES
    along, length, Z = weight * half / radius, weight * abs(half), (middle + half * s - center) / radius
    g, f = SHEAR_MODULUS / (np.pi * (KAPPA + 1)), -1 / (2 * np.pi * (KAPPA + 1))
    a, b = np.zeros(TERMS + 1, dtype=complex), np.zeros(TERMS + 1, dtype=complex)
    a[0], b[0] = f * (density * length).sum(), -KAPPA * f * (np.conj(density) * length).sum()
    for k in range(1, TERMS + 1):
        a[k] = (1j * g * Z ** (k - 1) * density * along - f / k * Z**k * density * length).sum()
        b[k] = 1j * g * (Z ** (k - 1) * (density * np.conj(along) - np.conj(density) * along)
                         + (k - 1) * np.conj(Z) * Z ** (k - 2) * density * along).sum()
        carried = -np.conj(Z) * Z ** (k - 1) * density + KAPPA / k * Z**k * np.conj(density)
        b[k] += f * (carried * length).sum()
    return a, b


def move_up(coefficients: Complex, ratio: complex, inner: float) -> Complex:
    """The first line of formula (39); ratio: d/R, inner: r/R."""
    moved = coefficients.copy()
    for k in range(1, TERMS + 1):
        moved[k] = sum(comb(k - 1, j - 1) * ratio ** (k - j) * inner**j * coefficients[j] for j in range(1, k + 1))
        moved[k] -= coefficients[0] * ratio**k / k
    return moved


def move_across(coefficients: Complex, distance: complex, source: float, target: float) -> Complex:
    """The first two lines of formula (40)."""
    seen = coefficients * (source / distance) ** np.arange(TERMS + 1)
    local = np.zeros(TERMS + 1, dtype=complex)
    local[0] = coefficients[0] * np.log(distance / LENGTH) + seen[1:].sum()
    for m in range(1, TERMS + 1):
        total = sum(comb(k + m - 1, m) * seen[k] for k in range(1, TERMS + 1))
        local[m] = (-target / distance) ** m * (total - coefficients[0] / m)
    return local


def move_down(coefficients: Complex, ratio: complex, inner: float) -> Complex:
    """The second line of formula (41)."""
    rest = range(TERMS + 1)
    return np.array([inner**k * sum(comb(m, k) * ratio ** (m - k) * coefficients[m] for m in rest if m >= k)
                     for k in rest])  # fmt: skip


def evaluate_local(A: Complex, B: Complex, center: complex, radius: float, z: complex) -> complex:
    """Formulas (36) and (2)."""
    power = ((z - center) / radius) ** np.arange(TERMS + 1)
    slope = (np.arange(1, TERMS + 1) * A[1:] * power[:-1]).sum() / radius
    field = KAPPA * (A * power).sum() - (z - center) * np.conj(slope) - np.conj((B * power).sum())
    return complex(field / (2 * SHEAR_MODULUS))


def test_printed_expansions_give_the_rows() -> None:
    z, number = 6 + 2j, np.arange(TERMS + 1)
    child, r, parent, R = 0.1 + 0.05j, 0.8, -0.3 + 0.2j, 2.0
    a, b = expand_element(child, r)
    d = child - parent
    a, b = move_up(a, d / R, r / R), move_up(b, d / R, r / R)
    b[1] -= np.conj(d) / R * a[0]
    b[2:] += number[1:-1] * np.conj(d) / R * a[1:-1]
    target, r_target, leaf, r_leaf = 6.3 + 1.5j, 1.2, 6.1 + 1.9j, 0.5
    distance = target - parent
    A, B = move_across(a, distance, R, r_target), move_across(b, distance, R, r_target)
    B[:-1] += number[1:] * np.conj(distance) / r_target * A[1:]
    d = leaf - target
    B[:-1] += number[1:] * np.conj(d) / r_target * A[1:]
    A, B = move_down(A, d / r_target, r_leaf / r_target), move_down(B, d / r_target, r_leaf / r_target)
    sources = Sources(STRAIGHT.start, STRAIGHT.end, np.zeros(1, dtype=np.int8), place_nodes(2), KAPPA, SHEAR_MODULUS,
                      LENGTH)  # fmt: skip
    moved = sum(take_rows(sources, z, 1.0)[:2])
    assert evaluate_local(A, B, leaf, r_leaf, z) == pytest.approx(moved, rel=1e-12)
