"""The geometry of elements of both kinds, alone and mixed: each function against another one or a plain quadrature."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.geometry.curve import Leg
from pbem.geometry.elements import Elements, cross_carriers
from pbem.geometry.intersection import project

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

S = np.array([-1.0, -0.83, -0.2, 0.0, 0.41, 0.77, 1.0])
GAUSS, WEIGHTS = np.polynomial.legendre.leggauss(30)
DENSE = np.linspace(-1, 1, 4001)


def make_elements(seed: int, kind: str, shift: complex = 0j) -> Elements:
    """Seven elements of about length 1, arcs that turn by up to 150 degrees either way."""
    rng = np.random.default_rng(seed)
    start = shift + rng.normal(size=7) + 1j * rng.normal(size=7)
    end = start + rng.uniform(0.5, 1.5, 7) * np.exp(2j * np.pi * rng.uniform(size=7))
    sweep = rng.uniform(0.1, 2.6, 7) * rng.choice([-1, 1], 7)
    straight = {"straight": np.ones(7), "arcs": np.zeros(7), "mixed": rng.permutation([0, 1, 0, 1, 1, 0, 0])}[kind]
    return Elements.by_ends(start, end, np.where(straight, 0.0, sweep))


@pytest.fixture(params=[(seed, kind) for seed in (1, 2, 3) for kind in ("straight", "arcs", "mixed")], ids=str)
def elements(request: pytest.FixtureRequest) -> Elements:
    return make_elements(*request.param)


def draw_points(count: int) -> Complex:
    rng = np.random.default_rng(5)
    return 1.5 * (rng.normal(size=count) + 1j * rng.normal(size=count))


def make_leg(one: Elements) -> Leg:
    """A single element as a leg of a curve."""
    sweep = float(one.sweep[0])
    return Leg(complex(one.start[0]), complex(one.end[0]), 3, center=complex(one.center[0]) if sweep else None,
               sweep=sweep)  # fmt: skip


def integrate(elements: Elements, values: Complex | Real) -> Complex | Real:
    """Along the length, of values (m, 30) at the Gauss points."""
    return (values * elements.stretch(GAUSS)) @ WEIGHTS


def expect_equal(found: object, expected: object, within: float = 1e-12) -> None:
    np.testing.assert_allclose(found, expected, rtol=within, atol=within)


def test_they_begin_and_end_at_their_ends(elements: Elements) -> None:
    expect_equal(elements.place(np.array([-1.0, 1.0])), np.stack([elements.start, elements.end], axis=1))
    ends = elements.place_fractions(np.array([0.0, 1.0]))
    assert (ends == np.stack([elements.start, elements.end], axis=1)).all()


def test_one_place_of_a_leg_is_that_among_many(elements: Elements) -> None:
    fractions = np.array([0.0, 0.2, 0.75, 1.0])
    for k in range(7):
        leg = make_leg(elements.select([k]))
        places = leg.point(fractions)
        for t, place in zip(fractions.tolist(), places.tolist(), strict=True):
            assert complex(leg.kind.place_fraction(leg, t)) == place
            # Along the normal there that is the nearest place.
            normal = leg.normals(np.array([place]))[0]
            found, distance = project(leg, complex(place + 0.05 * normal))
            expect_equal([found, distance], [t, 0.05], 1e-9)


def test_a_leg_without_length_is_as_far_away_as_its_ends() -> None:
    assert project(Leg(1 + 2j, 1 + 2j, 1), 4 + 6j) == (0.0, 5.0)


def test_the_slope_is_the_derivative_of_the_place(elements: Elements) -> None:
    # The map is analytic in s: differences along the imaginary axis and along the real one give the same.
    for h in (1e-4, 1e-4j):
        expect_equal(elements.slope(S), (elements.place(S + h) - elements.place(S - h)) / (2 * h), 1e-7)


def test_slope_stretch_and_normal_agree(elements: Elements) -> None:
    slope, stretch = elements.slope(S), elements.stretch(S)
    expect_equal(stretch, np.abs(slope))
    expect_equal(1j * elements.normals(S), slope / stretch)
    expect_equal(elements.normals_at(elements.place(S)), elements.normals(S))
    expect_equal(elements.crowding(S) * stretch, np.broadcast_to(elements.stretch(np.zeros(1)), stretch.shape))
    leaves, arrives = elements.directions()
    chord = np.abs(elements.end - elements.start)
    expect_equal(np.stack([leaves, arrives], axis=1) / chord[:, None], (slope / stretch)[:, [0, -1]])


def test_the_curvature_is_the_turning_of_the_tangent(elements: Elements) -> None:
    h = 1e-5
    turned = np.angle(elements.slope(S + h) / elements.slope(S - h)) / (2 * h)
    expect_equal(elements.curvature(S) * elements.stretch(S), turned, 1e-8)
    expect_equal(elements.curvature(S)[:, 0] * elements.lengths, elements.turns)
    leaves, arrives = elements.directions()
    expect_equal(np.angle(arrives / leaves), elements.turns)


def test_what_is_placed_is_located(elements: Elements) -> None:
    points, normals = elements.place(S), elements.normals(S)
    expect_equal(elements.preimage(points), np.broadcast_to(S, points.shape))
    complex_s = S + 0.3j * np.sin(5 * S)
    expect_equal(elements.preimage(elements.place(complex_s)), np.broadcast_to(complex_s, points.shape))
    for off in (-0.1, 0.2):
        expect_equal(elements.locate(points + off * normals), np.broadcast_to(S, points.shape))
    expect_equal(elements.sample(S), points)


def test_lengths_and_fractions_are_integrals_of_the_stretch(elements: Elements) -> None:
    expect_equal(elements.lengths, integrate(elements, np.ones((7, 30))))
    expect_equal(elements.fractions(S)[:, [0, -1]], np.broadcast_to([0.0, 1.0], (7, 2)))
    h = 1e-5
    slope = (elements.fractions(S + h) - elements.fractions(S - h)) / (2 * h)
    expect_equal(slope * elements.lengths[:, None], elements.stretch(S), 1e-8)
    expect_equal(elements.place_fractions(elements.fractions(S)), elements.place(S))
    before = np.cumsum(elements.lengths) - elements.lengths
    expect_equal(elements.arc_lengths(S)[:, -1], before + elements.lengths)


def test_centroids_and_areas_are_integrals(elements: Elements) -> None:
    legs = [make_leg(elements.select([number])) for number in range(7)]
    centroids = [leg.kind.centroid(leg) for leg in legs]
    expect_equal(centroids, integrate(elements, elements.place(GAUSS)) / elements.lengths)
    from_start = elements.place(GAUSS) - elements.start[:, None]
    expect_equal(elements.areas, 0.5 * (np.conj(from_start) * elements.slope(GAUSS)).imag @ WEIGHTS)


def test_a_piece_lies_where_it_was(elements: Elements) -> None:
    t, middle = np.linspace(0, 1, 5), np.linspace(0.2, 0.7, 7)
    whole = np.zeros(7), middle, np.ones(7)
    pieces = [elements.cut(first, last) for first, last in pairwise(whole)]
    for piece, first, last in zip(pieces, whole[:-1], whole[1:], strict=True):
        there = first[:, None] + (last - first)[:, None] * t
        expect_equal(piece.place_fractions(t), elements.place_fractions(there))
        expect_equal(piece.sample(S), piece.place(S))
    assert (pieces[0].end == pieces[1].start).all()
    expect_equal(sum(piece.lengths for piece in pieces), elements.lengths)
    expect_equal(sum(piece.turns for piece in pieces), elements.turns)


def test_travelled_backwards_they_are_the_same(elements: Elements) -> None:
    back, some = elements.turn_back(), np.arange(7) % 2 == 0
    expect_equal(back.place(-S), elements.place(S))
    expect_equal(back.normals(-S), -elements.normals(S))
    expect_equal(back.turns, -elements.turns)
    partly = elements.turn_back(some)
    expect_equal(partly.place(S), np.where(some[:, None], back.place(S), elements.place(S)))
    expect_equal(elements.reverse().place(S), back.place(S)[::-1])


def test_other_coordinates_move_the_points(elements: Elements) -> None:
    origin, factor = np.linspace(-1, 1, 7) + 2j, 3 * np.exp(1j * np.arange(7))
    moved = elements.move(origin, factor)
    expect_equal(moved.place(S), (elements.place(S) - origin[:, None]) * factor[:, None])
    expect_equal(moved.normals(S), elements.normals(S) * factor[:, None] / 3)
    expect_equal(moved.lengths, 3 * elements.lengths)


def test_the_distance_is_that_of_the_nearest_point(elements: Elements) -> None:
    points = draw_points(40)
    line = elements.place(DENSE)
    nearest = np.abs(points[None, :, None] - line[:, None]).min(axis=2)
    expect_equal(elements.distances(points), nearest, 1e-6)
    expect_equal(elements.distances(elements.place(S)), np.zeros((7, len(S))), 1e-12)


def test_rays_cross_where_they_meet_the_element(elements: Elements) -> None:
    points = draw_points(40)
    directions = np.exp(2j * np.pi * np.random.default_rng(6).uniform(size=40))
    found = elements.cross(points, directions)
    met = np.isfinite(found.distance)
    for number in range(found.distance.shape[2]):
        own = met[:, :, number]
        element, ray = np.nonzero(own)
        there = points[ray] + found.distance[element, ray, number] * directions[ray]
        s = found.local[element, ray, number]
        chosen = elements.select(element)
        near = np.abs(s) < 50
        expect_equal(chosen.place(s[:, None])[near, 0], there[near], 1e-9)
        against = (np.conj(directions[ray]) * chosen.normals(s[:, None])[:, 0]).real < 0
        assert (found.facing[element, ray, number] == against)[near].all()
    # As often as the ray changes sides along the element.
    side = (np.conj(directions)[None, :, None] * (elements.place(DENSE)[:, None] - points[None, :, None])).imag > 0
    assert ((met & (np.abs(found.local) < 1)).sum(axis=2) == (np.diff(side, axis=2) != 0).sum(axis=2)).all()


def test_the_angle_they_subtend_is_what_the_ray_turns_by(elements: Elements) -> None:
    points = draw_points(60)
    points = points[elements.distances(points).min(axis=0) > 0.02]
    rays = elements.place(DENSE)[:, None] - points[None, :, None]
    expect_equal(elements.subtend(points), np.angle(rays[..., 1:] / rays[..., :-1]).sum(axis=2), 1e-9)


def test_they_subtend_a_number_at_their_own_ends(elements: Elements) -> None:
    # Rounding decides which angle it is there; a quotient would be none at all.
    angles = elements.subtend(np.concatenate([elements.start, elements.end]))
    assert np.isfinite(angles).all() and (np.abs(angles) <= 2 * np.pi).all()


def test_boxes_circles_and_heights_contain_them(elements: Elements) -> None:
    line, middle = elements.place(DENSE), 0.5 * (elements.start + elements.end)
    low, high = elements.bounds()
    expect_equal(low, np.stack([line.real.min(axis=1), line.imag.min(axis=1)], axis=1), 1e-6)
    expect_equal(high, np.stack([line.real.max(axis=1), line.imag.max(axis=1)], axis=1), 1e-6)
    chord = elements.end - elements.start
    height = np.abs((np.conj(chord)[:, None] * (line - elements.start[:, None])).imag).max(axis=1) / np.abs(chord)
    expect_equal(elements.rises(), height, 1e-6)
    t = np.linspace(0, 1, 4)
    thirds = [elements.cut(np.full(7, a), np.full(7, b)).rises() for a, b in pairwise(t)]
    expect_equal(elements.rises(3), np.max(thirds, axis=0))
    radius = np.where(elements.bulges > 0, elements.bulges, 0.5 * np.abs(chord))
    reach = np.abs(line - middle[:, None]).max(axis=1)
    gentle = np.abs(elements.turns) <= np.pi
    assert (reach <= radius * (1 + 1e-12))[gentle].all()


def test_each_is_found_as_it_is_alone_and_in_rows_and_columns(elements: Elements) -> None:
    alone = [elements.select([number]) for number in range(7)]
    own = elements.place(S)
    for name in ("place", "slope", "stretch", "normals", "fractions", "curvature"):
        found = getattr(elements, name)(S)
        assert found.shape == (7, len(S))
        expect_equal(found, np.concatenate([getattr(one, name)(S) for one in alone]))
        square = getattr(elements.select(np.arange(6).reshape(2, 3)), name)(S)
        expect_equal(square.reshape(6, -1), found[:6])
    for name in ("preimage", "locate", "distances", "normals_at"):
        found = getattr(elements, name)(own)
        alike = [getattr(one, name)(own[number]) for number, one in enumerate(alone)]
        expect_equal(found, np.concatenate(alike))
    assert elements.degree == max(one.degree for one in alone)


@pytest.mark.parametrize("kind", ["straight", "arcs", "mixed"])
def test_far_from_the_origin_only_the_digits_of_the_coordinates_are_lost(kind: str) -> None:
    shift = 1e8 * (1 - 0.7j)
    far = make_elements(4, kind, shift)
    lost = 40 * np.finfo(float).eps * abs(shift)
    near = far.move(np.array(shift), np.array(1.0))
    expect_equal(far.place(S) - shift, near.place(S), lost)
    expect_equal(far.preimage(far.place(S)), np.broadcast_to(S, (7, len(S))), lost)
    expect_equal(far.locate(far.place(S)), np.broadcast_to(S, (7, len(S))), lost)
    expect_equal(far.normals(S), near.normals(S), lost)
    expect_equal(far.lengths, near.lengths, lost)
    expect_equal(far.distances(far.place(S)), np.zeros((7, len(S))), lost)
    pieces = far.cut(np.full(7, 0.25), np.full(7, 0.75))
    expect_equal(pieces.place_fractions(np.array([0.5])), far.place_fractions(np.array([0.5])), lost)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_leg_is_the_same_as_an_element(seed: int) -> None:
    elements = make_elements(seed, "mixed")
    t = np.linspace(0, 1, 5)
    for number in range(7):
        one = elements.select([number])
        leg = make_leg(one)
        expect_equal(leg.length, one.lengths[0])
        expect_equal(leg.turn, one.turns[0])
        expect_equal(leg.point(t), one.place_fractions(t)[0])
        expect_equal(leg.normals(leg.point(t)), one.normals_at(leg.point(t))[0])
        expect_equal([leg.tangent(False), leg.tangent(True)], 1j * one.normals(np.array([-1.0, 1.0]))[0])
        expect_equal(leg.reverse().point(t), leg.point(1 - t))
        first, second = leg.split(0.3, (1, 1))
        expect_equal(first.point(t), leg.point(0.3 * t))
        expect_equal(second.point(t), leg.point(0.3 + 0.7 * t))
        for at in (0.1, 0.6):
            off = complex(leg.point(np.array(at))) + 0.05 * complex(leg.normals(leg.point(np.array([at])))[0])
            expect_equal(leg.project(off), at)
        for end, beyond in ((leg.start, leg.point(np.array(-0.1))), (leg.end, leg.point(np.array(1.1)))):
            t, distance = project(leg, complex(beyond))
            expect_equal([t, distance], [float(end == leg.end), abs(beyond - end)])


@pytest.mark.parametrize("seed", range(5))
def test_carriers_meet_on_both(seed: int) -> None:
    legs = make_elements(seed, "mixed")
    for i in range(7):
        for j in range(i):
            both = legs.select([i]), legs.select([j])
            for point in cross_carriers(*map(make_leg, both), 0.0):
                for e in both:
                    s = e.locate(np.array([point]))
                    if abs(s[0, 0]) < 20:
                        expect_equal(e.place(s)[0, 0], point, 1e-9)


def test_a_point_that_rounds_to_the_centre_of_a_tiny_arc_has_no_normal() -> None:
    arc = Leg(-8j + 5e-9, -8j + 5e-9j, 1, center=-8j, sweep=math.pi / 2)
    assert Elements.collect([arc]).normals_at(np.array([[-8j]])) == 0


@pytest.mark.parametrize("count", [1, 2, 3])
def test_places_do_not_hang_on_where_arrays_lie_in_memory(count: int) -> None:
    """NumPy rounds complex products in one of two ways where operands are less than 64 bytes apart."""
    arcs, rng, kept = make_elements(1, "arcs").select(np.arange(count)), np.random.default_rng(7), {}
    found = set()
    for _ in range(3000):
        # Blocks of the sizes of the operands are given back in another order.
        kept[int(rng.integers(50))] = np.empty(int(rng.integers(1, 8)), dtype=complex)
        middles = arcs.cut(np.full(count, 0.25), np.full(count, 0.5)).start
        found.add(b"".join(each.tobytes() for each in (arcs.normals(np.array([0.3])), middles, *arcs.directions())))
    assert len(found) == 1
