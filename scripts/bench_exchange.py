#!/usr/bin/env python3
"""What the ranks exchange in a product, and what each of them holds, on several numbers of ranks: counted, not timed.

    .venv/bin/python scripts/bench_exchange.py [--ranks 1 2 4 8 16] [--cracks 2000] [--case CASE.toml]

The operator of a crack field (or of a case, with the hierarchical operator) is assembled, and a product K x and a
preconditioned residual are computed in statuses drawn at random. Of the rank with the largest number: messages and
bytes, the largest array of a collective call, processor seconds of a product, memory of the process beyond what it has
before anything is read, and the bytes of arrays by piece. The column after each piece is its part of that in the first
row, times the ranks: 1 is shared perfectly, the number of ranks means whole on each rank. More ranks than cores do not
matter to counts.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
LAUNCH = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe", "OMPI_MCA_btl_vader_single_copy_mechanism": "none",
    "OMPI_MCA_hwloc_base_binding_policy": "none", "OMPI_MCA_mpi_yield_when_idle": "1", "OMP_NUM_THREADS": "1",
}  # fmt: skip
FEW = 0.01  # pieces that are less of a rank's arrays in all rows are not printed


def find_memory() -> float:
    """MB of this process that are in memory."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


def list_bytes(item: Any, seen: set[int]) -> Iterator[int]:
    """Bytes of all arrays of an object that are not among those seen."""
    if id(item) in seen:
        return
    seen.add(id(item))
    if isinstance(item, np.ndarray):
        owner = item
        while isinstance(owner.base, np.ndarray):
            owner = owner.base
        if owner is item or id(owner) not in seen:
            seen.add(id(owner))
            yield owner.nbytes
    elif isinstance(item, dict | tuple | list):
        for part in item.values() if isinstance(item, dict) else item:
            yield from list_bytes(part, seen)
    elif hasattr(item, "__dict__"):
        yield from list_bytes(vars(item), seen)


def name_pieces(problem: Any, tangent: Any, law: Any, load: Any) -> dict[str, Any]:
    """What a rank holds, by what it is; what belongs to two pieces counts for the first."""
    system, operator = problem.system, problem.system.operator
    return {
        "mesh": problem.mesh, "laws": (problem.laws, law), "loads": (problem.outer, load),
        "map M": tangent.constraints, "trees": operator.parts.forest, "near rows": operator.near.leaves,
        "source tree": operator.sources, "far rows": (operator.targets, operator.far), "operator, rest": operator,
        "crack points": system.crack_points, "groups": (system.groups, tangent.preconditioner.inverses),
        "preconditioner": tangent.preconditioner, "tangent, rest": tangent, "problem, rest": problem,
    }  # fmt: skip


def measure(case: Path) -> list[dict[str, Any]]:
    """What each rank counts; on the first rank."""
    from counted import CountedComm

    from pbem.case.build import read_model
    from pbem.contact.deferred_laws import defer_laws
    from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, follow_leaders, start_memory
    from pbem.errors import CaseError
    from pbem.mesh.generate import generate_mesh
    from pbem.parallel import abort_if_unexpected, do_on_first, world
    from pbem.solve.system.assembly import assemble_problem

    def count(action: Any) -> dict[str, Any]:
        comm.ledger.clear()
        action()
        kinds = comm.ledger.kinds
        whole = [each for name, each in kinds.items() if name not in ("Isend", "Irecv")]
        return {
            "messages": sum(each.messages for name, each in kinds.items() if name == "Isend"),
            "received": sum(each.received for each in kinds.values()),
            "sent": sum(each.sent for each in kinds.values()),
            "collective": max((each.largest for each in whole), default=0),
        }  # fmt: skip

    with abort_if_unexpected(world, SystemExit):
        begin, comm = find_memory(), CountedComm(world)
        model = do_on_first(world, CaseError, lambda: read_model(case)[1])  # as runs do
        problem = assemble_problem(model, generate_mesh(model), comm)
        laws, load = problem.laws, problem.evaluate_load(0, 1.0)
        random, zeros, memory = np.random.default_rng(7), np.zeros(laws.count), start_memory(laws)
        drawn = random.choice([STICK, SLIP, OPEN], laws.count).astype(np.int8)
        modes = np.where(laws.bonded, memory.modes.mode, drawn)
        state = follow_leaders(laws, ModeState(modes, random.choice([-1.0, 1.0], laws.count)))
        law = defer_laws(laws, state, zeros, zeros, memory, load.pressure, problem.traction_scale)
        tangent: Any = problem.make_tangent()
        tangent.solve(problem.constrain(law, load), load, law, 0.5)  # what is made once is made
        part = random.standard_normal((problem.mesh.nodes, 2))[problem.system.nodes].ravel()
        product, preconditioned = (count(lambda: tangent.multiply(part)), count(lambda: tangent.precondition(part)))
        seconds = []
        for _ in range(5):
            at = time.process_time()
            problem.system.operator.apply_seen(np.zeros(problem.system.seen.count))
            seconds.append(time.process_time() - at)
        now, seen = find_memory() - begin, set[int]()  # what lists the pieces takes memory itself
        pieces = {
            name: sum(list_bytes(piece, seen)) for name, piece in name_pieces(problem, tangent, law, load).items()
        }
        return world.gather({
            "unknowns": problem.unknowns, "own": len(part), "product": product, "preconditioned": preconditioned,
            "seconds": min(seconds), "memory": now, "pieces": pieces,
        }) or []  # fmt: skip


def count_ranks(case: Path, ranks: int) -> dict[str, Any]:
    """The largest numbers of all ranks."""
    command = ["mpirun", "-n", str(ranks), sys.executable, __file__, "--inside", str(case)]
    run = subprocess.run(command, env=os.environ | LAUNCH, capture_output=True, text=True, cwd=ROOT)
    if run.returncode:
        sys.exit(run.stderr)
    told = json.loads(run.stdout.splitlines()[-1])

    def largest(*names: str) -> Any:
        values = []
        for each in told:
            for name in names:
                each = each[name]
            values.append(each)
        return max(values)

    found = {name: largest(name) for name in ("unknowns", "own", "seconds", "memory")}
    found |= {kind: {name: largest(kind, name) for name in told[0][kind]} for kind in ("product", "preconditioned")}
    return found | {"ranks": ranks, "pieces": {name: largest("pieces", name) for name in told[0]["pieces"]}}


def print_head() -> None:
    """What the columns of `print_exchange` are."""
    print("of the rank with the most: in a product, and in the preconditioner; kB; collective: largest array, bytes")
    print(f"{'ranks':>6s}{'unknowns':>10s}{'messages':>10s}{'sent':>9s}{'received':>10s}{'collective':>12s}"
          f"{'messages':>10s}{'received':>10s}{'seconds':>10s}{'times P':>9s}{'MB':>8s}")


def print_exchange(row: dict[str, Any], first: dict[str, Any]) -> None:
    """A line for a number of ranks."""
    one, other = row["product"], row["preconditioned"]
    share = row["seconds"] * row["ranks"] / (first["seconds"] * first["ranks"])
    print(f"{row['ranks']:6d}{row['own']:10d}{one['messages']:10d}{one['sent'] / 1e3:9.0f}"
          f"{one['received'] / 1e3:10.0f}{max(one['collective'], other['collective']):12d}{other['messages']:10d}"
          f"{other['received'] / 1e3:10.1f}{row['seconds']:10.4f}{share:9.2f}{row['memory']:8.0f}", flush=True)


def print_pieces(rows: list[dict[str, Any]]) -> None:
    """Memory by piece, a column for each number of ranks."""
    print("\narrays by piece, MB; after each its part of the first row's, times the ranks")
    print(f"{'ranks':16s}" + "".join(f"{row['ranks']:>10d}{'':7s}" for row in rows))
    sums = [sum(row["pieces"].values()) for row in rows]
    for name in (*rows[0]["pieces"], "all"):
        sizes = sums if name == "all" else [row["pieces"][name] for row in rows]
        if any(size > FEW * whole for size, whole in zip(sizes, sums, strict=True)):
            unit = max(sizes[0] * rows[0]["ranks"], 1)
            shares = [size * row["ranks"] / unit for size, row in zip(sizes, rows, strict=True)]
            cells = (f"{size / 1e6:10.2f}{share:7.2f}" for size, share in zip(sizes, shares, strict=True))
            print(f"{name:16s}" + "".join(cells))


def main() -> None:
    """Count and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4, 8, 16])
    parser.add_argument("--cracks", type=int, default=2000)
    parser.add_argument("--case", type=Path)
    parser.add_argument("--inside", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.inside:
        told = measure(options.inside)
        if told:
            print(json.dumps(told))
        return
    with tempfile.TemporaryDirectory() as name:
        from bench_field import make_field

        case = options.case or make_field(Path(name), options.cracks)
        rows: list[dict[str, Any]] = []
        print_head()
        for ranks in options.ranks:
            rows.append(count_ranks(case, ranks))
            print_exchange(rows[-1], rows[0])
        print_pieces(rows)


if __name__ == "__main__":
    main()
