"""Kernels of OpenBLAS that fit the processor, also one that OpenBLAS does not know."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from pbem.blas_kernels import CORE_TYPE, NEEDED, OLD, choose_kernels, name_kernels, note_old_kernels
from pbem.environment import WITHOUT_OTHERS, Site, find_launch, judge_nodes

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
    assert choose_kernels(write_flags(tmp_path, flags), lambda: own) == expected


def test_where_nothing_is_known_of_the_processor_openblas_chooses(tmp_path: Path) -> None:
    def ask() -> str:
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
    own = {name: value for name, value in os.environ.items() if not name.startswith(("OPENBLAS_", "OMPI_", "PMIX_"))}
    done = subprocess.run(
        [sys.executable, "-c", text], env={**own, **variables}, capture_output=True, text=True, timeout=60, check=True
    )
    return done.stdout.splitlines()


PREPARE = "import os; from pbem import cli; from pbem.blas_kernels import name_kernels\n"


def test_a_run_computes_with_kernels_that_fit() -> None:
    said = run_python(
        PREPARE + "print(name_kernels()); cli._prepare_libraries(); import numpy; print(name_kernels())"
    )
    flags = {name for line in Path("/proc/cpuinfo").read_text().splitlines() if line.startswith("flags")
             for name in line.split()}
    assert said[0] == ""  # else it would be too late to choose
    assert said[1].lower() not in OLD or not NEEDED["Haswell"] <= flags


@pytest.mark.parametrize(
    "variables", [{}, {CORE_TYPE: "Nehalem", "OMPI_MCA_pml": "^cm"}, {"PMI_RANK": "0", "PMI_SIZE": "2"}]
)
def test_what_the_user_has_set_stays(variables: dict[str, str]) -> None:
    said = run_python(
        PREPARE + "cli.choose_kernels = lambda: 'Haswell'; cli._prepare_libraries()\n"
        f"for name in {[CORE_TYPE, *WITHOUT_OTHERS]}: print(os.environ.get(name, ''))",
        **variables,
    )
    alone = {} if find_launch(variables).variable else WITHOUT_OTHERS
    assert said == [{CORE_TYPE: "Haswell", **alone, **variables}.get(name, "") for name in [CORE_TYPE, *WITHOUT_OTHERS]]


def test_loaded_libraries_are_left_alone() -> None:
    said = run_python(
        "import numpy, mpi4py.MPI\n" + PREPARE + "before = dict(os.environ); cli._prepare_libraries()\n"
        "print(before == dict(os.environ))"
    )
    assert said == ["True"]


def test_old_kernels_are_told_unless_the_user_wants_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pbem.blas_kernels._read_flags", lambda _: NEEDED["SkylakeX"] | NEEDED["Haswell"])
    monkeypatch.setattr("pbem.blas_kernels.name_kernels", lambda: "Prescott")
    monkeypatch.delenv(CORE_TYPE, raising=False)
    note = note_old_kernels()
    assert note is not None
    assert f"'Prescott': factorisations take several times as long; set {CORE_TYPE}=SkylakeX" in note
    site = Site("node1", 8, frozenset(range(8)), kernels=note)
    assert judge_nodes([[site, site], [site]], False) == (
        None, ("OMP_NUM_THREADS is not set: each of 2 ranks on node node1 may start a thread for every core; set "
               "OMP_NUM_THREADS=1 before Python starts", f"node node1: {note} (also on 1 more node)"))
    monkeypatch.setenv(CORE_TYPE, "Prescott")
    assert note_old_kernels() is None


def test_the_kernels_in_use_are_known() -> None:
    assert run_python(
        "import numpy; from pbem.blas_kernels import name_kernels; print(name_kernels())", OPENBLAS_CORETYPE="Nehalem"
    ) in (["Nehalem"], [""])  # the second: another BLAS
    assert isinstance(name_kernels(), str)
