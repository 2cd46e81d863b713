"""The gallery: every case has the numbers of its source, and pages and lists are those of the cases."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import pbem
from pbem.bundled import find_case
from pbem.cli import main
from scripts import make_gallery as gallery
from scripts.make_gallery import FOLDER, GalleryCase, Measured

CASES = gallery.list_gallery()
each_case = pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])


@each_case
def test_the_case_has_its_numbers_and_its_page(
    case: GalleryCase, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Computed by the Python of the page, which is in step with the case but for rounding and time."""
    page = case.page.read_text(encoding="utf-8")
    shown = gallery.read_measured(page)
    assert shown is not None and page == gallery.write_page(case, shown), "python -m scripts.make_gallery"
    results = pbem.run(case.case, tmp_path / "results.h5")
    asked = []
    monkeypatch.setattr(pbem, "run", lambda path: asked.append(path) or results)
    names: dict[str, dict[str, float]] = {}
    exec(gallery.write_snippet(case).replace("print(numbers)", ""), names)
    assert asked == [case.name]
    found = names["numbers"]
    assert found == case.compute(results)
    assert gallery.find_wrong(case, found) == []
    # The numbers of the page are those of now, to a small part of what is allowed.
    for name, (value, tolerance) in case.expected.items():
        off = abs(float(shown.values[name]) - found[name])
        assert off <= max(1e-5, 0.1 * tolerance) * max(abs(value), abs(found[name])) + 1e-12, name
    assert shown.unknowns == 2 * len(results.nodes.position)


@each_case
def test_the_case_is_complete(case: GalleryCase, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", f"gallery/{case.name}"]) == 0
    assert "Probably not meant" not in capsys.readouterr().out
    assert find_case(case.name) == find_case(f"gallery/{case.name}") == case.case
    assert case.case.read_text(encoding="utf-8").startswith("# ")
    assert len(case.source.splitlines()) <= 60
    assert {"TITLE", "PROBLEM", "SOURCE", "EXPECTED", "PICTURES"} <= vars(case.module).keys()
    assert case.expected and all(0 < tolerance <= 0.05 for _, tolerance in case.expected.values())
    assert case.module.PICTURES
    for path in case.list_pictures():
        assert path.read_bytes().startswith(b"\x89PNG") and path.stat().st_size <= gallery.LARGEST


def test_the_lists_are_complete() -> None:
    assert gallery.LIST.read_text(encoding="utf-8") == gallery.write_readme(CASES), "python -m scripts.make_gallery"
    assert gallery.PAGE.read_text(encoding="utf-8") == gallery.write_topic(CASES), "python -m scripts.make_gallery"


def test_the_gallery_holds_nothing_else_and_is_small() -> None:
    made = {path for case in CASES for path in (case.case, case.page, *case.list_pictures())}
    sources = {FOLDER / f"{case.name}.py" for case in CASES}
    assert {path for path in FOLDER.iterdir() if path.name != "__pycache__"} == made | sources
    assert sum(path.stat().st_size for path in FOLDER.glob("*.png")) <= gallery.LARGEST_SUM
    assert len(CASES) >= 20


def test_pages_change_by_more_than_noise_only() -> None:
    before = Measured({"a": "3.54491", "b": "0"}, 96, "1")
    noise = Measured({"a": "3.54490", "b": "0"}, 96, "0.5")
    assert gallery.settle(noise, before) == before
    other = Measured({"a": "3.54591", "b": "1e-7"}, 90, "0.2")
    assert gallery.settle(other, before) == Measured({"a": "3.54591", "b": "0"}, 90, "0.2")
    assert gallery.settle(other, None) == other


def test_a_number_that_is_not_as_expected_is_told() -> None:
    case = next(case for case in CASES if case.name == "griffith")
    right = {name: value for name, (value, _) in case.expected.items()}
    assert gallery.find_wrong(case, right) == []
    (told,) = gallery.find_wrong(case, right | {"T-stress, MPa": -2.1})
    assert told == "griffith: T-stress, MPa: -2.1, expected -2 within 0.002"
    assert gallery.find_wrong(case, right | {"T-stress, MPa": math.nan}) != []
    assert "compute() gives" in gallery.find_wrong(case, {"KI": 1.0})[0]
