"""Cracks: the eliminated form against the printed one with both faces, and a straight crack in a large plate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem.operator import collect_sources
from pbem.bem.rows import Sources, evaluate_rows
from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.exact import crack_opening
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh, list_faces
from pbem.model.material import Material
from pbem.model.model import Model
from pbem.parallel import world
from pbem.solve.problem.problem import Problem
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem
from tests.identities.bodies import ROCK, Body
from tests.identities.solving import linearise_pairs, march_to_end

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

FRICTION = 0.4


def make_plate(top: dict[str, float], law: dict[str, float | str], kink: complex = 0j, **options: object) -> Body:
    """A square held at its lower side, with a slanting crack that may have a kink."""
    curves = {
        "bottom": [0j, 2 + 0j], "right": [2 + 0j, 2 + 2j], "top": [2 + 2j, 2j], "left": [2j, 0j],
        "crack": [0.6 + 0.7j, 1.05 + 0.95j + kink, 1.5 + 1.2j],
    }  # fmt: skip
    held = {"bottom": {"ux": 0.0, "uy": 0.0}, "top": top, "right": {"tx": -0.002}}
    return Body(
        curves, {"plate": (ROCK, ["bottom", "right", "top", "left"])}, held, {"crack": law}, {"crack": "plate"},
        **options,  # type: ignore[arg-type]
    )  # fmt: skip


@dataclass(frozen=True)
class TwoFaces:
    """The crack's faces as elements of their own: the first in the crack's direction, the second back."""

    first: Sources
    second: Sources

    @staticmethod
    def split(mesh: Mesh, sources: Sources) -> tuple[Sources, TwoFaces]:
        """The outer boundary, and the faces, of a mesh of one region."""

        # Each face is a boundary of its own, with tractions, on the crack's nodes.
        family = np.where(sources.family == 3, 0, sources.family).astype(np.int8)

        def select(own: NDArray[np.bool_], local: Real) -> Sources:
            return replace(
                sources, start=sources.start[own], end=sources.end[own], family=family[own], local=local,
                crack_local=None, center=None, sweep=None,
            )  # fmt: skip

        first = select(mesh.crack, mesh.crack_local)
        turned = np.array([0, 2, 1], dtype=np.int8)[first.family]
        second = replace(first, start=first.end, end=first.start, family=turned)
        return select(~mesh.crack, mesh.local), TwoFaces(first, second)


def evaluate_all(
    outer: Sources, faces: TwoFaces, point: Complex, on_outer: NDArray[np.int64], on_crack: NDArray[np.int64],
    normal: Complex | None,
) -> tuple[Real, Real]:
    """A and B with columns of the outer nodes, the first face's and the second face's (nodes in the crack's order)."""
    parts = [evaluate_rows(outer, point, on_outer, normal), evaluate_rows(faces.first, point, on_crack, normal),
             evaluate_rows(faces.second, point, on_crack, normal)]  # fmt: skip
    per_element = len(outer.local)

    def join(which: int) -> Real:
        columns = [np.asarray(part[which]) for part in parts]
        back = columns[2].reshape(2 * len(point), -1, per_element, 2)[:, :, ::-1].reshape(2 * len(point), -1)
        return np.concatenate([columns[0], columns[1], back], axis=1)

    return join(0), join(1)


def solve_printed_form(model: Model, problem: Problem, step: Step) -> tuple[Complex, Complex, Complex]:
    """u_1, u_2 and p (on the first face) at the crack nodes, in the modes and signs of a converged step.

    Unknowns: those of the outer nodes, both faces' displacements, the traction. Displacement equations on the outer
    boundary and the first face, traction equations on the second, and the law of every pair.
    """
    mesh = problem.mesh
    sources = collect_sources(mesh, [model.regions[0].material])[0]
    outer_sources, faces = TwoFaces.split(mesh, sources)
    on_boundary = np.flatnonzero(~mesh.node_crack)
    crack = np.flatnonzero(mesh.node_crack)
    o, m = 2 * len(on_boundary), 2 * len(crack)
    # v = (u outer, u_1, u_2, t outer, p) from x = (outer unknowns, u_1, u_2, p) by the conditions alone
    constraints = problem.constrain(linearise_pairs(problem), problem.evaluate_load(step.stage, step.factor))
    rows = (2 * on_boundary[:, None] + np.arange(2)).ravel()
    known = constraints.matrix.toarray()
    u_map, t_map = (known[shift + rows][:, rows] for shift in (0, 2 * mesh.nodes))
    u_off, t_off = (constraints.offset[shift + rows] for shift in (0, 2 * mesh.nodes))

    element = mesh.node_element
    first_crack = int(element[crack[0]])
    off = np.full(len(crack), -1)
    A_o, B_o = evaluate_all(outer_sources, faces, mesh.position[on_boundary], element[on_boundary],
                            np.full(len(on_boundary), -1), None)  # fmt: skip
    A_1, B_1 = evaluate_all(outer_sources, faces, mesh.position[crack], off, element[crack] - first_crack, None)
    A_2, B_2 = evaluate_all(
        outer_sources, faces, mesh.position[crack], off, element[crack] - first_crack, -mesh.normal[crack]
    )
    length = model.size / model.regions[0].material.shear_modulus
    one = np.eye(m)
    # free terms: u/2; (u_1 + u_2)/2; (t_2 - t_1)/2 = -p
    H = np.concatenate([-A_o, -A_1, -length * A_2])
    G = np.concatenate([-B_o, -B_1, -length * B_2])
    H[:o, :o] += np.eye(o) / 2
    H[o : o + m, o : o + m] += one / 2
    H[o : o + m, o + m :] += one / 2
    G_p = G[:, o : o + m] - G[:, o + m :]
    G_p[o + m :] -= length * one
    K = np.zeros((o + 3 * m, o + 3 * m))
    right = np.zeros(o + 3 * m)
    K[: o + 2 * m, :o] = H[:, :o] @ u_map + G[:, :o] @ t_map
    K[: o + 2 * m, o : o + 2 * m] = H[:, o:]
    K[: o + 2 * m, o + 2 * m :] = G_p * problem.traction_scale
    right[: o + 2 * m] = -(H[:, :o] @ u_off + G[:, :o] @ t_off)
    _add_laws(K[o + 2 * m :], right[o + 2 * m :], mesh, step, o, m, problem.traction_scale)
    x = np.linalg.solve(K, right)
    parts = (x[o : o + m], x[o + m : o + 2 * m], problem.traction_scale * x[o + 2 * m :])
    first, second, traction = (part[0::2] + 1j * part[1::2] for part in parts)
    return first, second, traction


def _add_laws(K: Real, right: Real, mesh: Mesh, step: Step, o: int, m: int, scale: float) -> None:
    """Two equations a pair: g_n = 0 and g_s = slip so far, or g_n = 0 and Coulomb's law, or no traction."""
    pairs, contact = mesh.pairs, step.contact
    for k in range(pairs.count):
        node = int(pairs.first[k] - np.flatnonzero(mesh.node_crack)[0])
        at = {name: o + shift + 2 * node + np.arange(2) for name, shift in (("1", 0), ("2", m), ("p", 2 * m))}
        n = np.array([pairs.normal[k].real, pairs.normal[k].imag])
        s = np.array([-n[1], n[0]])
        row = 2 * k
        if contact.mode[k] == OPEN:
            K[row, at["p"]], K[row + 1, at["p"]] = n, s
            continue
        K[row, at["2"]], K[row, at["1"]] = n, -n
        if contact.mode[k] == STICK:
            K[row + 1, at["2"]], K[row + 1, at["1"]] = s, -s
            right[row + 1] = 0.0  # one step from rest
        else:
            K[row + 1, at["p"]] = scale * (s + np.sign(contact.traction_s[k]) * FRICTION * n)


LOADS: dict[str, tuple[dict[str, float], dict[str, float | str], set[int]]] = {
    "stick": ({"ux": 0.0005, "uy": -0.01}, {"law": "coulomb", "friction": FRICTION, "cohesion": 1.0}, {STICK}),
    "slip": ({"ux": -0.005, "uy": -0.01}, {"law": "coulomb", "friction": FRICTION}, {SLIP}),
    "open": ({"ux": 0.001, "uy": 0.01}, {"law": "coulomb", "friction": FRICTION}, {OPEN}),
}  # fmt: skip


def compare_forms(body: Body, expected: set[int]) -> None:
    model = body.build()
    problem = assemble_problem(model, generate_mesh(model), world)
    step = list(march(problem, SilentReporter()))[-1]
    mesh = problem.mesh
    assert set(step.contact.mode) == expected
    first, second, traction = solve_printed_form(model, problem, step)
    crack = np.flatnonzero(mesh.node_crack)
    opposite = np.empty(len(crack), dtype=complex)
    opposite[problem.second_faces - crack[0]] = step.displacement[mesh.nodes :]
    size = np.abs(step.displacement).max()
    assert np.abs(step.displacement[crack] - first).max() < 1e-10 * size
    assert np.abs(opposite - second).max() < 1e-10 * size
    assert np.abs(step.traction[crack] - traction).max() < 1e-10 * np.abs(step.traction).max()


@pytest.mark.parametrize("load", LOADS.values(), ids=list(LOADS))
@pytest.mark.parametrize("tips", [False, True], ids=["no_tips", "tips"])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_elimination_gives_the_same_as_both_faces(
    order: int, tips: bool, load: tuple[dict[str, float], dict[str, float | str], set[int]]
) -> None:
    top, law, expected = load
    compare_forms(make_plate(top, law, order=order, tips=tips), expected)


@pytest.mark.parametrize("tips", [False, True], ids=["no_tips", "tips"])
# Beside the corner, within 2e-4 of it, the leg that slips on is opened by the other one.
@pytest.mark.parametrize(("ux", "uy", "expected"), [
    (-0.01, -0.003, {SLIP, OPEN}), (0.002, -0.003, {STICK, SLIP, OPEN}),
])
def test_elimination_gives_the_same_on_a_kinked_crack_in_several_modes(
    ux: float, uy: float, expected: set[int], tips: bool
) -> None:
    law: dict[str, float | str] = {"law": "coulomb", "friction": FRICTION}
    compare_forms(make_plate({"ux": ux, "uy": uy}, law, 0.15j, tips=tips), expected)


def test_faces_part_by_the_jump_and_the_rest_of_the_plate_is_continuous() -> None:
    # Without friction or opening to speak of, recovered face displacements join the field around the crack.
    top, law, _ = LOADS["stick"]
    body = make_plate(top, law)
    mesh, steps = march_to_end(body.build())
    faces, step = list_faces(mesh), steps[-1]
    crack = np.flatnonzero(mesh.node_crack)
    first = {complex(z): u for z, u in zip(faces.position[crack], step.displacement[crack], strict=True)}
    second = {complex(z): u for z, u in zip(faces.position[mesh.nodes :], step.displacement[mesh.nodes :], strict=True)}
    assert first.keys() == second.keys()
    size = np.abs(step.displacement).max()
    assert max(abs(first[z] - second[z]) for z in first) < 1e-12 * size
    # the same plate without the crack
    whole, plain = march_to_end(
        replace(body, curves={k: v for k, v in body.curves.items() if k != "crack"}, cracks={}, interfaces={}).build()
    )
    sources = collect_sources(whole, [ROCK])[0]
    points = np.array(list(first))
    A, B = evaluate_rows(sources, points, np.full(len(points), -1))
    u, t = (np.stack([f.real, f.imag], 1).ravel() for f in (plain[-1].displacement, plain[-1].traction))
    assert B is not None
    inside = A @ u + B @ t
    np.testing.assert_allclose(inside[0::2] + 1j * inside[1::2], list(first.values()), rtol=0, atol=1e-6 * size)


def solve_pressurised_crack(order: int, elements: int, tips: bool, grading: str = "none") -> tuple[Real, Real]:
    """Opening at the nodes of a crack of half-length 1 under pressure in a plate 400 wide, and Griffith's."""
    material, far, pressure = Material("rock", 1.0, 0.25), 200.0, 0.01
    corners = [complex(x, y) * far for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    names = ["bottom", "right", "top", "left"]
    curves = {name: [corners[k], corners[(k + 1) % 4]] for k, name in enumerate(names)} | {"crack": [-1 + 0j, 1 + 0j]}
    law: dict[str, float | str] = {"law": "coulomb", "friction": 0.5, "pressure": pressure}
    counts = {name: elements if name == "crack" else 3 for name in curves}
    body = Body(
        curves, {"plate": (material, names)}, {"bottom": {"uy": 0.0}, "left": {"ux": 0.0}}, {"crack": law},
        {"crack": "plate"}, order=order, tips=tips, elements=counts, grading=grading,
    )  # fmt: skip
    mesh, steps = march_to_end(body.build())
    exact = crack_opening(material.plane_modulus, 1.0, pressure, mesh.pairs.position.real)
    return steps[-1].contact.opening, exact


# order, elements, tips, grading, largest error relative to the opening in the middle
OPENINGS = [
    (1, 10, False, "none", 0.09),
    (2, 10, False, "none", 0.05),
    (1, 4, True, "none", 0.04),
    (2, 4, True, "none", 1.3e-3),
    (3, 4, True, "none", 4.5e-4),
    (2, 16, False, "both", 8e-3),
]


@pytest.mark.parametrize(("order", "elements", "tips", "grading", "largest"), OPENINGS)
def test_a_crack_in_a_large_plate_opens_as_griffith_says(
    order: int, elements: int, tips: bool, grading: str, largest: float
) -> None:
    opening, exact = solve_pressurised_crack(order, elements, tips, grading)
    error = np.abs(opening - exact).max() / exact.max()
    assert error < largest
    # symmetric about the middle of the crack, to rounding
    np.testing.assert_allclose(opening, opening[::-1], rtol=1e-6)


def test_tip_elements_give_the_stress_intensity_factor() -> None:
    # The opening at the tip's own node: K = E'/8 sqrt(2 pi/rho) du, and Griffith's K = pressure sqrt(pi a).
    opening, exact = solve_pressurised_crack(2, 4, True)
    assert abs(opening[0] / exact[0] - 1) < 1.5e-3
