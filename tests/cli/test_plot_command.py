"""`pbem plot` by its options: pictures of all kinds, what is refused, and that nothing is then written."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from matplotlib import image

import pbem.plot_command
import pbem.results.curve_profile
import pbem.results.page
import pbem.results.trace_plot
from pbem.cli import main, make_parser
from pbem.results.reader import open_results
from tests.verification.planes import make_plane, make_straight, solve

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two cracks in a plane."""
    from pbem.results.writer import ResultWriter

    path = tmp_path_factory.mktemp("plot") / "run.h5"
    curves = {"t1.1": [make_straight(-1.0, 0.2, 3)], "t1.2": [make_straight(1j, 1 + 1.5j, 3)]}
    mesh, steps = solve(model := make_plane((0.0, -1.0, 0.4), curves))
    with ResultWriter(path, model, mesh, 1, "") as writer:
        writer.append(steps[-1])
    return path


@pytest.fixture
def folder(solved: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "run.h5").write_bytes(solved.read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(("options", "written"), [
    ("", "run.png"),
    ("--box -1 -0.5 0 0.5 --label t1 --magnify -2e1 --x x", "run.png"),
    ("--field mises --shape 12 12 --contours 3 --limits -1e0 2", "run_mises.png"),
    ("--field ux --displaced --magnify 3 --box -2 -2 2 2 --shape 9 9 --width column -o a.svg", "a.svg"),
    ("--curve t1 --field slip,traction_s --xlim 0 1 --ylim -1e-3 2 --size 9 8", "run_t1.png"),
    ("--curve t1.1 t1.2", "run_t1.1_t1.2.png"),
    ("--traces status --label t1.2 --dpi 50", "run_status.png"),
    ("--rose --step 1 --width 12cm -o rose.pdf", "rose.pdf"),
    ("-o run.gif --dpi 40 --fps 4", "run.gif"),
])  # fmt: skip
def test_pictures_are_written(folder: Path, capsys: Capture, options: str, written: str) -> None:
    assert main(["plot", "run.h5", *options.split()]) == 0
    assert capsys.readouterr().out == f"picture: {written}\n"
    assert (folder / written).stat().st_size > 2000
    assert sorted(path.name for path in folder.iterdir()) == sorted(["run.h5", written])


def test_sizes_are_those_asked_for(folder: Path) -> None:
    assert main(["plot", "run.h5", "--traces", "slip", "--size", "9", "7", "--dpi", "127"]) == 0
    assert image.imread("run_slip.png").shape[:2] == (350, 450)


@pytest.mark.parametrize(("options", "said"), [
    ("--field mise", ["argument --field: invalid choice: 'mise'; did you mean 'mises'?", "sxx"]),
    ("--traces slips", ["argument --traces: invalid choice: 'slips'; did you mean 'slip'?"]),
    ("--x angel --limits 2 1", ["--x: invalid choice: 'angel'; did you mean 'angle'?", "--limits is not for"]),
    ("--filed mises", ["unrecognized arguments: --filed", "did you mean '--field'?"]),
    ("--field ux --traces slip", ["--traces and --field are different pictures"]),
    ("--shape 3 3 --rose", ["--shape is not for --rose, only for: --field"]),
    ("--field ux --shape 1 3 --contours -1 --dpi 0", ["--shape: found 1 3", "--contours: found -1", "--dpi: found 0"]),
    ("--width colum", ["--width: found 'colum'; did you mean 'column'?"]),
    ("--width 5 --size 5 5", ["--width and --size are both given"]),
    ("--curve t2", ["there is no interface or crack 't2'; did you mean 't1.", "t1.1, t1.2"]),
    ("--label t2", ["there is no interface or crack 't2'"]),
    ("--curve t1.1 --field slipp", ["no quantity 'slipp' along 't1.1'; did you mean 'slip'"]),
    ("--curve t1.1 --x angle", ["'t1.1' is no arc of a circle"]),
    ("--box 0 0 0 1", ["--box 0 0 0 1 has no size"]),
    ("--step 9", ["holds no load step 9; it holds: 1"]),
    ("--step 1 -o a.gif", ["--step is one step, an animation has all"]),
    ("--fps 3", ["--fps is for animations"]),
    ("-o a.jpg", ["is no picture; its name should end with .png, .pdf, .svg, .gif, .mp4"]),
    ("--mesh", ["was not refined"]),
    ("--mesh -o a.gif", ["makes no animation"]),
])  # fmt: skip
def test_wrong_options_are_refused(folder: Path, capsys: Capture, options: str, said: list[str]) -> None:
    assert main(["plot", "run.h5", *options.split()]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    for text in said:
        assert text in err
    assert "Traceback" not in err
    assert [path.name for path in folder.iterdir()] == ["run.h5"]


@pytest.mark.parametrize("found", ["on the path", "in a package"])
def test_a_film_is_given_all_frames(folder: Path, monkeypatch: pytest.MonkeyPatch, found: str) -> None:
    """Of one size, both numbers even, one after the other; the program stores what it gets."""
    program = folder / "ffmpeg"
    program.write_text('#!/bin/sh\necho "$@" > arguments\nfor last; do :; done\n/bin/cat > "$last"\n')
    program.chmod(0o755)
    if found == "on the path":
        monkeypatch.setenv("PATH", str(folder))
    else:
        monkeypatch.setenv("PATH", "/nowhere")
        monkeypatch.setitem(sys.modules, "imageio_ffmpeg", SimpleNamespace(get_ffmpeg_exe=lambda: str(program)))
    monkeypatch.chdir(folder)
    assert main(["plot", "run.h5", "-o", "run.mp4", "--dpi", "40", "--fps", "3"]) == 0
    arguments = (folder / "arguments").read_text().split()
    width, height = map(int, arguments[arguments.index("-s") + 1].split("x"))
    assert width % 2 == height % 2 == 0 and arguments[arguments.index("-r") + 1] == "3"
    frames = len(open_results(folder / "run.h5").steps)
    assert (folder / "run.mp4").stat().st_size == 3 * width * height * frames


def test_a_film_without_its_program_says_so(folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert main(["plot", "run.h5", "-o", "run.mp4"]) == 2
    assert "needs the program ffmpeg" in capsys.readouterr().err
    assert not (folder / "run.mp4").exists()


def test_what_help_lists_is_what_there_is() -> None:
    # Help has to come before matplotlib is loaded: the lists are there twice.
    assert pbem.plot_command.TRACES == pbem.results.trace_plot.TRACES
    assert pbem.plot_command.ABSCISSAE == pbem.results.curve_profile.ABSCISSAE
    assert set(pbem.plot_command.WIDTHS) == set(pbem.results.page.WIDTHS)


def test_help_has_examples(capsys: Capture) -> None:
    assert main(["plot", "--help"]) == 0
    said = capsys.readouterr().out
    for line in said.splitlines():
        words = line.split("  ")[1] if line.startswith("  pbem plot run.h5") else ""
        if words:
            arguments = words.split()[1:]
            assert make_parser().parse_args(arguments).command == "plot"
    assert said.count("pbem plot run.h5") >= 8


def test_drawing_loads_neither_mpi_nor_petsc(folder: Path) -> None:
    code = ("import sys; from pbem.cli import main; "
            "code = main(['plot', 'run.h5', '--field', 'ux', '--shape', '5', '5']); "
            "print([name for name in ('mpi4py', 'petsc4py') if name in sys.modules]); sys.exit(code)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "[]"
    assert done.stderr == ""
