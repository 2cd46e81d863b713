"""The proofs hold by the hierarchical operator too, of which most is far and in many groups."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.verification.proofs import PROOFS
from tests.verification.test_proofs import VERIFY

# Leaves and groups of so few elements that small models have many.
SHRUNK = """
import runpy, sys
from pbem.bem import hierarchical
from pbem.solve.preconditioner import subdomains as groups
hierarchical.LEAF_ELEMENTS = hierarchical.SMALL_REGION = 4
groups.ONE_GROUP, groups.GROUP_ELEMENTS = 0, 24
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")
"""

# One process for each, so that what proofs have in common is solved once; of the slowest kinds one or two.
PARTS = {
    "cracks": ("crack under", "inclined crack", "collinear cracks", "plate, 2a", "crack along an arc", "kinked crack"),
    "contact": ("Hertz, parabolic", "cylinder first", "sheared crack, cohesion", "under a load of 1:", "panel with"),
    "inclusions": ("pulled out: force",),
    "samples": ("sample with",),
    "crack fields": ("order 1, number 1:", "load in five steps"),
}


def run_verify(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", SHRUNK, str(VERIFY), "--operator", "hierarchical", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=900)


@pytest.mark.parametrize("part", PARTS)
def test_proofs_by_the_hierarchical_operator(part: str) -> None:
    names = [name for each in PARTS[part] for name in ("--only", each)]
    done = run_verify(*names)
    assert done.returncode == 0, done.stdout + done.stderr
    chosen = [proof for proof in PROOFS if any(each in proof.name for each in PARTS[part])]
    assert f"{len(chosen)} of {len(chosen)} within their tolerances" in done.stdout
