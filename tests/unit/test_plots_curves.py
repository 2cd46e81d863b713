"""Lines along curves: ends at tips, limits that singular ends do not spoil, angles, what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import pbem
from pbem.results.curve_picture import CurveOptions, CurvePicture
from pbem.results.curve_plot import draw_quantity, join_limits
from pbem.results.curve_profile import measure_angles, read_profile
from pbem.results.picture_limits import Limits, limit_line, print_number, widen
from pbem.results.reader import Results, open_results
from pbem.results.writer import ResultWriter
from tests.unit.results_sample import make_mesh, make_model, make_steps

MODEL = make_model()
MESH = make_mesh(MODEL)


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    path = tmp_path_factory.mktemp("curves") / "a.h5"
    with ResultWriter(path, MODEL, MESH, 1, "") as writer:
        for step in make_steps(MODEL, MESH):
            writer.append(step)
    return open_results(path)


@pytest.mark.parametrize("abscissa", ["arc_length", "x", "y"])
def test_jumps_go_on_to_zero_at_tips(results: Results, abscissa: str) -> None:
    crack = results.contact["crack"]
    profile = read_profile(results, "crack", "slip", -1, abscissa)
    assert profile.line_values[0] == profile.line_values[-1] == 0.0
    ends = {"arc_length": (0.0, MODEL.curves["crack"].length), "x": (0.3, 1.5), "y": (0.3, 0.6)}[abscissa]
    np.testing.assert_allclose(profile.line_place[[0, -1]], ends, rtol=1e-12)
    np.testing.assert_array_equal(profile.values, crack.slip[-1])
    # Between the tip and the first pair like the root of the distance.
    there = profile.line_place < profile.place[0]
    share = (profile.line_place[there] - ends[0]) / (profile.place[0] - ends[0])
    np.testing.assert_allclose(profile.line_values[there], profile.values[0] * np.sqrt(share), rtol=1e-9, atol=1e-15)
    # Tractions do not end at zero there, and an interface has no tips.
    for name, quantity in (("crack", "traction_n"), ("joint", "slip")):
        other = read_profile(results, name, quantity)
        np.testing.assert_array_equal(other.line_values, other.values)


def test_singular_ends_do_not_spoil_the_limits() -> None:
    x = np.linspace(0.005, 0.995, 100)
    regular, singular = np.sin(3 * x), np.sin(3 * x) + 0.05 / (1 - x)
    assert limit_line(x, regular) == Limits(regular[0], regular.max(), regular[0], regular.max())
    limits = limit_line(x, singular)
    assert limits.largest == singular[-1] > 9 and limits.high < 3
    assert limits.describe_cut("t") == f"cut off: t reaches {print_number(float(singular[-1]))}"
    # A peak inside is no singular end, nor is one of a closed curve.
    peak = np.where(np.abs(x - 0.5) < 0.02, 50.0, 1.0)
    assert limit_line(x, peak).high == 50.0
    assert limit_line(x, singular, closed=True).high == singular[-1]
    low, high = widen(limit_line(x, np.full(100, 3e-9)))
    assert low < 3e-9 < high <= 6e-9


def test_a_junction_within_a_line_does_not_spoil_the_limits() -> None:
    # Another crack ends at 0.4; there the mesh is graded.
    near = 0.4 + np.array([-1, 1])[:, None] * np.geomspace(1e-4, 0.02, 5)
    x = np.sort(np.concatenate([np.linspace(0.01, 0.37, 12), near.ravel(), np.linspace(0.43, 0.99, 20)]))
    values = -1.0 - 1e-2 / np.abs(x - 0.4)
    for closed in (False, True):
        limits = limit_line(x, values, closed)
        assert limits.least == values.min() < -90 and limits.low > -20
    # A line that is fine throughout its peak shows the peak.
    fine = np.sort(np.concatenate([np.linspace(0.0, 1.0, 9), np.linspace(0.45, 0.55, 61)]))
    peak = np.sqrt(np.maximum(0.0, 0.05**2 - (fine - 0.5) ** 2))
    assert limit_line(fine, peak).high == peak.max()


def test_what_is_cut_off_would_lengthen_the_axis_of_all_lines() -> None:
    cut, other = Limits(0.0, 0.1, 0.0, 0.5), Limits(-2.0, 0.0, -2.0, 0.0)
    assert join_limits([cut]) == cut
    assert join_limits([cut, other]) == Limits(-2.0, 0.5, -2.0, 0.5)
    assert join_limits([cut, Limits(-0.2, 0.0, -0.2, 0.0)]).high == 0.1


def test_axes_say_what_is_cut_off(results: Results) -> None:
    axes = Figure().add_subplot()
    place = results.contact["joint"].arc_length
    profile = draw_quantity(axes, results, "joint", "traction_n", x="arc_length")
    assert axes.get_title(loc="right") == ""
    low, high = axes.get_ylim()
    assert low < profile.values.min() and high > profile.values.max()
    assert axes.get_xlabel() == "arc length (m)" and axes.get_ylabel() == "normal traction $t_n$ (kN/m$^{2}$)"
    np.testing.assert_array_equal(profile.place, place)
    draw_quantity(axes, results, "joint", "traction_s", ylim=(-1.0, 1.0), xlim=(0.5, 1.5))
    assert axes.get_ylim() == (-1.0, 1.0) and axes.get_xlim() == (0.5, 1.5)
    assert sum(line.get_label() == "_zero" for line in axes.get_lines()) == 1


def test_angles_along_a_circle_have_no_jumps(results: Results) -> None:
    profile = read_profile(results, "hole", "hoop", 0, "angle")
    position = results.nodes.position[results.nodes.curve == results.nodes.curve_names.index("hole")]
    on_circle = ((position - [1.0, 1.5]) @ [1, 1j]) / 0.2
    np.testing.assert_allclose(np.sort_complex(np.exp(1j * np.radians(profile.place)).round(9)),
                               np.sort_complex(on_circle.round(9)), atol=1e-8)
    assert np.abs(np.diff(profile.place)).max() < 30 and profile.closed
    for start, end in ((170, 200), (-100, -80), (350, 380), (0, 360), (360, 0)):
        angle = np.radians(np.linspace(start, end, 20))
        points = 3 + 4j + 2 * np.exp(1j * angle)
        found = measure_angles(np.column_stack([points.real, points.imag]), np.arange(20.0), "c")
        np.testing.assert_allclose(np.diff(found), (end - start) / 19, rtol=1e-6)
        assert -180 < 0.5 * (found.min() + found.max()) <= 180 + 1e-6
    with pytest.raises(ValueError, match="'joint' is no arc of a circle"):
        read_profile(results, "joint", "slip", -1, "angle")


def test_angles_along_a_crack_on_an_arc_go_from_tip_to_tip(tmp_path: Path) -> None:
    """What is drawn beside the tips lies on the circle, too."""
    case = {
        "materials": {"rock": {"young": 1e3, "poisson": 0.2}},
        "curves": {"arc": {"center": [3, 4], "radius": 2.0, "angles": [30, 120], "elements": 8}},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": ["arc"]}}, "remote": {"syy": 1.0},
    }
    profile = read_profile(pbem.run(case, tmp_path / "x.h5"), "arc", "opening", -1, "angle")
    assert profile.line_place[[0, -1]] == pytest.approx([30.0, 120.0], abs=1e-9)
    assert (np.diff(profile.line_place) > 0).all() and profile.line_values[[0, -1]].tolist() == [0.0, 0.0]


def test_quantities_of_nodes_are_those_of_the_first_side(results: Results) -> None:
    own = np.flatnonzero(results.nodes.curve == results.nodes.curve_names.index("hole"))
    traction, normal = results.traction[2][own], results.nodes.normal[own]
    found = read_profile(results, "hole", "normal", 2)
    np.testing.assert_allclose(found.values[::-1], (traction * normal).sum(axis=1), rtol=1e-12)
    assert found.place[0] > 0 and found.place[-1] < 2 * np.pi * 0.2 and (np.diff(found.place) > 0).all()
    joint = read_profile(results, "joint", "uy", 2)
    first = (results.nodes.curve == results.nodes.curve_names.index("joint")) & (results.nodes.region == 0)
    np.testing.assert_array_equal(np.sort(joint.values), np.sort(results.displacement[2][first, 1]))


@pytest.mark.parametrize("name", [name for name in MODEL.curves if name != "crack"])
def test_lengths_are_measured_from_the_first_point_of_a_curve(results: Results, name: str) -> None:
    """Whichever way the region travels along it, and whether quantities are those of pairs or of nodes."""
    curve = MODEL.curves[name]
    for quantity in ("uy", *(["slip"] if name in results.contact else [])):
        arc, x, y = (read_profile(results, name, quantity, 2, each).place for each in ("arc_length", "x", "y"))
        (leg,) = curve.legs
        along = arc / leg.length
        exact = leg.start + along * (leg.end - leg.start)
        if leg.center is not None:
            exact = leg.center + (leg.start - leg.center) * np.exp(1j * leg.sweep * along)
        np.testing.assert_allclose(x + 1j * y, exact, atol=1e-12)


def test_wrong_names_have_near_misses(results: Results) -> None:
    for arguments, said in (
        (("joynt", "slip"), "no interface, crack or curve 'joynt'; did you mean 'joint'"),
        (("joint", "slipp"), "no quantity 'slipp' along 'joint'; did you mean 'slip'"),
        (("hole", "slip"), "no quantity 'slip' along 'hole'"),
        (("joint", "slip", -1, "angel"), "no abscissa 'angel'; did you mean 'angle'"),
    ):
        with pytest.raises(ValueError, match=said):
            read_profile(results, *arguments)
    with pytest.raises(IndexError):
        read_profile(results, "joint", "slip", 6)


def test_pictures_of_curves_have_the_same_limits_at_all_steps(results: Results) -> None:
    picture = CurvePicture(results, ["j*", "hole"], CurveOptions(), [0, 5])
    first, last = picture.draw(0), picture.draw(5)
    assert [axes.get_ylim() for axes in first.axes] == [axes.get_ylim() for axes in last.axes]
    titles = [axes.get_title(loc="left") for axes in first.axes[:-1]]
    assert titles == ["joint", "joint", "hole", "hole"]
    entries = [text.get_text() for text in first.axes[-1].get_legend().get_texts()]
    # Slip is a quantity, drawn as a line, and what pairs do, a mark.
    lines = last.axes[-1].get_legend().get_lines()
    drawn = [(line.get_label(), line.get_linestyle() == "None") for line in lines]
    assert ("slip", False) in drawn and ("slip", True) in drawn
    assert len(drawn) == len(set(drawn)) == len(entries) >= 7


def test_numbers_of_pictures() -> None:
    assert print_number(-0.25) == "\N{MINUS SIGN}0.25"
    assert print_number(123456.0) == r"1.23$\times$10$^{5}$"
    assert print_number(12345.0) == "12345"
    assert print_number(1e-9) == r"1$\times$10$^{-9}$"
    assert print_number(0.0) == "0"


@pytest.mark.parametrize("options, said", [
    ({"curve": 3}, "curve: found 3; expected a name, or a list"), ({"curve": []}, "curve: found"),
    ({"curve": "joint", "field": True}, "field: found True"), ({"step": []}, "step: found"),
    ({"step": [0, 1]}, "step: found"), ({"curve": "joint", "xlim": 3}, "xlim: found 3; expected two different numbers"),
    ({"curve": "joint", "ylim": (1.0, 1.0)}, "ylim: found"), ({"curve": "joint", "xlim": (0, float("nan"))}, "xlim"),
])
def test_options_of_other_kinds_are_told(results: Results, options: dict[str, object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        results.plot(**options)
    with pytest.raises(ValueError, match="points: expected numbers"):
        results.evaluate(10**400)  # type: ignore[arg-type]


def test_quantities_with_commas_are_those_of_a_list(results: Results) -> None:
    joined, listed = (results.plot(curve="joint", field=field) for field in ("opening, slip,", ["opening", "slip"]))

    def read_lines(figure: Figure) -> list[np.ndarray]:
        return [np.asarray(line.get_ydata()) for axes in figure.axes for line in axes.get_lines()]

    assert read_lines(listed) and len(read_lines(joined)) == len(read_lines(listed))
    for one, other in zip(read_lines(joined), read_lines(listed), strict=True):
        np.testing.assert_array_equal(one, other)
