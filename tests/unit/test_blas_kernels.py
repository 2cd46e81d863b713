"""Kernels of OpenBLAS that fit the processor, also one that OpenBLAS does not know."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pbem.blas_kernels import CORE_TYPE, LIBRARY, NEEDED, OLD, choose_kernels, note_old_kernels
from pbem.environment import LAUNCHERS, WITHOUT_OTHERS, Site, judge_nodes, skip_networks
from pbem.results.trial import OF_LAUNCHERS

AVX512 = "fpu sse2 fma avx avx2 avx512f avx512dq avx512cd avx512bw avx512vl"


def write_flags(folder: Path, flags: str) -> Path:
    file = folder / "cpuinfo"
    file.write_text(f"processor\t: 0\nmodel\t\t: 207\nflags\t\t: {flags}\nbugs\t\t: none\n\nprocessor\t: 1\n")
    return file


@pytest.mark.parametrize(
    ("flags", "own", "expected"),
    [
        (AVX512, "Prescott", "SkylakeX"),
        (AVX512, "SANDYBRIDGE", "SkylakeX"),
        (AVX512, "Cooperlake", ""),
        (AVX512, "Zen", ""),
        (AVX512, "Haswell", ""),
        (AVX512, "a later one", ""),
        (AVX512, "", ""),  # another BLAS
        (AVX512.replace("avx512vl", ""), "Prescott", "Haswell"),
        ("fpu sse2 fma avx avx2", "Nehalem", "Haswell"),
        ("fpu sse2 fma avx avx2", "Haswell", ""),
        ("fpu sse2 avx", "Prescott", ""),
    ],
)
def test_better_kernels_are_chosen_where_openblas_takes_old_ones(
    tmp_path: Path, flags: str, own: str, expected: str
) -> None:
    assert choose_kernels(write_flags(tmp_path, flags), lambda named: named or own) == expected


@pytest.mark.parametrize(("built", "expected"), [(("Haswell",), "Haswell"), ((), "")])
def test_kernels_that_a_library_was_built_without_are_not_named(
    tmp_path: Path, built: tuple[str, ...], expected: str
) -> None:
    found = choose_kernels(write_flags(tmp_path, AVX512), lambda named: named if named in built else "Prescott")
    assert found == expected


def test_where_nothing_is_known_of_the_processor_openblas_chooses(tmp_path: Path) -> None:
    def ask(_: str) -> str:
        raise AssertionError("a library was loaded in vain")

    assert choose_kernels(tmp_path / "none", ask) == ""
    assert choose_kernels(write_flags(tmp_path, "fp asimd"), ask) == ""


@pytest.mark.parametrize("program", ["/no/such/program", "", "/bin/false"])
def test_where_openblas_cannot_be_asked_its_own_choice_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, program: str
) -> None:
    monkeypatch.setattr("pbem.blas_kernels.sys.executable", program)
    assert choose_kernels(write_flags(tmp_path, AVX512)) == ""


def test_an_answer_that_does_not_come_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pbem.blas_kernels.ASK", "import time; time.sleep(60)")
    monkeypatch.setattr("pbem.blas_kernels.PATIENCE", 0.2)
    begin = time.monotonic()
    assert choose_kernels(write_flags(tmp_path, AVX512)) == ""
    assert time.monotonic() - begin < 30


def run_python(text: str, **variables: str) -> list[str]:
    own = {name: value for name, value in os.environ.items() if not name.startswith(("OPENBLAS_", *OF_LAUNCHERS))}
    done = subprocess.run(
        [sys.executable, "-c", text], env={**own, **variables}, capture_output=True, text=True, timeout=60, check=True
    )
    return done.stdout.splitlines()


PREPARE = "import os; from pbem import cli; from pbem.blas_kernels import name_kernels\n"


def test_a_run_computes_with_kernels_that_fit() -> None:
    said = run_python(PREPARE + "print(name_kernels()); cli._choose_kernels(); import numpy; print(name_kernels())")
    flags = {name for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("flags")
             for name in line.split()}
    assert said[0] == ""  # else it would be too late to choose
    assert said[1].lower() not in OLD or not NEEDED["Haswell"] <= flags


@pytest.mark.parametrize("own", ["", "Nehalem"])
def test_kernels_that_the_user_has_named_stay(own: str) -> None:
    said = run_python(
        PREPARE + f"cli.choose_kernels = lambda: 'Haswell'; cli._choose_kernels(); print(os.environ['{CORE_TYPE}'])",
        **({CORE_TYPE: own} if own else {}),
    )
    assert said == [own or "Haswell"]


def test_libraries_that_are_loaded_are_left_alone() -> None:
    said = run_python("import numpy\n" + PREPARE + "before = dict(os.environ); cli.choose_kernels = lambda: 'Haswell'\n"
                      "cli._choose_kernels(); print(before == dict(os.environ))")
    assert said == ["True"]


def test_old_kernels_are_told_unless_the_user_wants_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pbem.blas_kernels._read_flags", lambda _: NEEDED["SkylakeX"] | NEEDED["Haswell"])
    monkeypatch.setattr("pbem.blas_kernels.name_kernels", lambda: "Prescott")
    monkeypatch.delenv(CORE_TYPE, raising=False)
    note = note_old_kernels()
    assert note is not None
    assert note.startswith("OpenBLAS uses its kernels of 'Prescott', although")
    assert f"set {CORE_TYPE}=SkylakeX before" in note
    site = Site("node1", 8, frozenset(range(8)), threads=(("OMP_NUM_THREADS", 1),), kernels=note)
    assert judge_nodes([[site, site], [site]], False) == (None, (f"node node1: {note} (also on 1 more node)",))
    monkeypatch.setenv(CORE_TYPE, "Prescott")
    assert note_old_kernels() is None


def test_the_kernels_in_use_are_known() -> None:
    ask = "import numpy; from pbem.blas_kernels import name_kernels; print(name_kernels())"
    used = [run_python(ask, OPENBLAS_CORETYPE=name) for name in ("Nehalem", "Prescott")]
    # Else another BLAS, or an OpenBLAS that was built for one processor.
    assert used == [["Nehalem"], ["Prescott"]] or used[0] == used[1]


def test_a_library_that_is_not_loaded_is_not_loaded_by_asking() -> None:
    said = run_python("from pbem.blas_kernels import name_kernels; print(name_kernels())\n"
                      f"print('{LIBRARY[:11]}' in open('/proc/self/maps').read())")
    assert said == ["", "False"]


@pytest.mark.parametrize("own", [{}, {"OMPI_MCA_btl": "^openib"}, {"OMPI_MCA_pml": "^cm"}])
def test_networks_are_skipped_while_mpi_is_loaded_alone(own: dict[str, str]) -> None:
    environ = {"PATH": "/bin", **own}
    with skip_networks(environ):
        assert environ == {"PATH": "/bin", **(own or WITHOUT_OTHERS)}
    assert environ == {"PATH": "/bin", **own}


@pytest.mark.parametrize("launcher", LAUNCHERS, ids=[size for _, size in LAUNCHERS])
def test_networks_are_not_skipped_under_a_launcher(launcher: tuple[str, str]) -> None:
    environ = {launcher[0]: "0", launcher[1]: "1"}
    with skip_networks(environ):
        assert environ.keys() == set(launcher)


def test_a_run_leaves_no_variable_of_mpi_behind(tmp_path: Path) -> None:
    """What a program launches after a run of its own may need networks."""
    said = run_python(
        "import os; from pbem import cli\n"
        f"code = cli.main(['run', 'two_blocks_hst', '-o', {str(tmp_path / 'run.h5')!r}, '--quiet'])\n"
        "print(code, [name for name in os.environ if name.startswith(('OMPI_MCA', 'PMIX_MCA_pml'))])"
    )
    assert said[-1].startswith("0 ")
    assert not set(WITHOUT_OTHERS) & set(said[-1].split("'"))
