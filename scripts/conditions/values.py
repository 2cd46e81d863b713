"""Displacements, tractions, pressures and springs along outer curves, by numbers, expressions and tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pbem.results.reader import Results
from scripts.conditions.draft import Draft, Setting
from scripts.conditions.field import Elastic, Field, add, linear, quadratic, times
from scripts.conditions.place import Real
from scripts.conditions.trial import CONDITIONS, Figure, Trial, compare, condition, exact, inside

SOFT = Elastic(1e3, 0.3)
STRESSED = Elastic(700.0, 0.2, "stress")
CORNERS = (0j, 2 + 0.1j, 2.1 + 1j, 0.1 + 0.9j, 1.9 + 2j, -0.1 + 1.8j)
INSIDE = [0.7 + 0.5j, 1.2 + 1.4j]
# Outer sides of the two bodies, all but the seam between them.
SIDES = ("foot", "right_low", "left_low", "right_up", "head", "left_up")


def lay_blocks(setting: Setting, material: Elastic, weight: complex = 0j, steps: int = 1) -> Draft:
    """Two blocks on each other, bonded along the line "seam", without right angles."""
    draft = Draft(setting, steps)
    draft.add_material("m", material, 1.0 if weight else 0.0)
    a, b, c, d, e, f = CORNERS
    draft.add_line("foot", a, b)
    draft.add_line("right_low", b, c)
    draft.add_line("seam", c, d, elements=4)
    draft.add_line("left_low", d, a)
    draft.add_line("right_up", c, e)
    draft.add_line("head", e, f)
    draft.add_line("left_up", f, d)
    draft.add_region("low", "m", ["foot", "right_low", "seam", "left_low"])
    draft.add_region("up", "m", ["right_up", "head", "left_up", "seam"])
    if weight:
        draft["gravity"].update(setting.place.pair(weight, setting.place.stress / setting.place.size, "gx", "gy"))
    return draft


def field_of(setting: Setting, name: str, lowest: bool = False) -> Field:
    """A field of the elements' order; lowest: of degree 1."""
    material = STRESSED if setting.seed % 2 else SOFT
    make = linear if setting.order < 2 or lowest else quadratic
    return make(material, setting.rng(name))



def finish(draft: Draft, field: Field, rigid: bool = False, factor: float = 1.0) -> Trial:
    """The blocks have the field."""
    setting = draft.setting

    def check(results: Results) -> Iterator[Figure]:
        tolerance = exact(setting, factor)
        yield from compare(results, setting.place, {"low": field, "up": field}, tolerance, rigid=rigid)
        yield from inside(results, setting.place, field, INSIDE, tolerance)

    return Trial(draft.case(), check)


def enter(name: str, how: Sequence[tuple[str, str]], lowest: bool = False) -> None:
    """A condition on every outer side in turn; how: (what, how) as of `Draft.give`."""

    def make(setting: Setting) -> Trial:
        field = field_of(setting, name, lowest)
        draft = lay_blocks(setting, field.material, field.weight())
        for k, side in enumerate(SIDES):
            draft.give(side, field, *how[k % len(how)])
        return finish(draft, field)

    CONDITIONS[name] = make


enter("displacement by x and y", [("u", "xy"), ("un", "xy")])
enter("displacement by s", [("u", "s"), ("un", "s"), ("t", "s")])
enter("displacement by table", [("u", "table"), ("un", "table")], lowest=True)
enter("traction by x and y", [("u", "xy"), ("t", "xy"), ("tn", "xy")])
enter("traction by s", [("u", "xy"), ("tn", "s"), ("t", "s")])
enter("mixed directions", [("un ts", "xy"), ("tn us", "s"), ("u", "xy")])


@condition("traction by table")
def tractions_by_table(setting: Setting) -> Trial:
    """Tractions are linear in s, which tables are, too."""
    field = field_of(setting, "traction by table")
    draft = lay_blocks(setting, field.material, field.weight())
    for k, side in enumerate(SIDES):
        draft.give(side, field, *[("u", "s"), ("t", "table"), ("tn", "table")][k % 3])
    return finish(draft, field)


@condition("traction by number, free body")
def tractions_by_number(setting: Setting) -> Trial:
    """Nothing holds the bodies; the loads balance."""
    field = field_of(setting, "traction by number", lowest=True)
    draft = lay_blocks(setting, field.material)
    for side in SIDES:
        draft.give(side, field, ("t", "tn")[len(side) % 2], "number")
    return finish(draft, field, rigid=True)


@condition("displacement by number")
def displacement_by_number(setting: Setting) -> Trial:
    """Ends that move as a whole, and sides with the uniform stress."""
    draft = Draft(setting)
    material = STRESSED if setting.seed % 2 else SOFT
    slope, strain = setting.rng("number").uniform(-1e-3, 1e-3, 2)
    field = Field(material, np.array([[0, slope]]), np.array([[0, strain]]))
    draft.add_material("m", material)
    names = draft.add_polygon("block", "m", [0j, 2 + 0j, 2.3 + 1j, 0.2 + 1j])
    for k, name in enumerate(names):
        draft.give(name, field, ("u", "t", "un", "tn")[k], "number")

    def check(results: Results) -> Iterator[Figure]:
        yield from compare(results, setting.place, {"block": field}, exact(setting))
        yield from inside(results, setting.place, field, [1 + 0.5j], exact(setting))

    return Trial(draft.case(), check)


@condition("values by time")
def values_by_time(setting: Setting) -> Trial:
    """Displacements and tractions in proportion to t squared, at every step."""
    field = field_of(setting, "time", lowest=True)
    draft = lay_blocks(setting, field.material, steps=4)
    for k, side in enumerate(SIDES):
        draft.give(side, field, *[("u", "xy"), ("tn", "s")][k % 2], time="t**2")

    def check(results: Results) -> Iterator[Figure]:
        for step, time in enumerate((0.25, 0.5, 0.75, 1.0)):
            fields = {"low": field, "up": field}
            yield from compare(results, setting.place, fields, exact(setting), time**2, step)

    return Trial(draft.case(), check)


# -- pressures --------------------------------------------------------------------------------------------------------


def pressed(setting: Setting, gradient: tuple[float, float]) -> Field:
    """Equal pressure in all directions in the plane, -p0 - gx x - gy y."""
    material = STRESSED if setting.seed % 2 else SOFT
    c = -1.0 / (2 * (material.lame + material.shear))
    gx, gy = gradient
    # ux,x = uy,y = c (p0 + gx x + gy y), ux,y + uy,x = 0
    ux = c * np.array([[0, 0, -gx / 2], [1.0, gy, 0], [gx / 2, 0, 0]])
    uy = c * np.array([[0, 1.0, gy / 2], [0, gx, 0], [-gy / 2, 0, 0]])
    return Field(material, ux, uy)


def enter_pressure(name: str, gradient: tuple[float, float], how: str) -> None:
    def make(setting: Setting) -> Trial:
        field = pressed(setting, gradient if setting.order > 1 else (0.0, 0.0))
        draft = lay_blocks(setting, field.material, field.weight())
        for side in SIDES[1:]:
            values = add(-draft.polynomials(field, side, "tn")[0])
            draft["boundary"][side] = {"pressure": draft.value(side, values, "t", how)}
        draft.give("foot", field, "u", "xy")
        return finish(draft, field)

    CONDITIONS[name] = make


enter_pressure("pressure by number", (0.0, 0.0), "number")
enter_pressure("hydrostatic pressure by y", (0.0, 0.3), "xy")
enter_pressure("hydrostatic pressure by table", (0.2, -0.3), "table")


# -- springs ----------------------------------------------------------------------------------------------------------


def add_springs(draft: Draft, field: Field, stiffness: dict[str, Real], beside: str, how: str) -> None:
    """Springs under sides of the blocks whose forces and displacements are those of the field.

    beside: what makes up for the difference, "tn" or "t" (tractions) or "end" (the far ends move).
    """
    kn, ks = stiffness["kn"], stiffness["ks"]
    for side in SIDES[::2]:
        (un, us), (tn, ts) = draft.polynomials(field, side, "un"), draft.polynomials(field, side, "tn")
        spring = {"kn": draft.value(side, kn, "k", how), "ks": draft.value(side, ks, "k", how)}
        given = draft["boundary"].setdefault(side, {})
        given["spring"] = spring
        if beside == "end":
            # tn = -kn (un - end)
            given["end_n"] = draft.value(side, add(un, tn / kn[0, 0]), "u", "xy")
            given["end_s"] = draft.value(side, add(us, ts / ks[0, 0]), "u", "s")
            continue
        more = (add(tn, times(kn, un)), add(ts, times(ks, us)))
        if beside == "tn":
            given["tn"], given["ts"] = (draft.value(side, each, "t", "xy") for each in more)
        else:
            axis = draft.normal(side) * draft.place.turn
            x, y = axis.real, axis.imag
            given["tx"] = draft.value(side, add(x * more[0], -y * more[1]), "t", "xy")
            given["ty"] = draft.value(side, add(y * more[0], x * more[1]), "t", "xy")
    for side in SIDES[1::2]:
        draft.give(side, field, "t", "xy")


def enter_springs(name: str, beside: str, varying: bool) -> None:
    def make(setting: Setting) -> Trial:
        field = field_of(setting, name, lowest=varying)
        draft = lay_blocks(setting, field.material, field.weight())
        e = field.material.young
        stiffness = {"kn": np.array([[0.3 * e]]), "ks": np.array([[0.1 * e]])}
        if varying:
            stiffness = {"kn": e * np.array([[0.5, 0.1], [0.1, 0.0]]), "ks": e * np.array([[0.5, -0.1], [0.1, 0.0]])}
        add_springs(draft, field, stiffness, beside, "xy" if varying else "number")
        return finish(draft, field, factor=10.0)

    CONDITIONS[name] = make


enter_springs("springs beside tractions tn, ts", "tn", False)
enter_springs("springs beside tractions tx, ty", "t", False)
enter_springs("springs with moved ends", "end", False)
enter_springs("springs that vary", "tn", True)


@condition("springs under a pressed block")
def springs_under_a_block(setting: Setting) -> Trial:
    """A block between springs and a uniform pressure, rollers beside it."""
    material = STRESSED if setting.seed % 2 else SOFT
    modulus, pressure, stiffness = material.lame + 2 * material.shear, 3.0, 150.0
    field = Field(material, np.zeros((1, 1)), np.array([[-pressure / stiffness, -pressure / modulus]]))
    draft = Draft(setting)
    draft.add_material("m", material)
    foot, right, head, left = draft.add_polygon("block", "m", [0j, 2 + 0j, 2 + 1j, 1j])
    draft["boundary"].update({
        foot: {"spring": {"kn": stiffness * setting.place.stress / setting.place.size}},
        right: {"un": 0.0}, left: {"un": 0.0}, head: {"pressure": pressure * setting.place.stress},
    })  # fmt: skip

    def check(results: Results) -> Iterator[Figure]:
        yield from compare(results, setting.place, {"block": field}, exact(setting, 10.0))

    return Trial(draft.case(), check)
