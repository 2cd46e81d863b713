"""Groups of elements: together they are the model, on any number of ranks, each with its neighbours around it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes
from pbem.solve.preconditioner import subdomains as groups
from pbem.solve.preconditioner.subdomains import connect_elements, divide_model, share_groups, surround_groups
from tests.unit.far_sample import TEXTS, make_sample

TRACE = """
[materials.rock]
young = 2.0e4
poisson = 0.25
[curves]
trace = { points = [[0, 0], [8, 0]], elements = 32, grading = "none" }
[regions.rock]
material = "rock"
infinite = true
cracks = ["trace"]
[interfaces.trace]
friction = 0.5
[remote]
syy = -1.0
"""
PIECES = [f"piece{k}" for k in range(4)]
CUT_TRACE = TRACE.replace(
    "trace = { points = [[0, 0], [8, 0]], elements = 32, grading = \"none\" }",
    "\n".join(f"piece{k} = {{ points = [[{2 * k}, 0], [{2 * k + 2}, 0]], elements = 8, grading = \"none\" }}"
              for k in range(4)),
).replace('["trace"]', str(PIECES).replace("'", '"')).replace(
    "[interfaces.trace]\nfriction = 0.5", "\n".join(f"[interfaces.{name}]\nfriction = 0.5" for name in PIECES)
)
each_sample = pytest.mark.parametrize("name", TEXTS)


@pytest.fixture(autouse=True)
def many_groups(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(groups, "ONE_GROUP", 0)
    monkeypatch.setattr(groups, "GROUP_ELEMENTS", 10)
    monkeypatch.setattr(groups, "CONNECTED_ELEMENTS", 10)
    monkeypatch.setattr(groups, "BODY_ELEMENTS", 10)


def take_mesh(name: str) -> Mesh:
    return make_sample(name).mesh


@each_sample
def test_every_element_is_in_one_group_of_what_it_is_connected_with(name: str) -> None:
    mesh = take_mesh(name)
    divided, sets = divide_model(mesh), connect_elements(mesh)[0]
    assert sorted(np.concatenate(divided)) == list(range(mesh.elements))
    assert len(divided) > 5
    for group in divided:
        assert 1 <= len(group) <= 10 and (np.diff(group) > 0).all()
        assert len(np.unique(sets[group])) == 1


@each_sample
def test_elements_are_connected_by_ends_and_contacts_alone(name: str) -> None:
    mesh = take_mesh(name)
    sets, connected = connect_elements(mesh)
    for points in (mesh.start, mesh.end):
        for other in (mesh.start, mesh.end):
            one, two = np.nonzero(points[:, None] == other[None])
            assert (sets[one] == sets[two]).all()
    first, second = mesh.node_element[mesh.pairs.first], mesh.node_element[mesh.pairs.second]
    assert (sets[first] == sets[second]).all()
    assert all(connected[k] == ((sets == k).sum() > groups.GROUP_ELEMENTS) for k in np.unique(sets))
    if name == "cracks":  # 16 cracks in a plate that has one boundary
        assert len(np.unique(sets)) == 17


def test_a_crack_is_divided_alike_in_one_piece_or_in_many() -> None:
    """What counts are the elements that are connected, not the curves that they are on."""
    whole, cut = (generate_mesh(parse_model(text)[1]) for text in (TRACE, CUT_TRACE))
    np.testing.assert_allclose(np.sort_complex(whole.start), np.sort_complex(cut.start), atol=1e-12)
    shares = []
    for mesh in (whole, cut):
        divided = divide_model(mesh)
        found = surround_groups(mesh, divided, 0, len(divided))
        middle = np.round(0.5 * (mesh.start + mesh.end), 9)
        shares.append({(frozenset(middle[each.elements]), frozenset(middle[each.around])) for each in found})
    assert shares[0] == shares[1] and len(shares[0]) > 2


def test_a_small_model_is_one_group(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = take_mesh("panel")
    monkeypatch.setattr(groups, "ONE_GROUP", 2 * mesh.nodes)
    (group,) = divide_model(mesh)
    np.testing.assert_array_equal(group, np.arange(mesh.elements))
    (only,) = surround_groups(mesh, [group], 0, 1)
    np.testing.assert_array_equal(only.around, group)
    monkeypatch.setattr(groups, "ONE_GROUP", 2 * mesh.nodes - 1)
    assert len(divide_model(mesh)) > 1


def test_both_sides_of_an_interface_are_in_one_group() -> None:
    mesh = take_mesh("blocks SST")
    group_of = np.empty(mesh.elements, dtype=np.int64)
    for number, group in enumerate(divide_model(mesh)):
        group_of[group] = number
    first, second = mesh.node_element[mesh.pairs.first], mesh.node_element[mesh.pairs.second]
    assert (group_of[first] == group_of[second]).mean() > 0.75  # but where a cut goes through


@pytest.mark.parametrize("ranks", [1, 2, 3, 8, 200])
@each_sample
def test_ranks_share_all_groups(name: str, ranks: int) -> None:
    mesh = take_mesh(name)
    divided = divide_model(mesh)
    bounds = [share_groups(mesh, divided, rank, ranks) for rank in range(ranks)]
    assert bounds[0][0] == 0 and bounds[-1][1] == len(divided)
    for (_, last), (first, _) in pairwise(bounds):
        assert first == last
    shares = [sum(len(group) for group in divided[first:last]) for first, last in bounds]
    if ranks <= len(divided):
        assert min(shares) > 0 and max(shares) <= mesh.elements / ranks + 2 * 10


def test_shares_are_equal_in_elements_not_in_groups() -> None:
    uneven = [np.arange(40), *(np.array([40 + k]) for k in range(40))]
    assert [share_groups(take_mesh("cracks"), uneven, rank, 2) for rank in range(2)] == [(0, 1), (1, 41)]


@each_sample
def test_groups_are_surrounded_by_those_next_to_them(name: str) -> None:
    mesh = take_mesh(name)
    divided = divide_model(mesh)
    found = surround_groups(mesh, divided, 0, len(divided))
    whole = np.arange(mesh.elements)
    sets, connected = connect_elements(mesh)
    for group, surrounded in zip(divided, found, strict=True):
        np.testing.assert_array_equal(surrounded.elements, group)
        assert set(group) < set(surrounded.around) <= set(whole)
        assert (np.diff(surrounded.around) > 0).all()
        if connected[sets[group[0]]]:
            assert set(surrounded.around) == set(group) | set(surrounded.nearest)
            continue
        # As many as there is room for, and those that it touches.
        ends = np.concatenate([mesh.start[group], mesh.end[group]])
        touching = [other for other in divided if np.isin([mesh.start[other], mesh.end[other]], ends).any()]
        assert all(set(other) <= set(surrounded.around) for other in touching)
        unknowns = 2 * (mesh.order + 1)
        extra = unknowns * (len(surrounded.around) - sum(len(other) for other in touching))
        share = groups.TOUCHING_SHARE if len(touching) > 1 else groups.NEIGHBOUR_SHARE
        assert extra <= max(groups.NEIGHBOUR_UNKNOWNS, share * unknowns * len(group))


def test_wider_surroundings_hold_the_narrow_ones() -> None:
    mesh = take_mesh("cracks")
    divided = divide_model(mesh)
    narrow, wide, widest = (surround_groups(mesh, divided, 0, len(divided), k) for k in (1, 2, 1000))
    assert all(set(one.around) <= set(other.around) for one, other in zip(narrow, wide, strict=True))
    assert sum(len(group.around) for group in wide) > 1.2 * sum(len(group.around) for group in narrow)
    assert all(len(group.around) == mesh.elements for group in widest)


def test_a_share_of_the_groups_is_surrounded_alike() -> None:
    mesh = take_mesh("cracks")
    divided = divide_model(mesh)
    whole = surround_groups(mesh, divided, 0, len(divided))
    part = surround_groups(mesh, divided, 3, 7)
    assert len(part) == 4
    for one, other in zip(part, whole[3:7], strict=True):
        np.testing.assert_array_equal(one.elements, other.elements)
        np.testing.assert_array_equal(one.around, other.around)


def test_nodes_are_listed_in_the_elements_order() -> None:
    mesh = take_mesh("cracks")
    nodes = list_nodes(mesh, np.array([7, 2]))
    np.testing.assert_array_equal(nodes, [21, 22, 23, 6, 7, 8])
    np.testing.assert_array_equal(mesh.node_element[nodes], [7] * 3 + [2] * 3)
