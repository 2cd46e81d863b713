"""What is said of a trace holds for its pieces, t12.1, t12.2, ..., but for what is said of a single one."""

from __future__ import annotations

from typing import Any

import pytest

from pbem.description.case import Case
from pbem.errors import CaseError
from pbem.model.build import build_model


def make(**tables: Any) -> Case:
    curves = {f"t12.{k}": {"points": [[k, 0], [k + 1, 0.1 * k**2]], "elements": 3} for k in (1, 2, 10)}
    curves["t12.2"]["points"] = [[2, 0.1], [3, 0.4]]
    return Case(
        materials={"rock": {"young": 100.0, "poisson": 0.2}}, curves=curves,
        regions={"plane": {"material": "rock", "infinite": True, "cracks": list(curves)}},
        remote={"syy": -1.0}, **tables,
    )  # fmt: skip


def test_a_law_of_a_trace_is_that_of_its_pieces_but_for_the_keys_that_they_name() -> None:
    case = make(interfaces={"t12": {"friction": 0.6, "cohesion": 0.1}, "t12.2": {"friction": 0.3}})
    laws = build_model(case).interfaces
    assert [(laws[name].law.friction, laws[name].law.cohesion) for name in ("t12.1", "t12.2", "t12.10")] == [
        (0.6, 0.1), (0.3, 0.1), (0.6, 0.1),
    ]
    assert case.families == {"t12": ("t12.1", "t12.2", "t12.10")}


def test_pressures_of_stages_spread_too() -> None:
    case = make(stages=[{"steps": 1, "interfaces": {"t12": {"pressure": 2.0}, "t12.10": {"pressure": 3.0}}}])
    assert dict(build_model(case).stages[0].pressure) == {"t12.1": 2.0, "t12.2": 2.0, "t12.10": 3.0}


def test_a_fault_of_a_piece_is_told_where_it_stands() -> None:
    with pytest.raises(CaseError) as caught:
        build_model(make(interfaces={"t12": {"friction": 0.5, "cohesion": 0.1, "tensile_strength": 9.0}}))
    assert {fault.place for fault in caught.value.faults} == {"interfaces.t12.tensile_strength"}


@pytest.mark.parametrize("own", [{"friction": 0.6}, {"friction_angle": 31.0}, {"cohesion": 0.5},
                                 {"friction": {"expression": "0.1 + s"}}])  # fmt: skip
def test_friction_of_a_piece_of_a_frictionless_trace_is_refused(own: dict[str, Any]) -> None:
    """The piece kept the law of the trace, and its friction had no effect."""
    (key,) = own
    with pytest.raises(CaseError) as caught:
        build_model(make(interfaces={"t12": {"law": "frictionless"}, "t12.2": own}))
    assert [fault.place for fault in caught.value.faults] == [f'interfaces."t12.2".{key}']
    law = build_model(make(interfaces={"t12": {"law": "frictionless"}, "t12.2": {"law": "coulomb", **own}}))
    assert law.interfaces["t12.2"].law.friction or law.interfaces["t12.2"].law.cohesion
    smooth = build_model(make(interfaces={"t12": {"law": "coulomb", **own}, "t12.2": {"law": "frictionless"}}))
    assert smooth.interfaces["t12.2"].law.friction == smooth.interfaces["t12.2"].law.cohesion == 0.0


def test_a_piece_may_change_one_of_two_keys_that_go_together() -> None:
    """Its table was refused as one that has one of them alone."""
    weak = {"friction": 0.6, "friction_dynamic": 0.3, "slip_distance": 1e-3}
    laws = build_model(make(interfaces={
        "t12": weak, "t12.1": {"friction_dynamic": 0.2}, "t12.2": {"slip_distance": 2e-3}})).interfaces
    found = [(laws[f"t12.{k}"].law.friction_dynamic, laws[f"t12.{k}"].law.slip_distance) for k in (1, 2, 10)]
    assert found == [(0.2, 1e-3), (0.3, 2e-3), (0.3, 1e-3)]
    with pytest.raises(CaseError, match=r'interfaces\."t12\.1"\.friction_dynamic: found only friction_dynamic'):
        build_model(make(interfaces={"t12": {"friction": 0.6}, "t12.1": {"friction_dynamic": 0.2}}))
    case = Case(
        materials={"rock": {"young": 100.0, "poisson": 0.2}}, regions={"plane": {"material": "rock", "infinite": True}},
        generate=[{"kind": "cracks", "name": "slip", "region": "plane", "count": 2, "elements": 4, "half_length": 1.0,
                   "density": 0.01, "distance": 0.5, **weak}],
        interfaces={"slip_2": {"friction_dynamic": 0.1}}, remote={"syy": -1.0},
    )  # fmt: skip
    assert [build_model(case).interfaces[f"slip_{k}"].law.friction_dynamic for k in (1, 2)] == [0.3, 0.1]


def test_a_trace_without_pieces_is_unknown() -> None:
    with pytest.raises(CaseError, match=r"interfaces\.t13: found unknown interface or crack 't13'"):
        build_model(make(interfaces={"t13": {"friction": 0.5}}))


def test_conditions_of_a_line_are_those_of_its_curves() -> None:
    corners = {"side.1": [[0, 0], [1, 0]], "side.2": [[1, 0], [1, 1]], "rest": [[1, 1], [0, 1], [0, 0]]}
    case = Case(
        materials={"rock": {"young": 100.0, "poisson": 0.2}},
        curves={name: {"points": points, "elements": 4} for name, points in corners.items()},
        regions={"body": {"material": "rock", "boundary": list(corners)}},
        boundary={"side": {"ux": 0.0, "uy": 0.0}, "side.2": {"uy": 0.5, "ux": 0.0}},
    )
    values = build_model(case).stages[0].boundary
    assert values["side.1"] == (0.0, 0.0) and values["side.2"] == (0.0, 0.5)


def test_inclusions_of_one_table_are_heated_by_its_name() -> None:
    def make_grains(**tables: Any) -> Case:
        return Case(
            materials={"rock": {"young": 100.0, "poisson": 0.2},
                       "ice": {"young": 9.0, "poisson": 0.3, "expansion": 5e-5}},
            regions={"plane": {"material": "rock", "infinite": True}},
            generate=[{"kind": "inclusions", "name": "grain", "region": "plane", "material": "ice", "count": 3,
                       "elements": 8, "radius": 1.0, "density": 0.01, "distance": 0.5}], **tables,
        )  # fmt: skip

    case = make_grains(temperature={"grain": 10.0, "grain_2": 4.0}, stages=[
        {"steps": 1}, {"steps": 1, "temperature": {"grain": 20.0}, "eigenstrain": {"grain": {"exy": 1e-3}}}])
    first, second = build_model(case).stages
    warm = 1.3 * 5e-5
    swollen = [first.swelling[f"grain_{k}"].strain[0] for k in (1, 2, 3)]
    assert swollen == pytest.approx([10 * warm, 4 * warm, 10 * warm])
    assert [second.swelling[f"grain_{k}"].strain[2] for k in (1, 2, 3)] == [1e-3] * 3
    assert second.swelling["grain_2"].strain[0] == pytest.approx(20 * warm)
    with pytest.raises(CaseError) as caught:
        build_model(make_grains(temperature={"grain": {"expression": "x*x"}}))
    assert [fault.path for fault in caught.value.faults] == [("temperature", "grain")]
    with pytest.raises(CaseError, match=r"unknown region 'grains'"):
        build_model(make_grains(temperature={"grains": 1.0}))


def test_a_curve_beside_another_one_shares_no_law_by_its_name() -> None:
    curves = {"t": [[0, 0], [1, 0]], "t.1": [[0, 3], [1, 3]]}
    case = Case(
        materials={"rock": {"young": 100.0, "poisson": 0.2}},
        curves={name: {"points": points, "elements": 4} for name, points in curves.items()},
        regions={"plane": {"material": "rock", "infinite": True, "cracks": list(curves)}},
        interfaces={"t": {"friction": 0.6, "friction_dynamic": 0.3, "slip_distance": 1e-3},
                    "t.1": {"friction": 0.5, "friction_dynamic": 0.1}},
        remote={"syy": -1.0},
    )  # fmt: skip
    with pytest.raises(CaseError, match=r'interfaces\."t\.1"\.friction_dynamic: found only friction_dynamic'):
        build_model(case)


WEAK = {"friction": 0.6, "friction_dynamic": 0.3, "slip_distance": 1e-3}


@pytest.mark.parametrize(("trace", "own", "key", "what"), [
    (WEAK, {"friction": 0.2}, "friction", "friction_dynamic = 0.3 above the static friction of 0.2"),
    (WEAK, {"friction": 0.2, "gap": 0.1}, "", "friction_dynamic = 0.3 above the static friction of 0.2"),
    (WEAK, {"friction": {"expression": "0.2 + 0*s"}}, "friction", "friction_dynamic above the static friction at"),
    ({"friction": 0.5, "dilation_angle": 20.0}, {"friction_angle": 5.0}, "friction_angle", "dilation_angle = 20 on"),
    ({"friction": 0.5, "cohesion": 2.0, "tensile_strength": 2.0}, {"cohesion": 0.1}, "cohesion", "tensile_strength ="),
    ({"cohesion": 1.0, "cohesion_lost": True}, {"cohesion": 0.0}, "cohesion", "cohesion_lost on faces without"),
])  # fmt: skip
def test_a_fault_that_a_piece_causes_is_told_at_its_own_key(
    trace: dict[str, Any], own: dict[str, Any], key: str, what: str
) -> None:
    """The keys of the trace, which are right by themselves, were said to be wrong, without the name of the piece."""
    build_model(make(interfaces={"t12": trace}))
    with pytest.raises(CaseError) as caught:
        build_model(make(interfaces={"t12": trace, "t12.2": own, "t12.10": {"gap": 0.05}}))
    (fault,) = caught.value.faults
    assert fault.place == 'interfaces."t12.2"' + (f".{key}" if key else "")
    assert what in fault.found and "with what is said of 't12'" in fault.found


@pytest.mark.parametrize("every", [False, True])
def test_a_fault_of_a_trace_is_told_there_whatever_its_pieces_say(every: bool) -> None:
    wrong = {"friction": 0.3, "friction_dynamic": 0.4, "slip_distance": 1e-3}
    pieces = {f"t12.{k}": {"gap": 0.1} for k in ((1, 2, 10) if every else (2,))}
    with pytest.raises(CaseError) as caught:
        build_model(make(interfaces={"t12": wrong, **pieces}))
    assert {fault.place for fault in caught.value.faults} == {"interfaces.t12.friction_dynamic"}
