"""Maps of fields at interior points: what they show, and where a grid is found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import PathCollection, QuadMesh
from numpy.typing import NDArray

import pbem.cli
from pbem.errors import ResultFileError
from pbem.results.field_plot import FIELDS, draw_field, evaluate_field, find_grid, plot_field
from pbem.results.reader import Results, open_results
from pbem.results.writer import ResultWriter
from pbem.solve.problem.step import Interior
from tests.unit.results_sample import make_mesh, make_model, make_steps

Real = NDArray[np.float64]

X, Y = np.meshgrid(np.linspace(0, 2, 5), np.linspace(0.1, 1.9, 4))
GRID = np.column_stack([X.ravel(), Y.ravel()])
POINTS = np.concatenate([GRID, [[0.7, 0.3], [0.2, 0.2]]])
REGION = np.where(POINTS[:, 1] > 1, 1, 0)
REGION[3] = -1


def write_results(path: Path, points: Real = POINTS) -> Results:
    """Invented fields: u = (y, x^2), sxx = x, syy = 1 - y, sxy = 2; nothing at the fourth point."""
    model = replace(make_model(), interior_points=tuple(points @ np.array([1, 1j])))
    mesh = make_mesh(model)
    x, y = np.where(np.arange(len(points)) == 3, np.nan, points.T)
    field = Interior(y + 1j * x**2, np.column_stack([x, 1 - y, 2 + 0 * x]))
    with ResultWriter(path, model, mesh, 1, "", (), REGION[: len(points)]) as writer:
        writer.append(replace(make_steps(model, mesh)[-1], interior=field))
    return open_results(path)


def test_fields_follow_from_displacement_and_stress(tmp_path: Path) -> None:
    results = write_results(tmp_path / "a.h5")
    x, y = POINTS.T
    syy = 1 - y
    # Eigenvalues of the tensor; materials of the sample: Poisson's ratio 0.3 below, 0.2 above, plane strain.
    lateral = np.where(REGION == 1, 0.2, 0.3)
    tensor = np.array([[[a, 2, 0], [2, b, 0], [0, 0, n * (a + b)]] for a, b, n in zip(x, syy, lateral, strict=True)])
    plane = np.linalg.eigvalsh(tensor[:, :2, :2])
    deviator = tensor - np.trace(tensor, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    expected = {
        "ux": y, "uy": x**2, "u": np.hypot(y, x**2), "sxx": x, "syy": syy, "sxy": 2 + 0 * x,
        "s1": plane[:, 1], "s2": plane[:, 0], "shear": 0.5 * (plane[:, 1] - plane[:, 0]),
        "mises": np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))),
    }  # fmt: skip
    assert set(expected) == set(FIELDS) == set(pbem.cli.FIELDS)
    there = REGION >= 0
    for name, values in expected.items():
        found = evaluate_field(results, name, 0)
        assert np.isnan(found[~there]).all()
        np.testing.assert_allclose(found[there], values[there], rtol=1e-12, atol=1e-14)


def test_a_grid_becomes_a_map_and_the_rest_dots(tmp_path: Path) -> None:
    figure = draw_field(write_results(tmp_path / "a.h5"), "uy")
    axes = figure.axes[0]
    (image,) = [each for each in axes.collections if isinstance(each, QuadMesh)]
    values = np.ma.getdata(image.get_array()).reshape(4, 5)
    hidden = np.ma.getmaskarray(image.get_array()).reshape(4, 5)
    np.testing.assert_allclose(values[~hidden], (X**2)[~hidden])
    assert np.argwhere(hidden).tolist() == [[0, 3]]
    (dots,) = [each for each in axes.collections if isinstance(each, PathCollection)]
    np.testing.assert_allclose(dots.get_offsets(), POINTS[-2:])
    np.testing.assert_allclose(dots.get_array(), POINTS[-2:, 0] ** 2)
    assert figure.axes[1].get_ylabel() == "$u_y$ (m)"
    assert axes.get_title(loc="left") == "Made-up blocks\nstep 6 (shear, factor 1)"


def test_signed_fields_have_white_at_zero(tmp_path: Path) -> None:
    results = write_results(tmp_path / "a.h5")
    found = {}
    for field in ("sxx", "syy"):
        image = next(each for each in draw_field(results, field).axes[0].collections if isinstance(each, QuadMesh))
        found[field] = image.get_cmap().name, image.get_clim()
    assert found["sxx"][0] == "viridis"
    name, (low, high) = found["syy"]
    assert name == "RdBu_r"
    assert low == -high < -0.8


def test_grids_are_found_at_the_beginning_of_the_points() -> None:
    assert find_grid(POINTS) == (5, 4)
    assert find_grid(GRID) == (5, 4)
    assert find_grid(GRID[::-1]) == (5, 4)
    assert find_grid(GRID[:7]) is None
    assert find_grid(GRID[:10]) == (5, 2)
    assert find_grid(np.random.default_rng(1).normal(size=(30, 2))) is None
    assert find_grid(GRID[:5]) is None
    assert find_grid(np.zeros((0, 2))) is None


@pytest.mark.parametrize("ending", ["png", "pdf"])
def test_maps_are_written(tmp_path: Path, ending: str) -> None:
    results = write_results(tmp_path / "a.h5", POINTS[-2:])
    plot_field(results, "mises", tmp_path / f"a.{ending}")
    assert (tmp_path / f"a.{ending}").stat().st_size > 5000


def test_the_command_line_draws_fields(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_results(tmp_path / "a.h5")
    assert pbem.cli.main(["plot", str(tmp_path / "a.h5"), "--field", "syy"]) == 0
    assert (tmp_path / "a_syy.png").stat().st_size > 5000
    assert pbem.cli.main(["plot", str(tmp_path / "a.h5"), "--field", "szz"]) == 2
    assert "invalid choice: 'szz'" in capsys.readouterr().err


def test_a_file_without_interior_points_says_how_to_get_them(tmp_path: Path) -> None:
    model = make_model()
    with ResultWriter(tmp_path / "a.h5", model, make_mesh(model), 1, "") as writer:
        writer.append(make_steps(model, make_mesh(model))[0])
    results = open_results(tmp_path / "a.h5")
    assert results.interior is None
    with pytest.raises(ResultFileError, match="interior = "):
        draw_field(results, "sxx")
