"""What the README and the pages of documentation show is true: their cases and their Python run."""

from __future__ import annotations

import importlib.util
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import h5py
import pytest

import pbem
from pbem.cli import main, make_parser
from pbem.description.translation import find_schema_findings
from pbem.pages import TOPICS, read_page

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = {topic: read_page(topic) for topic in TOPICS}
TEXTS = [README, *PAGES.values()]
BLOCKS = [block for text in TEXTS for block in re.findall(r"^```(\w+)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)]
# A snippet that begins with the name of a file is that file.
FILES = {
    found[1]: text for _, text in BLOCKS if (found := re.match(r"# (\w+\.(?:toml|py))\n", text))
}
SNIPPETS = {text: None for language, text in BLOCKS if language == "python" and text not in FILES.values()}
FRAGMENTS = [text for language, text in BLOCKS if language == "toml" and text not in FILES.values()]
COMMANDS = [line for language, text in BLOCKS if language == "sh" for line in text.splitlines()]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with the files that are shown."""
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
    assert (len(SNIPPETS), len(FRAGMENTS)) == (7, 8)
    whole = "".join(TEXTS)
    assert whole.count("```python") == 9 and whole.count("```toml") == 9
    assert len(COMMANDS) == sum(text.count("\n") for language, text in BLOCKS if language == "sh") > 10


def find_snippet(*words: str) -> str:
    """The one piece of Python that contains all the words."""
    (found,) = (text for text in SNIPPETS if all(word in text for word in words))
    return found


def test_the_first_case_is_the_one_that_comes_with_the_program() -> None:
    bundled = tomllib.loads((ROOT / "cases" / "block_on_block.toml").read_text(encoding="utf-8"))
    assert tomllib.loads(FILES["first.toml"]) == bundled


def test_the_first_case_gives_the_forces_that_are_told(folder: Path) -> None:
    lines = run_python(find_snippet("first.toml", "seat.slip"), folder)
    along, down = (abs(float(number)) for number in lines[2].strip("[]").split())
    assert f"carries {along:.3f} along and {down:.3f} down" in README
    assert float(lines[1]) > 0.9, "the part that slips"


def test_the_crack_has_the_classical_stress_intensity(folder: Path) -> None:
    lines = run_python(find_snippet("griffith.toml"), folder)
    start, end = (float(number) for number in lines[0].strip("[]").split())
    assert start == pytest.approx(end, rel=1e-9) == pytest.approx(3.14159265**0.5, rel=1e-4)


def test_the_crack_made_in_python_has_the_stress_intensity_of_its_friction(folder: Path) -> None:
    for line in run_python(find_snippet("pbem.Case("), folder):
        friction, start, end = (float(number) for number in re.findall(r"[-\d.e]+", line))
        driving = 0.5 * (1 - friction)  # shear less friction on the crack
        expected = driving * (3.14159265 * 0.7 * 2**0.5) ** 0.5
        assert abs(start) == pytest.approx(expected, rel=1e-4) == abs(end)
    assert pbem.Case.read(folder / "inclined.toml").interfaces["crack"].friction == 0.2


def test_cases_are_changed_and_swept_in_python(folder: Path) -> None:
    lines = run_python(find_snippet("case.replace("), folder)
    assert lines[-1] == "interfaces.seat.friction = 0.2"
    assert pbem.Case.read(folder / "finer.toml").interfaces["seat"].friction == 0.3
    lines = run_python(find_snippet("pbem.sweep("), folder)
    assert lines[-1] == "0.6 finished " + lines[-1].split()[-1] and (folder / "first.csv").is_file()


def test_a_law_of_ones_own_gives_the_force_that_is_told(folder: Path) -> None:
    (fragment,) = (text for text in FRAGMENTS if "limited_friction.py" in text)
    text, count = re.subn(r"(?ms)^\[interfaces\.seat\].*?(?=^\[)", fragment + "\n", FILES["first.toml"])
    assert count == 1
    (folder / "limited.toml").write_text(text, encoding="utf-8")
    results = pbem.run(folder / "limited.toml")
    assert abs(results.contact["seat"].traction_s).max() <= 2.0 * (1 + 1e-9)
    force = abs(results.reactions["top"][-1, 0])
    assert f"the shear force is then {force:.3f} in place of 2.497" in " ".join(PAGES["laws"].split())


@pytest.mark.parametrize("text", FRAGMENTS)
def test_pieces_of_cases_have_keys_of_cases(text: str) -> None:
    """They lack the rest of the case, and nothing else is wrong with them."""
    wrong = [each for each in find_schema_findings(tomllib.loads(text)) if not each.found.startswith("no ")]
    assert wrong == []


def test_the_readme_shows_the_picture_and_is_short() -> None:
    assert "](cases/block_on_block.png)" in README
    assert len(README.split()) <= 2500
    listed = re.findall(r"^\| \[([\w-]+)\]\(pbem/pages/([\w-]+)\.md\) \| (.+) \|$", README, re.MULTILINE)
    assert [(topic, topic, about) for topic, about in TOPICS.items()] == listed


@pytest.mark.parametrize("line", [line for line in COMMANDS if re.search(r"\bpbem \w", line.split("#")[0])])
def test_commands_are_those_of_the_program(line: str) -> None:
    words = shlex.split(line, comments=True)
    options = make_parser().parse_args(words[words.index("pbem") + 1 :])
    assert options.command in ("check", "run", "sweep", "info", "plot", "export", "import", "make", "help")
    for name in ("case", "file"):
        path = getattr(options, name, "")
        assert Path(path).stem in ("", "first", "field"), f"{path} is not shown"


def test_scripts_that_are_named_exist() -> None:
    scripts = {name for text in TEXTS for name in re.findall(r"\bscripts/[\w/]+\.(?:py|sh)", text)}
    assert len(scripts) > 15 and [name for name in sorted(scripts) if not (ROOT / name).is_file()] == []
    modules = {name for text in TEXTS for name in re.findall(r"-m (scripts\.\w+|pbem\.[\w.]+)", text)}
    assert len(modules) >= 2
    assert [name for name in modules if not (ROOT / (name.replace(".", "/") + ".py")).is_file()] == []


def test_exported_results_are_read_as_the_page_says(folder: Path) -> None:
    results = pbem.run("first.toml")
    assert main(["export", "first.h5"]) == 0
    seat = results.contact["seat"]
    (line,) = run_python(find_snippet("import h5py", "first.vtkhdf"), folder)
    assert line == f"seat {seat.slip[-1].min()} {seat.slip[-1].max()}"
    # PyVista is none of the project's libraries: its snippet has to be Python, and to name what is there; it is run
    # where it is installed.
    text = find_snippet("import pyvista")
    compile(text, "paraview.md", "exec")
    if importlib.util.find_spec("pyvista"):
        subprocess.run([sys.executable, "-c", text], cwd=folder, check=True, timeout=300)
        assert all((folder / f"first_{step}.png").stat().st_size > 1000 for step in range(len(results.steps)))
    with h5py.File("first.vtkhdf") as file:
        arrays = file["VTKHDF/faces/PointData"]
        named = [*re.findall(r'scalars="(\w+)"', text), *re.findall(r'warp_by_vector\("(\w+)"', text)]
        assert len(named) == 2 and set(named) <= set(arrays) and arrays["displacement"].shape[1] == 3
