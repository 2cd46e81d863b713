"""Meshes: places, normals, lengths, pairs, faces, and which equation is collocated where."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.mesh import generate
from pbem.mesh.carry import list_curve_elements
from pbem.mesh.generate import generate_mesh
from pbem.mesh.interpolation import differentiate_at_nodes
from pbem.mesh.mesh import Mesh, list_faces, second_face_nodes
from pbem.mesh.shape_functions import place_crack_nodes, place_nodes
from pbem.model.model import Model
from tests.identities.bodies import ROCK, Body, mesh_body

SQUARE = {
    "bottom": [0j, 2 + 0j], "right": [2 + 0j, 2 + 1j], "joint": [1j, 2 + 1j], "left": [1j, 0j],
    "right2": [2 + 1j, 2 + 2j], "top": [2 + 2j, 2j], "left2": [2j, 1j],
}  # fmt: skip


def make_blocks(**options: object) -> Body:
    """Two blocks: the lower one, listed first, has a round inclusion and a kinked crack, the upper one a hole."""
    return Body(
        curves=SQUARE | {
            "rim": (0.5 + 0.5j, 0.25), "hole": (1.5 + 1.5j, 0.25), "crack": [1.2 + 0.3j, 1.5 + 0.5j, 1.8 + 0.4j],
        },
        regions={
            "lower": (ROCK, ["bottom", "right", "joint", "left", "rim"]),
            "upper": (ROCK, ["joint", "right2", "top", "left2", "hole"]),
            "grain": (ROCK, ["rim"]),
        },
        conditions={"bottom": {"ux": 0.0, "uy": 0.0}},
        interfaces={"joint": {"law": "coulomb", "friction": 0.5}},
        cracks={"crack": "lower"},
        circles=frozenset({"rim", "hole"}),
        **{"elements": 8, **options},  # type: ignore[arg-type]
    )  # fmt: skip


def select(mesh: Mesh, region: str, curve: str) -> np.ndarray:
    """Nodes of a region on a curve."""
    return (mesh.node_region == mesh.region_names.index(region)) & (mesh.node_curve == mesh.curve_names.index(curve))


@pytest.fixture(scope="module")
def blocks() -> tuple[Model, Mesh]:
    return mesh_body(make_blocks(grading="both"))


def test_nodes_are_numbered_element_after_element_region_after_region(blocks: tuple[Model, Mesh]) -> None:
    _, mesh = blocks
    assert mesh.nodes == 3 * mesh.elements == len(mesh.normal) == len(mesh.weight) == len(mesh.traction_equation)
    assert np.all(np.diff(mesh.region) >= 0)
    np.testing.assert_array_equal(mesh.node_element, np.arange(mesh.nodes) // 3)
    some = np.random.default_rng(1).permutation(mesh.nodes)[: mesh.nodes // 2]
    np.testing.assert_array_equal(mesh.take_local(some), mesh.node_local[some])
    straight = mesh.sweep == 0
    middle, half = (mesh.start + mesh.end) / 2, (mesh.end - mesh.start) / 2
    local = np.where(mesh.crack[:, None], place_crack_nodes(2), place_nodes(2))
    places = middle[:, None] + half[:, None] * local
    np.testing.assert_allclose(mesh.position.reshape(-1, 3)[straight], places[straight], atol=1e-15)


def test_loops_close_and_have_the_region_on_their_left(blocks: tuple[Model, Mesh]) -> None:
    model, mesh = blocks
    for number, region in enumerate(model.regions):
        own = (mesh.region == number) & ~mesh.crack
        start, end = mesh.start[own], mesh.end[own]
        # every end is another element's start, to the last digit
        assert set(start) == set(end)
        # Seen from just inside a straight element, the whole boundary turns once around.
        nodes = np.repeat(own & (mesh.sweep == 0), 3)
        inward = mesh.position[nodes] - 1e-6 * mesh.normal[nodes]
        angles = np.angle((end - inward[:, None]) / (start - inward[:, None])).sum(axis=1)
        np.testing.assert_allclose(angles, 2 * np.pi, atol=1e-9, err_msg=region.name)


def test_normals_are_outward_unit_vectors(blocks: tuple[Model, Mesh]) -> None:
    _, mesh = blocks
    np.testing.assert_allclose(np.abs(mesh.normal), 1, atol=1e-15)
    for region, curve, normal in (
        ("lower", "bottom", -1j), ("lower", "right", 1), ("lower", "joint", 1j), ("lower", "left", -1),
        ("upper", "joint", -1j), ("upper", "top", 1j),
    ):  # fmt: skip
        np.testing.assert_allclose(mesh.normal[select(mesh, region, curve)], normal, atol=1e-15)
    for region, curve, center, sign in (
        ("grain", "rim", 0.5 + 0.5j, 1), ("lower", "rim", 0.5 + 0.5j, -1), ("upper", "hole", 1.5 + 1.5j, -1),
    ):  # fmt: skip
        nodes = select(mesh, region, curve)
        np.testing.assert_allclose(mesh.normal[nodes], sign * (mesh.position[nodes] - center) / 0.25, atol=1e-14)


def test_circles_are_round(blocks: tuple[Model, Mesh]) -> None:
    _, mesh = blocks
    nodes = select(mesh, "grain", "rim")
    np.testing.assert_allclose(np.abs(mesh.position[nodes] - 0.5 - 0.5j), 0.25, rtol=1e-14)
    assert mesh.weight[nodes].sum() == pytest.approx(2 * np.pi * 0.25, rel=2e-6)


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_weights_add_up_to_the_length_of_the_curve(order: int) -> None:
    _, mesh = mesh_body(make_blocks(order=order, elements=16))
    for region, curve, length in (("lower", "bottom", 2), ("upper", "left2", 1), ("lower", "crack", None)):
        nodes = select(mesh, region, curve)
        exact = length or abs(0.3 + 0.2j) + abs(0.3 - 0.1j)
        assert mesh.weight[nodes].sum() == pytest.approx(exact, rel=1e-14)
    round_length = mesh.weight[select(mesh, "upper", "hole")].sum() / (2 * np.pi * 0.25)
    # Weights integrate tractions, which on an arc are no polynomials of the parameter: q^(2 p + 2) with q = 0.1.
    assert abs(round_length - 1) < 0.5 * 0.1 ** (2 * order + 2)


def test_the_two_sides_of_an_interface_have_the_same_points(blocks: tuple[Model, Mesh]) -> None:
    _, mesh = blocks
    pairs = mesh.pairs
    joint = ~pairs.crack
    first, second = mesh.position[pairs.first], mesh.position[pairs.second]
    np.testing.assert_allclose(first, second, rtol=0, atol=3e-16)
    straight = mesh.sweep[mesh.node_element[pairs.first]] == 0
    np.testing.assert_array_equal(first[straight], second[straight])  # to the last digit
    np.testing.assert_allclose(mesh.normal[pairs.first], pairs.normal, atol=1e-15)
    np.testing.assert_allclose(mesh.normal[pairs.second[joint]], -pairs.normal[joint], atol=1e-15)
    np.testing.assert_allclose(first, pairs.position, rtol=0, atol=3e-16)
    assert len(set(pairs.first)) == pairs.count and len(set(pairs.second)) == pairs.count


def test_elements_of_closed_curves_are_listed_in_their_direction(blocks: tuple[Model, Mesh]) -> None:
    """Of a circle that two regions have, one travels it backwards."""
    model, mesh = blocks
    middle = 0.5 * (mesh.start + mesh.end)
    found = [(name, own) for name, own in list_curve_elements(model, mesh) if name in ("rim", "hole")]
    assert [name for name, _ in found] == ["rim", "hole", "rim"]
    assert found[0][1][0] > found[0][1][-1] and found[2][1][0] < found[2][1][-1]
    for name, own in found:
        leg = model.curves[name].legs[0]
        turned = np.angle((middle[own] - leg.center) / (leg.start - leg.center)) % (2 * np.pi)
        assert np.all(np.diff(turned * np.sign(leg.sweep)) > 0)


def test_curves_that_are_divided_at_once_have_the_elements_of_each(
    blocks: tuple[Model, Mesh], monkeypatch: pytest.MonkeyPatch
) -> None:
    model, mesh = blocks
    monkeypatch.setattr(generate, "JOINED", 2)
    monkeypatch.setattr(generate, "PLACED", 3)
    other = generate_mesh(model)
    for name in ("start", "end", "sweep", "position", "normal", "weight", "region", "curve"):
        assert np.allclose(getattr(other, name), getattr(mesh, name), rtol=1e-15, atol=1e-15), name
    for name, own in list_curve_elements(model, other):
        ends = np.concatenate([leg.element_ends()[1 if number else 0 :]
                               for number, leg in enumerate(model.curves[name].legs)])
        np.testing.assert_allclose(other.start[own] + other.end[own], ends[:-1] + ends[1:], rtol=0, atol=1e-15)


def test_pairs_follow_their_curve(blocks: tuple[Model, Mesh]) -> None:
    _, mesh = blocks
    assert mesh.interface_names == ("joint", "rim", "crack")
    assert np.all(np.diff(mesh.pairs.interface) >= 0)
    for number, name in enumerate(mesh.interface_names):
        own = mesh.pairs.interface == number
        along, position = mesh.pairs.arc_length[own], mesh.pairs.position[own]
        assert np.all(np.diff(along) > 0)
        if name == "joint":
            np.testing.assert_allclose(position, 1j + along, atol=1e-14)
        elif name == "rim":
            np.testing.assert_allclose(position, 0.5 + 0.5j + 0.25 * np.exp(4j * along), atol=1e-14)
        else:
            leg = abs(0.3 + 0.2j)
            first = 1.2 + 0.3j + along * (0.3 + 0.2j) / leg
            second = 1.5 + 0.5j + (along - leg) * (0.3 - 0.1j) / abs(0.3 - 0.1j)
            np.testing.assert_allclose(position, np.where(along < leg, first, second), atol=1e-14)
        length = {"joint": 2.0, "rim": 0.5 * np.pi, "crack": abs(0.3 + 0.2j) + abs(0.3 - 0.1j)}[name]
        assert mesh.pairs.weight[own].sum() == pytest.approx(length, rel=2e-6)
        assert 0 < along[0] < 0.1 * length and 0.9 * length < along[-1] < length


def test_the_first_side_is_that_of_the_region_listed_first(blocks: tuple[Model, Mesh]) -> None:
    _, mesh = blocks
    names = np.array(mesh.region_names)
    for name, first, second, normal in (("joint", "lower", "upper", 1j), ("rim", "lower", "grain", None)):
        own = mesh.pairs.interface == mesh.interface_names.index(name)
        assert set(names[mesh.node_region[mesh.pairs.first[own]]]) == {first}
        assert set(names[mesh.node_region[mesh.pairs.second[own]]]) == {second}
        if normal is not None:
            np.testing.assert_allclose(mesh.pairs.normal[own], normal, atol=1e-15)


def test_the_first_face_of_a_crack_lies_on_the_left_of_its_direction(blocks: tuple[Model, Mesh]) -> None:
    # The body on the left of the crack has its outward normal to the right.
    _, mesh = blocks
    own = mesh.pairs.crack
    assert np.array_equal(mesh.pairs.first[own], mesh.pairs.second[own])
    crack = mesh.crack
    direction = np.repeat((mesh.end - mesh.start)[crack] / np.abs(mesh.end - mesh.start)[crack], 3)
    np.testing.assert_allclose(mesh.pairs.normal[own], -1j * direction, atol=1e-15)
    assert mesh.start[crack][0] == 1.2 + 0.3j and mesh.end[crack][-1] == 1.8 + 0.4j


def test_reversing_a_curve_changes_the_order_of_its_pairs_only() -> None:
    body = make_blocks()
    _, forward = mesh_body(body)
    curves = {name: points if name in body.circles else points[::-1] for name, points in body.curves.items()}
    _, backward = mesh_body(replace(body, curves=curves))
    for number in (0, 1):  # the joint and the rim; a reversed crack has other sides
        one, other = (
            {complex(z): n for z, n in zip(pairs.position[own], pairs.normal[own], strict=True)}
            for pairs in (forward.pairs, backward.pairs)
            for own in [pairs.interface == number]
        )
        assert one.keys() == other.keys()
        assert all(abs(one[z] - other[z]) < 1e-14 for z in one)
    np.testing.assert_allclose(np.sort(forward.position), np.sort(backward.position), atol=1e-15)


def test_faces_append_the_second_face_of_every_crack(blocks: tuple[Model, Mesh]) -> None:
    _, mesh = blocks
    faces = list_faces(mesh)
    added = second_face_nodes(mesh)
    assert len(faces.position) == mesh.nodes + mesh.node_crack.sum()
    np.testing.assert_array_equal(faces.position[mesh.nodes :], mesh.position[added])
    np.testing.assert_array_equal(faces.normal[mesh.nodes :], -mesh.normal[added])
    np.testing.assert_array_equal(faces.weight[mesh.nodes :], mesh.weight[added])
    assert sorted(added) == list(np.flatnonzero(mesh.node_crack))
    # as on every other element the nodes follow the direction of travel
    along = np.real((faces.position - faces.start[faces.element]) / (faces.end - faces.start)[faces.element])
    straight = np.concatenate([mesh.sweep == 0, np.ones(mesh.crack.sum(), dtype=bool)])[faces.element]
    local = np.concatenate([mesh.node_local, np.tile(mesh.crack_local, mesh.crack.sum())])
    np.testing.assert_allclose(along[straight], (1 + local[straight]) / 2, atol=1e-12)
    outward = -1j * (faces.end - faces.start) / np.abs(faces.end - faces.start)
    np.testing.assert_allclose(faces.normal[straight], outward[faces.element][straight], atol=1e-14)


def test_tip_elements_are_at_the_tips_only(blocks: tuple[Model, Mesh]) -> None:
    model, _ = blocks
    cracks = np.flatnonzero(generate_mesh(model).crack)
    for tips, expected in (((True, True), (1, 2)), ((False, True), (0, 2)), ((True, False), (1, 0))):
        changed = replace(model, crack_tips={"crack": tips}, analysis=replace(model.analysis, tips=True))
        tip = generate_mesh(changed).tip
        assert (tip[cracks[0]], tip[cracks[-1]]) == expected
        assert np.count_nonzero(tip) == sum(tips)
    assert not generate_mesh(replace(model, analysis=replace(model.analysis, tips=False))).tip.any()


# Curves whose nodes carry the traction equation, per region; a crack always does, and no face beside it: those of the
# lower region are.
ALL_OUTER: dict[str, set[str]] = {"lower": set(), "upper": {"joint", "right2", "top", "left2"}, "grain": {"rim"}}
EQUATIONS = {
    "SST": {"lower": set(), "upper": set(), "grain": set()},
    "DBEM": {"lower": set(), "upper": {"joint"}, "grain": {"rim"}},
    "HST": {"lower": set(), "upper": {"joint"}, "grain": {"rim"}},
    "THST": ALL_OUTER,
}  # fmt: skip


@pytest.mark.parametrize("listed", ["host_first", "inclusion_first"])
@pytest.mark.parametrize("scheme", EQUATIONS)
def test_schemes_choose_the_equation_of_every_side(scheme: str, listed: str) -> None:
    body = make_blocks(scheme=scheme)
    if listed == "inclusion_first":
        order = ("grain", "lower", "upper")
        body = replace(body, regions={name: body.regions[name] for name in order})
    _, mesh = mesh_body(body)
    found: dict[str, set[str]] = {name: set() for name in mesh.region_names}
    for region in mesh.region_names:
        for curve in mesh.curve_names:
            nodes = select(mesh, region, curve)
            by_element = mesh.traction_equation[nodes].reshape(-1, 3)
            # The elements at both ends keep the displacement equation: corners, but on circles and cracks.
            inner = slice(1, -1) if curve in SQUARE else slice(None)
            if nodes.any() and by_element[inner].all():
                found[region].add(curve)
                assert by_element.sum() == by_element[inner].size
            else:
                assert not by_element.any()
    expected = {name: set(curves) for name, curves in EQUATIONS[scheme].items()}
    expected["lower"].add("crack")
    assert found == expected


@pytest.mark.parametrize("grading", ["none", "both"])
def test_a_corner_within_a_curve_keeps_the_displacement_equation(grading: str) -> None:
    # The angle of an L is one curve of two legs; where legs go straight on nothing is singular.
    outline = {"angle": [2 + 0j, 2 + 1j, 1 + 1j, 1 + 2j], "rest": [1 + 2j, 2j, 1j, 0j, 2 + 0j]}
    body = Body(outline, {"l": (ROCK, list(outline))}, {"rest": {"ux": 0.0, "uy": 0.0}},
                elements=12, grading=grading, scheme="THST")  # fmt: skip
    model, mesh = mesh_body(body)
    for curve, straight in (("angle", ()), ("rest", (2,))):  # joints of the legs; the second of the rest is at 1j
        by_element = mesh.traction_equation[select(mesh, "l", curve)].reshape(-1, 3).all(axis=1)
        joints = np.cumsum([leg.elements for leg in model.curves[curve].legs])[:-1]
        corners = np.delete(joints, [number - 1 for number in straight])
        expected = np.ones(len(by_element), dtype=bool)
        expected[[0, -1, *(corners - 1), *corners]] = False
        np.testing.assert_array_equal(by_element, expected)


@pytest.mark.parametrize(("scheme", "beside", "opposite"),
                         [("DBEM", False, True), ("HST", False, True), ("THST", True, True), ("SST", False, False)])
def test_free_parts_of_a_face_in_contact_have_the_equation_of_free_faces(
    scheme: str, beside: bool, opposite: bool
) -> None:
    # A narrow block on a wide one, whose top is the contact's second curve.
    outline = {"wide": [0j, 3 + 0j, 3 + 1j], "face": [3 + 1j, 1j], "rest": [1j, 0j], "foot": [1 + 1j, 2 + 1j],
               "above": [2 + 1j, 2 + 2j, 1 + 2j, 1 + 1j]}  # fmt: skip
    regions = {"a": (ROCK, ["wide", "face", "rest"]), "b": (ROCK, ["foot", "above"])}
    held = {"wide": {"ux": 0.0, "uy": 0.0}}
    body = Body(outline, regions, held, elements=18, grading="both", scheme=scheme)
    mesh = generate_mesh(parse_model(body.write() + '\n[contacts.k]\nbetween = ["foot", "face"]\n')[1])
    own = select(mesh, "a", "face")
    by_element = mesh.traction_equation[own].reshape(-1, 3).all(axis=1)
    x = mesh.position[own].real.reshape(-1, 3).mean(axis=1)
    middle = (x > 1) & (x < 2)
    assert by_element[middle].sum() == opposite * (middle.sum() - 2)
    assert by_element[~middle].sum() == beside * ((~middle).sum() - 4)


def test_a_curve_of_corner_elements_alone_is_told() -> None:
    lower, upper = ["bottom", "right", "joint", "left"], ["joint", "right2", "top", "left2"]
    regions = {"lower": (ROCK, lower), "upper": (ROCK, upper)}
    laws, held = {"joint": {"law": "bonded"}}, {"bottom": {"ux": 0.0, "uy": 0.0}}
    _, mesh = mesh_body(Body(SQUARE, regions, held, laws, elements=2, scheme="HST"))
    assert not mesh.traction_equation.any()
    told = [note for note in mesh.notes if "too few elements for HST" in note]
    assert len(told) == 1 and "'joint'" in told[0]


@pytest.mark.parametrize(("scheme", "loops"), [("SST", 0), ("DBEM", 0), ("HST", 2), ("THST", 3)])
def test_exceptions_to_the_scheme_are_told(scheme: str, loops: int) -> None:
    # The rim with HST; with THST the hole as well; and with both the faces beside the crack.
    _, mesh = mesh_body(make_blocks(scheme=scheme))
    assert len(mesh.notes) == loops
    assert all(scheme in note for note in mesh.notes)


def test_dbem_exchanges_the_sides_of_an_inclusion_that_is_listed_first() -> None:
    body = make_blocks(scheme="DBEM")
    _, mesh = mesh_body(replace(body, regions={name: body.regions[name] for name in ("grain", "lower", "upper")}))
    assert len(mesh.notes) == 1 and "rim" in mesh.notes[0]


def test_derivatives_at_nodes_are_those_of_polynomials() -> None:
    """Exact for every degree below the number of nodes, wherever these lie."""
    chance = np.random.default_rng(4)
    for count in range(1, 7):
        local = np.sort(chance.uniform(-1, 1, (9, count)), axis=1) + np.linspace(0, 0.2, count)
        factors = chance.normal(size=count)
        found = np.einsum("epj,ej->ep", differentiate_at_nodes(local), np.polyval(factors, local))
        expected = np.polyval(np.polyder(factors), local)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * max(1.0, np.abs(expected).max()))
