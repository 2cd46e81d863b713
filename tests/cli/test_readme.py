"""What the README tells is true: its cases and its Python run, and its table of keys is that of the program."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import pytest
from pydantic import BaseModel

import pbem
from pbem.case.schema import CaseFile, ContactTable, GenerateTable, LawTable

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)
# A snippet that begins with the name of a file is that file.
FILES = {
    found[1]: text for _, text in BLOCKS if (found := re.match(r"# (\w+\.(?:toml|py))\n", text))
}
SNIPPETS = [text for language, text in BLOCKS if language == "python" and text not in FILES.values()]
FRAGMENTS = [text for language, text in BLOCKS if language == "toml" and text not in FILES.values()]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the README's files."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_python(text: str, folder: Path) -> list[str]:
    """The lines that a snippet prints."""
    done = subprocess.run([sys.executable, "-c", text], cwd=folder, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, ""), done.stderr
    return done.stdout.splitlines()


def test_all_snippets_are_found() -> None:
    # Else the tests below could pass because they look at nothing.
    assert set(FILES) == {"first.toml", "limited_friction.py"}
    assert (len(SNIPPETS), len(FRAGMENTS)) == (2, 1)
    assert README.count("```python") == 3 and README.count("```toml") == 2


def test_the_first_case_is_the_one_that_comes_with_the_program() -> None:
    bundled = tomllib.loads((ROOT / "cases" / "block_on_block.toml").read_text(encoding="utf-8"))
    assert tomllib.loads(FILES["first.toml"]) == bundled


def test_the_first_case_gives_the_forces_that_are_told(folder: Path) -> None:
    lines = run_python(SNIPPETS[0], folder)
    along, down = (abs(float(number)) for number in lines[2].strip("[]").split())
    assert f"carries {along:.3f} along and {down:.3f} down" in README
    assert float(lines[1]) > 0.9, "the part that slips"


def test_the_crack_has_the_classical_stress_intensity(folder: Path) -> None:
    lines = run_python(SNIPPETS[1], folder)
    start, end = (float(number) for number in lines[0].strip("[]").split())
    assert start == pytest.approx(end, rel=1e-9) == pytest.approx(3.14159265**0.5, rel=1e-4)


def test_a_law_of_ones_own_gives_the_force_that_is_told(folder: Path) -> None:
    (fragment,) = FRAGMENTS
    text, count = re.subn(r"(?ms)^\[interfaces\.seat\].*?(?=^\[)", fragment + "\n", FILES["first.toml"])
    assert count == 1
    (folder / "limited.toml").write_text(text, encoding="utf-8")
    results = pbem.run(folder / "limited.toml")
    assert abs(results.contact["seat"].traction_s).max() <= 2.0 * (1 + 1e-9)
    assert f"the shear force is then {abs(results.reactions['top'][-1, 0]):.3f} in place of 2.497" in README


def test_pictures_and_links_lead_to_files() -> None:
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", README) if "://" not in link]
    assert "cases/block_on_block.png" in links
    assert [link for link in links if not (ROOT / link).exists()] == []
    for path in re.findall(r"`((?:scripts|pbem|cases|tests)/[\w/]+\.\w+)`", README):
        assert (ROOT / path).is_file(), path


# Names of one's own in the paths of keys.
NAMES = {
    "materials": "NAME", "curves": "NAME", "regions": "NAME", "contacts": "NAME", "boundary": "CURVE",
    "interfaces": "CURVE", "initial_stress": "MATERIAL", "petsc": "OPTION",
}  # fmt: skip


# Shown as one key, though they have keys of their own, which are told elsewhere in the table.
WHOLE = ("interfaces.CURVE.gap", "stages.boundary.CURVE", "stages.remote", "stages.gravity")


def find_table(annotation: Any) -> type[BaseModel] | None:
    """The table that a key of the schema holds, alone or many times, if any."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    tables = (find_table(part) for part in get_args(annotation))
    return next((table for table in tables if table is not None), None)


def list_keys(table: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Paths of all keys as the README writes them, with their fields."""
    for key, field in table.model_fields.items():
        if table is GenerateTable and key in LawTable.model_fields:
            continue  # those of interfaces
        named = key in NAMES and "Mapping" in str(field.annotation)
        path = f"{prefix}{key}.{NAMES[key]}" if named else f"{prefix}{key}"
        inner = find_table(field.annotation)
        if inner is ContactTable:
            yield f"{path}.between", ContactTable.model_fields["between"]
        elif inner is None or path in WHOLE:
            yield path, field
        else:
            yield from list_keys(inner, f"{path}.")


def read_key_table() -> dict[str, str]:
    """Keys and defaults of the README's table."""
    section = README.split("## The case file")[1].split("\n## ")[0]
    lines = [line.split("|")[1:3] for line in section.splitlines() if line.startswith("| `")]
    rows = [(key.strip(" `"), default.strip(" `")) for key, default in lines]
    assert len(rows) == len(dict(rows)), "a key is told twice"
    return dict(rows)


def test_all_keys_of_a_case_file_are_told_with_their_defaults() -> None:
    expected = {}
    for path, field in list_keys(CaseFile):
        default = field.default
        if field.is_required():
            expected[path] = "required"
        elif default is None or path in ("petsc.OPTION", "stages.boundary.CURVE"):  # mappings, empty by default
            expected[path] = "-"
        else:
            expected[path] = default
    told = {}
    for key, text in read_key_table().items():
        value = text if text in ("required", "-") else tomllib.loads(f"value = {text}")["value"]
        told[key] = tuple(value) if isinstance(value, list) else value
    assert told == expected
