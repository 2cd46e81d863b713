"""What must not change the result: units, place and orientation of the model, the way in which curves are written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem.rows import Sources, evaluate_rows
from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.mesh.mesh import Mesh
from pbem.mesh.shape_functions import place_nodes
from pbem.model.material import Material
from pbem.solve.problem.step import Step
from tests.identities.bodies import Body
from tests.identities.solving import march_to_end

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

SOFT, HARD = Material("soft", 2.0, 0.3), Material("hard", 3.0, 0.2)


# --- Rows of the equations --------------------------------------------------------------------------------------------


def make_sources(move: Callable[[Complex], Complex], modulus: float, length: float) -> tuple[Sources, Complex]:
    """Some elements, straight, curved and with tips, and points around them."""
    random = np.random.default_rng(5)
    start, end = random.normal(size=(2, 6, 2)) @ [1, 1j]
    sweep = np.array([0.0, 0.0, 0.0, 0.0, 0.7, -0.4])
    # centre of the arc from start to end
    turn = np.exp(1j * np.where(sweep == 0, 1.0, sweep))
    center = np.where(sweep == 0, 0, (end - start * turn) / (1 - turn))
    tip = np.array([0, 1, 2, 0, 0, 0], dtype=np.int8)
    points = random.normal(size=(7, 2)) @ [1, 1j]
    straight = sweep == 0
    sources = Sources(
        move(start), move(end), tip, place_nodes(2), 1.8, modulus, length, np.where(straight, 0, move(center)), sweep
    )
    return sources, move(points)


def turn_rows(rows: Real, angle: float) -> Real:
    """Rows and columns in axes turned by an angle."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    blocks = rows.reshape(len(rows) // 2, 2, -1, 2)
    return np.einsum("ab,ibjc,dc->iajd", turn, blocks, turn).reshape(rows.shape)


@pytest.mark.parametrize("angle", [0.0, 0.4, np.pi / 2, 3.0])
@pytest.mark.parametrize("shift", [0j, 3 - 5j])
@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
def test_rows_follow_scale_rotation_and_translation(size: float, shift: complex, angle: float) -> None:
    turn = complex(np.exp(1j * angle))
    sources, points = make_sources(lambda z: z, 1.3, 4.0)
    moved, moved_points = make_sources(lambda z: size * (turn * z + shift), 1.3, 4.0 * size)
    off = np.full(len(points), -1)
    normal = np.exp(1j * np.arange(7))
    for given, scales in ((None, (1.0, size)), (normal, (1 / size, 1.0))):
        one = evaluate_rows(sources, points, off, given)
        other = evaluate_rows(moved, moved_points, off, None if given is None else turn * given)
        for before, after, scale in zip(one, other, scales, strict=True):
            assert before is not None and after is not None
            expected = scale * turn_rows(before, angle)
            np.testing.assert_allclose(after, expected, rtol=0, atol=2e-12 * np.abs(expected).max())


def test_rows_follow_the_modulus() -> None:
    sources, points = make_sources(lambda z: z, 1.0, 4.0)
    stiff = replace(sources, shear_modulus=1e9)
    off = np.full(len(points), -1)
    for normal, scales in ((None, (1.0, 1e-9)), (np.ones(7) + 0j, (1e9, 1.0))):
        one, other = evaluate_rows(sources, points, off, normal), evaluate_rows(stiff, points, off, normal)
        for before, after, scale in zip(one, other, scales, strict=True):
            assert before is not None and after is not None
            np.testing.assert_allclose(after, scale * before, rtol=1e-13)


def test_the_unit_of_the_logarithm_adds_a_translation_only() -> None:
    # -kappa/(2 pi G (kappa + 1)) ln times the total force of a unit shape on the element
    sources, points = make_sources(lambda z: z, 1.3, 4.0)
    off = np.full(len(points), -1)
    first, second = (evaluate_rows(replace(sources, length=length), points, off)[1] for length in (4.0, 11.0))
    assert first is not None and second is not None
    difference = (second - first).reshape(7, 2, -1, 2)
    np.testing.assert_allclose(difference, difference[:1] + 0 * difference, atol=1e-14)  # the same at all points
    np.testing.assert_allclose(difference[..., [0, 1], :, [1, 0]], 0, atol=1e-14)


# --- A whole problem with friction ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Variant:
    """How the same problem is written down: lengths times size, stresses times stress, then turned and shifted."""

    size: float = 1.0
    stress: float = 1.0
    angle: float = 0.0
    shift: complex = 0j
    reversed: bool = False
    upper_first: bool = False
    steps: int = 1

    def place(self, z: complex) -> complex:
        return self.size * (z * complex(np.exp(1j * self.angle)) + self.shift)


def make_blocks(variant: Variant, **options: object) -> Body:
    """A block pressed on another and pushed aside, with a crack under pressure below: sticks, slips and parts."""
    curves: dict[str, list[complex]] = {
        "bottom": [0j, 2 + 0j], "right": [2 + 0j, 2 + 1j], "joint": [1j, 2 + 1j], "left": [1j, 0j],
        "right2": [2 + 1j, 2 + 2j], "top": [2 + 2j, 2j], "left2": [2j, 1j], "crack": [0.6 + 0.3j, 1.2 + 0.6j],
    }  # fmt: skip
    curves = {name: [variant.place(z) for z in points] for name, points in curves.items()}
    if variant.reversed:  # a reversed crack has its faces exchanged
        curves = {name: points if name == "crack" else points[::-1] for name, points in curves.items()}
    push = variant.size * (0.005 - 0.001j) * complex(np.exp(1j * variant.angle))
    soft, hard = (replace(material, young=variant.stress * material.young) for material in (SOFT, HARD))
    lower, upper = ["bottom", "right", "joint", "left"], ["joint", "right2", "top", "left2"]
    regions = {"lower": (hard, lower), "upper": (soft, upper)}
    if variant.upper_first:
        regions = {name: regions[name] for name in ("upper", "lower")}
    return Body(
        curves, regions, {"bottom": {"ux": 0.0, "uy": 0.0}, "top": {"ux": push.real, "uy": push.imag}},
        {"joint": {"law": "coulomb", "friction": 1.0, "cohesion": 1e-5 * variant.stress},
         "crack": {"law": "coulomb", "friction": 0.3, "pressure": 0.003 * variant.stress}},
        {"crack": "lower"}, elements=6, grading="both", steps=variant.steps, **options,  # type: ignore[arg-type]
    )  # fmt: skip


def read_contact(variant: Variant, **options: object) -> tuple[Mesh, Step]:
    mesh, steps = march_to_end(make_blocks(variant, **options).build())
    return mesh, steps[-1]


def expect_same(one: tuple[Mesh, Step], other: tuple[Mesh, Step], variant: Variant, tolerance: float = 1e-9) -> None:
    """The same modes, and jumps and tractions up to the units."""
    first, second = one[1].contact, other[1].contact
    np.testing.assert_array_equal(first.mode, second.mode)
    for name, unit in (("opening", variant.size), ("slip", variant.size), ("traction_n", variant.stress),
                       ("traction_s", variant.stress)):  # fmt: skip
        expected = unit * getattr(first, name)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(getattr(second, name), expected, rtol=0, atol=tolerance * scale, err_msg=name)


@pytest.fixture(scope="module")
def plain() -> tuple[Mesh, Step]:
    result = read_contact(Variant())
    assert {STICK, SLIP, OPEN} <= set(result[1].contact.mode)
    return result


MOVED = {
    "small": Variant(size=1e-3),
    "large": Variant(size=1e3),
    "in_pascal": Variant(stress=1e9),
    "in_other_units": Variant(size=25.4, stress=1e-6),
    "turned": Variant(angle=0.7),
    "turned_by_a_quarter": Variant(angle=np.pi / 2),
    "shifted": Variant(shift=5 - 3j),
    "all_at_once": Variant(size=1e3, stress=1e6, angle=-2.5, shift=1 + 2j),
    "curves_reversed": Variant(reversed=True),
}


@pytest.mark.parametrize("scheme", ["SST", "HST"])
@pytest.mark.parametrize("name", MOVED)
def test_results_do_not_depend_on_units_place_and_direction(
    name: str, scheme: str, plain: tuple[Mesh, Step]
) -> None:
    variant = MOVED[name]
    reference = plain if scheme == "SST" else read_contact(Variant(), scheme=scheme)
    found = read_contact(variant, scheme=scheme)
    if variant.reversed:  # the pairs of the joint come in the other order
        mesh, step = found
        joint = np.flatnonzero(mesh.pairs.interface == mesh.interface_names.index("joint"))
        order = np.arange(mesh.pairs.count)
        order[joint] = joint[::-1]
        fields = {key: value[order] for key, value in vars(step.contact).items() if key != "internal"}
        internal = {key: value[order] for key, value in step.contact.internal.items()}
        contact = replace(step.contact, **fields, internal=internal)
        found = mesh, replace(step, contact=contact)
    expect_same(reference, found, variant)


def test_results_do_not_depend_on_the_order_of_the_regions(plain: tuple[Mesh, Step]) -> None:
    # The other side comes first: the normal turns around, and with it s; jump and traction components stay.
    expect_same(plain, read_contact(Variant(upper_first=True)), Variant())


def test_moved_models_have_the_same_displacements(plain: tuple[Mesh, Step]) -> None:
    variant = MOVED["all_at_once"]
    _, step = read_contact(variant)
    turn = variant.size * complex(np.exp(1j * variant.angle))
    expected = turn * plain[1].displacement
    np.testing.assert_allclose(step.displacement, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
