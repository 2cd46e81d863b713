"""Pictures of fields: triangles that fill the regions and cross nothing, values that are the field's."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.typing import NDArray

import pbem.plot_command
import pbem.results.field_plot
import pbem.results.page
import pbem.results.region_triangles
from pbem.bem.location import locate_points
from pbem.errors import ResultFileError
from pbem.results.contents import Elements
from pbem.results.field_formulas import FIELDS
from pbem.results.field_plot import CONTOURS, FieldOptions, FieldPicture, draw_field, plot_field
from pbem.results.outline import to_columns
from pbem.results.page import choose_box
from pbem.results.picture_limits import CUT, limit_field, print_number
from pbem.results.plot_style import style
from pbem.results.reader import Results, open_results
from pbem.results.region_points import View
from pbem.results.region_triangles import Triangles, triangulate
from pbem.results.writer import ResultWriter
from tests.unit.results_sample import make_mesh, make_model, make_steps
from tests.verification.planes import make_plane, make_straight, solve

Real = NDArray[np.float64]

MODEL = make_model()
MESH = make_mesh(MODEL)
FINITE = np.zeros(2, dtype=bool)


def write_results(path: Path, steps: int = 6) -> Results:
    with ResultWriter(path, MODEL, MESH, 1, "") as writer:
        for step in make_steps(MODEL, MESH)[:steps]:
            writer.append(step)
    return open_results(path)


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """Two blocks, a hole, a crack; invented fields."""
    return write_results(tmp_path_factory.mktemp("sample") / "a.h5")


@pytest.fixture(scope="module")
def stress(griffith: Results) -> FieldPicture:
    """The stress across the crack, with triangles as fine as they are without a word about them."""
    return FieldPicture(griffith, "syy", FieldOptions(), [0])


@pytest.fixture(scope="module")
def griffith(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """A crack of half-length 1 in an infinite plane under unit tension across it, solved."""
    path = tmp_path_factory.mktemp("griffith") / "a.h5"
    model = make_plane((0.0, 1.0, 0.0), {"crack": [make_straight(-1.0, 1.0, 8)]})
    mesh, steps = solve(model)
    with ResultWriter(path, model, mesh, 1, "") as writer:
        writer.append(steps[-1])
    return open_results(path)


def make_view(results: Results, across: int = 30) -> View:
    box = choose_box(results)
    spacing = float(box.size.max()) / across
    return View(box.low, box.high, spacing, spacing / 6)


def list_notes(figure: Figure) -> str:
    said = [figure._suptitle, figure._supxlabel, *figure.axes[0].texts]  # type: ignore[attr-defined]
    return "\n".join(each.get_text() for each in said if each)


def test_triangles_fill_the_regions_and_nothing_else(sample: Results) -> None:
    found = triangulate(sample.elements, FINITE, make_view(sample))
    assert found.areas.min() > 0
    region = found.region[found.corners]
    assert (region == region[:, :1]).all()
    areas = np.bincount(region[:, 0], found.areas)
    np.testing.assert_allclose(areas, [2.0, 2.0 - np.pi * 0.04], rtol=1e-3)
    # By the winding numbers of the exact boundary, arcs included.
    location = locate_points(MESH, [False, False], found.position[found.corners].mean(axis=1))
    np.testing.assert_array_equal(location.region, region[:, 0])
    np.testing.assert_allclose(found.weights.sum(), found.areas.sum(), rtol=1e-12)


def test_vertices_on_the_boundary_are_where_their_faces_are(sample: Results) -> None:
    found = triangulate(sample.elements, FINITE, make_view(sample))
    on = found.face[:, 0] >= 0
    assert on.sum() > 100
    for side in (0, 1):
        places = sample.elements.geometry.select(found.face[on, side]).place(found.s[on, side, None])[:, 0]
        np.testing.assert_allclose(places, found.position[on], atol=1e-9)
        np.testing.assert_array_equal(sample.elements.region[found.face[on, side]], found.region[on])


def list_pairs_on_crack(triangles: Triangles, crack: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Vertices at the same place that are on faces of cracks."""
    on = np.flatnonzero((triangles.face[:, 0] >= 0) & crack[triangles.face[:, 0]])
    place = np.round(triangles.position[on], 9)
    return [on[place == each] for each in np.unique(place)]


def test_no_triangle_crosses_a_crack_and_both_sides_have_vertices(sample: Results) -> None:
    found = triangulate(sample.elements, FINITE, make_view(sample))
    start, end = 0.3 + 0.3j, 1.5 + 0.6j
    along = (found.position[found.corners] - start) / (end - start)
    beside = (along.real > 1e-6) & (along.real < 1 - 1e-6) & (np.abs(along.imag) > 1e-9)
    for low, high in ((0, 1), (1, 2), (2, 0)):
        crosses = (along.imag[:, low] * along.imag[:, high] < 0) & beside[:, low] & beside[:, high]
        assert not crosses.any()
    places = list_pairs_on_crack(found, sample.elements.crack)
    tips = np.flatnonzero(found.find_tips(sample.elements))
    np.testing.assert_allclose(np.sort_complex(found.position[tips]), [start, end], atol=1e-12)
    assert sorted(len(each) for each in places) == [1, 1] + [2] * (len(places) - 2)
    assert len(places) >= 13


def test_a_touching_crack_and_a_hole_in_an_infinite_plane(griffith: Results) -> None:
    found = triangulate(griffith.elements, np.array([True]), make_view(griffith))
    box = choose_box(griffith)
    places = to_columns(found.position)
    assert (places.min(axis=0) <= box.low).all() and (places.max(axis=0) >= box.high).all()
    np.testing.assert_allclose(found.areas.sum(), np.ptp(places, axis=0).prod(), rtol=1e-12)


def test_cracks_that_meet_in_tiny_elements_are_not_halved_without_end(monkeypatch: pytest.MonkeyPatch) -> None:
    # Three arms far from the origin, whose elements shrink towards the junction more than a triangulation can follow.
    along = np.r_[0.0, np.geomspace(1e-7, 1.0, 34)]
    arms = [along * arm + 4.66e5 + 6.691e6j for arm in np.exp(1j * np.array([0.0, 2.0, 4.1]))]
    lines = np.concatenate([np.stack([arm[:-1], arm[1:]], axis=1) for arm in arms])
    lines = np.stack([lines.real, lines.imag], axis=2)
    vertices = np.concatenate([lines, lines[:, ::-1]])
    none = np.zeros(len(vertices), dtype=np.int64)
    elements = Elements(vertices, np.zeros(len(none)), none, none, np.ones(len(none), dtype=bool), none)
    low, high = vertices.min(axis=(0, 1)) - 0.5, vertices.max(axis=(0, 1)) + 0.5
    halved = []
    halve = pbem.results.region_triangles._halve
    monkeypatch.setattr(pbem.results.region_triangles, "_halve",
                        lambda *given: halved.append(int(given[2].sum())) or halve(*given))
    found = triangulate(elements, np.array([True]), View(low, high, 0.05, 0.005))
    assert sum(halved) < 2000
    assert (found.areas >= 0).all()


def test_both_sides_of_a_crack_have_their_own_values(griffith: Results) -> None:
    picture = FieldPicture(griffith, "uy", FieldOptions(), [0])
    values, triangles = picture.values(0), picture.triangles
    # Opening of Griffith's crack: 4/E' sqrt(a^2 - x^2) under unit stress.
    plane_modulus = griffith.tips["crack"].plane_modulus
    for both in list_pairs_on_crack(triangles, griffith.elements.crack):
        x = triangles.position[both[0]].real
        opening = 4 / plane_modulus * np.sqrt(max(1 - x**2, 0.0))
        assert np.ptp(values[both]) == pytest.approx(opening, abs=0.02 * 4 / plane_modulus)
        assert len(both) == (1 if abs(x) == 1 else 2)


def test_values_are_those_of_the_field_and_the_extremes_are_marked(griffith: Results, stress: FieldPicture) -> None:
    picture, triangles, values = stress, stress.triangles, stress.values(0)
    inside = np.flatnonzero(triangles.face[:, 0] < 0)[::7]
    expected = griffith.evaluate(to_columns(triangles.position[inside])).stress[0, :, 1]
    np.testing.assert_allclose(values[inside], expected, rtol=1e-10, atol=1e-12)
    box = choose_box(griffith)
    shown = box.contains(to_columns(triangles.position)) & ~triangles.find_tips(griffith.elements)
    figure = picture.draw(0)
    said = list_notes(figure)
    assert f"max {print_number(float(values[shown].max()))}" in said
    assert f"min {print_number(float(values[shown].min()))}" in said
    marks = {line.get_label(): line for line in figure.axes[0].get_lines()}
    for name, which in (("_max", np.argmax), ("_min", np.argmin)):
        place = triangles.position[shown][which(values[shown])]
        assert complex(marks[name].get_xdata()[0], marks[name].get_ydata()[0]) == place
    assert "max at a crack tip, where stress may be infinite" in said
    # The colours end before the values, and the picture says so.
    high = figure.axes[0].collections[0].get_clim()[1]
    assert high < values[shown].max()
    assert "colours end before the values" in said
    assert print_number(float(values[shown].max())) in said.split("colours end")[1]


def test_formulas_of_fields() -> None:
    random = np.random.default_rng(5)
    u, s = random.normal(size=(9, 2)), random.normal(size=(9, 4))
    tensor = np.array([[[xx, xy, 0], [xy, yy, 0], [0, 0, zz]] for xx, yy, xy, zz in s])
    plane = np.linalg.eigvalsh(tensor[:, :2, :2])
    deviator = tensor - np.trace(tensor, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    expected = {
        "ux": u[:, 0], "uy": u[:, 1], "u": np.hypot(*u.T), "sxx": s[:, 0], "syy": s[:, 1], "sxy": s[:, 2],
        "s1": plane[:, 1], "s2": plane[:, 0], "shear": 0.5 * (plane[:, 1] - plane[:, 0]),
        "mises": np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))),
    }  # fmt: skip
    assert set(expected) == set(FIELDS) == set(pbem.plot_command.FIELDS)
    for name, values in expected.items():
        np.testing.assert_allclose(FIELDS[name][2](u, s), values, rtol=1e-12)


def test_colours_are_cut_for_singular_values_only() -> None:
    values = np.concatenate([np.linspace(0, 1, 1000), [1.6]])
    weights = np.ones(len(values))
    regular, singular = (limit_field(values, weights, lambda number, told=told: told) for told in (False, True))
    assert (regular.low, regular.high) == (0.0, 1.6)
    assert regular.describe_cut("x") == ""
    assert singular.high == pytest.approx(1 - CUT, abs=2e-3)
    assert singular.describe_cut("x") == "cut off: x reaches 1.6"
    # Far beyond all the rest, it is left out wherever it is.
    assert limit_field(np.append(values, 50.0), np.ones(len(values) + 1), lambda number: False).high < 2
    constant = limit_field(np.full(5, 3.0), np.ones(5), lambda number: True)
    assert (constant.low, constant.high) == (3.0, 3.0)


def test_displaced_pictures_and_parts(griffith: Results) -> None:
    figure = draw_field(griffith, "uy", options=FieldOptions(shape=(12, 12), displaced=True, magnify=100.0))
    assert "displacements × 100" in list_notes(figure)
    picture = FieldPicture(griffith, "uy", FieldOptions(box=(0.5, -0.25, 1.5, 0.25), shape=(30, 15)), [0])
    figure = picture.draw(0)
    assert figure.axes[0].get_xlim() == (0.5, 1.5) and figure.axes[0].get_ylim() == (-0.25, 0.25)
    assert "part from (0.5, \N{MINUS SIGN}0.25) to (1.5, 0.25)" in list_notes(figure)
    places = to_columns(picture.triangles.position[picture.triangles.corners])
    assert (places.max(axis=1)[:, 0] >= 0.5).all() and (places.min(axis=1)[:, 0] <= 1.5).all()
    fine = FieldPicture(griffith, "uy", FieldOptions(box=(0.5, -0.25, 1.5, 0.25), shape=(90, 45)), [0])
    assert len(fine.triangles.corners) > 1.5 * len(picture.triangles.corners)


def test_marks_at_the_edge_are_written_inside(griffith: Results) -> None:
    for box in ((-2.0, -1.5, 2.0, 0.05), (-2.0, -0.05, 2.0, 1.5), (-0.5, -0.02, 0.5, 0.02)):
        figure = draw_field(griffith, "uy", options=FieldOptions(box=box, shape=(24, 12)))
        figure.draw_without_rendering()
        axes = figure.axes[0]
        marks = [each.get_window_extent() for each in axes.texts if each.get_text().startswith(("max", "min"))]
        assert len(marks) == 2
        assert all(axes.bbox.y0 <= 0.5 * (each.y0 + each.y1) <= axes.bbox.y1 for each in marks)


def test_wrong_fields_and_boxes(sample: Results, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no field 'mise'; did you mean 'mises'\?; there are: ux"):
        draw_field(sample, "mise")
    with pytest.raises(ValueError, match="shows nothing: the model reaches from x 0 to 2 and from y 0 to 2"):
        draw_field(sample, "ux", options=FieldOptions(box=(5, 5, 6, 6)))
    with pytest.raises(ValueError, match="has no size"):
        draw_field(sample, "ux", options=FieldOptions(box=(0, 0, 0, 1)))
    with pytest.raises(ResultFileError, match="holds no load step"):
        draw_field(write_results(tmp_path / "b.h5", steps=0), "ux")
    empty = open_results(tmp_path / "b.h5")
    with pytest.raises(ResultFileError, match="holds no load step"):
        empty.evaluate([[0.5, 0.5]])
    with pytest.raises(ResultFileError, match="holds no load step"):
        FieldPicture(empty, "mises", FieldOptions(), [])
    with pytest.raises(IndexError):
        draw_field(sample, "ux", step=6)


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_maps_are_written(griffith: Results, tmp_path: Path, ending: str) -> None:
    plot_field(griffith, "mises", tmp_path / f"a.{ending}", options=FieldOptions(shape=(12, 12)))
    assert (tmp_path / f"a.{ending}").stat().st_size > 5000


def test_units_from_small_to_large_have_few_ticks(tmp_path: Path) -> None:
    for scale in (1e-9, 1e9):
        model = make_plane((0.0, 1.0, 0.0), {"crack": [make_straight(-scale, scale, 4)]})
        mesh, steps = solve(model)
        with ResultWriter(tmp_path / f"{scale}.h5", replace(model, units_length="m"), mesh, 1, "") as writer:
            writer.append(steps[-1])
        with style():
            figure = draw_field(open_results(tmp_path / f"{scale}.h5"), "syy", options=FieldOptions(shape=(12, 12)))
            figure.canvas.draw()
        axes = figure.axes[0]
        for axis in (axes.xaxis, axes.yaxis):
            texts = [re.sub(r"[^0-9.]", "", each.get_text()) for each in axis.get_ticklabels()]
            assert 3 <= len(texts) <= 9 and max(map(len, texts)) <= 5
            assert r"10" in axis.get_offset_text().get_text()


def test_rounding_is_shown_as_zero(tmp_path: Path) -> None:
    """A block pressed along y has no stress along x: all of it is 0, without marks and contours, in any unit."""
    for unit in (1e-6, 1.0, 1e9):
        case = {
            "materials": {"rock": {"young": 1e3 * unit, "poisson": 0.0}},
            "curves": {"sides": {"points": [[2, 0], [2, 1]], "elements": 4}, "bottom": {"points": [[0, 0], [2, 0]],
                       "elements": 4}, "top": {"points": [[2, 1], [0, 1]], "elements": 4},
                       "left": {"points": [[0, 1], [0, 0]], "elements": 4}},
            "regions": {"block": {"material": "rock", "boundary": ["bottom", "sides", "top", "left"]}},
            "boundary": {"bottom": {"un": 0.0}, "left": {"un": 0.0}, "top": {"tn": -1.0 * unit}},
        }
        results = pbem.run(case, tmp_path / "x.h5", force=True)
        picture = FieldPicture(results, "sxx", FieldOptions(shape=(8, 8)), [0])
        assert np.isfinite(picture.values(0)).all() and not picture.values(0).any()
        assert not any("min" in text.get_text() for text in picture.draw(0).axes[0].texts)
        assert (FieldPicture(results, "syy", FieldOptions(shape=(8, 8)), [0]).values(0) < -0.099 * unit).all()


def test_lines_of_zero_are_left_out_where_nothing_acts(griffith: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    """They stay where values go through zero, and along the rim of where they do not act."""
    def measure_zero_lines(values: NDArray[np.float64]) -> float:
        picture = FieldPicture(griffith, "sxy", FieldOptions(limits=(-1.0, 1.0)), [0])
        monkeypatch.setattr(picture, "values", lambda step: values)
        drawn = picture.draw(0).axes[0].collections
        lines = [each for each in drawn if np.allclose(each.get_linewidth(), 0.9)]
        return float(sum(np.abs(np.diff(path.vertices, axis=0)).sum() for each in lines for path in each.get_paths()))

    x = FieldPicture(griffith, "sxy", FieldOptions(), [0]).triangles.position.real
    chance = np.random.default_rng(3)
    once = measure_zero_lines(x)
    assert once > 1 and 0 < measure_zero_lines(np.where(x > 0, x, 0.0) + 1e-4 * chance.normal(size=len(x))) < 2 * once


def test_triangles_are_fine_enough_for_the_lines_of_a_map(griffith: Results, stress: FieldPicture) -> None:
    """Between the vertices, where the field is interpolated, it is off by less than a quarter of what lines are apart.
    """
    triangles, values = stress.triangles, stress.values(0)
    middle = triangles.position[triangles.corners].mean(axis=1)
    far = np.minimum(np.abs(middle - 1), np.abs(middle + 1)) > 0.1
    exact = griffith.evaluate(to_columns(middle[far]), steps=[0]).stress[0, :, 1]
    off = np.abs(values[triangles.corners[far]].mean(axis=1) - exact)
    low, high, _ = stress._choose_colours()
    assert off.max() < 0.25 * (high - low) / CONTOURS


def test_lines_are_left_out_where_many_cracks_are_shown(
    griffith: Results, sample: Results, monkeypatch: pytest.MonkeyPatch
) -> None:
    def count_lines(options: FieldOptions) -> int:
        return FieldPicture(griffith, "syy", options, [0])._count_contours()

    coarse = FieldOptions(shape=(8, 8))
    assert count_lines(coarse) == CONTOURS
    monkeypatch.setattr(pbem.results.field_plot, "MANY_LINES", 1)
    assert count_lines(coarse) == 0 and count_lines(replace(coarse, contours=5)) == 5
    # Interfaces count as cracks do.
    several = FieldPicture(sample, "syy", coarse, [0])
    monkeypatch.setattr(pbem.results.field_plot, "MANY_LINES", 2)
    assert several._count_contours() == 0
    monkeypatch.setattr(pbem.results.field_plot, "MANY_LINES", 3)
    assert several._count_contours() == CONTOURS
    monkeypatch.setattr(pbem.results.field_plot, "MANY_LINES", 1)
    # Nor is there a crack in this part.
    assert count_lines(replace(coarse, box=(1.5, 0.5, 2.0, 1.0))) == CONTOURS
    room = choose_box(griffith).size
    monkeypatch.setattr(pbem.results.page, "MANY", 1)
    assert (choose_box(griffith).size < room).all()
