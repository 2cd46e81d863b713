"""How well K, J and T are known at the tips of cracks that are cut into curves and graded in many ways, from seeds.

For straight, arc and kinked cracks and each order: the largest errors, and those that nine of ten do not exceed, of KI
and KII (relative to the root of the sum of their squares), J and T (relative to the stress). "as given": the elements
as they come, with neighbours as 1:1000 and more; "2": elements halved until neighbours differ by a factor of 2 at most.
Then kinked cracks that turn by 5 to 150 degrees, with wings of 0.01 to 1 of the other leg, as case files, on the
meshes that the program makes of them: with the gradings of the file ("file"), and with its own ("auto"); K (relative
to that of the tip) and J, each against a fine mesh.

usage: .venv/bin/python -m scripts.study_tips [WAYS] [KINDS]     (of each kind; 200; straight,arc,kinked,files)
"""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import astuple

import numpy as np

from tests.verification.kinks import draw_kink, measure_kink
from tests.verification.ways import limit_ratios, make_arc_crack, make_griffith, make_kinked_crack, measure

KINDS = {"straight": make_griffith, "arc": make_arc_crack, "kinked": make_kinked_crack}
QUANTITIES = ("KI", "KII", "J", "T")
# Errors of K beyond this are listed one by one.
MOST = 5e-3


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    kinds = sys.argv[2].split(",") if len(sys.argv) > 2 else [*KINDS, "files"]
    heads = "".join(f"{f'{name}: largest, 90 %':>22s}" for name in QUANTITIES)
    print(f"{'crack':10s}{'neighbours':12s}{'order':>5s}{'ways':>6s}{heads}")
    for kind, make in ((kind, KINDS[kind]) for kind in kinds if kind in KINDS):
        for mesh in ("as given", "2"):
            errors = defaultdict(list)
            for seed in range(count):
                way = make(seed)
                errors[way.order].append(astuple(measure(way if mesh == "as given" else limit_ratios(way))))
            for order, found in sorted(errors.items()):
                each = np.array(found)
                worst, most = each.max(axis=0), np.quantile(each, 0.9, axis=0)
                text = "".join(f"{f'{a:.1e} {b:.1e}':>22s}" for a, b in zip(worst, most, strict=True))
                print(f"{kind:10s}{mesh:12s}{order:5d}{len(found):6d}{text}", flush=True)
    if "files" in kinds:
        print_kinks_of_files(count)


def print_kinks_of_files(count: int) -> None:
    """Their part of the table, and those whose K is off by more than 5e-3."""
    errors, beyond = defaultdict(list), []
    for seed in range(count):
        kink = draw_kink(seed)
        for mesh in ("file", "auto"):
            found = measure_kink(kink, mesh == "file")
            errors[mesh, kink.order].append(astuple(found))
            if found.K > MOST:
                beyond.append(f"K off by {found.K:.1e}, seed {seed}, {mesh}: {kink.text}")
    print(f"{'crack':10s}{'mesh':12s}{'order':>5s}{'ways':>6s}{'K: largest, 90 %':>22s}{'J: largest, 90 %':>22s}")
    for (mesh, order), each in sorted(errors.items()):
        worst, most = np.max(each, axis=0), np.quantile(each, 0.9, axis=0)
        text = "".join(f"{f'{a:.1e} {b:.1e}':>22s}" for a, b in zip(worst, most, strict=True))
        print(f"{'kinked':10s}{mesh:12s}{order:5d}{len(each):6d}{text}")
    print("\n".join(beyond))


if __name__ == "__main__":
    main()
