"""The bundled cases by the hierarchical operator, of which most is far and in many groups, as by the dense one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import pbem
from pbem.bem import near
from pbem.results.reader import Results
from pbem.solve.preconditioner import subdomains as groups
from pbem.solve.tangent import krylov
from tests.cases.bundled import CASES, Solve
from tests.cases.conditions import find_faults
from tests.cases.expectations import check_expectation, parse_expectations
from tests.unit.far_sample import shrink_leaves

pytestmark = pytest.mark.usefixtures("without_errors")

# Of the largest displacement, traction, ...: the tolerance 1e-8 of products, times the condition of the equations.
AGREEMENT = 1e-6
# Of the largest traction at single nodes, beside the ends of interfaces, where it is singular.
AT_ENDS = 1e-5
# Of GMRES for one linear system, on models of so many groups.
MOST_ITERATIONS = 60


@pytest.fixture(autouse=True)
def mostly_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small leaves and groups in a small model, and its weak entries packed as those of a large one."""
    shrink_leaves(monkeypatch, 4)
    monkeypatch.setattr(near, "LARGE", 0)
    monkeypatch.setattr(groups, "ONE_GROUP", 0)


@pytest.fixture
def iterations(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[int]]:
    """GMRES' iterations for all linear systems."""
    counts: list[int] = []
    destroy = krylov.KrylovTangent.destroy

    def take_note(tangent: krylov.KrylovTangent) -> None:
        counts.extend(tangent.iterations)
        destroy(tangent)

    monkeypatch.setattr(krylov.KrylovTangent, "destroy", take_note)
    yield counts


# Layers that are pulled take long, and are of the same kind as those that are pushed; the field of cracks is the one of
# several steps; each scheme has blocks that slide.
LIKE_OTHERS = ("layers_pull", "layers_pull_stiff", "crack_field",
               "two_blocks_dbem", "two_blocks_hst", "two_blocks_thst")  # fmt: skip


@pytest.mark.parametrize("name", [name for name in CASES if name not in LIKE_OTHERS])
def test_both_operators_give_the_same(name: str, solve: Solve, tmp_path: Path, iterations: list[int]) -> None:
    dense = solve(name)
    found = pbem.run(CASES[name], tmp_path / "hierarchical.h5", operator="hierarchical")
    assert not find_faults(found.path)
    for expected in parse_expectations(CASES[name].read_text(encoding="utf-8")):
        value, error = check_expectation(found, expected)
        assert error <= 1, f"{expected}: found {value:.7g}"
    expect_equal(found, dense)
    assert iterations and max(iterations) <= MOST_ITERATIONS


def expect_equal(found: Results, dense: Results) -> None:
    """The same steps and modes; fields agree. Of bodies fewer pairs are settled together than by the dense operator."""
    np.testing.assert_array_equal(found.steps.factor, dense.steps.factor)
    assert (found.steps.iterations <= 1.5 * dense.steps.iterations).all()
    length, stress = np.abs(dense.displacement).max(), np.abs(dense.traction).max()
    np.testing.assert_allclose(found.displacement, dense.displacement, rtol=0, atol=AGREEMENT * length)
    np.testing.assert_allclose(found.traction, dense.traction, rtol=0, atol=AT_ENDS * stress)
    assert np.linalg.norm(found.traction - dense.traction) <= AGREEMENT * np.linalg.norm(dense.traction)
    for name, contact in dense.contact.items():
        other = found.contact[name]
        np.testing.assert_array_equal(other.mode, contact.mode, err_msg=name)
        limits = {"opening": AGREEMENT * length, "slip": AGREEMENT * length}
        limits |= {"traction_n": AT_ENDS * stress, "traction_s": AT_ENDS * stress}
        for field, limit in limits.items():
            pair = getattr(other, field), getattr(contact, field)
            np.testing.assert_allclose(*pair, rtol=0, atol=limit, err_msg=f"{name} {field}")
    for curve, force in dense.reactions.items():
        scale = max(np.abs(each).max() for each in dense.reactions.values())
        np.testing.assert_allclose(found.reactions[curve], force, rtol=0, atol=AGREEMENT * scale, err_msg=curve)
