"""What names a case that comes with the program, and what names a file."""

from pathlib import Path

import pytest

import pbem
from pbem.bundled import locate


def test_a_name_is_that_of_a_case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert locate("griffith").is_file()


@pytest.mark.parametrize("written", ["griffith.toml", Path("griffith"), Path("griffith.toml"), "./griffith"])
def test_a_path_is_that_of_a_file(
    written: str | Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Mistyped, it must not become another problem."""
    monkeypatch.chdir(tmp_path)
    assert locate(written) == Path(written)
    with pytest.raises(pbem.PbemError, match="griffith"):
        pbem.run(written)


def test_a_file_comes_before_a_case_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "griffith").write_text("title = 1")
    assert locate("griffith") == Path("griffith")
