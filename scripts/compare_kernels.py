#!/usr/bin/env python3
"""Run models on two ranks, once with equal kernels and once with one rank's built for another processor, and compare.

    .venv/bin/python -m scripts.compare_kernels --count 200 [--first 0] [--records FILE]

A cluster's nodes need not be alike: what one rank computes may differ in the last bits from what the other one does.
The kernels are compiled once more, without AVX and hardly optimised; one rank (in turn) takes them in the second run of
each pair. Statuses, iterations, steps and the reason of an end must be the same; the largest difference of
displacements and tractions is told. Models are those of scripts/torture.py of up to --nodes nodes. Exit code 1 if any
pair differs or does not end. Every third model takes the hierarchical operator, the others the one that the program
chooses.

With --libraries each model is run on one rank, in a process whose NumPy and BLAS take their own instructions, and again
in one where they take those of an old processor; the kernels are the same.
"""

from __future__ import annotations

import argparse
import importlib.machinery
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from types import ModuleType
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
# Compiled modules, and the modules of the program that take them.
COMPILED = {"_kernels": ("rows",), "_expansions": ("expansion", "near")}
# Other instructions, another order of sums, no vector functions: the last bits differ in most entries.
OTHER_FLAGS = "-O1 -mno-avx -mno-avx2 -mno-fma"
# The environment in which NumPy and OpenBLAS take other instructions.
OTHER_LIBRARIES = {
    "OPENBLAS_CORETYPE": "Nehalem",
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL",
}
Found = dict[str, Any]


def main() -> int:
    """The script; returns its exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200, help="pairs of runs")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--nodes", type=int, default=400, help="of the largest model")
    parser.add_argument("--records", type=Path, help="a line for each pair is added; pairs that are there are not run")
    parser.add_argument("--timeout", type=float, default=600.0, help="seconds for a pair")
    parser.add_argument("--worker", nargs=2, metavar=("FOLDER", "RECORDS"), help=argparse.SUPPRESS)
    parser.add_argument("--libraries", action="store_true", help="other instructions of NumPy and BLAS, on one rank")
    parser.add_argument("--alone", type=Path, metavar="FOLDER", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.alone:
        run_alone(options.alone, options.first, options.count, options.nodes)
        return 0
    if options.libraries:
        return compare_libraries(options)
    if options.worker:
        work(Path(options.worker[0]), Path(options.worker[1]), options.first, options.count, options.nodes)
        return 0
    with tempfile.TemporaryDirectory() as name:
        records = (options.records or Path(name) / "records").absolute()
        records.touch()
        return launch_all(build_others(Path(name)), records, options)


def launch_all(others: Path, records: Path, options: argparse.Namespace) -> int:
    """Workers until all pairs are there; one that hangs is ended, and the next goes on after its pair."""
    from tests.parallel.launch import kill_session, make_environment

    done = read_records(records)
    first = max([options.first, *(each["seed"] + 1 for each in done)])
    while sum("equal" in each for each in done) < options.count:
        missing = options.count - sum("equal" in each for each in done)
        command = ["mpirun", "-n", "2", sys.executable, "-m", "scripts.compare_kernels", "--first", str(first),
                   "--count", str(missing), "--nodes", str(options.nodes), "--worker", str(others), str(records)]
        process = subprocess.Popen(command, cwd=ROOT, env=make_environment(), start_new_session=True,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        size, since = -1, time.monotonic()
        while process.poll() is None and time.monotonic() - since < options.timeout:
            time.sleep(0.2)
            if records.stat().st_size != size:
                size, since = records.stat().st_size, time.monotonic()
        hangs = process.poll() is None
        error = kill_session(process)[1] if hangs else process.communicate()[1]
        done = read_records(records)
        first = max([first, *(each["seed"] + 1 for each in done)])
        if hangs or process.returncode:
            text = "no end" if hangs else f"exit code {process.returncode}: {error[-500:]}"
            with records.open("a") as file:
                file.write(json.dumps({"seed": first, "equal": False, "differs": [text]}) + "\n")
            done, first = read_records(records), first + 1
    return report([each for each in done if "equal" in each])


def report(pairs: list[Found]) -> int:
    """Print what differs, and the sum of it; the exit code."""
    for each in pairs:
        if not each["equal"]:
            print(each)
    largest = max((each.get("largest", 0.0) for each in pairs), default=0.0)
    settled = sum(each.get("end") == "finished" for each in pairs)
    unlike = sum(each.get("largest", 0.0) > 0 for each in pairs)
    wrong = sum(not each["equal"] for each in pairs)
    print(f"{len(pairs)} pairs, {settled} finished: {wrong} differ in statuses, iterations or ends; values differ in "
          f"{unlike}, by {largest:.1e} of the largest at most")
    return 1 if wrong else 0


def read_records(path: Path) -> list[Found]:
    """What was found so far; a model that is too large or refused has a record without the key "equal"."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def build_others(folder: Path) -> Path:
    """The compiled modules built with other instructions; the folder that holds them."""
    environment = os.environ | {"PBEM_MARCH": "x86-64", "CFLAGS": f"{os.environ.get('CFLAGS', '')} {OTHER_FLAGS}"}
    command = [sys.executable, "setup.py", "-q", "build_ext", "--build-lib", str(folder), "--build-temp", str(folder)]
    subprocess.run(command, cwd=ROOT, env=environment, check=True, stdout=subprocess.DEVNULL)
    return folder


def load_compiled(name: str, folder: Path) -> ModuleType:
    """A compiled module of this folder, beside the one in use."""
    path = str(next(folder.rglob(f"{name}*.so")))
    loader = importlib.machinery.ExtensionFileLoader(f"pbem.bem.{name}", path)
    spec = importlib.util.spec_from_file_location(f"pbem.bem.{name}", path, loader=loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    assert module.__file__ == path
    return module


def use(modules: dict[str, ModuleType]) -> None:
    """These compiled modules from now on, in place of others of their names."""
    for name, users in COMPILED.items():
        for user in users:
            setattr(importlib.import_module(f"pbem.bem.{user}"), name, modules[name])


def write_case(seed: int, case: Path) -> str:
    """The case of a seed; returns its kind."""
    from scripts.torture.kinds import draw_sample

    sample = draw_sample(seed)
    case.write_text(sample.text() + ('\n[solver]\noperator = "hierarchical"\n' if (seed + seed // 12) % 3 == 0 else ""))
    return sample.kind


def work(others: Path, records: Path, first: int, count: int, most_nodes: int) -> None:
    """On all ranks: so many pairs from a seed on; the first rank adds a line for each."""
    from pbem.case.build import read_model
    from pbem.errors import CaseError
    from pbem.mesh.generate import generate_mesh
    from pbem.parallel import world

    own = {name: importlib.import_module(f"pbem.bem.{name}") for name in COMPILED}
    other = {name: load_compiled(name, others) for name in COMPILED}
    assert all(own[name].__file__ != other[name].__file__ for name in COMPILED)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(world.bcast(name))
        case, pairs, seed = folder / "case.toml", 0, first
        while pairs < count:
            found: Found = {"seed": seed}
            if world.rank == 0:
                found["kind"] = write_case(seed, case)
            found = world.bcast(found)
            try:
                nodes = generate_mesh(read_model(case)[1]).nodes
            except CaseError as error:  # before any kernel is asked
                nodes, found = 0, found | {"refused": str(error)[-200:]}
            if 0 < nodes <= most_nodes:
                ends = []
                for turn, mixed in enumerate((False, True)):
                    use(other if mixed and world.rank == seed % 2 else own)
                    ends.append(compute(case, folder / f"{turn}.h5"))
                use(own)
                found |= {"nodes": nodes, **compare(*ends)}
                pairs += 1
            # All ranks must have found the same.
            alike = world.allgather({name: value for name, value in found.items() if name != "largest"})
            if any(each != alike[0] for each in alike):
                found = {**found, "equal": False, "differs": ["the ranks"]}
            if world.rank == 0:
                with records.open("a") as file:
                    file.write(json.dumps(found) + "\n")
            seed += 1
        world.Barrier()


def compare_libraries(options: argparse.Namespace) -> int:
    """The same models in two processes; returns the exit code."""
    import pbem

    with tempfile.TemporaryDirectory() as name:
        folders = [Path(name) / "own", Path(name) / "other"]
        for folder, environment in zip(folders, ({}, OTHER_LIBRARIES), strict=True):
            folder.mkdir()
            command = [sys.executable, "-m", "scripts.compare_kernels", "--first", str(options.first), "--count",
                       str(options.count), "--nodes", str(options.nodes), "--alone", str(folder)]
            subprocess.run(command, cwd=ROOT, env=os.environ | environment, check=True, stdout=subprocess.DEVNULL)
        pairs = []
        for end in sorted(folders[0].glob("*.end")):
            ends = [
                ((folder / end.name).read_text(), pbem.open_results(target) if target.exists() else None)
                for folder in folders for target in (folder / f"{end.stem}.h5",)
            ]
            pairs.append({"seed": int(end.stem), **compare(*ends)})
    return report(pairs)


def run_alone(folder: Path, first: int, count: int, most_nodes: int) -> None:
    """So many models from a seed on, in this process: their results, and how they ended, into the folder."""
    from pbem.case.build import read_model
    from pbem.errors import CaseError
    from pbem.mesh.generate import generate_mesh

    seed = first
    while count:
        case = folder / f"{seed}.toml"
        write_case(seed, case)
        try:
            nodes = generate_mesh(read_model(case)[1]).nodes
        except CaseError:  # which other instructions do not change
            nodes = 0
        if 0 < nodes <= most_nodes:
            case.with_suffix(".end").write_text(compute(case, case.with_suffix(".h5"))[0])
            count -= 1
        seed += 1


def compute(case: Path, target: Path) -> tuple[str, Any]:
    """How a run ended, and its results, loaded; None if there are none."""
    import pbem
    from pbem.parallel import world

    try:
        pbem.run(case, target, force=True)
        end = "finished"
    except pbem.ConvergenceError as error:
        end = error.reason
    world.Barrier()
    results = pbem.open_results(target) if target.exists() else None
    if results is not None:
        for name in ("displacement", "traction"):
            assert getattr(results, name) is not None
        for contact in results.contact.values():
            assert contact.mode is not None
    world.Barrier()
    return end, results


def compare(one: tuple[str, Any], other: tuple[str, Any]) -> Found:
    """What differs between two runs: ends, steps, iterations and statuses by name; the largest difference of values."""
    import numpy as np

    (end, mine), (other_end, yours) = one, other
    if end != other_end or (mine is None) != (yours is None):
        return {"end": end, "equal": False, "differs": [f"end: {end}, {other_end}"]}
    if mine is None:
        return {"end": end, "equal": True, "largest": 0.0, "steps": 0}
    pairs = {f"steps {name}": (getattr(mine.steps, name), getattr(yours.steps, name))
             for name in ("number", "stage", "iterations")}
    pairs |= {f"convergence {name}": (mine.convergence[name], yours.convergence[name])
              for name in ("step", "iteration", "changed", "stick", "slip", "open")}
    pairs |= {f"statuses of {name}": (each.mode, yours.contact[name].mode) for name, each in mine.contact.items()}
    differs = [name for name, (first, second) in pairs.items() if not np.array_equal(first, second)]
    largest = 0.0
    for name in ("displacement", "traction"):
        first, second = getattr(mine, name), getattr(yours, name)
        if first.shape == second.shape and first.size:
            # Where all pairs are open tractions are rounding, but not stresses along the faces.
            values = [first, mine.hoop_stress] if name == "traction" else [first]
            size = max(float(np.nanmax(np.abs(each), initial=0.0)) for each in values)
            largest = max(largest, float(np.abs(first - second).max() / max(size, 1e-300)))
    return {"end": end, "equal": not differs, "differs": differs, "largest": largest, "steps": len(mine.steps)}


if __name__ == "__main__":
    sys.exit(main())
