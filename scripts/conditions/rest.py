"""Stress at rest, weight, heat and misfit, fluid in cracks, and points that choose the motion of free bodies."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from pbem.results.reader import Results
from scripts.conditions.draft import Draft, Setting
from scripts.conditions.field import ZERO, Elastic, Field, add, evaluate, linear, quadratic, stressed
from scripts.conditions.place import Complex, Real
from scripts.conditions.trial import CONDITIONS, Figure, Trial, compare, condition, exact, inside, off, own
from scripts.conditions.values import CORNERS, INSIDE, SIDES, SOFT, STRESSED, finish, lay_blocks, pressed

HEATED = Elastic(1e3, 0.3, expansion=1.2e-5)
HEATED_STRESSED = Elastic(700.0, 0.2, "stress", 1.2e-5)
AT_REST = (-2.0, -5.0, 0.7)
CRACK = (0.5 + 0.35j, 1.4 + 0.6j)


def plain(setting: Setting) -> Elastic:
    return STRESSED if setting.seed % 2 else SOFT


def still(material: Elastic, initial: tuple[Real, Real, Real]) -> Field:
    """No displacement, and a stress that is there."""
    return Field(material, ZERO, ZERO, initial=initial)


def uniform(stress: tuple[float, float, float]) -> tuple[Real, Real, Real]:
    return tuple(np.array([[each]]) for each in stress)  # type: ignore[return-value]


def add_rest(draft: Draft, field: Field, material: str = "m") -> None:
    """The stress at rest of a field, by numbers or expressions."""
    place = draft.place
    sxx, syy, sxy = (np.pad(each, ((0, 2 - each.shape[0]), (0, 2 - each.shape[1]))) for each in field.initial)
    parts: dict[str, Real] = {key: np.zeros((2, 2)) for key in ("sxx", "syy", "sxy")}
    for j, k in ((0, 0), (1, 0), (0, 1)):
        turned = place.stress_components((sxx[j, k], syy[j, k], sxy[j, k]))
        for key, value in turned.items():
            parts[key][j, k] = value
    varies = any(np.abs(values[1:]).max() or np.abs(values[0, 1:]).max() for values in parts.values())
    draft["initial_stress"][material] = {
        key: {"expression": place.text(values)} if varies else float(values[0, 0]) for key, values in parts.items()
    }


# Weight along -y, and horizontal stress half of the vertical one; both with a part that is uniform.
GROWING = (np.array([[-1.0, 0.4]]), np.array([[-2.0, 0.8]]), np.array([[0.3]]))


def enter_rest(
    name: str, initial: tuple[Real, Real, Real], give: Callable[[Draft, Field, int, str], None],
    moving: bool = False, rigid: bool = False,
) -> None:
    """Stress at rest in two blocks; moving: with a displacement beside."""

    def make(setting: Setting) -> Trial:
        material = plain(setting)
        field = still(material, initial)
        if moving:
            field = (quadratic if setting.order > 1 else linear)(material, setting.rng(name), initial=initial)
        draft = lay_blocks(setting, material, field.weight())
        add_rest(draft, field)
        for k, side in enumerate(SIDES):
            give(draft, field, k, side)
        return finish(draft, field, rigid=rigid)

    CONDITIONS[name] = make


def hold(draft: Draft, field: Field, k: int, side: str) -> None:
    draft.give(side, field, "u", "xy")


def load(draft: Draft, field: Field, k: int, side: str) -> None:
    draft.give(side, field, ("t", "tn")[k % 2], "xy")


def both(draft: Draft, field: Field, k: int, side: str) -> None:
    draft.give(side, field, ("u", "t", "un ts")[k % 3], "xy")


enter_rest("stress at rest, held all around", uniform(AT_REST), hold)
enter_rest("stress at rest, loaded all around", uniform(AT_REST), load, rigid=True)
enter_rest("stress at rest that grows", GROWING, both)
enter_rest("stress at rest that grows, loaded all around", GROWING, load, rigid=True)


@condition("stress at rest that is set free")
def stress_set_free(setting: Setting) -> Trial:
    """A free body loses the stress and takes the strain of its opposite."""
    material = plain(setting)
    field = stressed(material, (2.0, 5.0, -0.7), initial=uniform(AT_REST))
    draft = lay_blocks(setting, material)
    add_rest(draft, field)

    def check(results: Results) -> Iterator[Figure]:
        fields = {"low": field, "up": field}
        yield from compare(results, setting.place, fields, exact(setting), stress=5.0, rigid=True)
        yield from inside(results, setting.place, field, INSIDE, exact(setting), scale=5.0)

    return Trial(draft.case(), check)


@condition("stress at rest beside a moving field")
def stress_at_rest_and_loads(setting: Setting) -> Trial:
    """The load grows from the stress at rest, in two steps."""
    material = plain(setting)
    field = linear(material, setting.rng("rest"), initial=uniform(AT_REST))
    draft = lay_blocks(setting, material, steps=2)
    add_rest(draft, field)
    rest = still(material, field.initial)
    for k, side in enumerate(SIDES):
        draft.give(side, field, ("u", "t")[k % 2], "xy")
    stages = []
    for number, given in enumerate((rest, field)):
        stage = Draft(setting)
        stage.lines = draft.lines
        for k, side in enumerate(SIDES):
            stage.give(side, given, ("u", "t")[k % 2], "xy")
        stages.append({"name": f"stage{number}", "steps": 2, "boundary": stage["boundary"]})
    draft.tables["stages"] = stages

    def check(results: Results) -> Iterator[Figure]:
        for step, factor in ((2, 0.5), (3, 1.0)):
            yield from compare(results, setting.place, {"low": field, "up": field}, exact(setting), factor, step)
        for name in ("low", "up"):
            u = results.displacement[1][own(results, name)] / setting.place.size
            yield Figure("u at rest", float(np.abs(u).max()) / (5.0 / material.young), exact(setting))

    return Trial(draft.case(), check)


@condition("weight and rollers")
def weight_and_rollers(setting: Setting) -> Trial:
    """A column under its weight between rollers: u = -w y (2 h - y)/(2 M)."""
    material = plain(setting)
    modulus, weight, height = material.lame + 2 * material.shear, 0.8, 1.5
    field = Field(material, ZERO, -weight / modulus * np.array([[0, height, -0.5]]))
    draft = Draft(setting)
    draft.add_material("m", material, 2.0)
    low = draft.add_polygon("column", "m", [0j, 1 + 0j, 1 + height * 1j, height * 1j])
    unit = 0.5 * setting.place.stress / setting.place.size
    draft["gravity"].update(setting.place.pair(-1j * weight, unit, "gx", "gy"))
    draft["boundary"].update({low[0]: {"un": 0.0}, low[1]: {"un": 0.0}, low[3]: {"un": 0.0}})

    def check(results: Results) -> Iterator[Figure]:
        tolerance = exact(setting) if setting.order > 1 else 0.1
        yield from compare(results, setting.place, {"column": field}, tolerance)

    return Trial(draft.case(), check)


# -- heat and misfit --------------------------------------------------------------------------------------------------


def warm(setting: Setting) -> Elastic:
    return HEATED_STRESSED if setting.seed % 2 else HEATED


def free_growth(material: Elastic, temperature: Real) -> Field:
    """Displacement of a body that is free to take the strain of a temperature that is linear in x and y."""
    a, b, c = (float(add(temperature, np.zeros((2, 2)))[jk]) for jk in ((0, 0), (1, 0), (0, 1)))
    factor = material.expansion * (1 + material.poisson if material.plane == "strain" else 1.0)
    ux = factor * np.array([[0, 0, -b / 2], [a, c, 0], [b / 2, 0, 0]])
    uy = factor * np.array([[0, a, c / 2], [0, b, 0], [-c / 2, 0, 0]])
    return Field(material, ux, uy, temperature)


def add_heat(draft: Draft, field: Field) -> None:
    text = {"expression": draft.place.text(field.temperature)}
    number = float(field.temperature[0, 0])
    for region in ("low", "up"):
        draft["temperature"][region] = text if field.temperature.size > 1 else number


def enter_heat(name: str, temperature: Real, held: bool) -> None:
    def make(setting: Setting) -> Trial:
        material = warm(setting)
        heat = temperature if setting.order > 1 else temperature[:1, :1]
        field = free_growth(material, heat)
        if held:
            still_ = Field(material, ZERO, ZERO, heat)
            field = still_ if setting.order < 2 else quadratic(material, setting.rng(name), temperature=heat)
        draft = lay_blocks(setting, material, field.weight())
        add_heat(draft, field)
        if held:
            for k, side in enumerate(SIDES):
                draft.give(side, field, ("u", "un ts", "t")[k % 3], "xy")
        scale = material.young * material.expansion * 100

        def check(results: Results) -> Iterator[Figure]:
            fields = {"low": field, "up": field}
            yield from compare(results, setting.place, fields, exact(setting), stress=scale, rigid=not held)
            yield from inside(results, setting.place, field, INSIDE, exact(setting), scale=scale)

        return Trial(draft.case(), check)

    CONDITIONS[name] = make


enter_heat("heat, free", np.array([[100.0]]), False)
enter_heat("heat that varies, free", np.array([[80.0, -30.0], [20.0, 0.0]]), False)
enter_heat("heat, held", np.array([[100.0]]), True)
enter_heat("heat that varies, held", np.array([[80.0, -30.0], [20.0, 0.0]]), True)


@condition("heat and stress at rest that balance")
def heat_against_rest(setting: Setting) -> Trial:
    """Held all around: the stress at rest is taken away by heat, all tractions end as zero."""
    material = warm(setting)
    heat = np.array([[-100.0]])
    hot = Field(material, ZERO, ZERO, heat)
    pressure = -float(hot.stress()[0][0, 0])
    field = Field(material, ZERO, ZERO, heat, initial=uniform((pressure, pressure, 0.0)))
    draft = lay_blocks(setting, material)
    add_heat(draft, field)
    add_rest(draft, field)
    for side in SIDES:
        draft["boundary"][side] = {"ux": 0.0, "uy": 0.0}

    def check(results: Results) -> Iterator[Figure]:
        fields = {"low": field, "up": field}
        yield from compare(results, setting.place, fields, exact(setting), stress=abs(pressure))

    return Trial(draft.case(), check)


# -- fluid in cracks --------------------------------------------------------------------------------------------------


def add_crack(draft: Draft, **law: object) -> None:
    draft.add_line("crack", *CRACK, elements=6)
    draft["regions"]["low"]["cracks"] = ["crack"]
    draft["interfaces"]["crack"] = law


def check_crack(results: Results, tolerance: float, length: float, normal: float | Complex) -> Iterator[Figure]:
    crack = results.contact["crack"]
    yield Figure("opening", float(np.abs(crack.opening[-1]).max()) / length, tolerance)
    yield Figure("slip", float(np.abs(crack.slip[-1]).max()) / length, tolerance)
    yield Figure("fluid", off(crack.traction_n[-1], normal, float(np.abs(normal).max())), tolerance)


def enter_fluid(name: str, gradient: float, how: str, **law: object) -> None:
    """Equal pressure in all directions; the fluid in a crack has the same, so that its faces do not move."""

    def make(setting: Setting) -> Trial:
        grows = gradient if setting.order > 1 else 0.0
        field = pressed(setting, (0.0, grows))
        draft = lay_blocks(setting, field.material, field.weight())
        for k, side in enumerate(SIDES):
            draft.give(side, field, ("u", "tn")[k % 2], "xy")
        add_crack(draft, **law)
        values = -field.stress()[0]
        draft["interfaces"]["crack"]["pressure"] = draft.value("crack", values, "t", how)

        def check(results: Results) -> Iterator[Figure]:
            fields = {"low": field, "up": field}
            yield from compare(results, setting.place, fields, exact(setting, 10))
            z = setting.place.local(results.contact["crack"].position)
            length = setting.place.size * 1.0 / field.material.young
            normal = -evaluate(values, z) * setting.place.stress
            yield from check_crack(results, exact(setting, 10), length, normal)
            root = setting.place.stress * setting.place.size**0.5
            tips = results.tips["crack"]
            for factor in ("KI", "KII"):
                yield Figure(factor, float(np.abs(getattr(tips, factor)[-1]).max()) / root, exact(setting, 10))

        return Trial(draft.case(), check)

    CONDITIONS[name] = make


enter_fluid("fluid in an open crack", 0.0, "number", law="open")
enter_fluid("fluid in a crack by y", 0.3, "xy", law="open")
enter_fluid("fluid in a crack by s", 0.3, "s", law="open")
enter_fluid("fluid in a crack by table", 0.3, "table", friction=0.3)
enter_fluid("fluid in closed faces too", 0.0, "number", friction=0.3, pressurised="all")


@condition("a crack that stays closed")
def closed_crack(setting: Setting) -> Trial:
    """Friction holds what the stress at rest and a load drive."""
    material = plain(setting)
    field = stressed(material, (-1.0, -2.0, 0.1), initial=uniform(AT_REST))
    draft = lay_blocks(setting, material)
    add_rest(draft, field)
    for k, side in enumerate(SIDES):
        draft.give(side, field, ("u", "tn")[k % 2], "xy")
    add_crack(draft, friction=0.9)

    def check(results: Results) -> Iterator[Figure]:
        yield from compare(results, setting.place, {"low": field, "up": field}, exact(setting, 10))
        crack = results.contact["crack"]
        yield Figure("sticks", float((crack.mode[-1] != 0).sum()), 0.5)

    return Trial(draft.case(), check)


# -- points -----------------------------------------------------------------------------------------------------------


def enter_supports(name: str, at: dict[str, tuple[complex, str]], moved: bool = False) -> None:
    """A free body takes the motion that points have in the field; moved: with a rigid motion besides."""

    def make(setting: Setting) -> Trial:
        material = plain(setting)
        field = (quadratic if setting.order > 1 else linear)(material, setting.rng("supports"))
        draft = lay_blocks(setting, material, field.weight())
        for k, side in enumerate(SIDES):
            draft.give(side, field, ("t", "tn")[k % 2], "xy")
        for point, (z, keys) in at.items():
            u = complex(field.displacement_at(np.array([z]))[0])
            pair = setting.place.pair(u, setting.place.size, "ux", "uy")
            draft["point_supports"][point] = {"at": setting.place.at(z), **{key: pair[key] for key in keys.split()}}

        def check(results: Results) -> Iterator[Figure]:
            yield from compare(results, setting.place, {"low": field, "up": field}, exact(setting, 30))
            for point in at:
                reaction = np.abs(results.reactions[point][-1]).max() / (setting.place.stress * setting.place.size)
                largest = max(np.abs(each).max() for each in field.stress())
                yield Figure("reaction", float(reaction) / largest, exact(setting, 30))

        return Trial(draft.case(), check)

    CONDITIONS[name] = make


enter_supports("point supports in corners", {"p": (CORNERS[0], "ux uy"), "q": (CORNERS[1], "uy")})
enter_supports("point supports on sides", {"p": (1 + 0.05j, "ux uy"), "q": (2.05 + 0.55j, "ux")})
enter_supports("point supports on a seam", {"p": (CORNERS[2], "ux uy"), "q": (CORNERS[3], "uy")})
enter_supports("point supports within a seam", {"p": (0.6 + 0.925j, "ux uy"), "q": (CORNERS[0], "ux")})
