"""The patch test: piecewise linear fields, which the shapes contain, come out exactly through the whole program.

Layers whose joints run along x have the exact solution u = (a y, b y) in each, with one shear and one normal traction
through all of them, whatever their materials; at a joint both components may jump. Their sides may have any shape.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.case.build import parse_model
from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.exact import PlaneField, uniform_field
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh, list_faces
from pbem.model.material import Material
from pbem.parallel import world
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem
from tests.identities.bodies import Body
from tests.identities.solving import march_to_end

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

EXACT = 1e-10
LOWER, UPPER = Material("lower", 3.0, 0.2), Material("upper", 1.7, 0.35)
FRICTION = 0.5

schemes = pytest.mark.parametrize("scheme", ["SST", "DBEM", "HST", "THST"])
# Units act on all orders alike.
orders_and_sizes = pytest.mark.parametrize(("order", "size"), [(1, 1e3), (2, 1e-3), (3, 1.0), (2, 1.0)])


@dataclass(frozen=True)
class Layers:
    """Two layers below and above y = height, held at y = 0, with the normal and shear traction at y = const.

    jump: displacement of the upper layer at the joint beyond that of the lower.
    """

    height: float
    normal: float
    shear: float
    jump: complex
    materials: tuple[Material, Material] = (LOWER, UPPER)

    def fields(self) -> tuple[PlaneField, PlaneField]:
        fields, below, shift = [], 0.0, 0j
        for material in self.materials:
            strain, slope = self._strain(material)
            lame = self.normal - 2 * material.shear_modulus * strain
            # u = shift + (slope, strain) (y - below)
            translation = shift - below * (slope + 1j * strain)
            fields.append(
                uniform_field(
                    material.kappa, material.shear_modulus, (lame, self.normal, self.shear), -slope / 2, translation
                )
            )
            shift += self.height * (slope + 1j * strain) + self.jump
            below = self.height
        return fields[0], fields[1]

    @staticmethod
    def _modulus(material: Material) -> float:
        """Stress over strain along y where there is no strain along x."""
        return material.shear_modulus * (material.kappa + 1) / (material.kappa - 1)

    def _strain(self, material: Material) -> tuple[float, float]:
        return self.normal / self._modulus(material), self.shear / material.shear_modulus


def draw_sides(
    random: np.random.Generator | None, size: float
) -> tuple[list[list[complex]], list[list[complex]]]:
    """Corners of the right side of both layers, from bottom to top, and of the left side; the layers are size high.

    Without random numbers the sides are straight.
    """
    sides = []
    for start in (2.0, 0.0):
        if random is None:
            sides.append([[complex(start, y) * size for y in layer] for layer in ((0, 0.5, 1), (1, 1.5, 2))])
            continue
        x = start + random.uniform(-0.3, 0.3, 5)
        y = np.array([0, random.uniform(0.2, 0.8), 1, random.uniform(1.2, 1.8), 2])
        corners = [complex(size * point) for point in x + 1j * y]
        sides.append([corners[:3], corners[2:]])
    return sides[0], sides[1]


def make_layers(
    exact: Layers, random: np.random.Generator | None, size: float, law: dict[str, float | str], free_top: bool = False,
    **options: object,
) -> Body:
    """Every leg of the sides is a curve of its own with the uniform traction of the exact stress on it."""
    right, left = draw_sides(random, size)
    curves: dict[str, list[complex]] = {"bottom": [left[0][0], right[0][0]], "joint": [left[0][2], right[0][2]],
                                        "top": [left[1][2], right[1][2]]}  # fmt: skip
    conditions: dict[str, dict[str, float]] = {"bottom": {"ux": 0.0, "uy": 0.0}}
    fields = exact.fields()
    top = fields[1].displacement(left[1][2]), fields[1].traction(0, 1j)
    names = ("tx", "ty") if free_top else ("ux", "uy")
    conditions["top"] = dict(zip(names, (float(top[free_top].real), float(top[free_top].imag)), strict=True))
    outlines = [["bottom", "joint"], ["joint", "top"]]
    for layer in (0, 1):
        for side, corners, outward in (("right", right, -1j), ("left", left, 1j)):
            for part in (0, 1):
                start, end = corners[layer][part : part + 2]
                traction = complex(fields[layer].traction(start, outward * (end - start) / abs(end - start)))
                name = f"{side}{layer}{part}"
                curves[name] = [start, end]
                conditions[name] = {"tx": traction.real, "ty": traction.imag}
                outlines[layer].append(name)
    regions = {"lower": (exact.materials[0], outlines[0]), "upper": (exact.materials[1], outlines[1])}
    return Body(curves, regions, conditions, {"joint": law}, elements=2, **options)  # type: ignore[arg-type]


def expect_fields(mesh: Mesh, step: Step, fields: dict[str, PlaneField]) -> None:
    """Displacement and traction at every node, relative to the largest of each.

    Where there is no traction, relative to a hundredth of modulus times displacement over length.
    """
    faces = list_faces(mesh)
    u, t = np.zeros_like(faces.position), np.zeros_like(faces.position)
    modulus, extent = next(iter(fields.values())).shear_modulus, np.ptp(faces.position.imag)
    for name, exact in fields.items():
        own = faces.region == mesh.region_names.index(name)
        u[own] = exact.displacement(faces.position[own])
        t[own] = exact.traction(faces.position[own], faces.normal[own])
    assert np.abs(step.displacement - u).max() <= EXACT * np.abs(u).max()
    stress = max(np.abs(t).max(), 0.01 * modulus * np.abs(u).max() / extent)
    assert np.abs(step.traction - t).max() <= EXACT * stress


def expect_layers(exact: Layers, body: Body, mode: int, steps: int) -> None:
    mesh, found = march_to_end(body.build())
    assert len(found) == steps
    lower, upper = exact.fields()
    expect_fields(mesh, found[-1], {"lower": lower, "upper": upper})
    contact = found[-1].contact
    np.testing.assert_array_equal(contact.mode, mode)
    # first side below: n = +y, s = -x
    jump = max(np.abs(lower.displacement(1j * exact.height)), np.abs(exact.jump))
    traction = max(np.hypot(exact.normal, exact.shear), 0.01 * LOWER.shear_modulus * jump / exact.height)
    for values, expected, scale in (
        (contact.traction_n, exact.normal, traction), (contact.traction_s, -exact.shear, traction),
        (contact.opening, exact.jump.imag, jump), (contact.slip, -exact.jump.real, jump),
    ):  # fmt: skip
        assert np.abs(values - expected).max() <= EXACT * scale


# jump and tractions in units of the layers' height and of stress; the top moves as far as the exact solution says
CONTACTS: dict[str, tuple[dict[str, float | str], tuple[float, float, complex], int]] = {
    "bonded, pulled": ({"law": "bonded"}, (0.01, -0.02, 0j), STICK),
    "pressed": ({"law": "coulomb", "friction": FRICTION}, (-0.01, 0.0, 0j), STICK),
    "pressed and sheared": ({"law": "coulomb", "friction": FRICTION}, (-0.01, 0.004, 0j), STICK),
    "slipping": ({"law": "coulomb", "friction": FRICTION}, (-0.01, 0.005, 0.003 + 0j), SLIP),
    "slipping back": ({"law": "coulomb", "friction": FRICTION}, (-0.01, -0.005, -0.003 + 0j), SLIP),
    "smooth": ({"law": "frictionless"}, (-0.01, 0.0, 0.02 + 0j), SLIP),
    "parted": ({"law": "coulomb", "friction": FRICTION}, (0.0, 0.0, 0.002 + 0.01j), OPEN),
}  # fmt: skip

contacts = pytest.mark.parametrize("contact", CONTACTS.values(), ids=[name.replace(" ", "_") for name in CONTACTS])


@schemes
@contacts
@orders_and_sizes
def test_layers_of_different_materials_come_out_exactly(
    size: float, order: int, contact: tuple[dict[str, float | str], tuple[float, float, complex], int], scheme: str
) -> None:
    law, (normal, shear, jump), mode = contact
    exact = Layers(size, normal, shear, size * jump)
    random = np.random.default_rng(order)
    expect_layers(exact, make_layers(exact, random, size, law, scheme=scheme, order=order), mode, 1)


@schemes
@contacts
def test_steps_of_a_growing_load_end_alike(
    contact: tuple[dict[str, float | str], tuple[float, float, complex], int], scheme: str
) -> None:
    law, (normal, shear, jump), mode = contact
    exact = Layers(1.0, normal, shear, jump)
    body = make_layers(exact, np.random.default_rng(7), 1.0, law, scheme=scheme, steps=5)
    expect_layers(exact, body, mode, 5)


@schemes
@pytest.mark.parametrize("contact", ["bonded, pulled", "pressed and sheared"])
def test_layers_loaded_by_tractions_all_around_but_below(contact: str, scheme: str) -> None:
    law, (normal, shear, jump), mode = CONTACTS[contact]
    exact = Layers(1.0, normal, shear, jump)
    expect_layers(exact, make_layers(exact, np.random.default_rng(3), 1.0, law, True, scheme=scheme), mode, 1)


@schemes
def test_fluid_pressure_presses_the_open_faces_apart(scheme: str) -> None:
    exact = Layers(1.0, -0.02, 0.0, 0.01j)
    law: dict[str, float | str] = {"law": "coulomb", "friction": FRICTION, "pressure": 0.02}
    expect_layers(exact, make_layers(exact, np.random.default_rng(4), 1.0, law, scheme=scheme), OPEN, 1)


@schemes
def test_a_gap_closes_and_then_carries(scheme: str) -> None:
    # The upper layer comes down by more than the gap: its jump at the joint is the gap itself.
    exact = Layers(1.0, -0.01, 0.002, -0.004j)
    law: dict[str, float | str] = {"law": "coulomb", "friction": FRICTION, "gap": 0.004}
    body = make_layers(exact, np.random.default_rng(5), 1.0, law, scheme=scheme)
    mesh, steps = march_to_end(body.build())
    lower, upper = exact.fields()
    expect_fields(mesh, steps[-1], {"lower": lower, "upper": upper})
    assert np.abs(steps[-1].contact.opening).max() < 1e-12


@schemes
@pytest.mark.parametrize("strength", [0.0, 0.005, 0.0099, 0.0101])
def test_a_joint_parts_where_tension_reaches_its_strength(strength: float, scheme: str) -> None:
    # Without lateral contraction the tension is uniform although the straight sides are free.
    cork = Material("cork", 1.0, 0.0)
    bonded = Layers(1.0, 0.01, 0.0, 0j, (cork, cork))
    parted = Layers(1.0, 0.0, 0.0, complex(bonded.fields()[1].displacement(2j)), (cork, cork))
    holds = strength > bonded.normal
    law: dict[str, float | str] = {"law": "coulomb", "cohesion": 1.0, "tensile_strength": strength}
    exact = bonded if holds else parted
    expect_layers(exact, make_layers(exact, None, 1.0, law, scheme=scheme), STICK if holds else OPEN, 1)


@schemes
def test_friction_is_followed_through_a_cycle_of_shear(scheme: str) -> None:
    # Stick to the cone, slip, stick on the way back, slip back: between the corners all is linear in time.
    normal, limit, slip = -0.01, 0.005, 0.004
    corners = [(limit, 0.0), (limit, slip), (-limit, slip), (-limit, -slip), (limit, -slip)]
    press = Layers(1.0, normal, 0.0, 0j)
    law: dict[str, float | str] = {"law": "coulomb", "friction": FRICTION}
    states = [press, *(Layers(1.0, normal, shear, complex(jump)) for shear, jump in corners)]
    bodies = [make_layers(state, np.random.default_rng(8), 1.0, law, scheme=scheme) for state in states]
    stages = []
    for number, body in enumerate(bodies):
        stages += ["[[stages]]", f'name = "stage{number}"', "steps = 2"]
        for curve, values in body.conditions.items():
            stages += [f"[stages.boundary.{curve}]", *(f"{key} = {value!r}" for key, value in values.items())]
    text = bodies[0].write().replace("[analysis]", "\n".join([*stages, "[analysis]"]))
    model = parse_model(text)[1]
    mesh = generate_mesh(model)
    found = {
        step.stage: step for step in march(assemble_problem(model, mesh, world), SilentReporter()) if step.last_of_stage
    }
    path = 0.0
    for number, state in enumerate(states):
        lower, upper = state.fields()
        expect_fields(mesh, found[number], {"lower": lower, "upper": upper})
        path += abs(state.jump - states[max(number - 1, 0)].jump)
        np.testing.assert_allclose(found[number].contact.slip, -state.jump.real, atol=1e-12)
        np.testing.assert_allclose(found[number].contact.slip_path, path, atol=1e-12)


COMPLIANT: dict[str, tuple[float, float, float, int]] = {
    "pressed": (-0.01, 0.004, 0.0, STICK),
    "slipping": (-0.01, 0.005, 0.003, SLIP),
    "slipping back": (-0.01, -0.005, -0.003, SLIP),
}


@schemes
@pytest.mark.parametrize(("slip", "friction"), [(0.02, 0.4), (0.1, 0.2)])
def test_the_elastic_slip_of_a_joint_weakens_nothing(slip: float, friction: float, scheme: str) -> None:
    # As below, where all slip is plastic; half as much again is elastic here.
    shear = 0.01 * friction
    exact = Layers(1.0, -0.01, shear, complex(1.5 * slip))
    law: dict[str, float | str] = {
        "law": "coulomb", "friction": FRICTION, "friction_dynamic": 0.2, "slip_distance": 0.06,
        "tangential_stiffness": shear / (0.5 * slip),
    }  # fmt: skip
    expect_layers(exact, make_layers(exact, np.random.default_rng(2), 1.0, law, scheme=scheme), SLIP, 1)


@schemes
@pytest.mark.parametrize("load", COMPLIANT.values(), ids=[name.replace(" ", "_") for name in COMPLIANT])
def test_elastic_joints_give_way_by_compliance_times_traction(
    load: tuple[float, float, float, int], scheme: str
) -> None:
    normal, shear, slip, mode = load
    stiffness_n, stiffness_s = 7.0, 2.0
    exact = Layers(1.0, normal, shear, slip + shear / stiffness_s + 1j * normal / stiffness_n)
    law: dict[str, float | str] = {
        "law": "coulomb", "friction": FRICTION, "normal_stiffness": stiffness_n, "tangential_stiffness": stiffness_s,
    }  # fmt: skip
    expect_layers(exact, make_layers(exact, np.random.default_rng(9), 1.0, law, scheme=scheme), mode, 1)


@schemes
@pytest.mark.parametrize(("slip", "friction"), [(0.02, 0.4), (0.06, 0.2), (0.1, 0.2)])
def test_friction_weakens_with_slip(slip: float, friction: float, scheme: str) -> None:
    # From 0.5 to 0.2 over a slip of 0.06, so slowly that the slip neither runs away nor localises.
    exact = Layers(1.0, -0.01, 0.01 * friction, complex(slip))
    law: dict[str, float | str] = {
        "law": "coulomb", "friction": FRICTION, "friction_dynamic": 0.2, "slip_distance": 0.06,
    }  # fmt: skip
    expect_layers(exact, make_layers(exact, np.random.default_rng(2), 1.0, law, scheme=scheme), SLIP, 1)


@schemes
@orders_and_sizes
@pytest.mark.parametrize("law", ["bonded", "coulomb", "frictionless"])
def test_a_block_with_an_inclusion_of_its_own_material(law: str, size: float, order: int, scheme: str) -> None:
    # A random hexagon in a random quadrilateral on two rollers; under equal pressure all around no law is felt.
    random = np.random.default_rng(order)
    corners = [0j, 2 + 0j, *(random.uniform(1.7, 2.2) + 1j * random.uniform(1.7, 2.2) for _ in range(1)), 2.1j]
    corners = [complex(size * corner) for corner in corners]
    angles = np.pi / 3 * (np.arange(7) + random.uniform(-0.2, 0.2, 7))
    hexagon = [complex(size * (1 + 1j + r * np.exp(1j * a))) for r, a in zip(random.uniform(0.3, 0.7, 7), angles)]  # noqa: B905
    hexagon[6] = hexagon[0]
    stress = (-0.01, -0.01, 0.0) if law == "frictionless" else (-0.01, -0.013, 0.0)
    exact = uniform_field(LOWER.kappa, LOWER.shear_modulus, stress)
    curves = {"bottom": corners[:2], "right": corners[1:3], "top": corners[2:], "left": [corners[3], corners[0]]}
    conditions: dict[str, dict[str, float]] = {"bottom": {"uy": 0.0}, "left": {"ux": 0.0}}
    for name in ("right", "top"):
        start, end = curves[name]
        traction = complex(exact.traction(start, -1j * (end - start) / abs(end - start)))
        conditions[name] = {"tx": traction.real, "ty": traction.imag}
    table: dict[str, float | str] = {"law": law, **({"friction": FRICTION} if law == "coulomb" else {})}
    body = Body(
        curves | {"rim": hexagon}, {"block": (LOWER, [*curves, "rim"]), "grain": (LOWER, ["rim"])}, conditions,
        {"rim": table}, elements=2, order=order, scheme=scheme,
    )  # fmt: skip
    mesh, steps = march_to_end(body.build())
    expect_fields(mesh, steps[-1], {"block": exact, "grain": exact})
    assert np.all(steps[-1].contact.mode == (SLIP if law == "frictionless" else STICK))
    assert np.abs(steps[-1].contact.slip).max() < 1e-11 * size
