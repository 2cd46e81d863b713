"""Wrong case files by the command line: refused at once, all faults with their places, nothing written."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from pbem.cli import main
from tests.cli.cli_sample import BLOCKS
from tests.parallel.launch import OUTER_JOB

Launch = Callable[..., subprocess.CompletedProcess[str]]

PLATE = """\
[materials.rock]
young = 1.0
poisson = 0.2
[curves]
bottom = { points = [[0, 0], [2, 0]], elements = 2 }
right = { points = [[2, 0], [2, 2]], elements = 2 }
top = { points = [[2, 2], [0, 2]], elements = 2 }
left = { points = [[0, 2], [0, 0]], elements = 2 }
crack = { points = [[0.5, 1], [1.5, 1]], elements = 2 }
[regions.plate]
material = "rock"
boundary = ["bottom", "right", "top", "left"]
cracks = ["crack"]
[boundary]
bottom = { ux = 0.0, uy = 0.0 }
top = { ty = 1.0 }
"""


def change(text: str, *changes: tuple[str, str]) -> str:
    """The text with each old part, which must be there once, in its new form."""
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


def line_of(text: str, part: str) -> int:
    """The number of the only line that holds this part."""
    (number,) = (k for k, line in enumerate(text.splitlines(), start=1) if part in line)
    return number


THIRD_REGION = """
[curves.third_side]
points = [[2, 1], [3, 1]]
elements = 1
[regions.third]
material = "soft"
boundary = ["joint", "third_side"]
"""

# What is wrong: the file, and for every fault its place, the part of the file whose line is told (None: no line), and
# a part of the message.
Faults = list[tuple[str, str | None, str]]
WRONG: dict[str, tuple[str, Faults]] = {
    "a key that is nearly one": (
        change(BLOCKS, ("friction = 0.2", "frction = 0.2")),
        [("interfaces.joint.frction", "frction", "did you mean 'friction'?")],
    ),
    "a wrong type": (
        change(PLATE, ("young = 1.0", 'young = "1.0"')),
        [("materials.rock.young", "young", 'found "1.0"; expected a number')],
    ),
    "a negative modulus": (
        change(PLATE, ("young = 1.0", "young = -1.0")),
        [("materials.rock.young", "young", "found -1.0; expected a number > 0")],
    ),
    "not a number": (
        change(PLATE, ("ty = 1.0", "ty = nan")),
        [("boundary.top.ty", "ty =", "found nan; expected a finite number")],
    ),
    "an open loop": (
        change(PLATE, ("[0, 2], [0, 0]", "[0, 2], [0.5, 0.5]")),
        [("regions.plate.boundary", "boundary = [", "an open loop: curve 'bottom' starts at (0, 0)"),
         ("regions.plate.boundary", "boundary = [", "an open loop: curve 'left' ends at (0.5, 0.5)")],
    ),
    "unknown names": (
        change(BLOCKS, ('boundary = ["bottom",', 'boundary = ["botom",'), ("[interfaces.joint]", "[interfaces.jont]"),
               ("[boundary.bottom]", "[boundary.botom]"),
               ('[regions.upper]\nmaterial = "soft"', '[regions.upper]\nmaterial = "sfot"')),
        [
            ("regions.lower.boundary[1]", 'boundary = ["botom"', "unknown curve 'botom'; did you mean 'bottom'?"),
            ("curves.bottom", "bottom = {", "which no region uses"),
            ("regions.upper.material", "sfot", "unknown material 'sfot'; did you mean 'soft'?"),
            ("boundary.botom", "[boundary.botom]", "unknown curve 'botom'"),
            ("interfaces.jont", "[interfaces.jont]", "unknown interface or crack 'jont'; did you mean 'joint'?"),
        ],
    ),
    "no elements": (
        change(PLATE, ("[2, 2]], elements = 2", "[2, 2]], elements = 0")),
        [("curves.right.elements", "right = {", "found 0; expected a whole number from 1")],
    ),
    "a curve of three regions": (
        BLOCKS + THIRD_REGION,
        [("curves.joint", "joint = {", "in the boundary of 3 regions"),
         ("regions.third.boundary", '["joint", "third_side"]', "an open loop: curve 'joint'"),
         ("regions.third.boundary", '["joint", "third_side"]', "an open loop: curve 'third_side'")],
    ),
    "a loop that crosses itself": (
        change(PLATE, ("[2, 0], [2, 2]", "[2, 0], [0, 2]"), ("[2, 2], [0, 2]", "[0, 2], [2, 2]"),
               ("[0, 2], [0, 0]", "[2, 2], [0, 0]"), ('cracks = ["crack"]\n', ""),
               ("crack = { points = [[0.5, 1], [1.5, 1]], elements = 2 }\n", "")),
        [("curves.left", "left = {", "'right'")],
    ),
    "a crack outside": (
        change(PLATE, ("[0.5, 1], [1.5, 1]", "[2.5, 1], [3.5, 1]")),
        [("regions.plate.cracks[1]", "cracks = [", "crack 'crack'")],
    ),
    "two conditions in one direction": (
        change(PLATE, ("top = { ty = 1.0 }", "top = { ty = 1.0, uy = 0.5 }")),
        [("boundary.top.ty", "top = { ty", "both uy and ty; expected one condition in one direction")],
    ),
    "nothing that holds a body": (
        change(PLATE, ("bottom = { ux = 0.0, uy = 0.0 }\n", "")),
        [("regions.plate", "[regions.plate]", "translation along y of 'plate'"),
         ("regions.plate", "[regions.plate]", "rotation")],
    ),
    "an empty file": ("", [("the file", None, "an empty file")]),
    "no TOML": (
        change(PLATE, ("young = 1.0", "young is 1.0")),
        [("line 2, column 7", None, "text that is not TOML")],
    ),
    "a law with its file missing": (
        change(BLOCKS, ('law = "coulomb"\nfriction = 0.2', 'law = "custom"\nfile = "none.py"')),
        [("interfaces.joint.file", 'file = "none.py"', "no such file")],
    ),
    "a contact of an unknown curve": (
        BLOCKS + '[contacts.seat]\nbetween = ["top", "floor"]\n',
        [("contacts.seat.between[2]", "between = [", "unknown curve 'floor'")],
    ),
    "many faults at once": (
        change(PLATE, ("young = 1.0", "young = 0"), ("poisson = 0.2", "poisson = 0.5"),
               ("[2, 2], [0, 2]]", '[2, 2], ["a", 2]]'), ("top = { ty = 1.0 }", "top = { ty = inf, t = 1 }"))
        + "[solver]\nmin_step = 2\n[analysis]\nscheme = \"BEM\"\norder = 4\n",
        [
            ("materials.rock.young", "young", "found 0; expected a number > 0"),
            ("materials.rock.poisson", "poisson", "found 0.5"),
            ("curves.top.points[2][1]", "top = { points", 'found "a"; expected a number'),
            ("boundary.top.ty", "top = { ty", "found inf; expected a finite number"),
            ("boundary.top.t", "top = { ty", "unknown key 't'"),
            ("solver.min_step", "min_step", "found 2"),
            ("analysis.scheme", "scheme", 'found "BEM"'),
            ("analysis.order", "order", "found 4"),
        ],
    ),
}


def check_message(message: str, file: str, text: str, faults: Faults) -> None:
    """The message is that of these faults: its heading, and a line for each with place, line number and reason."""
    heading, *lines = message.splitlines()
    count = "1 fault" if len(faults) == 1 else f"{len(faults)} faults"
    assert heading == f"pbem: {file}: {count}", message
    assert len(lines) == len(faults), message
    for place, part, reason in faults:
        start = f"  {place}: " if part is None else f"  {place} (line {line_of(text, part)}): "
        (line,) = [line for line in lines if line.startswith(start) and reason in line] or [None]
        assert line is not None, f"not told: {start}... {reason}\n{message}"
        assert re.search(r": found .+; (expected|did you mean) .+", line), line


def run_alone(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """pbem in a process of its own, outside of any launcher."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(OUTER_JOB)}
    command = [sys.executable, "-m", "pbem", *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize("what", WRONG)
def test_a_wrong_case_is_refused_with_all_its_faults(
    what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text, faults = WRONG[what]
    (tmp_path / "wrong.toml").write_text(text)
    monkeypatch.chdir(tmp_path)
    code, printed = main(["run", "wrong.toml"]), capsys.readouterr()
    assert (code, printed.out) == (2, ""), printed.err
    check_message(printed.err, "wrong.toml", text, faults)
    assert [path.name for path in tmp_path.iterdir()] == ["wrong.toml"]


@pytest.mark.parametrize("command", [("run", "wrong.toml"), ("check", "wrong.toml", "--plot", "model.png")])
def test_processes_of_both_commands_tell_the_same(command: tuple[str, ...], tmp_path: Path) -> None:
    text, faults = WRONG["many faults at once"]
    (tmp_path / "wrong.toml").write_text(text)
    done = run_alone(tmp_path, *command)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    check_message(done.stderr, "wrong.toml", text, faults)
    assert [path.name for path in tmp_path.iterdir()] == ["wrong.toml"]


def test_an_earlier_result_is_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "plate.toml").write_text(PLATE)
    monkeypatch.chdir(tmp_path)
    assert main(["run", "plate.toml", "--quiet"]) == 0
    result = (tmp_path / "plate.h5").read_bytes()
    (tmp_path / "plate.toml").write_text(change(PLATE, ("young = 1.0", "young = -1.0")))
    assert main(["run", "plate.toml"]) == 2
    assert main(["run", "plate.toml", "--resume"]) == 2
    assert (tmp_path / "plate.h5").read_bytes() == result
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plate.h5", "plate.toml"]


# By the reader, and by what is found of the model.
@pytest.mark.parametrize("what", ["no TOML", "nothing that holds a body"])
def test_two_ranks_refuse_a_wrong_case_once(what: str, tmp_path: Path, mpirun: Launch) -> None:
    text, faults = WRONG[what]
    (tmp_path / "wrong.toml").write_text(text)
    done = mpirun(2, "run", "wrong.toml", cwd=tmp_path, timeout=60)
    assert done.returncode == 2, done.stderr
    # Between rules the launcher remarks that a rank has ended with an error.
    message, _, _ = done.stderr.partition("-" * 70)
    check_message(message, "wrong.toml", text, faults)
    assert done.stderr.count("pbem: wrong.toml") == 1
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["wrong.toml"]


# One launch for all files: the commands follow each other, and the first rank says what each has returned on both.
ALL_FILES = """
import sys, time, warnings
from pbem import cli
from pbem.parallel import world

warnings.simplefilter("ignore", ResourceWarning)  # main() is not made to replace standard output so often
time.sleep = lambda seconds: None  # the second rank waits for the launcher, which is not told anything here
for file in sys.argv[1:]:
    codes = world.gather(cli.main(["run", file]))
    if world.rank == 0:
        print("codes", *codes, file=sys.stderr, flush=True)
"""


def test_two_ranks_refuse_all_wrong_cases_once(tmp_path: Path, mpirun_snippet: Launch) -> None:
    files = [f"wrong{number}.toml" for number in range(len(WRONG))]
    for file, (text, _) in zip(files, WRONG.values(), strict=True):
        (tmp_path / file).write_text(text)
    done = mpirun_snippet(2, ALL_FILES, *files, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    messages = done.stderr.split("codes 2 2\n")
    assert len(messages) == len(files) + 1 and messages[-1] == "", done.stderr
    for file, message, (text, faults) in zip(files, messages, WRONG.values(), strict=False):
        check_message(message, file, text, faults)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(files)
