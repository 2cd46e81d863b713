"""Rates of convergence and levels of error on a smooth problem with a known solution, for every order and equation.

With shapes of order p on both fields, displacements from displacement equations converge like h^(p + 1). Tractions lose
one order: they follow from the interpolation error of known displacements, h^(p + 1) on a wave length of h. The same
loss is felt by displacements from traction equations, unless the nodes are placed so that it cancels (p even).

No corner is singular for this field. So the rates are those of each equation alone, without the displacement equation
that elements at corners keep; with it the displacements are several times as good, the tractions about the same.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.exact import exponential_field
from pbem.geometry.curve import Curve
from pbem.model.model import Model
from tests.identities.bodies import ROCK, Body, sample_field
from tests.identities.solving import solve_for_field

Real = NDArray[np.float64]

CORNERS = [0j, 2 + 0.2j, 1.8 + 1.4j, -0.1 + 1.1j]
FIELD = exponential_field(ROCK.kappa, ROCK.shear_modulus, (0.3 + 0.2j) * ROCK.shear_modulus, 1.1 - 0.6j)
# Known: both displacements, both tractions, and one of each in both frames. The values come from the field.
BOTTOM, RIGHT = {"ux": 1.0, "uy": 1.0}, {"tx": 1.0, "ty": 1.0}
TOP, LEFT = {"un": 1.0, "ts": 1.0}, {"ux": 1.0, "ty": 1.0}


def make_quadrilateral(elements: int, order: int, scheme: str) -> Body:
    """One region."""
    a, b, c, d = CORNERS
    curves = {"bottom": [a, b], "right": [b, c], "top": [c, d], "left": [d, a]}
    conditions = {"bottom": BOTTOM, "right": RIGHT, "top": TOP, "left": LEFT}
    return Body(curves, {"body": (ROCK, list(curves))}, conditions, elements=elements, order=order, scheme=scheme)


def make_halves(elements: int, order: int, scheme: str) -> Body:
    """The same body of two bonded halves."""
    a, b, c, d = CORNERS
    right, left = 0.5 * (b + c), 0.45 * (a + d)
    curves = {
        "bottom": [a, b], "right": [b, right], "joint": [left, right], "left": [left, a],
        "right2": [right, c], "top": [c, d], "left2": [d, left],
    }  # fmt: skip
    lower, upper = ["bottom", "right", "joint", "left"], ["joint", "right2", "top", "left2"]
    regions = {"lower": (ROCK, lower), "upper": (ROCK, upper)}
    conditions = {"bottom": BOTTOM, "right": RIGHT, "right2": RIGHT, "top": TOP, "left": LEFT, "left2": LEFT}
    laws = {"joint": {"law": "bonded"}}
    return Body(curves, regions, conditions, laws, elements=elements, order=order, scheme=scheme)


def leave_corners(model: Model) -> Model:
    """The model with no end of a leg marked as singular."""
    curves = {
        name: Curve(name, tuple(replace(leg, singular_start=False, singular_end=False) for leg in curve.legs))
        for name, curve in model.curves.items()
    }
    return replace(model, curves=curves)


def measure_errors(body: Body, corners: bool = False) -> Real:
    """Errors of displacement and traction along the boundary, root mean square, relative to the field's.

    corners: elements at corners keep the displacement equation, as they do in runs.
    """
    model = body.build()
    mesh, v = solve_for_field(model if corners else leave_corners(model), FIELD)
    exact = sample_field(FIELD, mesh).reshape(2, -1)
    weight = np.repeat(mesh.weight, 2)
    error = v.reshape(2, -1) - exact
    return np.asarray(np.sqrt((weight * error**2).sum(axis=1) / (weight * exact**2).sum(axis=1)))


# scheme, order, elements a side (then half as many), least rates of displacement and traction, largest errors
SINGLE = [
    ("SST", 0, 16, 1.1, 0.5, 3e-2, 4e-2),
    ("SST", 1, 16, 1.9, 0.9, 1e-3, 1.5e-2),
    ("SST", 2, 16, 2.9, 1.9, 6e-6, 2e-4),
    ("SST", 3, 12, 3.9, 2.8, 4e-7, 1.5e-5),
    ("THST", 0, 16, 0.9, 0.5, 7e-2, 6e-2),
    ("THST", 1, 16, 0.9, 0.9, 1.5e-2, 1.5e-2),
    ("THST", 2, 16, 2.7, 2.0, 3e-5, 1.5e-4),
    ("THST", 3, 12, 2.8, 2.8, 8e-6, 1.2e-5),
]


def expect_convergence(errors: list[Real], rates: tuple[float, float], levels: tuple[float, float]) -> None:
    """The errors on two meshes, the second twice as fine."""
    observed = np.log2(errors[0] / errors[1])
    assert np.all(observed >= rates), f"rates {observed}"
    assert np.all(errors[1] <= levels), f"errors {errors[1]}"


@pytest.mark.parametrize(("scheme", "order", "fine", "u_rate", "t_rate", "u_error", "t_error"), SINGLE)
def test_one_region_converges(
    scheme: str, order: int, fine: int, u_rate: float, t_rate: float, u_error: float, t_error: float
) -> None:
    errors = [measure_errors(make_quadrilateral(count, order, scheme)) for count in (fine // 2, fine)]
    expect_convergence(errors, (u_rate, t_rate), (u_error, t_error))


HALVES = [
    ("SST", 1, 12, 1.8, 0.8, 1.5e-3, 2e-2),
    ("SST", 2, 10, 2.8, 1.9, 4.5e-5, 6e-4),
    ("DBEM", 2, 10, 2.6, 1.9, 8e-5, 5e-4),
    ("HST", 2, 10, 2.6, 1.9, 8e-5, 4e-4),
    ("THST", 2, 10, 2.6, 1.9, 3e-4, 3e-4),
    ("SST", 3, 8, 3.7, 2.7, 2.5e-6, 6e-5),
    ("HST", 3, 8, 2.7, 2.7, 3e-5, 4e-5),
]


@pytest.mark.parametrize(("scheme", "order", "fine", "u_rate", "t_rate", "u_error", "t_error"), HALVES)
def test_two_regions_converge(
    scheme: str, order: int, fine: int, u_rate: float, t_rate: float, u_error: float, t_error: float
) -> None:
    errors = [measure_errors(make_halves(count, order, scheme)) for count in (fine // 2, fine)]
    expect_convergence(errors, (u_rate, t_rate), (u_error, t_error))


# scheme, order, elements a side, part of the displacements' error that is left
CORNERS_KEPT = [
    ("HST", 2, 10, 0.8), ("HST", 3, 8, 0.7), ("THST", 1, 12, 0.6), ("THST", 2, 10, 0.3), ("THST", 3, 8, 0.5),
]


@pytest.mark.parametrize(("scheme", "order", "elements", "part"), CORNERS_KEPT)
def test_displacement_equations_at_corners_do_no_harm(scheme: str, order: int, elements: int, part: float) -> None:
    body = make_halves(elements, order, scheme)
    alone, mixed = measure_errors(body), measure_errors(body, corners=True)
    assert mixed[0] < part * alone[0] and mixed[1] < 1.8 * alone[1]


def make_ring(elements: int, order: int, scheme: str) -> Body:
    """A ring held outside, with known tractions around its eccentric hole, of circular elements."""
    curves = {"outside": (0.2 + 0.1j, 1.0), "hole": (0.4 + 0.3j, 0.4)}
    return Body(
        curves, {"ring": (ROCK, list(curves))}, {"outside": BOTTOM, "hole": RIGHT}, elements=elements, order=order,
        scheme=scheme, circles=frozenset(curves),
    )  # fmt: skip


RINGS = [
    ("SST", 1, 32, 1.8, 0.8, 7e-4, 4e-2),
    ("SST", 2, 32, 2.8, 1.9, 1.5e-5, 2e-3),
    ("SST", 3, 32, 3.7, 2.7, 5e-7, 3e-4),
    ("THST", 2, 32, 2.6, 1.9, 5e-5, 1e-3),
    ("THST", 3, 32, 2.7, 2.7, 1e-5, 2e-4),
]


@pytest.mark.parametrize(("scheme", "order", "fine", "u_rate", "t_rate", "u_error", "t_error"), RINGS)
def test_circular_elements_converge(
    scheme: str, order: int, fine: int, u_rate: float, t_rate: float, u_error: float, t_error: float
) -> None:
    errors = [measure_errors(make_ring(count, order, scheme)) for count in (fine // 2, fine)]
    expect_convergence(errors, (u_rate, t_rate), (u_error, t_error))
