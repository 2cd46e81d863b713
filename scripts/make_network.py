"""A made map of fracture traces, of any size, with the statistics of a mapped one.

Each trace is a copy of one of the mapped traces, drawn at random, so that lengths, shapes and orientations (and how
these go together) are distributed as in the map. It is turned by a few degrees and put at a random place of a square,
which is so large that a trace meets as many others in the mean as in the map: as mapped traces cluster, their length
per area is larger than in the map's convex hull. As large a share of the ends as in the map, of those that can, ends on
another trace: they are cut back to the last one that they cross. What is not kept: clusters, and which set ends on
which.

usage: .venv/bin/python -m scripts.make_network MAP.geojson -o FILE.geojson [--traces 3200] [--seed 0]
then:  pbem import FILE.geojson -o network.toml --simplify 0.1 --size 0.7 --friction 0.6 --sxx -5 --syy -30
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbem.geometry.boxes import Boxes

# Degrees by which copies of a trace are turned (standard deviation).
TURN = 5.0
# An end that is nearer to another trace than this part of the median length ends on it.
TOUCHING = 1e-3
MOST_TRIES = 10

Points = NDArray[np.complex128]
Numbers = NDArray[np.float64]


def read_lines(path: Path) -> list[Points]:
    """The traces of a map, those of several parts taken apart."""
    lines = []
    for feature in json.loads(path.read_text())["features"]:
        shape = feature["geometry"]
        parts = [shape["coordinates"]] if shape["type"] == "LineString" else shape["coordinates"]
        lines += [np.array([complex(x, y) for x, y, *_ in part]) for part in parts]
    return lines


def measure_length(line: Points) -> float:
    return float(np.abs(np.diff(line)).sum())


def measure_ending(lines: list[Points]) -> float:
    """Share of the ends that lie on another trace."""
    near = TOUCHING * float(np.median([measure_length(line) for line in lines]))
    start, end, owner = _list_segments(lines)
    ends = np.array([line[k] for line in lines for k in (0, -1)])
    own = np.repeat(np.arange(len(lines)), 2)
    which, segment = _surround(start, end).find_meeting(_surround(ends, ends, near))
    apart = own[which] != owner[segment]
    which, segment = which[apart], segment[apart]
    along = (end - start)[segment]
    at = np.clip(((ends[which] - start[segment]) * along.conj()).real / np.abs(along) ** 2, 0, 1)
    return len(np.unique(which[np.abs(ends[which] - start[segment] - at * along) < near])) / len(ends)


def place_copies(lines: list[Points], count: int, rng: np.random.Generator) -> list[Points]:
    """Copies of random lines, turned a little, at random places of a square where they meet as often as the lines."""
    chosen = [lines[k] for k in rng.integers(len(lines), size=count)]
    turns = np.exp(1j * np.radians(TURN) * rng.standard_normal(count))
    turned = [turn * (line - line.mean()) for line, turn in zip(chosen, turns, strict=True)]
    places = rng.random((count, 2)) @ (1, 1j)
    wanted, side = count_meetings(lines), np.sqrt(count) * np.mean([measure_length(line) for line in chosen])
    for _ in range(MOST_TRIES):
        placed = [side * place + line for line, place in zip(turned, places, strict=True)]
        ratio = count_meetings(placed) / wanted
        if abs(ratio - 1) < 0.01:
            break
        side *= np.sqrt(ratio)
    return placed


def cut_back(lines: list[Points], share: float, rng: np.random.Generator) -> list[Points]:
    """The lines, a share of whose ends is cut back to the crossing that is next to it."""
    crossed, place = find_crossings(lines)
    result = []
    for number, (line, wanted) in enumerate(zip(lines, rng.random((len(lines), 2)) < share, strict=True)):
        at = np.sort(place[crossed == number])
        wanted &= len(at) > 1
        low, high = at[0] if wanted[0] else 0.0, at[-1] if wanted[1] else len(line) - 1.0
        inner = np.arange(np.floor(low) + 1, np.ceil(high))
        result.append(np.interp(np.concatenate([[low], inner, [high]]), np.arange(len(line)), line))
    return result


def find_crossings(lines: list[Points]) -> tuple[NDArray[np.int64], Numbers]:
    """Number of the line and place on it, in vertices from its start, of every crossing, for each of its two lines."""
    start, end, owner = _list_segments(lines)
    boxes = _surround(start, end)
    one, other = boxes.find_meeting(boxes)
    apart = owner[one] != owner[other]
    one, other = one[apart], other[apart]
    a, b, gap = (end - start)[one], (end - start)[other], start[other] - start[one]
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = (gap.conj() * b).imag / (a.conj() * b).imag, (gap.conj() * a).imag / (a.conj() * b).imag
    crossing = (s > 0) & (s < 1) & (t > 0) & (t < 1)
    first = np.searchsorted(owner, np.arange(len(lines)))
    return owner[one][crossing], (one - first[owner[one]] + s)[crossing]


def count_meetings(lines: list[Points]) -> float:
    """Crossings and ends on another trace, per trace."""
    return 0.5 * len(find_crossings(lines)[0]) / len(lines) + 2 * measure_ending(lines)


def _list_segments(lines: list[Points]) -> tuple[Points, Points, NDArray[np.int64]]:
    """Starts, ends and numbers of the lines of all straight parts."""
    owner = np.repeat(np.arange(len(lines)), [len(line) - 1 for line in lines])
    return np.concatenate([line[:-1] for line in lines]), np.concatenate([line[1:] for line in lines]), owner


def _surround(start: Points, end: Points, margin: float = 0.0) -> Boxes:
    corners = np.stack([np.stack([start.real, end.real]), np.stack([start.imag, end.imag])], axis=2)
    return Boxes(corners.min(axis=0) - margin, corners.max(axis=0) + margin)


def main() -> None:
    parser = argparse.ArgumentParser(description="A made map with the statistics of a mapped one.")
    parser.add_argument("map", type=Path)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--traces", type=int, default=3200)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    lines = read_lines(options.map)
    made = cut_back(place_copies(lines, options.traces, rng), measure_ending(lines), rng)
    features = [
        {"type": "Feature", "properties": {}, "geometry": {
            "type": "LineString", "coordinates": np.round(np.stack([line.real, line.imag], axis=1), 6).tolist()}}
        for line in made
    ]
    options.output.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    for name, each in (("map", lines), ("made", made)):
        print(f"{name}: {len(each)} traces, {sum(map(measure_length, each)):.6g} long, "
              f"{count_meetings(each):.3g} meetings a trace, {100 * measure_ending(each):.3g} % of the ends on another")


if __name__ == "__main__":
    main()
