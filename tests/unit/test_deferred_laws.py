"""Linearised laws that are formed for some pairs are those of all pairs, and only these pairs' are stored."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.case.build import parse_model
from pbem.contact import deferred_laws
from pbem.contact.deferred_laws import (
    DeferredLinearisation,
    defer_laws,
    defer_smoothed,
    defer_stiffness,
    free_jumps,
    spread_directions,
)
from pbem.contact.laws import OPEN, SLIP, STICK, Memory, ModeState, PairLaws, PairState, collect_laws, start_memory
from pbem.contact.modes import Linearisation
from pbem.mesh.generate import generate_mesh
from pbem.model.model import Model
from tests.cases.bundled import CASES
from tests.unit.case_sample import build
from tests.unit.test_group_memory import measure_peak
from tests.unit.test_uniform import FIELD

Real = NDArray[np.float64]
Integer = NDArray[np.int64]

SCALE = 2.0e3
SOFT = "normal_stiffness = 3.0e3\ntangential_stiffness = 2.0e3\ncohesion = 0.3\ntensile_strength = 0.2"
MODELS: dict[str, Callable[[], Model]] = {
    "cracks": lambda: build(FIELD),
    "soft joints": lambda: build(FIELD.replace("friction = 0.5", f"friction = 0.5\n{SOFT}")),
    "blocks": lambda: parse_model(CASES["two_blocks"].read_text(encoding="utf-8"))[1],
}


class Drawn:
    """Laws of a model, and states, modes and a memory that are drawn; every fifth pair follows the one before."""

    def __init__(self, name: str) -> None:
        model = MODELS[name]()
        random, laws = np.random.default_rng(5), collect_laws(model, generate_mesh(model))
        leader = np.arange(laws.count)
        leader[4::5] -= 1
        self.laws: PairLaws = replace(laws, leader=leader)
        self.modes = ModeState(random.choice([STICK, SLIP, OPEN], laws.count).astype(np.int8),
                               random.choice([-1.0, 1.0], laws.count))
        self.state = PairState(*random.normal(size=(4, laws.count)))
        self.memory: Memory = replace(start_memory(laws), slip=random.normal(size=laws.count))
        self.pressure = random.uniform(size=laws.count)
        self.pairs: Integer = np.sort(random.choice(laws.count, laws.count // 3, replace=False))
        self.directions = random.normal(size=(len(self.pairs), 4, 2))

    def list(self) -> dict[str, DeferredLinearisation]:
        """All kinds of laws that are formed for some pairs."""
        laws, state, count = self.laws, self.state, self.laws.count
        plain = defer_laws(laws, self.modes, state.p_n, state.g_s, self.memory, self.pressure, SCALE, "slip",
                           np.stack([state.g_n, state.g_s], axis=1))
        stiffness = np.where(self.modes.mode == OPEN, self.pressure, 0.0)
        smooth = ~(laws.bonded | laws.parted | laws.follows)
        width = 0.1 + self.pressure
        return {
            "plain": plain, "stiffened": defer_stiffness(plain, state, stiffness),
            "smoothed": defer_smoothed(laws, smooth, state, self.memory, self.pressure, SCALE, width, width, 0.1),
            "spread": spread_directions(laws.leader, self.pairs[::-1], self.directions),
            "free": free_jumps(laws.leader, np.arange(count) % 3 > 0, SCALE),
        }


@pytest.mark.parametrize("name", MODELS)
def test_laws_of_some_pairs_are_those_of_all(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = Drawn(name)
    pairs = np.random.default_rng(7).permutation(drawn.laws.count)[: drawn.laws.count // 2]
    unknowns = np.random.default_rng(8).normal(size=(drawn.laws.count, 2))
    monkeypatch.setattr(deferred_laws, "EVALUATED", drawn.laws.count // 3 - 1)  # the last part is small
    for kind, (law, whole) in {key: (law, drawn.list()[key].store()) for key, law in drawn.list().items()}.items():
        some, state = law.take(pairs), law.evaluate(unknowns)
        assert type(whole) is Linearisation and "_whole" not in vars(law), kind
        for found, expected in ((some.tangent, whole.tangent[pairs]), (some.offset, whole.offset[pairs])):
            np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-14 * np.abs(expected).max(), err_msg=kind)
        assert some.smoothed == whole.smoothed == (kind == "smoothed")
        for found, expected in zip(vars(state).values(), vars(whole.evaluate(unknowns)).values(), strict=True):
            np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-13 * np.abs(expected).max(), err_msg=kind)
        # Once all are formed they are taken from these.
        np.testing.assert_array_equal(law.tangent, whole.tangent)
        assert "_whole" in vars(law) and np.array_equal(law.take(pairs).tangent, whole.tangent[pairs])


def test_laws_of_some_pairs_take_the_room_of_these() -> None:
    model = build(FIELD.replace("count = 12", "count = 150").replace("12, 12", "50, 50"))
    laws = collect_laws(model, generate_mesh(model))
    memory, zeros = start_memory(laws), np.zeros(laws.count)
    law = defer_laws(laws, memory.modes, zeros - 1.0, zeros, memory, zeros, SCALE)
    some, most = measure_peak(lambda: law.take(np.arange(laws.count // 8)))
    whole, all_pairs = measure_peak(law.store)
    assert len(some.tangent) == laws.count // 8 and len(whole.tangent) == laws.count
    assert most < all_pairs / 4
