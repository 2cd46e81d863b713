"""Values that vary along a curve: read with their faults, evaluated at the right place and time."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.arrays import Complex, Real
from pbem.case.case import parse_case
from pbem.contact.laws import collect_laws
from pbem.contact.loads import collect_outer_nodes, evaluate_load, evaluate_pressure
from pbem.errors import CaseError
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.build import build_model
from pbem.model.model import Model
from pbem.model.varying import Moment, Places, Varying, blend, negate

PLATE = """
[materials.m]
young = 1000.0
poisson = 0.2
[curves]
bottom = {{ points = [[0, 0], [2, 0]], elements = 4 }}
right = {{ points = [[2, 1], [2, 0]], elements = 3 }}
top = {{ points = [[2, 1], [1, 1], [0, 1]], elements = [3, 2] }}
left = {{ points = [[0, 0], [0, 1]], elements = 3 }}
crack = {{ points = [[0.5, 0.5], [1.5, 0.5]], elements = 8 }}
[regions.a]
material = "m"
boundary = ["bottom", "right", "top", "left"]
cracks = ["crack"]
[boundary.bottom]
ux = 0.0
uy = 0.0
{text}
"""


def build(text: str) -> tuple[Model, Mesh]:
    model = build_model(parse_case(PLATE.format(text=text)))
    return model, generate_mesh(model)


def load_on(model: Model, mesh: Mesh, curve: str, stage: int = 0, factor: float = 1.0) -> tuple[Complex, Real]:
    """The places of a curve's nodes, and what is prescribed there."""
    outer = collect_outer_nodes(model, mesh)
    on = mesh.node_curve[outer.node] == mesh.curve_names.index(curve)
    return mesh.position[outer.node[on]], evaluate_load(model, mesh, outer, stage, factor).values[on]


def test_s_runs_along_the_curve_as_it_is_written() -> None:
    """Whichever way the region's boundary is travelled: right is written against it, the others along it or not."""
    model, mesh = build("""
[boundary.right]
tx = { expression = "s" }
[boundary.top]
ty = { expression = "3*s + x" }
[boundary.left]
tx = { table = [[0.25, 1], [0.5, 3]] }
""")
    place, values = load_on(model, mesh, "right")
    np.testing.assert_allclose(values[:, 0], 1 - place.imag, atol=1e-14)
    place, values = load_on(model, mesh, "top")
    np.testing.assert_allclose(values[:, 1], 3 * (2 - place.real) + place.real, atol=1e-13)
    place, values = load_on(model, mesh, "left")
    np.testing.assert_allclose(values[:, 0], np.interp(place.imag, [0.25, 0.5], [1, 3]), atol=1e-14)


def test_values_are_linear_in_a_stage_but_for_those_of_time() -> None:
    model, mesh = build("""
[interfaces.crack]
friction = { expression = "0.1 + 0.2*x" }
cohesion = { table = [[0, 1], [1, 2]] }
pressure = { expression = "y" }
[[stages]]
boundary.top.ty = { expression = "x" }
[[stages]]
boundary.top.ty = { expression = "x*t**2" }
interfaces.crack.pressure = 3.0
[[stages]]
boundary.top.ty = 5.0
""")
    expected = {(0, 0.5): lambda x: 0.5 * x, (1, 0.001): lambda x: 1.001**2 * x, (1, 0.5): lambda x: 2.25 * x,
                (2, 0.0): lambda x: 4 * x, (2, 0.5): lambda x: 2 * x + 2.5}
    for (stage, factor), wanted in expected.items():
        place, values = load_on(model, mesh, "top", stage, factor)
        np.testing.assert_allclose(values[:, 1], wanted(place.real), rtol=1e-13)
    assert evaluate_pressure(model, mesh, 0, 0.5) == pytest.approx(0.25)
    assert evaluate_pressure(model, mesh, 1, 0.5) == pytest.approx(0.5 * (0.5 + 3.0))
    laws = collect_laws(model, mesh)
    (group,) = laws.strengths
    x = mesh.pairs.position.real
    np.testing.assert_allclose(group.parameters["friction"], 0.1 + 0.2 * x, rtol=1e-14)
    np.testing.assert_allclose(group.parameters["cohesion"], 1 + (x - 0.5), rtol=1e-14)


def test_a_moment_of_a_stage() -> None:
    places = Places(np.array([1 + 2j, 3 - 1j]), np.array([0.5, 4.0]))
    moment = Moment(2.0, 2.5, 0.25)
    assert blend(2.0, Varying("x*y + s"), places, moment) == pytest.approx([1.5 + 0.25 * 2.5, 1.5 + 0.25 * 1.0])
    assert blend(7.0, Varying("x*t"), places, moment) == pytest.approx([2.5, 7.5])
    table = Varying(table=((0.0, 1.0), (1.0, 3.0)))
    assert negate(table).evaluate(places) == pytest.approx([-2.0, -3.0])
    assert negate(Varying("x - t")).evaluate(places, 3.0) == pytest.approx([2.0, 0.0])
    assert f"{table:g}" == "table of 2 (1 at s = 0 to 3 at s = 1)"
    assert f"{Varying('x'):g}" == '"x"'


FAULTS = {
    "boundary.top.ty": ('{ expression = "x +" }', "breaks off"),
    "boundary.left.tx": ('{ expression = "1/y" }', "no finite value at (0, 0) on curve 'left'"),
    "boundary.right.tx": ("{ table = [[0, 1], [0, 2]] }", "s increases from row to row"),
    "boundary.right.pressure": ("{ table = [[0, 1]] }", "{ table = [[s, value], ...] }"),
    "interfaces.crack.friction": ('{ expression = "x - 1" }', "a friction that is -0.5 at (0.5, 0.5)"),
    "interfaces.crack.cohesion": ('{ expression = "t" }', "unknown name 't'"),
    "interfaces.crack.tensile_strength": ("{ table = [[0, 0], [1, -1]] }", "values >= 0"),
    "interfaces.crack.pressure": ('{ expression = "sqrt(0.2 - t)" }', "no finite value at the time 0.5"),
    "interfaces.crack.gap": ('{ expresion = "x" }', "did you mean 'expression'"),
}


@pytest.mark.parametrize("place", FAULTS)
def test_wrong_values_are_told(place: str) -> None:
    value, text = FAULTS[place]
    table, key = place.rsplit(".", 1)
    with pytest.raises(CaseError) as raised:
        build(f"[{table}]\n{key} = {value}\n")
    assert place in str(raised.value) and text in str(raised.value)
    assert len(raised.value.faults) == 1


@pytest.mark.parametrize(
    ("lines", "text"),
    [
        ('friction = { expression = "x" }\nfriction_dynamic = 1.2\nslip_distance = 1', "friction_dynamic above"),
        ("friction = 1.0\ncohesion = { table = [[0, 1], [1, 2]] }\ntensile_strength = 1.5", "beyond the apex"),
    ],
)
def test_strengths_that_do_not_fit_somewhere_are_told(lines: str, text: str) -> None:
    with pytest.raises(CaseError, match=text):
        build(f"[interfaces.crack]\n{lines}\n")


def test_durations_go_with_loads_that_depend_on_time() -> None:
    stage = "[[stages]]\nduration = 5\n"
    with pytest.raises(CaseError, match="no effect"):
        build(stage + "boundary.top.ty = 1.0\n")
    timed = 'boundary.top.ty = { expression = "t" }\n'
    model, _ = build(stage + timed + stage)
    assert (model.timed, model.find_time(1, 0.5)) == (True, 7.5)
    with pytest.raises(CaseError, match="a stage without duration"):
        build(stage + timed + "[[stages]]\n")
    # A force of a curve is a load like any other, spread over it or on a rigid body.
    for kind in ('how = "uniform"', 'how = "linear"'):
        force = f'boundary.top.force = {{ {kind}, fy = {{ expression = "t" }} }}\n'
        assert build("[boundary]\n" + force.replace("boundary.", "") + stage + stage)[0].find_time(1, 0.5) == 7.5
