"""Terms that close in on a fixed point, and terms that run away from one."""

from __future__ import annotations

import numpy as np

from pbem.solve.nonlinear.fixed_point import FixedPoint

COUNT = 12


def iterate(ratio: np.ndarray, times: int, moving: np.ndarray | None = None) -> list[np.ndarray]:
    """Terms x of x -> rest + B (x - rest), B symmetric with the given eigenvalues; less the rest."""
    rng = np.random.default_rng(3)
    turn = np.linalg.qr(rng.normal(size=(COUNT, COUNT)))[0]
    matrix, rest = turn @ np.diag(ratio) @ turn.T, rng.normal(size=COUNT)
    terms, fixed_point = [np.zeros(COUNT)], FixedPoint()
    for _ in range(times):
        found = rest + matrix @ (terms[-1] - rest)
        terms.append(fixed_point.choose(b"", terms[-1], found, np.ones(COUNT, bool) if moving is None else moving))
    return [term - rest for term in terms]


def test_terms_with_few_ratios_end_in_a_few_iterations() -> None:
    """Three ratios near to one: each difference takes one away, where plain terms would keep 0.99 ** 8 of it."""
    ratio = np.repeat([0.99, 0.9, 0.6], COUNT // 3)
    errors = [float(np.abs(each).max()) for each in iterate(ratio, 8)]
    assert min(errors) < 1e-6 * errors[0]


def test_terms_that_run_away_run_on_some_terms_at_a_time() -> None:
    """The first as it was found; then terms of growing powers, never back to the state that they leave."""
    terms = iterate(np.full(COUNT, 1.5), 6)
    np.testing.assert_allclose(terms[1], 1.5 * terms[0], rtol=1e-12)
    np.testing.assert_allclose(terms[2], 1.5**5 * terms[0], rtol=1e-12)
    assert all(np.abs(after).min() > 0 and (after * terms[0] > 0).all() for after in terms)


def test_terms_that_grow_in_turns_are_left_alone() -> None:
    terms = iterate(np.full(COUNT, -1.5), 5)
    np.testing.assert_allclose(terms[-1], (-1.5) ** 5 * terms[0], rtol=1e-12)


def test_other_modes_begin_anew_and_other_pairs_take_what_was_found() -> None:
    fixed_point, moving = FixedPoint(), np.array([True, False])
    taken = np.zeros(2)
    for name, factor in ((b"a", 1.0), (b"a", 0.5), (b"b", 0.25)):
        found = taken + factor
        chosen = fixed_point.choose(name, taken, found, moving)
        assert chosen[1] == found[1]
        # 1, then half of it: the series 1 + 1/2 + ... ends at 2.
        assert chosen[0] == (2.0 if factor == 0.5 else found[0])
        taken = found
