"""Networks: traces coloured by what they do, their orientations, names of traces and pieces."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

import pbem
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.results.animation import animate
from pbem.results.curve_picture import find_curves
from pbem.results.curve_profile import read_profile
from pbem.results.label_room import part_labels
from pbem.results.law_text import list_law_rows
from pbem.results.page import Page
from pbem.results.picture_limits import Limits
from pbem.results.plots import BodyOptions, BodyPicture
from pbem.results.reader import Results, open_results
from pbem.results.trace_names import find_names, name_trace
from pbem.results.trace_plot import (
    BINS,
    TRACES,
    RosePicture,
    TraceOptions,
    TracePicture,
    list_segments,
    plot_traces,
    sum_orientations,
)
from pbem.results.traces import list_traces
from pbem.results.writer import ResultWriter
from pbem.sweeps.outcome import list_quantity_names
from tests.unit.results_sample import make_mesh, make_model, make_steps
from tests.unit.test_label_room import find_overlaps

MODEL = make_model(cracks=7)
COLOURS = ("#D00000", "#00A000", "#0000B0", "#FFFFFF")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Results:
    path = tmp_path_factory.mktemp("network") / "a.h5"
    mesh = make_mesh(MODEL)
    with ResultWriter(path, MODEL, mesh, 1, "") as writer:
        for step in make_steps(MODEL, mesh):
            writer.append(step)
    return open_results(path)


@pytest.fixture(scope="module")
def cut(tmp_path_factory: pytest.TempPathFactory) -> Results:
    """A crack from -1 to 2 crossed at 0 by another one, and an arc that ends on the first: tips at one end only."""
    tables = """
        materials.m = { young = 1000.0, poisson = 0.2 }
        curves.long = { points = [[-1, 0], [2, 0]], elements = 9, grading = "end" }
        curves.short = { points = [[0, -1], [0, 1]], elements = 4 }
        curves.arc = { center = [1.5, 0], radius = 0.5, angles = [90, 180], elements = 5 }
        regions.plane = { material = "m", infinite = true, cracks = ["long", "short", "arc"] }
        interfaces.long = { friction = 0.1 }
        interfaces.short = { friction = 0.2 }
        interfaces.arc = { friction = 0.2 }
        remote.syy = -1.0
        analysis.steps = 1
    """
    _, model = parse_model("\n".join(line.strip() for line in tables.splitlines()))
    path = tmp_path_factory.mktemp("cut") / "a.h5"
    mesh = make_mesh(model)
    with ResultWriter(path, model, mesh, 1, "") as writer:
        for step in make_steps(model, mesh):
            writer.append(step)
    return open_results(path)


def test_pieces_of_a_trace_are_joined_along_it(cut: Results) -> None:
    names = [name for name in cut.contact if name_trace(name) == "long"]
    pieces, whole = [cut.contact[name] for name in names], cut.contact["long"]
    assert len(names) > 1 and "long" not in cut.contact and cut.contact.get("wide") is None
    assert whole.pairs == sum(piece.pairs for piece in pieces) == whole.slip.shape[1]
    # From the start of the crack at (-1, 0), along the x axis.
    np.testing.assert_allclose(whole.arc_length, whole.position[:, 0] + 1.0, atol=1e-12)
    assert (np.diff(whole.arc_length) > 0).all()
    for quantity in ("opening", "slip", "traction_n"):
        sums = sum(piece.integrate(quantity) for piece in pieces)
        np.testing.assert_allclose(whole.integrate(quantity), sums, rtol=1e-12, atol=1e-15)
    assert whole.law["friction"] == 0.1


def test_a_trace_is_drawn_as_one_curve_from_tip_to_tip(cut: Results) -> None:
    profile, pieces = read_profile(cut, "long", "slip"), find_names(["long"], list(cut.contact))["long"]
    assert len(profile.place) == sum(len(read_profile(cut, name, "slip").place) for name in pieces)
    assert (np.diff(profile.line_place) >= -1e-12).all()
    assert find_curves(cut, ["long", "long.*"]) == ["long", *pieces]
    with pytest.raises(ValueError, match="there is no interface, crack or curve 'lonk'"):
        read_profile(cut, "lonk", "slip")


def test_segments_are_as_long_as_the_curves(results: Results) -> None:
    segments, lengths = list_segments(results)
    owner = results.pairs.interface
    for number, name in enumerate(results.pairs.names):
        assert lengths[owner == number].sum() == pytest.approx(MODEL.curves[name].length, rel=1e-9)
        own = segments[owner == number]
        np.testing.assert_allclose(own[1:, 0], own[:-1, 2], atol=1e-14)
        ends = np.array([MODEL.curves[name].start, MODEL.curves[name].end])
        np.testing.assert_allclose(own[[0, -1], [0, 2]] @ [1, 1j], ends, atol=1e-12)


def test_segments_of_cut_traces_end_where_the_traces_do(cut: Results) -> None:
    segments, lengths = list_segments(cut)
    trace = np.array([name_trace(name) for name in cut.pairs.names])[cut.pairs.interface]
    expected = {
        "long": ([-1, 2], [0, 0], 3.0), "short": ([0, 0], [-1, 1], 2.0), "arc": ([1, 1.5], [0, 0.5], np.pi / 4),
    }  # fmt: skip
    assert len(cut.pairs.names) > len(expected) == len(set(trace))
    for name, (x, y, length) in expected.items():
        own = segments[trace == name]
        low, high = own.min(axis=(0, 1)), own.max(axis=(0, 1))
        np.testing.assert_allclose([low[1], high[1]], y, atol=1e-9)
        np.testing.assert_allclose([low[0], high[0]], x, atol=1e-9)
        # The quadrature of arcs is not exact.
        assert lengths[trace == name].sum() == pytest.approx(length, rel=1e-4 if name == "arc" else 1e-9)
        drawn = np.hypot(*np.moveaxis(np.diff(own, axis=1), 2, 0)).sum(axis=1)
        assert drawn.sum() == pytest.approx(length, rel=1e-2 if name == "arc" else 1e-9)
    touching = cut.pairs.interface[1:] == cut.pairs.interface[:-1]
    np.testing.assert_allclose(segments[1:, 0][touching], segments[:-1, 2][touching], atol=1e-9)
    assert sum_orientations(cut, 0).length.sum() == pytest.approx(5 + np.pi / 4, rel=1e-5)


def test_integrals_of_slip_are_those_of_the_results(cut: Results) -> None:
    assert all((each.slip >= 0).all() for each in cut.contact.values())
    integral = sum(each.integrate("slip")[0] for each in cut.contact.values())
    assert sum_orientations(cut, 0).slip.sum() == pytest.approx(integral, rel=1e-12)


@pytest.mark.parametrize(("values", "low"), [(0.0, 0.0), (2.0, 0.0), (-2.0, -3.0)])
def test_colours_of_magnitudes_begin_at_zero(results: Results, values: float, low: float) -> None:
    quantity = "slip" if values >= 0 else "traction_n"
    picture = TracePicture(results, quantity, TraceOptions(), [5])
    picture._values = {5: np.full(results.pairs.count, values)}
    picture._limits = Limits(values, values, values, values)
    figure = picture.draw(5)
    lines = next(each for each in figure.axes[0].collections if each.get_array() is not None)
    assert lines.get_clim()[0] == low < lines.get_clim()[1]


@pytest.mark.parametrize("quantity", TRACES)
def test_traces_have_the_values_of_their_pairs(results: Results, quantity: str, tmp_path: Path) -> None:
    figure = TracePicture(results, quantity, TraceOptions(labels=["crack3"]), [5]).draw(5)
    lines = [each for each in figure.axes[0].collections if isinstance(each, LineCollection)][1:]
    assert [text.get_text() for text in figure.axes[0].texts] == ["crack3"]
    if quantity == "status":
        counts = [(results.pairs.at("mode", 5) == which).sum() for which in (0, 1, 2)]
        assert sorted(len(each.get_segments()) for each in lines) == sorted(count for count in counts if count)
        return
    values = results.pairs.at(quantity, 5)
    expected = np.abs(values) if quantity in ("slip", "traction_s") else values
    np.testing.assert_allclose(np.sort(lines[0].get_array()), np.sort(expected))
    assert lines[0].get_array().shape == (results.pairs.count,)


def test_a_picture_of_traces_is_written(results: Results, tmp_path: Path) -> None:
    plot_traces(results, "slip", str(tmp_path / "a.pdf"))
    assert (tmp_path / "a.pdf").stat().st_size > 5000
    with pytest.raises(ValueError, match="no traces by 'slipp'; did you mean 'slip'"):
        plot_traces(results, "slipp", str(tmp_path / "a.pdf"))


def test_orientations_sum_up_to_all(results: Results) -> None:
    found = sum_orientations(results, 5)
    _, lengths = list_segments(results)
    assert found.length.sum() == pytest.approx(lengths.sum())
    # No slip changes its sign along a trace of the sample.
    slip = sum(abs(each.integrate("slip")[5]) for each in results.contact.values())
    assert found.slip.sum() == pytest.approx(slip)
    expected = np.zeros(BINS)
    for name in results.contact:
        along = MODEL.curves[name].end - MODEL.curves[name].start
        expected[int(np.degrees(np.angle(along)) % 180 // (180 / BINS))] += MODEL.curves[name].length
    assert (expected > 0).sum() == 2
    np.testing.assert_allclose(found.length, expected, rtol=1e-9, atol=1e-12)
    figure = RosePicture(results, Page(), [5]).draw(5)
    bars = figure.axes[1].patches[:BINS]
    np.testing.assert_allclose([bar.get_height() for bar in bars], found.slip)


def test_names_stand_for_traces_pieces_and_patterns() -> None:
    known = ["t1", "t12.1", "t12.2", "t2.5a", "seat"]
    assert [name_trace(name) for name in known] == ["t1", "t12", "t12", "t2.5a", "seat"]
    assert find_names(["t12", "t1", "t12.2", "s*"], known) == {
        "t12": ["t12.1", "t12.2"], "t1": ["t1"], "t12.2": ["t12.2"], "s*": ["seat"],
    }  # fmt: skip
    with pytest.raises(ValueError, match=r"'t13'; did you mean .*; there is no .* 'seet'; did you mean"):
        find_names(["t13", "seet"], known)


def test_pieces_that_are_cut_again_belong_to_their_trace(tmp_path: Path) -> None:
    # The whole is in pieces as an import writes them, and one is crossed by a crack that was added.
    crossing = {"x": {"points": [[-0.5, -0.5], [-0.4, 0.5]], "size": 0.4}}
    halves = {"t.1": {"points": [[-1, 0], [0, 0]], "size": 0.4}, "t.2": {"points": [[0, 0], [1, 0]], "size": 0.4}}
    found = {}
    for name, curves in {"whole": {"t": {"points": [[-1, 0], [0, 0], [1, 0]], "size": 0.4}}, "pieces": halves}.items():
        found[name] = pbem.run({
            "materials": {"rock": {"young": 1000.0, "poisson": 0.25}}, "curves": {**curves, **crossing},
            "regions": {"plane": {"material": "rock", "infinite": True, "cracks": [*curves, "x"]}},
            "interfaces": {"t": {"friction": 0.25}, "x": {"friction": 0.6}},
            "remote": {"syy": -1.0, "sxy": 0.5}, "analysis": {"steps": 1},
        }, tmp_path / f"{name}.h5")
    whole, cut = found["whole"], found["pieces"]
    assert list(whole.contact)[:2] == ["t.1", "t.2"] and list(cut.contact)[:3] == ["t.1.1", "t.1.2", "t.2"]
    for quantity in ("slip", "traction_n"):
        one, other = (each.contact["t"].integrate(quantity)[-1] for each in (whole, cut))
        assert other == pytest.approx(one, rel=0.02)
        part = cut.contact["t.1"].integrate(quantity)[-1] + cut.contact["t.2"].integrate(quantity)[-1]
        assert other == pytest.approx(part, rel=1e-12)
    assert (np.diff(cut.contact["t"].arc_length) >= 0).all()
    assert cut.tips["t"].KII[-1] == pytest.approx(whole.tips["t"].KII[-1], rel=0.02)
    totals = {each.name: each for each in list_traces(cut)}
    assert list(totals) == ["t", "x"] and totals["t"].pieces == 3 and totals["t"].length == pytest.approx(2.0)
    assert find_names(["t", "t.1"], list(cut.contact)) == {"t": ["t.1.1", "t.1.2", "t.2"], "t.1": ["t.1.1", "t.1.2"]}
    _, model = parse_model(cut.case)
    names = list_quantity_names(model, generate_mesh(model))
    assert names.families["t"] == ("t.1.1", "t.1.2", "t.2") and names.families["t.1"] == ("t.1.1", "t.1.2")


def test_curves_that_are_called_like_pieces_are_none(tmp_path: Path) -> None:
    # Two of them are cut by x; of v1 and v2 nothing is said, and their curves are apart.
    curves = {"v1.2": [[-1, 0], [2, 0]], "v1.3": [[-1, 2], [2, 2]], "v2.1": [[4, 0], [4, 2]], "v2.2": [[6, 0], [6, 2]],
              "x": [[0, -1], [0.3, 3]]}  # fmt: skip
    results = pbem.run({
        "materials": {"rock": {"young": 1000.0, "poisson": 0.25}},
        "curves": {name: {"points": points, "elements": 6} for name, points in curves.items()},
        "regions": {"plane": {"material": "rock", "infinite": True, "cracks": [*curves]}},
        "interfaces": {name: {"friction": 0.2} for name in curves},
        "remote": {"syy": -1.0, "sxy": 0.5}, "analysis": {"steps": 1},
    }, tmp_path / "a.h5")  # fmt: skip
    lengths = {name: abs(complex(*b) - complex(*a)) for name, (a, b) in curves.items()}
    pieces = {"v1.2": 2, "v1.3": 2, "v2.1": 1, "v2.2": 1, "x": 3}
    totals = {each.name: each for each in list_traces(results)}
    assert {name: each.pieces for name, each in totals.items()} == pieces
    for name, each in totals.items():
        assert each.length == pytest.approx(lengths[name])
    assert results.contact["v1.2"].pairs == sum(results.contact[f"v1.2.{k}"].pairs for k in (1, 2))
    assert results.contact.get("v1") is None and results.tips.get("v1") is None
    with pytest.raises(ValueError, match="there is no interface or crack 'v1'"):
        find_names(["v1"], list(results.contact), results.contact.traces)
    # What is not cut may be asked for together, as with a pattern.
    assert find_names(["v2", "v1.3"], list(results.contact), results.contact.traces) == {
        "v2": ["v2.1", "v2.2"], "v1.3": ["v1.3.1", "v1.3.2"],
    }  # fmt: skip
    _, model = parse_model(results.case)
    assert list_law_rows(model)[0][0] == "v1.2, v1.3, v2.1, v2.2, x (5 cracks in 9 pieces)"
    families = list_quantity_names(model, generate_mesh(model)).families
    assert "v1" not in families and families["v1.2"] == ("v1.2.1", "v1.2.2")


def test_files_of_earlier_versions_have_traces_by_names(cut: Results, tmp_path: Path) -> None:
    path = shutil.copy(cut.path, tmp_path / "b.h5")
    with h5py.File(path, "a") as file:
        del file["contact"].attrs["traces"]
    older = open_results(path)
    assert dict(older.contact.traces) == dict(cut.contact.traces)
    assert [each.name for each in list_traces(older)] == [each.name for each in list_traces(cut)]


def test_animations_have_a_frame_for_each_step(results: Results, tmp_path: Path) -> None:
    from PIL import Image

    steps = list(range(len(results.steps)))
    page = Page(width=8.6, dpi=40)
    animate(TracePicture(results, "slip", TraceOptions(page=page), steps), steps, tmp_path / "a.gif", page)
    with Image.open(tmp_path / "a.gif") as movie:
        assert movie.n_frames == len(steps) == 6
        assert movie.info["duration"] == 500


class Colours:
    """Frames of one colour each."""

    def draw(self, step: int) -> Figure:
        figure = Figure(figsize=(2, 1), facecolor=COLOURS[step])
        FigureCanvasAgg(figure)
        return figure


def test_the_colours_of_an_animation_are_those_of_all_frames(tmp_path: Path) -> None:
    from PIL import Image

    animate(Colours(), range(len(COLOURS)), tmp_path / "a.gif", Page(dpi=40))
    with Image.open(tmp_path / "a.gif") as movie:
        for step, colour in enumerate(COLOURS):
            movie.seek(step)
            found = np.array(movie.convert("RGB").getpixel((3, 3))) / 255
            np.testing.assert_allclose(found, to_rgb(colour), atol=0.02)


def test_names_that_would_lie_on_each_other_are_parted(results: Results) -> None:
    axes = BodyPicture(results, BodyOptions(interfaces=["joint"]), [1]).draw(1).axes[0]
    text = axes.texts[0]
    labels = [(axes.annotate(f"name {number}", text.xy, xytext=(5.0, 5.0), textcoords="offset points"), 1j)
              for number in range(3)]
    assert find_overlaps(axes)
    part_labels(axes, labels)
    assert not find_overlaps(axes)


def test_all_frames_have_the_same_limits(results: Results) -> None:
    picture = BodyPicture(results, BodyOptions(interfaces=["joint"]), [1, 5])
    frames = [picture.draw(step) for step in (1, 5)]
    for first, last in zip(*(figure.axes for figure in frames), strict=True):
        assert first.get_xlim() == last.get_xlim() and first.get_ylim() == last.get_ylim()
