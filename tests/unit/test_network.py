"""Networks of traces: what meets is cut there, what all but meets is joined, and nothing is done in silence."""

from __future__ import annotations

import cmath
import itertools
import math
import random
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from pbem.geometry.curve import Curve
from pbem.geometry.intersection import enclosed_area
from pbem.geometry.network import Network, cut_network
from pbem.geometry.network.noding import UnsettledError, _refuse_nothing
from pbem.geometry.network.strands import Strand
from pbem.geometry.shape import Division, draw_circle, draw_polyline

DIVISION = Division(elements=12)


def draw(**traces: Sequence[complex]) -> dict[str, Curve]:
    return {name: draw_polyline(name, points, DIVISION) for name, points in traces.items()}


def list_changes(network: Network) -> list[tuple[str, str, str]]:
    return [(change.kind, change.trace, change.other) for change in network.changes]


def list_kinds(network: Network) -> list[str]:
    return sorted(junction.kind for junction in network.junctions)


A = [0j, 2 + 0j]
# Traces, snap distance, pieces, kinds of junctions, number of blocks, changes.
CASES: dict[str, tuple[dict[str, list[complex]], float, list[str], list[str], int, list[tuple[str, str, str]]]] = {
    "apart": ({"a": A, "b": [1j, 2 + 1j]}, 0.1, ["a", "b"], [], 0, []),
    "crossing": ({"a": A, "b": [1 - 1j, 1 + 1j]}, 0.0, ["a.1", "a.2", "b.1", "b.2"], ["X"], 0,
                 [("cut", "a", "b"), ("cut", "b", "a")]),
    "end on a leg": ({"a": A, "b": [1 + 0j, 1 + 1j]}, 0.0, ["a.1", "a.2", "b"], ["T"], 0, [("cut", "a", "b")]),
    "end on a vertex": ({"a": [0j, 1 + 0j, 2 + 1j], "b": [1 + 0j, 1 - 1j]}, 0.0, ["a.1", "a.2", "b"], ["T"], 0,
                        [("cut", "a", "b")]),
    "end that misses": ({"a": A, "b": [1 + 0.01j, 1 + 1j]}, 0.05, ["a.1", "a.2", "b"], ["T"], 0,
                        [("joined", "b", "a"), ("cut", "a", "b")]),
    "end that misses by more": ({"a": A, "b": [1 + 0.06j, 1 + 1j]}, 0.05, ["a", "b"], [], 0, []),
    "end that pokes through": ({"a": A, "b": [1 - 0.01j, 1 + 1j]}, 0.05, ["a.1", "a.2", "b"], ["T"], 0,
                               [("cut off", "b", "a"), ("cut", "a", "b")]),
    "end that crosses": ({"a": A, "b": [1 - 0.06j, 1 + 1j]}, 0.05, ["a.1", "a.2", "b.1", "b.2"], ["X"], 0,
                         [("cut", "a", "b"), ("cut", "b", "a")]),
    "ends that meet": ({"a": A, "b": [2.01 + 0j, 3 + 1j]}, 0.05, ["a", "b"], ["end to end"], 0,
                       [("joined", "b", "a")]),
    "three ends": ({"a": A, "b": [2 + 0j, 3 + 1j], "c": [2 + 0j, 3 - 1j]}, 0.0, ["a", "b", "c"], ["Y"], 0, []),
    "star": ({"a": [-1 + 0j, 1 + 0j], "b": [-1j, 1j], "c": [-1 - 1j, 1 + 1j]}, 0.0,
             ["a.1", "a.2", "b.1", "b.2", "c.1", "c.2"], ["star"], 0,
             [("cut", "a", "b"), ("cut", "b", "a"), ("cut", "c", "a")]),
    "twice the same": ({"a": A, "b": A}, 0.0, ["a"], [], 0, [("merged", "b", "a")]),
    "there and back": ({"a": A, "b": A[::-1]}, 0.0, ["a"], [], 0, [("merged", "b", "a")]),
    "over a part": ({"a": A, "b": [1 + 0j, 3 + 0j]}, 0.0, ["a", "b"], ["end to end"], 0, [("merged", "b", "a")]),
    "longer on shorter": ({"a": A, "b": [-1 + 0j, 3 + 0j]}, 0.0, ["b"], [], 0, [("merged", "a", "b")]),
    "nearly on it": ({"a": A, "b": [0.5 + 0.01j, 1.5 - 0.01j]}, 0.05, ["a"], [], 0,
                     [("joined", "b", "a"), ("joined", "b", "a"), ("merged", "b", "a")]),
    "back on itself": ({"a": [0j, 2 + 0j, 1 + 0j]}, 0.0, ["a"], [], 0, [("merged", "a", "a")]),
    "closed": ({"a": [0j, 2 + 0j, 2 + 2j, 2j, 0j]}, 0.0, ["a"], [], 1, []),
    "all but closed": ({"a": [0j, 2 + 0j, 2 + 2j, 2j, 0.01j]}, 0.05, ["a"], [], 1, [("joined", "a", "a")]),
    "eight": ({"a": [0j, 2 + 2j, 2 + 0j, 2j, 0j]}, 0.0, ["a.1", "a.2"], ["X"], 2, [("cut", "a", "a")]),
    "loop": ({"a": [0j, 3 + 0j, 1 - 1j, 1 + 1j]}, 0.0, ["a.1", "a.2", "a.3"], ["X"], 1, [("cut", "a", "a")]),
    "closed and crossed": ({"a": [0j, 2 + 0j, 2 + 2j, 2j, 0j], "b": [-1 + 1j, 3 + 1j]}, 0.0,
                           ["a.1", "a.2", "b.1", "b.2", "b.3"], ["X", "X"], 2,
                           [("cut", "a", "b"), ("cut", "a", "b"), ("cut", "b", "a"), ("cut", "b", "a")]),
    "no length": ({"a": A, "b": [1 + 1j, 1 + 1j]}, 0.0, ["a"], [], 0, [("dropped", "b", "")]),
    "shorter than snap": ({"a": A, "b": [1 + 1j, 1.04 + 1j]}, 0.05, ["a"], [], 0, [("dropped", "b", "")]),
    "doubled vertices": ({"a": [0j, 0j, 1 + 0j, 1 + 0j, 2 + 1j, 2 + 1j]}, 0.0, ["a"], [], 0,
                         [("thinned", "a", "")] * 3),
    "three in all but one point": (
        {"a": [-1 + 0j, 1 + 0j], "b": [0.01 - 1j, 0.01 + 1j], "c": [-1 - 1j, 1 + 1j]}, 0.05,
        ["a.1", "a.2", "b.1", "b.2", "c.1", "c.2"], ["star"], 0,
        [("bent", "b", "a"), ("cut", "a", "b"), ("cut", "b", "a"), ("cut", "c", "a")]),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_cases(name: str) -> None:
    traces, snap, pieces, junctions, blocks, changes = CASES[name]
    network = cut_network(draw(**traces), snap)
    assert sorted(network.pieces) == pieces
    assert list_kinds(network) == junctions
    assert len(network.blocks) == blocks
    found = [change for change in list_changes(network)]
    if name == "three in all but one point":  # which of the three is bent is not said
        found = [change for change in found if change[0] != "bent"]
        changes = [change for change in changes if change[0] != "bent"]
        assert {change[:1] for change in found} == {("cut",)}
    assert Counter(change[:2] for change in found) == Counter(change[:2] for change in changes)
    check_sound(network)


def check_sound(network: Network) -> None:
    """Pieces meet at ends only, junctions are where ends are equal, and blocks are as many as Euler's formula says."""
    ends: Counter[complex] = Counter()
    for curve in network.pieces.values():
        ends.update((curve.start, curve.end))
        for one, other in itertools.pairwise(curve.legs):
            assert one.end == other.start
    assert {point: count for point, count in ends.items() if count > 1} == {
        junction.point: len(junction.ends) for junction in network.junctions
    } | {
        curve.start: 2 for curve in network.pieces.values() if curve.closed and ends[curve.start] == 2
    }
    group = {point: point for point in ends}

    def find(point: complex) -> complex:
        while group[point] != point:
            point = group[point]
        return point

    for curve in network.pieces.values():
        group[find(curve.start)] = find(curve.end)
    components = len({find(point) for point in group})
    assert len(network.blocks) == len(network.pieces) - len(group) + components
    for block in network.blocks:
        area = 0.0
        for ring in block.rings:
            legs = []
            for name, forwards in ring:
                curve = network.pieces[name]
                legs += list((curve if forwards else curve.reverse()).legs)
            assert all(one.end == other.start for one, other in itertools.pairwise([*legs, legs[0]]))
            area += enclosed_area(legs)
        assert area == pytest.approx(block.area, rel=1e-6) and area > 0


def test_distances_are_told() -> None:
    network = cut_network(draw(a=A, b=[1 + 0.01j, 1 + 1j], c=[0.5 - 0.02j, 0.5 + 1j]), 0.05)
    told = {(change.kind, change.trace): change for change in network.changes}
    assert told["joined", "b"].distance == pytest.approx(0.01) and told["joined", "b"].place == 1 + 0.01j
    assert told["cut off", "c"].distance == pytest.approx(0.02) and told["cut off", "c"].place == 0.5 - 0.02j
    assert network.pieces["b"].start == 1 and network.pieces["c"].start == 0.5


def test_ends_that_go_on_to_a_node_are_told_by_how_far_they_went() -> None:
    # Both come to lie on a, next to where it begins or turns, which is further away than 0.05: b from its side, c from
    # beyond it.
    network = cut_network(draw(a=[0, 2, 2 + 1j], b=[0.5 - 1j, 0.04 - 0.04j], c=[1.965 + 0.04j, 1.98 - 1j]), 0.05)
    b, cut, c = (change for change in network.changes if change.kind in ("joined", "cut off"))
    assert (b.kind, b.trace, b.place) == ("joined", "b", 0.04 - 0.04j) and network.pieces["b"].end == 0
    assert b.distance == pytest.approx(0.04 * math.sqrt(2))
    assert (cut.kind, cut.trace, cut.place) == ("cut off", "c", 1.965 + 0.04j) and network.pieces["c"].start == 2
    assert (c.kind, c.trace) == ("joined", "c") and c.distance == pytest.approx(abs(2 - c.place))
    assert cut.distance == pytest.approx(abs(c.place - cut.place)) and c.place.imag == pytest.approx(0.0, abs=1e-12)


def test_traces_of_which_ends_are_cut_off_and_nothing_is_left_are_told_by_their_length() -> None:
    network = cut_network(draw(a=[-1j, 1j], b=[-0.045, 0.015]), 0.05)
    dropped = [change for change in network.changes if change.kind == "dropped"]
    assert [(change.trace, change.place) for change in dropped] == [("b", -0.045)]
    assert dropped[0].distance == pytest.approx(0.06) and list(network.pieces) == ["a"]


def test_traces_are_cut_by_what_has_a_piece_there() -> None:
    # At 1 and 2 the trace b ends, which lies on a: c is what cuts it at 1, and nothing at 2.
    network = cut_network(draw(a=[0, 4], b=[1, 2], c=[1 - 1j, 1 + 1j]), 0.01)
    cuts = [(change.trace, change.place, change.other) for change in network.changes if change.kind == "cut"]
    assert sorted(cuts) == [("a", 1, "c"), ("c", 1, "a")]


def test_a_trace_to_which_nothing_is_done_keeps_its_curve() -> None:
    traces = {**draw(a=A), "c": draw_circle("c", 5j, 1.0, DIVISION)}
    network = cut_network(traces)  # type: ignore[arg-type]
    assert all(network.pieces[name] is curve for name, curve in traces.items())


def test_elements_are_shared_by_the_pieces() -> None:
    network = cut_network(draw(a=A, b=[0.5 - 1j, 0.5 + 1j]))
    assert [leg.elements for name in ("a.1", "a.2") for leg in network.pieces[name].legs] == [3, 9]


def test_a_name_that_is_taken_is_passed_over() -> None:
    traces = draw(a=A, b=[1 - 1j, 1 + 1j])
    traces["a.1"] = draw_polyline("a.1", [5j, 6j], DIVISION)
    network = cut_network(traces)
    assert [name for name, trace in network.traces.items() if trace == "a"] == ["a.2", "a.3"]
    assert network.members["a"] == ("a.2", "a.3")


def test_circles_are_cut_where_lines_cross_them() -> None:
    circle = draw_circle("c", 1 + 1j, 2.0, DIVISION)
    assert isinstance(circle, Curve)
    network = cut_network({"c": circle, **draw(a=[-4 + 1j, 4 + 1j])})
    assert sorted(network.pieces) == ["a.1", "a.2", "a.3", "c.1", "c.2"]
    assert sorted(block.area for block in network.blocks) == pytest.approx([2 * math.pi] * 2)
    points = {junction.point for junction in network.junctions}
    assert all(min(abs(point - at) for at in points) < 1e-12 for point in (-1 + 1j, 3 + 1j))
    check_sound(network)


def test_arcs_that_miss_a_line_are_joined_and_stay_arcs() -> None:
    arc = draw_circle("c", 0j, 1.0, DIVISION, (1.0, 120.0))
    assert isinstance(arc, Curve)
    network = cut_network({"c": arc, **draw(a=[0j, 2 + 0j])}, 0.05)
    (leg,) = network.pieces["c"].legs
    assert abs(leg.start.imag) < 1e-15 and leg.turn == pytest.approx(math.radians(119.0))
    assert list_kinds(network) == ["T"]
    check_sound(network)


def make_segments(seed: int, count: int, extent: float = 1.0) -> dict[str, list[complex]]:
    r = random.Random(seed)
    segments = {}
    for number in range(1, count + 1):
        center, half = complex(r.random(), r.random()) * extent, cmath.rect(0.15 * extent, r.uniform(0, math.pi))
        segments[f"t{number}"] = [center - half, center + half]
    return segments


def count_crossings(segments: Mapping[str, Sequence[complex]]) -> int:
    """Brute force: each end of one on another side of the other."""

    def differ(line: Sequence[complex], other: Sequence[complex]) -> bool:
        a, b = line
        sides = [((b - a).conjugate() * (point - a)).imag for point in other]
        return sides[0] * sides[1] < 0

    return sum(differ(one, other) and differ(other, one) for one, other in itertools.combinations(segments.values(), 2))


@pytest.mark.parametrize("seed", range(3))
def test_random_networks_against_brute_force(seed: int) -> None:
    segments = make_segments(seed, 60)
    crossings = count_crossings(segments)
    network = cut_network(draw(**segments))
    assert network.crossings == crossings > 50
    assert len(network.pieces) == 60 + 2 * crossings
    total = sum(curve.length for curve in network.pieces.values())
    assert total == pytest.approx(sum(abs(b - a) for a, b in segments.values()), rel=1e-12)
    assert all(change.kind == "cut" for change in network.changes)
    check_sound(network)


@pytest.mark.parametrize("seed", range(4))
def test_stretches_on_a_line_are_cut_at_ends_and_vertices_alone(seed: int) -> None:
    """Rounding makes two of them cross somewhere, at a place that is no vertex: 3 of these 100 pairs."""
    random_numbers = random.Random(seed)
    for _ in range(25):
        along = cmath.rect(random_numbers.uniform(0.5, 2.0), random_numbers.uniform(0.0, 2 * math.pi))
        start = complex(random_numbers.uniform(-3, 3), random_numbers.uniform(-3, 3))
        bend, begin = start + along, start + random_numbers.uniform(0.2, 0.8) * along
        traces = draw(a=[start, bend, bend + 1j * along], b=[begin, begin + along])
        nodes = {leg.start for curve in cut_network(traces, 1e-3).pieces.values() for leg in curve.legs}
        assert nodes == {start, begin, bend}


@pytest.mark.parametrize("place", [0j, 5.3e5 + 4.2e6j])
def test_traces_that_end_on_another_at_small_angles_are_cut_there_alone(place: complex) -> None:
    """Rounding makes half of them cross it, too, at up to the rounding over the angle from their ends."""
    random_numbers = random.Random(7)
    for _ in range(60):
        along = 300 * cmath.rect(1.0, random_numbers.uniform(0.0, 2 * math.pi))
        start = place + complex(random_numbers.uniform(-300, 300), random_numbers.uniform(-300, 300))
        end = start + random_numbers.uniform(0.2, 0.8) * along
        angle = random_numbers.choice([-1, 1]) * 10 ** random_numbers.uniform(-6.0, -1.0)
        traces = draw(a=[start, start + along], b=[end, end + 0.15 * along * cmath.exp(1j * angle)])
        network = cut_network(traces, 0.0)
        assert sorted(network.pieces) == ["a.1", "a.2", "b"] and list_kinds(network) == ["T"]
        assert [len(curve.legs) for curve in network.pieces.values()] == [1, 1, 1]


@pytest.mark.parametrize("place", [0j, 5.3e5 + 4.2e6j])
def test_traces_that_cross_at_small_angles_are_cut(place: complex) -> None:
    random_numbers = random.Random(8)
    for _ in range(60):
        along = 300 * cmath.rect(1.0, random_numbers.uniform(0.0, 2 * math.pi))
        off = 1j * along * 10 ** random_numbers.uniform(-8.0 if not place else -6.0, -1.0)
        traces = draw(a=[place, place + along], b=[place + 0.1 * along - off, place + 0.8 * along + off])
        network = cut_network(traces, 0.0)
        assert sorted(network.pieces) == ["a.1", "a.2", "b.1", "b.2"] and list_kinds(network) == ["X"]


def test_traces_that_end_on_an_arc_at_small_angles_are_cut_there_and_where_they_cross_it() -> None:
    """Rounding made 33 of 80 cross it beside their end, too; chords do cross it once more."""
    random_numbers = random.Random(3)
    for _ in range(60):
        center = complex(random_numbers.uniform(-1, 1), random_numbers.uniform(-1, 1))
        out = cmath.rect(1.0, random_numbers.uniform(0.0, 2 * math.pi))
        angle = 10 ** random_numbers.uniform(-4.0, -1.0)
        for inwards, count in ((False, 2), (True, 3)):
            end = center + out + 0.4 * 1j * out * cmath.exp(1j * angle * (1 if inwards else -1))
            circle = draw_circle("circle", center, 1.0, DIVISION)
            network = cut_network({"circle": circle, **draw(trace=[center + out, end])}, 0.0)
            legs = [leg for curve in network.pieces.values() for leg in curve.legs]
            assert min(leg.length for leg in legs) > 1e-4
            nodes = {node for leg in legs if not leg.sweep for node in (leg.start, leg.end)}
            assert len(nodes) == count
            if inwards:
                chord = min(nodes, key=lambda node: abs(abs(node - center - out) - 2 * math.sin(angle)))
                assert abs(chord - center - out) == pytest.approx(2 * math.sin(angle), rel=1e-6)


def describe(network: Network, unit: float = 1.0) -> tuple[Counter[str], Counter[str], list[float]]:
    lengths = sorted(curve.length / unit for curve in network.pieces.values())
    areas = sorted(block.area / unit**2 for block in network.blocks)
    kinds = Counter(change.kind for change in network.changes)
    return Counter(junction.kind for junction in network.junctions), kinds, [*lengths, *areas]


@pytest.mark.parametrize("factor, by, reverse", [
    (1.0, 1e7 - 3e7j, False), (cmath.rect(1.0, 0.7), 0j, False), (1e-6, 0j, False), (1e5 * 1j, 0j, True),
    (1.0, 0j, True),
], ids=["shift", "turn", "smaller", "larger and backwards", "backwards"])  # fmt: skip
def test_networks_move_turn_and_grow_with_their_traces(factor: complex, by: complex, reverse: bool) -> None:
    segments = make_segments(11, 60)
    r = random.Random(5)
    for name, (a, b) in list(segments.items())[:20]:
        # Ends that miss by less than the snap distance.
        t = r.uniform(0.2, 0.8)
        end = a + t * (b - a) + 3e-4 * r.choice((-1, 1)) * 1j * (b - a) / abs(b - a)
        segments[f"{name}x"] = [end, end + 0.1 * 1j * (b - a) / abs(b - a)]
    unit = abs(factor)
    expected = describe(cut_network(draw(**segments), 1e-3))
    moved = {name: [point * factor + by for point in points] for name, points in segments.items()}
    if reverse:
        moved = {name: points[::-1] for name, points in reversed(moved.items())}
    network = cut_network(draw(**moved), 1e-3 * unit)
    check_sound(network)
    found = describe(network, unit)
    assert found[:2] == expected[:2]
    # 3e7 is known to 4e-9.
    assert found[2] == pytest.approx(expected[2], rel=1e-6, abs=3e-8)
    assert Counter(change.kind for change in network.changes)["cut"] > 100


def test_parts_without_a_length_are_refused_with_their_places() -> None:
    legs = draw(a=[0j, 2 + 1j, 3 + 1j])["a"].legs
    _refuse_nothing([Strand("a", list(legs))])
    with pytest.raises(UnsettledError) as raised:
        _refuse_nothing([Strand("a", [legs[0], replace(legs[1], end=legs[1].start)])])
    assert raised.value.places == [2 + 1j]



@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("snap", [1e-3, 2e-2, 0.1])
def test_networks_with_large_snap_distances_settle(seed: int, snap: float) -> None:
    r = random.Random(seed)
    traces = {}
    for number in range(25):
        points = [complex(r.random(), r.random())]
        for _ in range(r.randint(1, 8)):
            points.append(points[-1] + cmath.rect(r.uniform(0, 0.15), r.uniform(0, 7)))
        traces[f"t{number}"] = points
    network = cut_network(draw(**traces), snap)
    check_sound(network)
    again = cut_network(network.pieces, 1e-12)
    assert len(again.pieces) == len(network.pieces)
    assert all(change.kind != "cut" for change in again.changes)
    names = np.array([change.kind for change in network.changes])
    assert (names == "thinned").any() or snap < 0.05
