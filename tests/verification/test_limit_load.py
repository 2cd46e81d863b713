"""The largest loads that friction bears: blocks that slide or topple, by what tractions could balance and in runs."""

from __future__ import annotations

import pytest

from pbem.contact.laws import start_memory
from pbem.errors import ConvergenceError
from pbem.mesh.generate import generate_mesh
from pbem.model.build import parse_model
from pbem.parallel import world
from pbem.solve import march
from pbem.solve.assembly import assemble_problem
from pbem.solve.limit_load import find_balanced_fraction
from tests.verification.proofs.proof import write_case
from tests.verification.test_settling import BLOCKS, Listener, run


def write_pushed_block(shear: float, law: dict[str, float], unit: float = 1.0, shift: float = 0.0) -> str:
    """A block of 2 x 1 on another one, pressed by 1 and then pushed; unit: of lengths."""
    curves = {
        name: {**curve, "points": [(point + shift * (1 + 1j)) * unit for point in curve["points"]]}
        for name, curve in BLOCKS["curves"].items()
    }
    return write_case(
        BLOCKS | {
            "curves": curves,
            "interfaces": {"joint": {"law": "coulomb", **law}},
            "stages": [
                {"name": "press", "steps": 1, "boundary": {"top": {"tx": 0.0, "ty": -1.0}}},
                {"name": "push", "steps": 2, "boundary": {"top": {"tx": shear, "ty": -1.0}}},
            ],
        }
    )  # fmt: skip


def find(text: str, target: float = 1.0) -> float | None:
    model = parse_model(text)[1]
    problem = assemble_problem(model, generate_mesh(model), world)
    return find_balanced_fraction(problem, start_memory(problem.laws), 1, 0.0, target)


@pytest.mark.parametrize(("unit", "shift"), [(1.0, 0.0), (1e3, 1e3), (1e-3, 0.0)])
@pytest.mark.parametrize(
    ("law", "expected"),
    [
        ({"friction": 0.25}, 0.25),
        ({"friction": 0.25, "cohesion": 0.1}, 0.35),
        ({"friction": 0.25, "friction_dynamic": 0.1, "slip_distance": 1.0}, 0.25),
    ],
)
def test_the_push_that_friction_can_balance(law: dict[str, float], expected: float, unit: float, shift: float) -> None:
    assert find(write_pushed_block(0.7, law, unit, shift)) == pytest.approx(expected / 0.7, rel=1e-2)
    assert find(write_pushed_block(0.2, law, unit, shift)) == 1.0


def test_the_push_at_which_a_block_topples() -> None:
    # About an edge at half its width of 2, by a push at its height of 1: as large as the pressure.
    assert find(write_pushed_block(2.0, {"friction": 3.0})) == pytest.approx(0.5, rel=1e-2)
    # Where the faces hold together, nothing is the limit that they bear: 1 along the whole width.
    assert find(write_pushed_block(1.5, {"friction": 3.0, "cohesion": 9.0, "tensile_strength": 2.0})) == 1.0


def test_a_run_comes_to_its_limit_load_in_a_few_steps() -> None:
    listener = Listener()
    told = r"limit load reached at fraction 0\.3[45].*translation along x"
    with pytest.raises(ConvergenceError, match=told) as caught:
        run(write_pushed_block(0.7, {"friction": 0.25}), listener)
    assert caught.value.reason == "limit load"
    assert 1 <= len(listener.rejected) <= 4


def test_small_steps_that_fail_for_other_reasons_are_no_limit_load(monkeypatch: pytest.MonkeyPatch) -> None:
    # What forces could balance is then the whole step, however little it is more than what was reached.
    def fail(*_: object) -> None:
        raise ConvergenceError("mode cycle", "as it is made to")

    problem = parse_model(write_pushed_block(0.2, {"friction": 0.25}))[1]
    assembled = assemble_problem(problem, generate_mesh(problem), world)
    monkeypatch.setattr(march, "solve_step", fail)
    start = march.Start(2, 1, 0.499, start_memory(assembled.laws))
    with pytest.raises(ConvergenceError) as caught:
        next(march.march(assembled, Listener(), start))
    assert caught.value.reason == "mode cycle"
