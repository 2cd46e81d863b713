"""Curves that stay rigid, tractions with a given resultant, rigid tools of every shape, and point loads."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from pbem.results.reader import Results
from scripts.conditions.draft import Draft, Setting
from scripts.conditions.field import Elastic, Field
from scripts.conditions.place import Place
from scripts.conditions.trial import CONDITIONS, Figure, Trial, compare, condition, exact, inside, off

# A bar of the width 1 and the length 2 without contraction, held at y = 0: plane ends stay plane under N and M.
BAR = Elastic(1e3, 0.0)
AXIAL, MOMENT = -3.0, 0.2


def bend(axial: float, moment: float) -> Field:
    """u = -c y^2/2 + i (e y + c x y), x from the middle, with s_yy = N + 12 M x."""
    e, c = axial / BAR.young, 12 * moment / BAR.young
    return Field(BAR, np.array([[0, 0, -c / 2]]), np.array([[0, e], [0, c]]))


def forces(place: Place, axial: float, moment: float) -> dict[str, float]:
    unit = place.stress * place.size
    return {**place.pair(1j * axial, unit, "fx", "fy"), "moment": moment * unit * place.size}


def motions(place: Place, axial: float, moment: float) -> dict[str, float]:
    """Of the upper end of the bar, y = 2."""
    e, c = axial / BAR.young, 12 * moment / BAR.young
    return {**place.pair(complex(-2 * c, 2 * e), place.size, "ux", "uy"), "rotation": math.degrees(2 * c)}


def lay_bar(setting: Setting, elements: int = 3) -> Draft:
    draft = Draft(setting)
    draft.add_material("m", BAR)
    draft.add_polygon("bar", "m", [-0.5 + 0j, 0.5 + 0j, 0.5 + 2j, -0.5 + 2j], elements)
    draft["boundary"]["bar0"] = {"ux": 0.0, "uy": 0.0}
    return draft


def strength(setting: Setting) -> float:
    """The moment: bending is quadratic."""
    return MOMENT if setting.order > 1 else 0.0


def finish_bar(draft: Draft, moment: float, name: str = "", factor: float = 10.0) -> Trial:
    """The bar is bent, and the rigid body with the name has its force and motion."""
    setting, field = draft.setting, bend(AXIAL, moment)

    def check(results: Results) -> Iterator[Figure]:
        tolerance = exact(setting, factor)
        yield from compare(results, setting.place, {"bar": field}, tolerance)
        yield from inside(results, setting.place, field, [0.2 + 0.7j], tolerance)
        if name:
            body, place = results.rigid[name], setting.place
            unit = place.stress * place.size
            given = np.array(list(forces(place, AXIAL, moment).values())) / [unit, unit, unit * place.size]
            found = np.array(body.force[-1]) / [unit, unit, unit * place.size]
            yield Figure("force", off(found, given, abs(AXIAL)), tolerance)
            moved = np.array(body.motion[-1]) / [place.size, place.size, 1.0]
            exact_motion = np.array(list(motions(place, AXIAL, moment).values())) / [place.size, place.size, 1.0]
            yield Figure("motion", off(moved, exact_motion, np.abs(exact_motion).max()), tolerance)

    return Trial(draft.case(), check)


def enter_bar(name: str, end: str, known: str, **more: Any) -> None:
    """end: "rigid", "force", or "tool" (which sticks to the end); known: "forces", "motions" or "mixed"."""

    def make(setting: Setting) -> Trial:
        draft, place, moment = lay_bar(setting), setting.place, strength(setting)
        force, motion = forces(place, AXIAL, moment), motions(place, AXIAL, moment)
        given = {"forces": force, "motions": motion,
                 "mixed": {"fx": force["fx"], "uy": motion["uy"], "rotation": motion["rotation"]}}[known]
        if end == "tool":
            start, stop = more.get("ends", (-0.5 + 2j, 0.5 + 2j))
            draft.add_line("press", start, stop, elements=more.get("elements", 4))
            draft["tools"]["press"] = {**given, "about": place.at(2j)}
            draft["contacts"]["seat"] = {"between": more.get("between", ["bar2", "press"]), "friction": 0.6}
            return finish_bar(draft, moment, "press")
        draft["boundary"]["bar2"] = {end: given | ({"how": "linear"} if end == "force" else {})}
        return finish_bar(draft, moment, "bar2" if end == "rigid" else "")

    CONDITIONS[name] = make


enter_bar("rigid curve under forces", "rigid", "forces")
enter_bar("rigid curve that is moved", "rigid", "motions")
enter_bar("rigid curve, force and motions", "rigid", "mixed")
enter_bar("linear force", "force", "forces")
enter_bar("flat tool under forces", "tool", "forces")
enter_bar("flat tool that is moved", "tool", "motions")
enter_bar("flat tool of one element", "tool", "forces", elements=1)
enter_bar("wide tool of one element", "tool", "forces", elements=1, ends=(-2 + 2j, 1.5 + 2j))
enter_bar("wide tool, written the other way", "tool", "mixed", elements=2, ends=(3 + 2j, -1 + 2j),
          between=["press", "bar2"])  # fmt: skip


@condition("uniform force")
def uniform_force(setting: Setting) -> Trial:
    draft = lay_bar(setting)
    given = forces(setting.place, AXIAL, 0.0)
    del given["moment"]
    draft["boundary"]["bar2"] = {"force": given}
    return finish_bar(draft, 0.0)


@condition("two rigid curves as one body")
def two_curves(setting: Setting) -> Trial:
    """Two bars side by side under one beam; a force beside the middle: N = F (1/2 +- e/d), as bars only stretch."""
    place, apart = setting.place, 2.0
    draft = Draft(setting)
    draft.add_material("m", BAR)
    for name, x in (("a", -apart / 2), ("b", apart / 2)):
        draft.add_polygon(name, "m", [x - 0.5 + 0j, x + 0.5 + 0j, x + 0.5 + 2j, x - 0.5 + 2j])
        draft["boundary"][f"{name}0"] = {"ux": 0.0, "uy": 0.0}
    given = forces(place, AXIAL, 0.0)
    draft["boundary"]["a2"] = {"rigid": {"curves": ["b2"], **place.pair(0j, 1.0, "ux", "uy"), "rotation": 0.0}}
    if place.angle == 0:
        draft["boundary"]["a2"] = {"rigid": {"curves": ["b2"], "fx": 0.0, "fy": 2 * given["fy"], "rotation": 0.0}}
        field = bend(AXIAL, 0.0)
    else:
        moved = place.pair(2j * AXIAL / BAR.young, place.size, "ux", "uy")
        draft["boundary"]["a2"] = {"rigid": {"curves": ["b2"], **moved, "rotation": 0.0}}
        field = bend(AXIAL, 0.0)

    def check(results: Results) -> Iterator[Figure]:
        yield from compare(results, place, {"a": field, "b": field}, exact(setting, 10.0))
        unit = place.stress * place.size
        found = place.back(results.rigid["a2"].force[-1][:2]) / unit
        yield Figure("force", off(np.array(found), 2j * AXIAL, 6.0), exact(setting, 10.0))

    return Trial(draft.case(), check)


# -- tools and pins that touch in a part ---------------------------------------------------------------------------

STEEL = Elastic(1e3, 0.3)


def balance(
    results: Results, setting: Setting, curves: list[str], force: complex, tolerance: float
) -> Iterator[Figure]:
    """Reactions of curves against a force."""
    place = setting.place
    found = sum(place.back(results.reactions[name][-1]) for name in curves) / (place.stress * place.size)
    yield Figure("balance", abs(complex(found) + force) / abs(force), tolerance)


def lay_plate(setting: Setting, clearance: float, elements: int = 24) -> Draft:
    """A square plate with a hole of radius 1, and a pin in it that is smaller."""
    draft = Draft(setting)
    draft.add_material("m", STEEL)
    corners = [-3 - 3j, 3 - 3j, 3 + 3j, -3 + 3j]
    names = [draft.add_line(f"side{k}", corners[k], corners[(k + 1) % 4], elements=4) for k in range(4)]
    draft.add_circle("hole", 0j, 1.0, elements)
    draft.add_region("plate", "m", [*names, "hole"])
    for name in names:
        draft["boundary"][name] = {"ux": 0.0, "uy": 0.0}
    draft.add_circle("pin", 0j, 1.0 - clearance, elements)
    return draft


def enter_pin(name: str, direction: float, friction: float, clearance: float = 0.01, **more: Any) -> None:
    """A pin under a force, without a given rotation; direction (degrees) in the model's own axes."""

    def make(setting: Setting) -> Trial:
        draft, place = lay_plate(setting, clearance, more.get("elements", 24)), setting.place
        force = 5.0 * np.exp(1j * math.radians(direction))
        unit = place.stress * place.size
        draft["tools"]["pin"] = {**place.pair(complex(force), unit, "fx", "fy"), **more.get("given", {})}
        draft["contacts"]["seat"] = {"between": more.get("between", ["pin", "hole"]), "friction": friction}
        draft["analysis"]["steps"] = more.get("steps", 1)

        def check(results: Results) -> Iterator[Figure]:
            yield from balance(results, setting, [f"side{k}" for k in range(4)], complex(force), 5e-3)
            moved = complex(place.back(results.rigid["pin"].motion[-1][:2])) / place.size
            # By symmetry it moves along the force, by the clearance at least.
            side = abs((moved * np.exp(-1j * math.radians(direction))).imag)
            yield Figure("aside", side / abs(moved), 0.02)
            yield Figure("touches", clearance / abs(moved), 1.0)
            yield Figure("turned", abs(results.rigid["pin"].motion[-1][2]) / math.degrees(clearance), 0.05)

        return Trial(draft.case(), check, lacks=1e-2)

    CONDITIONS[name] = make


enter_pin("pin along an axis", 0.0, 0.0)
enter_pin("pin along an axis, with friction", 90.0, 0.3)
enter_pin("pin along a node", 7.5, 0.3, between=["hole", "pin"])
enter_pin("pin between nodes, in steps", 3.1, 0.2, steps=3)
enter_pin("pin of many elements along a node", 180.0, 0.4, elements=32)
enter_pin("pin with little clearance", 45.0, 0.3, 1e-4)
enter_pin("pin with given rotation", -90.0, 0.3, given={"rotation": 0.0})


def enter_round(name: str, elements: int, known: str, friction: float, steps: int = 2) -> None:
    """A round tool pressed on a block: what the tool bears is what the block's foot bears, alike on both sides."""

    def make(setting: Setting) -> Trial:
        draft, place = Draft(setting, steps), setting.place
        draft.add_material("m", STEEL)
        draft.add_polygon("block", "m", [-2 + 0j, 2 + 0j, 2 + 2j, -2 + 2j], 6)
        draft["curves"]["block2"]["elements"] = 24
        draft["boundary"]["block0"] = {"ux": 0.0, "uy": 0.0}
        radius = 6.0
        angle = math.degrees(place.angle)
        draft["curves"]["roll"] = {"center": place.at(2j + 1j * radius), "radius": radius * place.size,
                                   "angles": [250 + angle, 290 + angle], "elements": elements}
        unit = place.stress * place.size
        tip = place.at(2j)
        if known == "force":
            given = {**place.pair(-20j, unit, "fx", "fy"), "rotation": 0.0}
        else:
            given = {**place.pair(-0.02j, place.size, "ux", "uy"), "rotation": 0.0}
        draft["tools"]["roll"] = {**given, "about": tip}
        draft["contacts"]["seat"] = {"between": ["block2", "roll"], "friction": friction}

        def check(results: Results) -> Iterator[Figure]:
            body = results.rigid["roll"]
            force = complex(place.back(body.force[-1][:2])) / unit
            yield Figure("presses", 0.0 if force.imag < -1 else 1.0, 0.5)
            yield from balance(results, setting, ["block0"], force, 5e-3)
            yield Figure("aside", abs(force.real) / abs(force), 1e-3)
            moved = complex(place.back(body.motion[-1][:2])) / place.size
            yield Figure("moved aside", abs(moved.real) / abs(moved), 1e-2)
            pressure = results.contact["seat"].traction_n[-1]
            yield Figure("symmetry", off(pressure, pressure[::-1], float(np.abs(pressure).max())), 1e-5)

        return Trial(draft.case(), check, lacks=1e-2)

    CONDITIONS[name] = make


enter_round("round tool under a force", 20, "force", 0.0)
enter_round("round tool under a force, friction", 20, "force", 0.4)
enter_round("round tool that is moved", 12, "motion", 0.4)
enter_round("round tool of one element", 1, "motion", 0.0)
enter_round("round tool of one element under a force", 1, "force", 0.3, 1)


# -- point loads ------------------------------------------------------------------------------------------------------


def enter_point_load(name: str, at: complex, force: complex, moment: float = 0.0) -> None:
    """What holds a block bears its point load."""

    def make(setting: Setting) -> Trial:
        draft, place = Draft(setting), setting.place
        draft.add_material("m", STEEL)
        draft.add_polygon("block", "m", [-1 + 0j, 1 + 0j, 1 + 2j, -1 + 2j], 10)
        for k in range(4):
            draft["curves"][f"block{k}"]["grading"] = "auto"
        draft["boundary"]["block0"] = {"ux": 0.0, "uy": 0.0}
        unit = place.stress * place.size
        load = {"at": place.at(at), **place.pair(force, unit, "fx", "fy")}
        if moment:
            load["moment"] = moment * unit * place.size
        draft["point_loads"]["p"] = load

        def check(results: Results) -> Iterator[Figure]:
            tolerance = {1: 2e-2, 2: 1e-3, 3: 1e-3}[setting.order]
            assert results.balance is not None
            yield Figure("whole", float(results.balance.whole_relative[-1]), tolerance)
            if force:
                yield from balance(results, setting, ["block0"], force, tolerance)

        return Trial(draft.case(), check)

    CONDITIONS[name] = make


enter_point_load("point load inside", 0.3 + 1.2j, 1.0 - 2.0j)
enter_point_load("moment inside", 0.3 + 1.2j, 0j, 1.5)
enter_point_load("point load on a side", 1 + 1.1j, -1.0 - 0.5j)
enter_point_load("point load in a corner", 1 + 2j, -1.0 - 2j)
