"""How well K, J and T are known at the tips of cracks that are cut into curves and graded in many ways, from seeds.

For straight, arc and kinked cracks and each order: the largest errors, and those that nine of ten do not exceed, of KI
and KII (relative to the root of the sum of their squares), J and T (relative to the stress). "as given": the elements
as they come, with neighbours as 1:1000 and more; "2": elements halved until neighbours differ by a factor of 2 at most.

usage: .venv/bin/python -m scripts.study_tips [WAYS]     (of each kind; 200)
"""

from __future__ import annotations

import sys
from collections import defaultdict
from dataclasses import astuple

import numpy as np

from tests.verification.ways import limit_ratios, make_arc_crack, make_griffith, make_kinked_crack, measure

KINDS = {"straight": make_griffith, "arc": make_arc_crack, "kinked": make_kinked_crack}
QUANTITIES = ("KI", "KII", "J", "T")


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    heads = "".join(f"{f'{name}: largest, 90 %':>22s}" for name in QUANTITIES)
    print(f"{'crack':10s}{'neighbours':12s}{'order':>5s}{'ways':>6s}{heads}")
    for kind, make in KINDS.items():
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


if __name__ == "__main__":
    main()
