"""Tables [[generate]]: what they stand for, places that keep their distance, and their faults."""

from __future__ import annotations

import itertools
import math
from random import Random

import numpy as np
import pytest

from pbem.case import parse_case
from pbem.description.placement import Body, draw_sizes, find_area, make_ground, measure_distance, place_bodies
from pbem.description.schema import GenerateTable
from tests.unit.case_sample import build, change, find_faults, find_only_fault

ROCK = """
[materials.rock]
young = 1000.0
poisson = 0.2
[materials.grain]
young = 5000.0
poisson = 0.3
[regions.rock]
material = "rock"
infinite = true
[remote]
syy = -1.0
"""

CRACKS = ROCK + """
[[generate]]
kind = "cracks"
name = "crack"
region = "rock"
count = 40
elements = 4
half_length = 1.0
density = 0.1
distance = 0.1
friction = 0.6
cohesion = 0.01
"""

INCLUSIONS = ROCK + """
[[generate]]
kind = "inclusions"
name = "grain"
region = "rock"
material = "grain"
count = 20
elements = 8
radius = 1.0
fraction = 0.3
distance = 0.1
law = "coulomb"
friction = 0.6
"""


def read_ends(text: str) -> np.ndarray:
    """(n, 2) ends of all cracks of a case, complex."""
    return np.array([[complex(*point) for point in curve.points] for curve in parse_case(text).curves.values()])


def read_circles(text: str) -> tuple[np.ndarray, np.ndarray]:
    """Centres and radii of all circles of a case."""
    curves = parse_case(text).curves.values()
    return np.array([complex(*curve.center) for curve in curves]), np.array([curve.radius for curve in curves])


def least_distance(ends: np.ndarray) -> float:
    """Of any two segments, from points along both; too large by less than 1e-4 of their squares."""
    t = np.linspace(0, 1, 201)
    points = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * t
    return min(
        float(np.abs(points[i][:, None] - points[j][None, :]).min())
        for i, j in itertools.combinations(range(len(ends)), 2)
    )


def test_cracks_have_the_length_the_density_and_the_distance() -> None:
    ends = read_ends(CRACKS)
    assert len(ends) == 40
    np.testing.assert_allclose(abs(ends[:, 1] - ends[:, 0]), 2.0, rtol=1e-7)
    centers = ends.mean(axis=1)
    assert max(abs(centers.real).max(), abs(centers.imag).max()) <= 0.5 * math.sqrt(40 / 0.1)
    assert 0.1 <= least_distance(ends) < 0.3


def test_large_fields_keep_the_distance() -> None:
    # By points along the cracks, and a tree: nothing of the search that placed them.
    from scipy.spatial import cKDTree

    ends = read_ends(change(CRACKS, ("count = 40", "count = 2000"), ("density = 0.1", "density = 0.3")))
    points = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * np.linspace(0, 1, 41)
    near = cKDTree(np.stack([points.real.ravel(), points.imag.ravel()], axis=1)).query_pairs(0.1, output_type="ndarray")
    assert len(near) > 0, "points of one crack"
    assert (near[:, 0] // 41 == near[:, 1] // 41).all()


def test_inclusions_have_the_fraction_and_the_distance() -> None:
    centers, radii = read_circles(change(INCLUSIONS, ("count = 20", "count = 200\nspread = 0.5")))
    gaps = abs(centers[:, None] - centers) - radii[:, None] - radii + 1e9 * np.eye(len(radii))
    assert 0.1 <= gaps.min() < 0.2
    assert 0.5 <= radii.min() < 0.52 and 1.48 < radii.max() <= 1.5
    side = math.sqrt(math.pi * (radii**2).sum() / 0.3)
    assert 0.98 * side < np.ptp(centers.real) <= side


def test_directions_are_spread_about_the_orientation() -> None:
    text = change(CRACKS, ("half_length", "orientation = 30.0\norientation_spread = 10.0\nhalf_length"))
    ends = read_ends(change(text, ("count = 40", "count = 400")))
    degrees = np.degrees(np.angle(ends[:, 1] - ends[:, 0]))
    assert 20 <= degrees.min() < 21 and 39 < degrees.max() <= 40
    assert degrees.mean() == pytest.approx(30, abs=1)
    all_alike = read_ends(change(CRACKS, ("count = 40", "count = 2000")))
    degrees = np.degrees(np.angle(all_alike[:, 1] - all_alike[:, 0])) % 180
    assert np.histogram(degrees, bins=6, range=(0, 180))[0] / 2000 == pytest.approx(1 / 6, abs=0.03)


def test_centres_fill_a_disc() -> None:
    text = change(CRACKS, ("density", 'shape = "disc"\ncenter = [5.0, 7.0]\ndensity'), ("count = 40", "count = 1000"))
    away = abs(read_ends(text).mean(axis=1) - (5 + 7j))
    radius = math.sqrt(1000 / 0.1 / math.pi)
    assert 0.97 * radius < away.max() <= radius * (1 + 1e-9)
    assert (away < radius / math.sqrt(2)).mean() == pytest.approx(0.5, abs=0.05)


def test_all_of_a_box_is_inside() -> None:
    ends = read_ends(change(CRACKS, ("density = 0.1", "box = [20.0, 0.0, 0.0, 30.0]")))
    assert ends.real.min() >= 0.1 and ends.real.max() <= 19.9 and ends.imag.min() >= 0.1 and ends.imag.max() <= 29.9
    circles, radii = read_circles(change(INCLUSIONS, ("fraction = 0.3", "box = [0.0, 0.0, 18.0, 18.0]")))
    assert min((circles.real - radii).min(), (18 - circles.imag - radii).min()) >= 0.1


def make_table(**keys: object) -> GenerateTable:
    """A table of cracks with other keys."""
    given = {"kind": "cracks", "name": "c", "region": "r", "count": 20000, "elements": 8, "density": 1.0,
             "distance": 0.1, "half_length": 2.0}
    return GenerateTable.model_validate(given | keys)


def test_sizes_follow_their_distributions() -> None:
    sizes = np.array(draw_sizes(make_table(distribution="lognormal", spread=0.5), Random(1)))
    assert (np.diff(sizes) <= 0).all(), "the largest first"
    assert np.log(sizes / 2).mean() == pytest.approx(0, abs=0.02)
    # A normal distribution that is cut off at three has this standard deviation.
    assert np.log(sizes / 2).std() == pytest.approx(0.5 * 0.9866, rel=0.02)
    assert sizes.max() <= 2 * math.exp(1.5) * (1 + 1e-9)
    for exponent in (1.0, 2.5):
        sizes = np.array(draw_sizes(make_table(distribution="power", exponent=exponent, largest=20.0), Random(1)))
        assert 2.0 <= sizes.min() < 2.01 and 15 < sizes.max() <= 20
        # The part beyond b of what falls like a^-x from 2 to 20.
        total, beyond = (
            math.log(20 / a) if exponent == 1 else a ** (1 - exponent) - 20 ** (1 - exponent) for a in (2.0, 4.0)
        )
        assert (sizes > 4).mean() == pytest.approx(beyond / total, rel=0.05)


def test_distances_of_bodies() -> None:
    # Crossing, end on the side, end to end, parallel; discs; a disc beside a line.
    line = Body(0j, 2 + 0j, 0.0)
    assert measure_distance(line, Body(1 - 1j, 1 + 1j, 0.0)) == 0
    assert measure_distance(line, Body(1 + 0.5j, 1 + 2j, 0.0)) == pytest.approx(0.5)
    assert measure_distance(line, Body(5 + 4j, 9 + 9j, 0.0)) == pytest.approx(5.0)
    assert measure_distance(line, Body(0.5 + 0.25j, 3 + 0.25j, 0.0)) == pytest.approx(0.25)
    assert measure_distance(Body(0j, 0j, 1.0), Body(3 + 4j, 3 + 4j, 2.0)) == pytest.approx(2.0)
    assert measure_distance(line, Body(1 + 3j, 1 + 3j, 2.0)) == pytest.approx(1.0)


def test_long_and_short_bodies_are_placed_together() -> None:
    table = make_table(count=300, distribution="power", exponent=1.5, largest=40.0, density=0.004)
    bodies, area = place_bodies(table, make_ground([table]))
    assert len(bodies) == 300 and area.size == pytest.approx(300 / 0.004)
    assert all(measure_distance(one, other) >= 0.1 for one, other in itertools.combinations(bodies, 2))
    assert find_area(table, []).size == pytest.approx(300 / 0.004)


@pytest.mark.parametrize("large", ["half_length = 1e8", "half_length = 1e8\ndistribution = 'lognormal'\nspread = 0.5"])
def test_bodies_of_very_different_tables_are_placed_soon(large: str) -> None:
    """The ground's cells follow the smallest bodies only as far as the largest do not cover millions of them."""
    cracks = CRACKS.replace("count = 40", "count = 3").replace("half_length = 1.0", large)
    curves = parse_case(cracks.replace("density = 0.1", "density = 1e-20") + INCLUSIONS[len(ROCK):]).curves
    assert len(curves) == 23
    lengths = [math.dist(*curve.points) for name, curve in curves.items() if curve.points and name.startswith("crack")]
    assert min(lengths) > 2e7


def test_a_table_that_finds_no_room_at_all_is_told_so() -> None:
    fault = find_only_fault(CRACKS + INCLUSIONS[len(ROCK):].replace("fraction = 0.3\ndistance = 0.1",
                                                                    "fraction = 0.3\ndistance = 1e6"))
    assert "room for 0 of 20 inclusions" in fault and "expected a lower fraction, or a smaller distance" in fault


def test_the_same_table_gives_the_same_places_everywhere() -> None:
    # Numbers written down once: they must not change with versions or machines.
    expected = parse_case(CRACKS).curves["crack_1"].points
    assert expected == PLACED
    assert parse_case(change(CRACKS, ("friction = 0.6", "seed = 2"))).curves["crack_1"].points != expected


PLACED = ((8.92212463, 6.82820791), (10.77961186, 7.56965324))


def test_tables_keep_their_distance_from_each_other() -> None:
    second = CRACKS.split("[[generate]]")[1].replace('"crack"', '"other"').replace("= 0.1\nfriction", "= 0.5\nfriction")
    ends = read_ends(f"{CRACKS}[[generate]]{second}seed = 2")
    assert len(ends) == 80
    between = [least_distance(np.array([a, b])) for a in ends[:40] for b in ends[40:]]
    assert 0.5 <= min(between) < 0.7


def test_what_is_made_is_what_could_be_written() -> None:
    case = parse_case(CRACKS)
    names = [f"crack_{number}" for number in range(1, 41)]
    assert list(case.curves) == list(case.regions["rock"].cracks) == names
    model = build(CRACKS)
    assert {interface.law.friction for interface in model.interfaces.values()} == {0.6}
    assert {interface.law.cohesion for interface in model.interfaces.values()} == {0.01}
    model = build(INCLUSIONS)
    assert [region.name for region in model.regions] == ["rock", *(f"grain_{number}" for number in range(1, 21))]
    assert {(one.first, one.law.friction) for one in model.interfaces.values()} == {("rock", 0.6)}
    assert {region.material.name for region in model.regions[1:]} == {"grain"}


def test_one_of_many_can_have_its_own_law() -> None:
    model = build(CRACKS + "[interfaces.crack_7]\nfriction = 0.1\n")
    assert [model.interfaces[name].law.friction for name in ("crack_6", "crack_7")] == [0.6, 0.1]
    assert [model.interfaces[name].law.cohesion for name in ("crack_6", "crack_7")] == [0.01, 0.01]


@pytest.mark.parametrize(
    ("own", "kind", "friction", "cohesion", "gap"),
    [
        ("gap = 0.001", "coulomb", 0.6, 0.01, 0.001), ("cohesion = 0.0", "coulomb", 0.6, 0.0, 0.0),
        ("friction_angle = 45.0", "coulomb", 1.0, 0.01, 0.0), ('law = "open"', "open", 0.0, 0.0, 0.0),
        ('law = "frictionless"', "coulomb", 0.0, 0.0, 0.0), ('law = "bonded"', "bonded", 0.0, 0.0, 0.0),
        ('law = "coulomb"\nfriction = 0.2', "coulomb", 0.2, 0.01, 0.0),
    ],
)  # fmt: skip
def test_one_of_many_keeps_what_its_own_law_does_not_name(
    own: str, kind: str, friction: float, cohesion: float, gap: float
) -> None:
    model = build(CRACKS + f"[interfaces.crack_7]\n{own}\n")
    law = model.interfaces["crack_7"].law
    assert (law.kind, law.friction, law.cohesion, law.gap) == (kind, pytest.approx(friction), cohesion, gap)
    other = model.interfaces["crack_8"].law
    assert (other.kind, other.friction, other.cohesion) == ("coulomb", 0.6, 0.01)


def test_a_stage_can_press_on_all_or_on_one() -> None:
    stages = """
[[stages]]
interfaces.crack = { pressure = 2.0 }
[[stages]]
interfaces.crack_3 = { pressure = 3.0 }
"""
    first, second = build(CRACKS + stages).stages
    assert set(first.pressure.values()) == {2.0}
    assert second.pressure == first.pressure | {"crack_3": 3.0}


WRONG = {
    "no kind": ('kind = "cracks"', 'kind = "crack"', "generate[1].kind (line 15): ", "did you mean 'cracks'?"),
    "unknown key": ("density", "densty = 1\ndensity", "generate[1].densty (line 21)", "did you mean 'density'?"),
    "no count": ("count = 40\n", "", "generate[1].count (line 14)", "no count"),
    "no region": ('"rock"\ncount', '"rok"\ncount', "generate[1].region (line 17)", "did you mean 'rock'?"),
    "no size": ("half_length = 1.0\n", "", "generate[1] (line 14)", "cracks without half_length"),
    "radius": ("half_length", "radius = 1\nhalf_length", "generate[1].radius (line 20)", "which cracks do not have"),
    "no area": ("density = 0.1\n", "", "generate[1] (line 14)", "neither density nor box"),
    "two areas": ("density", "box = [0, 0, 9, 9]\ndensity", "generate[1].box (line 21)", "box together with density"),
    "flat box": ("density = 0.1", "box = [0, 0, 9, 0]", "generate[1].box (line 21)", "a box without area"),
    "spread": ("density", "spread = 1.0\ndensity", "generate[1].spread (line 21)", "a number below 1"),
    "exponent": ("density", "exponent = 2.0\ndensity", "generate[1].exponent (line 21)", 'distribution = "power"'),
    "largest": ("density", 'distribution = "power"\nexponent = 2.0\nlargest = 0.5\ndensity',
                "generate[1].largest (line 23)", "above the least one, 1.0"),
    "orientation": ("density", "orientation_spread = 9.0\ndensity", "generate[1].orientation_spread (line 21)",
                    "without orientation"),
    "friction twice": ("friction", "friction_angle = 30.0\nfriction", "generate[1].friction_angle (line 23)",
                       "both friction and friction_angle"),
    "name": ('name = "crack"', 'name = "a/b"', "generate[1].name (line 16)", "without '/'"),
    "bonded": ("friction = 0.6\ncohesion", 'law = "bonded"\ncohesion', "generate[1].cohesion (line 24)",
               "no effect with law"),
    "too dense": ("density = 0.1", "density = 40.0", "generate[1].density (line 21)", "of 40 cracks at a distance"),
    "too small a box": ("density = 0.1", "box = [0, 0, 5, 5]", "generate[1].count (line 18)", "cracks in this box"),
}


@pytest.mark.parametrize("what", WRONG)
def test_faults_have_their_place(what: str) -> None:
    old, new, place, words = WRONG[what]
    fault = find_only_fault(change(CRACKS, (old, new)))
    assert place in fault and words in fault, fault


def test_what_is_possible_is_told() -> None:
    fault = find_only_fault(change(CRACKS, ("count = 40", "count = 400"), ("density = 0.1", "density = 40.0")))
    possible = fault.split("density of about ")[1].split(" at most")[0]
    build(change(CRACKS, ("count = 40", "count = 400"), ("density = 0.1", f"density = {possible}")))
    assert float(possible) > 1


def test_faults_of_inclusions() -> None:
    fault = find_only_fault(change(INCLUSIONS, ("fraction = 0.3", "fraction = 0.7"), ("count = 20", "count = 200")))
    assert "generate[1].fraction" in fault and "inclusions at a distance of 0.1" in fault
    fault = find_only_fault(change(INCLUSIONS, ('material = "grain"\ncount', 'material = "gran"\ncount')))
    assert "generate[1].material" in fault and "did you mean 'grain'?" in fault
    fault = find_only_fault(change(INCLUSIONS, ("elements = 8", "elements = 6")))
    assert "generate[1] (line 14)" in fault and "at least 8" in fault


def test_names_are_not_given_twice() -> None:
    curve = "[curves]\ncrack_40 = { points = [[90, 0], [91, 0]], elements = 4 }\n"
    curve += "[regions.rock]\ncracks = [\"crack_40\"]\n"
    fault = find_only_fault(change(CRACKS, ("[regions.rock]\n", curve)))
    assert "generate[1].name" in fault and "makes 'crack_40' a second time" in fault
    again = "[[generate]]" + CRACKS.split("[[generate]]")[1]
    assert "the name 'crack' of generate[1] again" in find_only_fault(CRACKS + again)


def test_faults_of_many_are_told_once() -> None:
    # All forty cross a curve of the file or lie outside of a region: a few examples do.
    plate = """
[curves]
a = { points = [[100, 100], [101, 100]], elements = 4 }
b = { points = [[101, 100], [101, 101], [100, 100]], elements = 4 }
[regions.rock]
boundary = ["a", "b"]
"""
    elsewhere = change(CRACKS, ("[regions.rock]", plate), ("infinite = true\n", ""), ("[remote]\nsyy = -1.0", ""))
    faults = find_faults(elsewhere)
    texts = [str(fault) for fault in faults if "generate" in str(fault)]
    assert len(texts) == 6
    assert "generate[1] (line 18): found crack 'crack_1' outside region 'rock'" in texts[0]
    assert "found 35 more of such faults" in texts[-1]
    faults = find_faults(change(CRACKS, ("elements = 4", "elements = 1")))
    assert "generate[1].elements (line 19): found 1 element on crack 'crack_1' with two tips" in str(faults[0])
    assert len(faults) == 6
