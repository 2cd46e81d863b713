#!/usr/bin/env python3
"""Cut-outs of a mapped network: dense against hierarchical operator, and its blocks against the same ones as regions.

    [mpirun -n 2] .venv/bin/python -m scripts.study_networks [TRACES.geojson] [--at 0.5 0.5] [--count 40]
        [--length 0.7] [--sxx -5] [--syy -30] [--sxy 0] [--orders 2] [--refine 1 2] [--only operators|regions]
        [--accuracy 3e-3]

The traces nearest to a place of the map (--at, parts of its extent) are imported as `pbem import` does, with friction.
A line for each size of elements: pairs, blocks, pairs whose status differs between the operators, and their largest
difference of slip over the largest slip; the same for the case in which pieces that enclose blocks are interfaces of
regions and the others remain cracks, with the length of the faces whose status differs over that of all. Slips are
compared within the elements, by their own shape functions, beside tips with the root of the distance. With --accuracy
the elements of these two are refined, each for itself, until that is met: both are off by what their meshes lack, so
only then does the difference say anything.
"""

from __future__ import annotations

import argparse
import itertools
import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

import pbem
from pbem.arrays import Real
from pbem.case.writer import write_tables
from pbem.geometry.curve import Curve, Leg
from pbem.geometry.network import Network, cut_network
from pbem.parallel import world
from pbem.solve.problem.step import SilentReporter

KB11 = Path(__file__).resolve().parents[1] / "cases" / "networks" / "KB11_traces.geojson"
# Part of a piece beside its ends and corners where slips are not compared.
AWAY = 0.02


def cut_out(path: Path, at: tuple[float, float], count: int) -> dict[str, object]:
    """GeoJSON of so many traces whose middles are nearest to a place, in parts of the map's extent."""
    features = json.loads(path.read_text())["features"]
    lines = [np.array(each["geometry"]["coordinates"])[:, :2] for each in features]
    ends = np.concatenate(lines)
    place = ends.min(axis=0) + np.array(at) * np.ptp(ends, axis=0)
    reach = np.array([np.hypot(*(line - place).T).max() for line in lines])
    chosen = np.sort(np.argsort(reach, kind="stable")[:count])
    return {"type": "FeatureCollection", "features": [features[k] for k in chosen]}


def import_traces(options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """The tables of the case of the cut-out."""
    source, case = folder / "traces.geojson", folder / "traces.toml"
    source.write_text(json.dumps(cut_out(options.traces, tuple(options.at), options.count)))
    subprocess.run([sys.executable, "-m", "pbem", "import", str(source), "-o", str(case), "--force", "--simplify",
                    "0.1", "--size", str(options.length), f"--sxx={options.sxx}", f"--syy={options.syy}",
                    f"--sxy={options.sxy}", f"--friction={options.friction}"], check=True, capture_output=True)
    return tomllib.loads(case.read_text(encoding="utf-8"))


def read_network(tables: dict[str, Any]) -> Network:
    """The pieces of a case of straight cracks, which meet at their ends."""
    curves = {}
    for name, table in tables["curves"].items():
        points = [complex(*point) for point in table["points"]]
        curves[name] = Curve(name, tuple(Leg(a, b, 1) for a, b in itertools.pairwise(points)))
    return cut_network(curves, 0.0)


def write_regions(tables: dict[str, Any]) -> dict[str, Any]:
    """The same model with a region for each block, whose outlines are interfaces; other pieces remain cracks."""
    network = read_network(tables)
    if list(network.pieces) != list(tables["curves"]):
        raise SystemExit("the pieces of the case are cut once more")
    owners: dict[str, list[str]] = {name: [] for name in network.pieces}
    for number, block in enumerate(network.blocks):
        for name in {name for ring in block.rings for name, _ in ring}:
            owners[name].append(f"block{number}")
    bounds: dict[str, list[str]] = {}
    for name, regions in owners.items():
        for region in regions + [_find_host(network, name, regions[0])] * (len(regions) == 1) if regions else ():
            bounds.setdefault(region, []).append(name)
    cracks: dict[str, list[str]] = {}
    for name, regions in owners.items():
        if not regions:
            cracks.setdefault(_find_host(network, name, ""), []).append(name)
    regions = {}
    for region in ["plane", *(f"block{number}" for number in range(len(network.blocks)))]:
        table: dict[str, Any] = {"material": "rock", "boundary": bounds.get(region, [])}
        table |= {"infinite": True} if region == "plane" else {}
        regions[region] = {**table, **({"cracks": cracks[region]} if region in cracks else {})}
    laws = {name: {"law": "coulomb", **_find_law(tables, name)} for name in network.pieces}
    return {**tables, "regions": regions, "interfaces": laws}


def _find_law(tables: dict[str, Any], name: str) -> dict[str, Any]:
    laws = tables["interfaces"]
    return dict(laws.get(name) or laws[name.rpartition(".")[0]])


def _find_host(network: Network, name: str, apart: str) -> str:
    """The block that a piece lies in, the smallest one but for that which it bounds, or the plane."""
    leg = network.pieces[name].legs[0]
    place, found = 0.5 * (leg.start + leg.end), "plane"
    least = np.inf
    for number, block in enumerate(network.blocks):
        turn = 0.0
        for ring in block.rings:
            corners = [z for piece, ahead in ring for z in _list_corners(network.pieces[piece], ahead)]
            steps = np.array([*corners, corners[0]]) - place
            turn += float(np.angle(steps[1:] / steps[:-1]).sum())
        if abs(turn) > np.pi and block.area < least and apart != f"block{number}":
            found, least = f"block{number}", block.area
    return found


def _list_corners(curve: Curve, ahead: bool) -> list[complex]:
    corners = [curve.legs[0].start, *(leg.end for leg in curve.legs)]
    return corners[:-1] if ahead else corners[:0:-1]


def refine(tables: dict[str, Any], by: int, order: int, accuracy: float | None = None) -> dict[str, Any]:
    """The case with smaller elements and another order; accuracy: that it is to reach."""
    curves = {name: {**table, **({"size": table["size"] / by} if "size" in table else
                                 {"elements": table["elements"] * by})} for name, table in tables["curves"].items()}
    analysis = {**tables["analysis"], "order": order, **({"accuracy": accuracy} if accuracy else {})}
    return {**tables, "curves": curves, "analysis": analysis}


def run(tables: dict[str, Any], folder: Path, name: str, operator: str) -> Any:
    """The results, on the first rank."""
    case = folder / f"{name}.toml"
    if world.rank == 0:
        case.write_text(write_tables(tables), encoding="utf-8")
    world.Barrier()
    results = pbem.run(case, folder / f"{name}.h5", force=True, operator=operator, reporter=SilentReporter())
    return results if world.rank == 0 else None


def compare_operators(tables: dict[str, Any], folder: Path) -> None:
    """Print a line."""
    dense, far = (run(tables, folder, operator, operator) for operator in ("dense", "hierarchical"))
    if dense is None:
        return
    one, other = dense.pairs, far.pairs
    slip = [each.at("slip", -1) for each in (one, other)]
    mode = [each.at("mode", -1) for each in (one, other)]
    counts = np.bincount(mode[0], minlength=3)
    print(f"operators: {one.count} pairs ({counts[0]} stick, {counts[1]} slip, {counts[2]} open); "
          f"{int((mode[0] != mode[1]).sum())} statuses differ; slip "
          f"{np.abs(slip[0] - slip[1]).max() / np.abs(slip[0]).max():.1e}; iterations "
          f"{int(dense.steps.iterations.sum())}, {int(far.steps.iterations.sum())}", flush=True)


def interpolate(
    at: Real, values: Real, places: Real, order: int, length: float = 0.0, tips: tuple[bool, bool] = (False, False)
) -> Real:
    """Values at places (p,) from those at the nodes (k,) of elements, one after the other, of order + 1 nodes each.

    tips: whether the piece, of that length, begins and ends at the tip of a crack: there they follow the root of the
    distance.
    """
    if any(tips):
        nodes, result = order + 1, interpolate(at, values, places, order)
        for tip, begin in ((0.0, 0),) * tips[0] + ((length, len(at) - nodes),) * tips[1]:
            own = at[begin : begin + nodes]
            here = np.searchsorted(0.5 * (at[order:-1:nodes] + at[nodes::nodes]), places) == begin // nodes
            root = values[begin : begin + nodes] / np.sqrt(np.abs(own - tip))
            result[here] = interpolate(own, root, places[here], order) * np.sqrt(np.abs(places[here] - tip))
        return result
    nodes = order + 1
    last, first = at[order:-1:nodes], at[nodes::nodes]
    element = np.searchsorted(0.5 * (last + first), places)
    own = element[:, None] * nodes + np.arange(nodes)
    distance, apart = places[:, None] - at[own], at[own][:, :, None] - at[own][:, None, :]
    weights = np.ones(own.shape)
    for k, m in itertools.permutations(range(nodes), 2):
        weights[:, k] *= distance[:, m] / apart[:, k, m]
    return np.asarray((weights * values[own]).sum(axis=1))


def compare_regions(cracks: dict[str, Any], regions: dict[str, Any], folder: Path) -> None:
    """Print a line."""
    operator = "auto" if "accuracy" in cracks["analysis"] else "dense"
    one, other = (run(each, folder, name, operator) for each, name in ((cracks, "cracks"), (regions, "regions")))
    if one is not None:
        compare_slips(cracks, one, other)


def compare_slips(cracks: dict[str, Any], one: Any, other: Any) -> None:
    """Print a line on the results of a case of cracks, and of the same with regions."""
    order = int(cracks["analysis"]["order"])
    ends = [tuple(table["points"][end]) for table in cracks["curves"].values() for end in (0, -1)]
    meeting = {end: ends.count(end) for end in ends}
    largest = max(float(np.abs(each.slip[-1]).max()) for each in one.contact.values())
    worst, place, pairs, differing, whole = 0.0, "", 0, 0.0, 0.0
    for name, each in one.contact.items():
        same = other.contact[name]
        pairs += each.pairs
        at, slip = np.asarray(same.arc_length), np.asarray(same.slip[-1])
        mine, own = np.asarray(each.arc_length), np.asarray(each.slip[-1])
        if float(np.hypot(*(each.position[0] - same.position[0]))) > float(np.hypot(*(each.position[0] -
                                                                                     same.position[-1]))):
            raise SystemExit(f"{name} runs the other way")
        # Near their ends and corners both have nodes in other places, where slips are singular or jump.
        corners = np.cumsum(np.abs(np.diff(np.array(cracks["curves"][name]["points"]) @ [1, 1j])), dtype=float)
        apart = np.abs(mine[:, None] - [0.0, *corners]).min(axis=1)
        within = (mine >= at[0]) & (mine <= at[-1]) & (apart >= AWAY * corners[-1])
        tips = tuple(meeting[tuple(cracks["curves"][name]["points"][end])] == 1 for end in (0, -1))
        off = np.where(within, np.abs(interpolate(at, slip, mine, order, float(corners[-1]), tips) - own), 0.0)
        if off.max() > worst:
            worst, place = float(off.max()), f"{name} at {mine[off.argmax()]:.3g} of {mine[-1]:.3g}"
        weights = np.gradient(mine) if len(mine) > 1 else np.ones(1)
        nearest = np.abs(mine[:, None] - at).argmin(axis=1)
        differing += float(weights[each.mode[-1] != same.mode[-1][nearest]].sum())
        whole += float(weights.sum())
    print(f"regions: {pairs} pairs, {sum(each.pairs for each in other.contact.values())} with regions; slip "
          f"{worst / largest:.1e} ({place}); length with other statuses {differing / whole:.1e}", flush=True)


def main() -> None:
    """Print the lines."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("traces", nargs="?", type=Path, default=KB11)
    parser.add_argument("--at", type=float, nargs=2, default=(0.5, 0.5))
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--length", type=float, default=0.7)
    for key, value in (("sxx", -5.0), ("syy", -30.0), ("sxy", 0.0), ("friction", 0.6)):
        parser.add_argument(f"--{key}", type=float, default=value)
    parser.add_argument("--orders", type=int, nargs="+", default=[2])
    parser.add_argument("--refine", type=int, nargs="+", default=[1])
    parser.add_argument("--only", choices=("operators", "regions"))
    parser.add_argument("--accuracy", type=float, help="of cracks and of regions, which are then refined")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(world.bcast(name))
        tables = world.bcast(import_traces(options, folder) if world.rank == 0 else None)
        regions = write_regions(tables) if options.only != "operators" else {}
        if world.rank == 0:
            network = read_network(tables)
            print(f"{len(network.pieces)} pieces, {len(network.junctions)} junctions, {len(network.blocks)} blocks")
        for order in options.orders:
            for by in options.refine:
                cracks = refine(tables, by, order)
                if options.only != "regions":
                    compare_operators(cracks, folder)
                if options.only != "operators":
                    compare_regions(*(refine(each, by, order, options.accuracy) for each in (tables, regions)), folder)
        world.Barrier()


if __name__ == "__main__":
    main()
