"""How well K, J and T are known at the tips of cracks that are cut into curves and graded in many ways, from seeds.

For straight, arc and kinked cracks and each order: the largest errors, and those that nine of ten do not exceed, of KI
and KII (relative to the root of the sum of their squares), J and T (relative to the stress). "as given": the elements
as they come, with neighbours as 1:1000 and more; "2": elements halved until neighbours differ by a factor of 2 at most.
Then straight cracks, arcs of 20 to 200 degrees, and kinked cracks that turn by 5 to 150 degrees, with wings of 0.01 to
1 of the other leg, as case files, on the meshes that the program makes of them: with the gradings of the file ("file"),
and with its own ("auto"); K (relative to that of the tip) and J, against closed forms and, for kinks, a fine mesh.

usage: .venv/bin/python -m scripts.study_tips [WAYS] [KINDS] [FIRST]
    of each kind; 200; straight,arc,kinked,straight-files,arc-files,kinked-files; "files" for the last three; the first
    seed; 0
"""

from __future__ import annotations

import sys
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import astuple

import numpy as np

from tests.verification.cuts import Cut, draw_arc_cut, draw_straight_cut, measure_cut
from tests.verification.kinks import Kink, TipErrors, draw_kink, measure_kink
from tests.verification.ways import limit_ratios, make_arc_crack, make_griffith, make_kinked_crack, measure

KINDS = {"straight": make_griffith, "arc": make_arc_crack, "kinked": make_kinked_crack}
QUANTITIES = ("KI", "KII", "J", "T")
Drawn = Kink | Cut
FILES: dict[str, tuple[Callable[[int], Drawn], Callable[[Drawn, bool], TipErrors], float]] = {
    "straight": (draw_straight_cut, measure_cut, 3e-3),
    "arc": (draw_arc_cut, measure_cut, 5e-3),
    "kinked": (draw_kink, measure_kink, 5e-3),
}


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    kinds = sys.argv[2].split(",") if len(sys.argv) > 2 else [*KINDS, "files"]
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    seeds = range(first, first + count)
    if any(kind in KINDS for kind in kinds):
        print_ways(seeds, [kind for kind in kinds if kind in KINDS])
    files = [kind for kind in FILES if "files" in kinds or f"{kind}-files" in kinds]
    if files:
        print_files(seeds, files)


def print_ways(seeds: Sequence[int], kinds: list[str]) -> None:
    """The first part of the table."""
    heads = "".join(f"{f'{name}: largest, 90 %':>22s}" for name in QUANTITIES)
    print(f"{'crack':10s}{'neighbours':12s}{'order':>5s}{'ways':>6s}{heads}")
    for kind, make in ((kind, KINDS[kind]) for kind in kinds):
        for mesh in ("as given", "2"):
            errors = defaultdict(list)
            for seed in seeds:
                way = make(seed)
                errors[way.order].append(astuple(measure(way if mesh == "as given" else limit_ratios(way))))
            for order, found in sorted(errors.items()):
                each = np.array(found)
                worst, most = each.max(axis=0), np.quantile(each, 0.9, axis=0)
                text = "".join(f"{f'{a:.1e} {b:.1e}':>22s}" for a, b in zip(worst, most, strict=True))
                print(f"{kind:10s}{mesh:12s}{order:5d}{len(found):6d}{text}", flush=True)


def print_files(seeds: Sequence[int], kinds: list[str]) -> None:
    """The part of case files, and those whose K is off by more than it should be."""
    print(f"{'crack':10s}{'mesh':12s}{'order':>5s}{'ways':>6s}{'K: largest, 90 %':>22s}{'J: largest, 90 %':>22s}")
    beyond = []
    for kind in kinds:
        draw, measure_tips, allowed = FILES[kind]
        errors = defaultdict(list)
        for seed in seeds:
            drawn = draw(seed)
            for mesh in ("file", "auto"):
                found = measure_tips(drawn, mesh == "file")
                errors[mesh, drawn.order].append(astuple(found))
                if allowed < found.K:
                    beyond.append(f"K of {kind} off by {found.K:.1e}, seed {seed}, {mesh}: {drawn.text}")
        for (mesh, order), each in sorted(errors.items()):
            worst, usual = np.max(each, axis=0), np.quantile(each, 0.9, axis=0)
            text = "".join(f"{f'{a:.1e} {b:.1e}':>22s}" for a, b in zip(worst, usual, strict=True))
            print(f"{kind:10s}{mesh:12s}{order:5d}{len(each):6d}{text}", flush=True)
    print("\n".join(beyond))


if __name__ == "__main__":
    main()
