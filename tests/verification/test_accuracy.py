"""`analysis.accuracy` in models of other kinds than those of the proofs; see scripts/refined_models.py."""

from __future__ import annotations

import pytest

from scripts.bench_estimate import make_model, measure_error, refine, solve_finer
from scripts.refined_models import list_models


@pytest.mark.parametrize(("name", "accuracy"), [
    # Forces where the foot is held and at the re-entrant corner; where two materials meet a side that is free.
    ("L-shaped body", 1e-3), ("blocks of two materials", 1e-3),
    # Slips where the crack turns; a contact of which the first meshes have a pair or two.
    ("kinked closed crack, friction", 1e-3), ("disc between plates", 1e-2),
])  # fmt: skip
def test_the_accuracy_asked_for_is_met(name: str, accuracy: float) -> None:
    text, elements = list_models()[name]
    model = make_model(text)
    refined = refine(model, accuracy, elements)
    assert measure_error(refined, solve_finer(model, refined)) <= accuracy
