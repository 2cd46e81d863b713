"""Smooth loads, strengths, gaps and springs that are narrower than the elements that were asked for: their resultants,
and what the user is told."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import pbem
from pbem.model.build import build_model
from pbem.solve.problem.step import SilentReporter

pytestmark = pytest.mark.usefixtures("without_errors")

Tables = dict[str, Any]


class Notes(SilentReporter):
    """Keeps them."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def note(self, text: str) -> None:
        self.texts.append(text)


def write_gauss(middle: float, width: float, unit: float, factor: str = "1") -> Tables:
    return {"expression": f"{factor} * exp(-((x - {middle * unit}) / {width * unit})**2)"}


def press_block(load: Tables, order: int, elements: int, unit: float = 1.0, **curve: Any) -> Tables:
    """A block on its lower side, 4 by 2, under a pressure on its upper one."""
    corners = [[0.0, 0.0], [4 * unit, 0.0], [4 * unit, 2 * unit], [0.0, 2 * unit]]
    curves: Tables = {side: {"points": [corners[k], corners[(k + 1) % 4]], "elements": elements}
                      for k, side in enumerate("brtl")}
    curves["t"] |= curve
    return {"materials": {"m": {"young": 1e3, "poisson": 0.3}}, "curves": curves,
            "regions": {"r": {"material": "m", "boundary": list(curves)}},
            "boundary": {"b": {"ux": 0.0, "uy": 0.0}, "t": {"pressure": load}},
            "analysis": {"steps": 1, "order": order}}  # fmt: skip


def integrate(middle: float, width: float) -> float:
    """From 0 to 4."""
    return 0.5 * math.sqrt(math.pi) * width * (math.erf((4 - middle) / width) + math.erf(middle / width))


@pytest.mark.parametrize(("middle", "width", "order", "elements", "unit"), [
    (1.7, 0.1, 2, 8, 1.0), (2.03, 0.1, 1, 8, 1e3), (1.234, 0.02, 2, 8, 1e-3), (2.0, 0.3, 3, 8, 1.0),
    (2.9, 0.1, 2, 1, 1.0), (0.0, 0.05, 2, 4, 1.0), (3.3, 0.7, 1, 5, 1.0),
])  # fmt: skip
def test_the_resultant_of_a_narrow_load(
    middle: float, width: float, order: int, elements: int, unit: float, tmp_path: Path
) -> None:
    """On the elements that are asked for it was 2 to 100 % off."""
    case = press_block(write_gauss(middle, width, unit), order, elements, unit)
    results = pbem.run(pbem.Case(**case), tmp_path / "block.h5")
    found = results.reactions["b"][-1, 1] / unit
    assert found == pytest.approx(integrate(middle, width), rel=0.01)


def test_a_load_that_grows_and_moves_with_time(tmp_path: Path) -> None:
    load = {"expression": "t * exp(-((x - 1 - 2 * t) / 0.1)**2)"}
    results = pbem.run(pbem.Case(**press_block(load, 2, 8) | {"analysis": {"steps": 2}}), tmp_path / "block.h5")
    assert results.reactions["b"][:, 1] == pytest.approx(
        [0.5 * integrate(2.0, 0.1), integrate(3.0, 0.1)], rel=0.01)


def test_a_load_that_moves_by_more_than_an_element_in_a_step(tmp_path: Path) -> None:
    """In the middle and at the end of the stage alone its resultants were 7 to 124 % of the exact ones."""
    load = {"expression": "exp(-((x - 4 * t) / 0.05)**2)"}
    results = pbem.run(pbem.Case(**press_block(load, 2, 8) | {"analysis": {"steps": 8}}), tmp_path / "block.h5")
    exact = [integrate(0.5 * step, 0.05) for step in range(1, 9)]
    assert results.reactions["b"][:, 1] == pytest.approx(exact, rel=0.01)


def part_blocks(load: Tables, between: list[str], lower: int, upper: int, unit: float, **curve: Any) -> Tables:
    """Two blocks, 4 by 2, held on their far sides, a tenth apart, with a fluid between."""
    case: Tables = press_block(load, 2, lower, unit)
    high = 2.1 * unit
    above = press_block(load, 2, upper, unit)["curves"]
    for side, table in above.items():
        case["curves"]["u" + side] = {**table, "points": [[x, y + high] for x, y in table["points"]]}
    case["curves"]["ub"] |= curve
    case["regions"]["u"] = {"material": "m", "boundary": list("u" + side for side in "brtl")}
    case["boundary"] = {"b": {"ux": 0.0, "uy": 0.0}, "ut": {"ux": 0.0, "uy": 0.0}}
    case["contacts"] = {"c": {"between": between, "law": "coulomb", "friction": 0.0, "pressure": load}}
    return case


@pytest.mark.parametrize(("turned", "lower", "upper", "unit", "along"), [
    (False, 8, 8, 1.0, False), (True, 8, 8, 1e3, False), (False, 30, 6, 1.0, False), (True, 30, 6, 1e-3, False),
    (False, 5, 30, 1.0, True), (True, 5, 30, 1.0, True),
])  # fmt: skip
def test_the_resultants_of_a_fluid_on_a_short_part_of_a_contact(
    turned: bool, lower: int, upper: int, unit: float, along: bool, tmp_path: Path
) -> None:
    """With elements halved on the first curve alone they were a tenth."""
    load = {"expression": f"exp(-((s - {1.7 * unit}) / {0.1 * unit})**2)"} if along else write_gauss(1.7, 0.1, unit)
    between = ["ub", "t"] if turned else ["t", "ub"]
    results = pbem.run(pbem.Case(**part_blocks(load, between, lower, upper, unit)), tmp_path / "blocks.h5")
    found = [results.reactions[side][-1, 1] / unit for side in ("b", "ut")]
    assert found == pytest.approx([integrate(1.7, 0.1), -integrate(1.7, 0.1)], rel=0.01)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_factors_under_a_fluid_on_a_short_part_of_a_crack(order: int, tmp_path: Path) -> None:
    """By the weight function of Griffith's crack."""
    case: Tables = {
        "materials": {"m": {"young": 1e3, "poisson": 0.3}},
        "curves": {"c": {"points": [[-1.0, 0.0], [1.0, 0.0]], "elements": 8}},
        "regions": {"r": {"material": "m", "infinite": True, "cracks": ["c"]}},
        "interfaces": {"c": {"law": "open", "pressure": write_gauss(0.3, 0.04, 1.0)}},
        "analysis": {"steps": 1, "order": order},
    }
    results = pbem.run(pbem.Case(**case), tmp_path / "crack.h5")
    found = np.sort(np.asarray(results.tips["c"].KI)[-1])
    exact = [quad(lambda x, s=s: math.exp(-(((x - 0.3) / 0.04) ** 2)) * math.sqrt((1 + s * x) / (1 - s * x)),
                  0.1, 0.5)[0] / math.sqrt(math.pi) for s in (-1, 1)]  # fmt: skip
    assert found == pytest.approx(exact, rel=0.02)


def test_what_is_left_as_it_is_is_told(tmp_path: Path) -> None:
    """A grading of the user's; a curve that would get too many elements; neither where the elements are good."""

    def list_notes(load: Tables, **curve: Any) -> list[str]:
        notes = Notes()
        pbem.run(pbem.Case(**press_block(load, 2, 8, **curve)), tmp_path / "b.h5", force=True, reporter=notes)
        return [text for text in notes.texts if "oad varies" in text or "oads vary" in text]

    case = part_blocks(write_gauss(1.7, 0.1, 1.0), ["t", "ub"], 30, 6, 1.0, grading="none")
    notes = Notes()
    pbem.run(pbem.Case(**case), tmp_path / "b.h5", force=True, reporter=notes)
    assert any("oads vary within" in text and "'ub' by " in text and "'t'" not in text for text in notes.texts)
    narrow, wild = write_gauss(1.7, 0.2, 1.0), {"expression": "1 + sin(400 * x)"}
    assert [text[:50] for text in list_notes(narrow)] == ["Elements added where a load varies within one: 't'"]
    for load, curve in ((narrow, {"grading": "none"}), (wild, {})):
        told, = list_notes(load, **curve)
        assert told.startswith("Loads vary within elements by more than these can follow") and "'t' by " in told
    jump = list_notes({"expression": "tanh((x - 1.7) / 1e-5)"})
    assert len(jump) == 2 and "'t' by " in jump[1]
    assert not list_notes({"expression": "x**2 + 3 * x + sin(x)"}) and not list_notes(write_gauss(2.0, 2.0, 1.0))


@pytest.mark.parametrize(("middle", "width", "order", "elements"), [
    (1.7, 0.1, 2, 8), (1.234, 0.02, 1, 6), (2.9, 0.05, 3, 3),
])  # fmt: skip
@pytest.mark.parametrize("moved", [False, True])
def test_the_resultant_of_soft_springs_on_a_short_part(
    middle: float, width: float, order: int, elements: int, moved: bool, tmp_path: Path
) -> None:
    """Whose ends are moved there alone, or that are stiff there alone; the block yields by 1e-5 of that. They were 90
    to 100 % off."""
    narrow = {"expression": f"0.01 * exp(-((x - {middle}) / {width})**2)"}
    springs = {"spring": {"kn": 0.01}, "end_n": narrow} if moved else {"spring": {"kn": narrow}, "end_n": 0.01}
    case = press_block({}, order, elements)
    case["boundary"]["t"] = springs
    results = pbem.run(pbem.Case(**case), tmp_path / "block.h5")
    assert results.reactions["b"][-1, 1] == pytest.approx(-1e-4 * integrate(middle, width), rel=0.01)


def lay_blocks(law: Tables, matching: bool, lower: int, upper: int, unit: float, push: float) -> Tables:
    """Two blocks without Poisson's ratio, 4 by 2 each, one on the other, pressed together by a strain of 1e-3."""
    case = part_blocks({}, ["t", "ub"], lower, upper, unit)
    for table in case["curves"].values():
        table["points"] = [[x, y - 0.1 * unit if y > 2.05 * unit else y] for x, y in table["points"]]
    case["materials"]["m"]["poisson"] = 0.0
    case["boundary"]["ut"] = {"ux": push * unit, "uy": -4e-3 * unit}
    case["contacts"] = {"c": {"between": ["t", "ub"], "law": "coulomb", **law}}
    if matching:
        del case["curves"]["ub"], case["contacts"]
        case["regions"]["u"]["boundary"].remove("ub")
        case["regions"]["u"]["boundary"].append("t")
        case["interfaces"] = {"t": {"law": "coulomb", **law}}
    return case


def test_springs_on_a_curve_named_as_a_table(tmp_path: Path) -> None:
    case = press_block({"expression": "1 + 0 * x"}, 2, 4)
    case["curves"] = {("contacts" if name == "t" else name): curve for name, curve in case["curves"].items()}
    case["regions"]["r"]["boundary"] = list(case["curves"])
    case["boundary"] = {"b": {"ux": 0.0, "uy": 0.0},
                        "contacts": {"spring": {"kn": {"expression": "1e3 * (1 + x)"}}, "end_n": 1e-3}}
    results = pbem.run(pbem.Case(**case), tmp_path / "block.h5")
    assert results.status == "finished"
    np.testing.assert_allclose(results.reactions["b"][-1] + results.reactions["contacts"][-1], 0.0, atol=1e-4)


@pytest.mark.parametrize(("elements", "order", "tips"), [
    (20, 2, True), (12, 1, True), (8, 3, True), (2, 1, False), (2, 2, False),
])  # fmt: skip
def test_a_gap_like_the_root_of_the_distance_adds_no_elements_at_tips(elements: int, order: int, tips: bool) -> None:
    """Whose jumps are that root there, if they have elements of their own; two elements without them are too few."""
    built = build_model(pbem.Case(**{
        "materials": {"m": {"young": 1e3, "poisson": 0.2}},
        "curves": {"crack": {"points": [[-1, 0], [1, 0]], "elements": elements}},
        "regions": {"plane": {"material": "m", "cracks": ["crack"], "infinite": True}},
        "interfaces": {"crack": {"friction": 0.1, "gap": {"expression": "-1e-3*sqrt(1 - x**2)"}}},
        "analysis": {"steps": 1, "order": order, "tips": tips},
    }))  # fmt: skip
    assert (sum(leg.elements for leg in built.curves["crack"].legs) == elements) is tips


@pytest.mark.parametrize(("key", "matching", "lower", "upper", "unit"), [
    ("friction", True, 8, 8, 1.0), ("friction", False, 6, 14, 1e3), ("cohesion", False, 14, 6, 1e-3),
    ("gap", True, 8, 8, 1e-3), ("gap", False, 6, 14, 1.0),
])  # fmt: skip
def test_the_resultants_of_a_strength_or_a_gap_on_a_short_part(
    key: str, matching: bool, lower: int, upper: int, unit: float, tmp_path: Path
) -> None:
    """They were none, or twice as large. By Betti's theorem a gap between faces that stay closed takes its volume times
    the pressure under which the blocks would yield by one length."""
    size = {"friction": 1e-3, "cohesion": 1e-3, "gap": -4e-5 * unit}[key]
    law = {"friction": 0.0, key: write_gauss(1.234, 0.06, unit, repr(size))}
    case = lay_blocks(law, matching, lower, upper, unit, 0.1 if key != "gap" else 0.0)
    found = pbem.run(pbem.Case(**case), tmp_path / "blocks.h5").reactions["ut"][-1] / unit
    narrow = integrate(1.234, 0.06)
    if key == "gap":
        assert found[1] + 4.0 == pytest.approx(-1e-2 * narrow, rel=0.02)
    else:
        assert found[0] == pytest.approx(1e-3 * narrow, rel=0.02)


def test_strengths_and_gaps_that_the_elements_follow_add_none(tmp_path: Path) -> None:
    notes = Notes()
    law = {"friction": {"expression": "0.3 + 0.005 * sin(50 * x)"}, "gap": {"expression": "-1e-3 * x * (4 - x)"}}
    pbem.run(pbem.Case(**lay_blocks(law, False, 8, 8, 1.0, 0.0)), tmp_path / "b.h5", reporter=notes)
    assert not [text for text in notes.texts if "varies" in text or "vary" in text]
    wild = {"friction": {"expression": "0.3 + 0.2 * sin(400 * x)"}}
    pbem.run(pbem.Case(**lay_blocks(wild, False, 8, 8, 1.0, 0.0)), tmp_path / "c.h5", reporter=notes)
    told, = [text for text in notes.texts if "varies" in text or "vary" in text]
    assert told.startswith("Loads, strengths, gaps or springs vary within elements") and "'t' by " in told


def test_a_load_at_another_place_in_each_of_many_steps(tmp_path: Path) -> None:
    """More than a curve has elements for: what it gets serves all the same, and what is left is told. Of 150 steps
    100 are looked at."""
    notes = Notes()
    case = press_block({"expression": "exp(-((x - 4 * t) / 0.02)**2)"}, 2, 4) | {"analysis": {"steps": 20}}
    results = pbem.run(pbem.Case(**case), tmp_path / "block.h5", reporter=notes)
    exact = [integrate(0.2 * step, 0.02) for step in range(1, 21)]
    assert results.reactions["b"][:, 1] == pytest.approx(exact, rel=0.25)
    assert any("Elements added" in text for text in notes.texts)
    assert any(text.startswith("Loads vary within elements") for text in notes.texts)
    for steps, told in ((100, False), (150, True)):
        model = build_model(pbem.Case(**case | {"analysis": {"steps": steps}}))
        assert any("after 100 of their load steps" in text for text in model.notes) == told


@pytest.mark.parametrize(("width", "elements"), [(0.02, 8), (0.3, 6)])
def test_a_load_that_moves_in_many_small_steps_is_borne_in_each(width: float, elements: int, tmp_path: Path) -> None:
    """Of what acts at the nodes, however little it differs from what acted before. It ended as "singular tangent"."""
    sides = {"below": (0, 4), "right": (4, 4 + 2j), "above": (4 + 2j, 2j), "left": (2j, 0)}
    case = {
        "materials": {"m": {"young": 1000.0, "poisson": 0.25}},
        "curves": {name: {"points": [[z.real, z.imag] for z in map(complex, ends)], "elements": elements,
                          "grading": "none"} for name, ends in sides.items()},
        "regions": {"block": {"material": "m", "boundary": list(sides)}},
        "boundary": {"below": {"ux": 0.0, "uy": 0.0},
                     "above": {"pressure": {"expression": f"exp(-((x - 4*t)/{width})**2)"}}},
        "analysis": {"steps": 150},
    }  # fmt: skip
    results = pbem.run(case, tmp_path / "moving.h5")
    borne, acting = results.reactions["below"], results.reactions["above"]
    assert np.abs(acting[:, 1]).max() > 0.3 * width
    np.testing.assert_allclose(borne, -acting, rtol=0, atol=2e-3 * np.abs(acting).max())


@pytest.mark.parametrize("load", [
    write_gauss(1.7, 0.2, 1.0), {"table": [[0, 1], [1.7, 1], [1.700001, 2], [4, 2]]}, write_gauss(1.7, 5.0, 1.0),
])  # fmt: skip
def test_stages_whose_loads_the_mesh_of_a_file_does_not_follow_are_not_added(load: Tables, tmp_path: Path) -> None:
    """With that reason: they were taken for another case. Others are."""
    case = press_block({"expression": "1"}, 2, 8) | {"analysis": {}}
    stages: list[Tables] = [{"steps": 1}, {"steps": 1, "boundary": {"t": {"pressure": load}}}]
    path = tmp_path / "block.h5"
    pbem.run(pbem.Case(**case, stages=stages[:1]), path)
    if "5.0" in str(load):
        results = pbem.run(pbem.Case(**case, stages=stages), path, resume=True)
        assert results.reactions["b"][-1, 1] == pytest.approx(integrate(1.7, 5.0), rel=0.01)
        return
    with pytest.raises(pbem.ResultFileError, match=r"loads of the added stages .*'t' \d+ in place of 8; run without"):
        pbem.run(pbem.Case(**case, stages=stages), path, resume=True)
    case["boundary"]["t"]["pressure"] = {"expression": "2"}
    with pytest.raises(pbem.ResultFileError, match="another case"):
        pbem.run(pbem.Case(**case, stages=stages), path, resume=True)
