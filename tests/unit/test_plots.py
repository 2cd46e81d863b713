"""Pictures hold what they should: looked at as figures, not as pixels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from scipy.integrate import trapezoid

from pbem.contact.laws import OPEN
from pbem.mesh.mesh import second_face_nodes
from pbem.model.model import Condition, Model
from pbem.results.model_plot import draw_model
from pbem.results.outline import POINTS_PER_ELEMENT, trace_outlines
from pbem.results.plot_style import FORCE, MODES, MOTION, label
from pbem.results.plots import draw_results, plot_model, plot_results
from pbem.results.reader import Results, open_results
from pbem.results.writer import ResultWriter
from tests.unit.results_sample import make_mesh, make_model, make_steps
from tests.verification.planes import make_plane, make_straight, solve

MODEL = make_model()
MESH = make_mesh(MODEL)
STEPS = make_steps(MODEL, MESH)


def write_results(path: Path, model: Model = MODEL, steps: int = len(STEPS)) -> Results:
    mesh = make_mesh(model)
    with ResultWriter(path, model, mesh, 1, "3.18.5") as writer:
        for step in make_steps(model, mesh)[:steps]:
            writer.append(step)
    return open_results(path)


def list_texts(figure: Figure) -> str:
    """All that is written in a figure."""
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    texts += [each.get_text() for each in (figure._suptitle, figure._supxlabel) if each]  # type: ignore[attr-defined]
    texts += [axes.get_title(loc="left") for axes in figure.axes]
    texts += [text.get_text() for axes in figure.axes if (legend := axes.get_legend()) for text in legend.get_texts()]
    return "\n".join(texts)


def count_arrows(figure: Figure, color: str) -> int:
    quivers = [each for each in figure.axes[0].collections if hasattr(each, "U")]
    return sum(each.N for each in quivers if to_hex(each.get_facecolor()[0]) == color.lower())


def test_results_have_two_panels_for_each_interface(tmp_path: Path) -> None:
    figure = draw_results(write_results(tmp_path / "a.h5"))
    body, *panels, row = figure.axes
    assert len(panels) == 4
    assert [axes.get_title(loc="left") for axes in panels[::2]] == ["joint", "crack"]
    assert [axes.get_ylabel() for axes in panels[:2]] == ["traction (kN/m$^{2}$)", "opening, slip (m)"]
    assert {axes.get_xlabel() for axes in panels} == {"arc length (m)"}
    assert "Made-up blocks\nstep 6 (shear, factor 1), displacements × 100" in list_texts(figure)
    # One legend, every entry once.
    assert [axes for axes in figure.axes if axes.get_legend()] == [row]
    legend = [text.get_text() for text in row.get_legend().get_texts()]
    assert legend == ["displaced", "as it was", "stick", "slip", "open", "crack tip",
                      "normal traction $t_n$; opening", "shear traction $t_s$; slip"]
    assert body.get_xlabel() == "$x$ (m)"


def test_curves_and_marks_are_those_of_the_step(tmp_path: Path) -> None:
    figure = draw_results(write_results(tmp_path / "a.h5"), step=2)
    contact = STEPS[2].contact
    joint = MESH.pairs.interface == 0
    order = np.argsort(MESH.pairs.arc_length[joint])
    normal, tangential = figure.axes[1].get_lines()[:2]
    np.testing.assert_array_equal(normal.get_ydata(), contact.traction_n[joint][order])
    np.testing.assert_array_equal(tangential.get_ydata(), contact.traction_s[joint][order])
    opening, slip = figure.axes[2].get_lines()[:2]
    np.testing.assert_array_equal(opening.get_ydata(), contact.opening[joint][order])
    np.testing.assert_array_equal(slip.get_ydata(), contact.slip[joint][order])
    # Marks come mode after mode for the first quantity; those of open pairs are the third.
    marks = figure.axes[1].collections[list(MODES).index(OPEN)]
    assert len(marks.get_offsets()) == (contact.mode[joint] == OPEN).sum() > 0


def test_marks_lie_on_the_displaced_first_side(tmp_path: Path) -> None:
    figure = draw_results(write_results(tmp_path / "a.h5"), magnify=50.0)
    scatters = [each for each in figure.axes[0].collections if len(each.get_offsets()) > 1]
    marks = np.concatenate([each.get_offsets() for each in scatters]) @ [1, 1j]
    displaced = MESH.position + 50 * STEPS[-1].displacement[: MESH.nodes]
    expected = displaced[MESH.pairs.first]
    np.testing.assert_allclose(np.sort_complex(marks), np.sort_complex(expected), rtol=1e-13)
    assert "displacements × 50" in list_texts(figure)


def test_the_interfaces_where_most_happens_are_drawn(tmp_path: Path) -> None:
    results = write_results(tmp_path / "a.h5", make_model(cracks=30), 1)
    figure = draw_results(results)
    assert len(figure.axes) == 1 + 2 * 4 + 1
    titles = [axes.get_title(loc="left") for axes in figure.axes[1:-1:2]]
    moved = {name: trapezoid(np.abs(each.slip[0]) + np.abs(each.opening[0]), each.arc_length)
             for name, each in results.contact.items()}
    assert titles == sorted(titles, key=list(results.contact).index)
    assert min(moved[name] for name in titles) >= 0.95 * sorted(moved.values())[-4]
    assert "27 of 31 interfaces are left out" in list_texts(figure)


def test_a_file_without_steps_shows_the_body_as_it_was(tmp_path: Path) -> None:
    figure = draw_results(write_results(tmp_path / "a.h5", steps=0))
    assert len(figure.axes) == 2  # the legend has its own
    assert "no step stored" in list_texts(figure)
    with pytest.raises(IndexError):
        draw_results(open_results(tmp_path / "a.h5"), step=0)


@pytest.mark.parametrize("ending", ["png", "pdf", "svg"])
def test_pictures_are_written(tmp_path: Path, ending: str) -> None:
    plot_results(write_results(tmp_path / "a.h5"), tmp_path / f"a.{ending}")
    plot_model(MODEL, MESH, tmp_path / f"b.{ending}")
    assert min((tmp_path / f"{name}.{ending}").stat().st_size for name in "ab") > 5000


def test_outlines_close_and_follow_a_linear_displacement(tmp_path: Path) -> None:
    results = write_results(tmp_path / "a.h5", steps=1)
    gradient = np.array([[0.1, -0.2], [0.3, 0.4]])
    displacement = results.nodes.position @ gradient.T
    outlines = trace_outlines(results.nodes, results.elements, displacement)
    assert [(each.region, each.crack) for each in outlines] == \
        [(0, False), (1, False), (1, False), (0, True), (0, True)]
    for each in outlines:
        # On an arc a linear field is no polynomial of the coordinate; on straight elements it is.
        arc = each is outlines[2]
        np.testing.assert_allclose(each.displacement, each.position @ gradient.T, atol=1e-3 if arc else 1e-13)
        assert (each.position[0] == each.position[-1]).all() != each.crack
    x, y = outlines[0].position.T
    assert 0.5 * (x[:-1] @ y[1:] - y[:-1] @ x[1:]) == pytest.approx(2.0)
    # The hole: clockwise, every point on the circle.
    x, y = outlines[2].position.T
    np.testing.assert_allclose(np.hypot(x - 1, y - 1.5), 0.2, rtol=1e-13)
    assert 0.5 * (x[:-1] @ y[1:] - y[:-1] @ x[1:]) == pytest.approx(-np.pi * 0.04, rel=2e-3)


def test_coordinates_on_elements_are_those_of_the_mesh() -> None:
    outer = ~MESH.crack
    lines = MESH.geometry.select(outer).place(MESH.local)
    assert (MESH.sweep != 0).sum() == 16
    np.testing.assert_allclose(lines.ravel(), MESH.position[~MESH.node_crack], atol=1e-14)
    found = MESH.geometry.select(outer).preimage(lines).real
    np.testing.assert_allclose(found, np.tile(MESH.local, (outer.sum(), 1)), atol=1e-12)


def test_faces_of_a_crack_meet_at_its_tips(tmp_path: Path) -> None:
    results = write_results(tmp_path / "a.h5", steps=1)
    displacement = np.zeros_like(results.nodes.position)
    displacement[MESH.nodes:] = [0.0, 1.0]
    first, second = trace_outlines(results.nodes, results.elements, displacement)[-2:]
    for here, there in ((0, -1), (-1, 0)):
        np.testing.assert_array_equal(first.position[here], second.position[there])
        np.testing.assert_allclose(first.displacement[here], [0.0, 0.5], atol=1e-14)
        np.testing.assert_array_equal(first.displacement[here], second.displacement[there])
    # Off the tip elements the jump is a polynomial of each element.
    body = second.displacement[POINTS_PER_ELEMENT:-POINTS_PER_ELEMENT]
    np.testing.assert_allclose(body, np.tile([0.0, 1.0], (len(body), 1)))


def test_faces_open_like_a_root_at_tip_elements(tmp_path: Path) -> None:
    # An ellipse, as under tension: between the nodes of the last element no polynomial would follow it.
    results = write_results(tmp_path / "a.h5", steps=1)
    length = MODEL.curves["crack"].length
    node = np.flatnonzero(MESH.node_crack)
    along = MESH.pairs.arc_length[MESH.pairs.crack]
    opening = np.zeros(MESH.nodes)
    opening[node] = np.sqrt(along * (length - along))
    displacement = np.zeros_like(results.nodes.position)
    displacement[: MESH.nodes, 1] = opening
    displacement[MESH.nodes :, 1] = -opening[second_face_nodes(MESH)]
    first, second = trace_outlines(results.nodes, results.elements, displacement)[-2:]
    for face, sign in ((first, 1), (second, -1)):
        place = np.hypot(*(face.position - first.position[0]).T)
        expected = sign * np.sqrt(np.maximum(place * (length - place), 0))
        np.testing.assert_allclose(face.displacement[:, 1], expected, atol=2e-3 * length)


def test_a_crack_in_the_last_region_has_two_faces(tmp_path: Path) -> None:
    model = make_plane((0.0, 1.0, 0.0), {"crack": [make_straight(-1.0, 1.0, 4)]})
    mesh, steps = solve(model)
    with ResultWriter(tmp_path / "a.h5", model, mesh, 1, "") as writer:
        writer.append(steps[-1])
    results = open_results(tmp_path / "a.h5")
    above, below = trace_outlines(results.nodes, results.elements, results.displacement[-1])
    np.testing.assert_array_equal(above.position[[0, -1]], [[-1, 0], [1, 0]])
    np.testing.assert_array_equal(below.position[[0, -1]], [[1, 0], [-1, 0]])
    figure = draw_results(results)
    dots = [line for line in figure.axes[0].get_lines() if line.get_marker() == "."]
    assert len(dots) == 1
    assert len(np.unique(np.round(dots[0].get_xydata(), 12), axis=0)) == 2


def test_a_model_is_drawn_with_names_conditions_and_sides() -> None:
    figure = draw_model(MODEL, MESH)
    said = list_texts(figure)
    for text in ("lower", "upper", "joint", "crack", "bottom\nux = 0, uy = 0", "top\ntx = 0, 3, uy = -0.001",
                 "82 elements of order 2", "cracks (1)", "normal of the first side"):
        assert text in said
    assert [text.get_text() for text in figure.axes[0].texts].count("1") == 2
    assert count_arrows(figure, FORCE) == 12
    assert count_arrows(figure, MOTION) == 6


def test_arrows_point_in_the_direction_of_the_load() -> None:
    figure = draw_model(MODEL, MESH)
    quivers = {to_hex(each.get_facecolor()[0]): each for each in figure.axes[0].collections if hasattr(each, "U")}
    press = quivers[MOTION.lower()]
    assert (press.V < 0).all() and np.abs(press.U).max() < 1e-12
    # A pressed boundary is met by the points of the arrows, just outside of it.
    np.testing.assert_allclose(press.Y + press.V, 2.04, rtol=1e-12)


def test_rollers_stand_where_one_direction_is_held() -> None:
    before = len(draw_model(MODEL, MESH).axes[0].patches)
    rolling = Condition("left_lower", known=("displacement", "traction"))
    model = replace(MODEL, conditions=dict(MODEL.conditions) | {"left_lower": rolling})
    patches = draw_model(model, MESH).axes[0].patches
    assert len(patches) == before + 6
    assert max(patch.get_path().vertices[:, 0].max() for patch in patches[-6:]) <= 1e-12


def test_names_of_many_curves_are_left_out() -> None:
    model = make_model(cracks=40)
    said = list_texts(draw_model(model, make_mesh(model)))
    assert "crack17" not in said
    assert "48 curves, names left out" in said
    assert "cracks (40)" in said


def test_units_are_set_with_superscripts() -> None:
    assert label("traction", "kN/m^2") == "traction (kN/m$^{2}$)"
    assert label("traction", "N*mm**-2") == "traction (N*mm$^{-2}$)"
    assert label("price", "$") == r"price (\$)"
    assert label("traction", "") == "traction"
