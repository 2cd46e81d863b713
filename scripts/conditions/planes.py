"""Infinite regions: stress far away, holes and inclusions, cracks that feel nothing, press fits, and families of
generated cracks and inclusions."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from pbem.results.reader import Results
from scripts.conditions.draft import Draft, Setting
from scripts.conditions.field import ZERO, Elastic, Field, stressed
from scripts.conditions.rest import AT_REST, add_rest, still, uniform
from scripts.conditions.trial import CONDITIONS, Check, Figure, Trial, condition, drop_motion, exact, inside, off, own

ROCK = Elastic(1e3, 0.25)
FAR = (-1.0, 0.5, 0.3)
# Circles are no polynomials: what is exact is known to the mesh.
CURVED = {1: 2e-2, 2: 2e-4, 3: 1e-4}
CORNERS = (-1 - 0.6j, 1.2 - 0.8j, 0.9 + 0.7j, -0.8 + 1j)


def far(setting: Setting, stress: tuple[float, float, float]) -> dict[str, float]:
    return setting.place.stress_components(stress)


def lay_plane(setting: Setting, **remote: float) -> Draft:
    draft = Draft(setting)
    draft.add_material("rock", ROCK)
    if remote:
        draft.tables["remote"] = dict(remote)
    return draft


def check_uniform(
    setting: Setting, field: Field, regions: list[str], points: list[complex], scale: float, factor: float = 1.0
) -> Check:
    """Displacements up to a rigid motion, tractions at nodes and stress inside, in all regions."""

    def check(results: Results) -> Iterator[Figure]:
        place, tolerance = setting.place, exact(setting, 10.0 * factor)
        yield from inside(results, place, field, points, tolerance, scale=scale)
        for name in regions:
            nodes = own(results, name)
            z = place.local(results.nodes.position[nodes])
            u = place.back(results.displacement[-1][nodes]) / place.size
            t = place.back(results.traction[-1][nodes]) / place.stress
            normal = place.back(results.nodes.normal[nodes])
            yield Figure(f"t {name}", off(t, field.traction_at(z, normal), scale), tolerance)
            left = drop_motion(z, u - field.displacement_at(z))
            yield Figure(f"u {name}", float(np.abs(left).max()) / (scale / ROCK.young), tolerance)

    return check


def enter_plane(name: str, what: str) -> None:
    """A polygonal inclusion or hole in a plane under a uniform stress that it does not disturb."""

    def make(setting: Setting) -> Trial:
        draft = lay_plane(setting, **far(setting, FAR))
        field = stressed(ROCK, FAR)
        sides = [draft.add_line(f"side{k}", CORNERS[k], CORNERS[(k + 1) % 4], elements=4) for k in range(4)]
        draft.add_region("plane", "rock", sides, infinite=True)
        regions = ["plane"]
        if what == "inclusion":
            draft.add_region("core", "rock", sides)
            regions.append("core")
        else:
            for side in sides:
                # The hole's own normal points into it.
                normal = -draft.normal(side)
                x, y = field.traction(-normal)
                text = draft.place
                traction = -complex(x[0, 0], y[0, 0])
                turned = traction * text.turn * text.stress
                draft["boundary"][side] = {"tx": turned.real, "ty": turned.imag}
        points = [2 + 0.5j, -0.5 - 1.9j] + ([0.2 + 0.1j] if what == "inclusion" else [])
        return Trial(draft.case(), check_uniform(setting, field, regions, points, 1.0))

    CONDITIONS[name] = make


enter_plane("inclusion of the plane's own material", "inclusion")
enter_plane("hole under the stress of the plane", "hole")


@condition("cracks along principal stress")
def cracks_along(setting: Setting) -> Trial:
    """Open cracks along the direction of a tension carry nothing and disturb nothing."""
    draft = lay_plane(setting, **far(setting, (2.0, 0.0, 0.0)))
    draft.add_line("one", -1 + 0j, 1 + 0j, elements=6)
    draft.add_line("two", 0.5 + 0.8j, 1.7 + 0.8j, elements=5)
    draft.add_region("plane", "rock", [], infinite=True, cracks=["one", "two"])
    draft["interfaces"]["one"] = {"law": "open"}
    field = stressed(ROCK, (2.0, 0.0, 0.0))

    def check(results: Results) -> Iterator[Figure]:
        tolerance, place = exact(setting, 10.0), setting.place
        yield from inside(results, place, field, [0.3 + 0.4j, -2 + 1j], tolerance)
        for name in ("one", "two"):
            jump = np.hypot(results.contact[name].opening[-1], results.contact[name].slip[-1]) / place.size
            yield Figure(f"jump {name}", float(jump.max()) / (2.0 / ROCK.young), tolerance)
            for factor in (results.tips[name].KI, results.tips[name].KII):
                root = place.stress * place.size**0.5
                yield Figure("K", float(np.abs(factor[-1]).max()) / root, tolerance)

    return Trial(draft.case(), check)


@condition("crack under tension")
def crack_under_tension(setting: Setting) -> Trial:
    """KI = s sqrt(pi a)."""
    draft = lay_plane(setting, **far(setting, (0.0, 1.0, 0.0)))
    draft.add_line("crack", -1 + 0j, 1 + 0j, elements=8)
    draft.add_region("plane", "rock", [], infinite=True, cracks=["crack"])

    def check(results: Results) -> Iterator[Figure]:
        root = setting.place.stress * (np.pi * setting.place.size) ** 0.5
        yield Figure("KI", off(results.tips["crack"].KI[-1], root, root), {1: 1e-2}.get(setting.order, 1e-6))
        yield Figure("KII", off(results.tips["crack"].KII[-1], 0.0, root), {1: 1e-2}.get(setting.order, 1e-6))

    return Trial(draft.case(), check, lacks=1e-2)


@condition("stress at rest in a plane")
def rest_in_a_plane(setting: Setting) -> Trial:
    """A full tunnel in a plane at rest, with a crack beside it that sticks: nothing moves."""
    draft = Draft(setting)
    draft.add_material("rock", ROCK)
    draft.add_circle("wall", 0j, 1.0, 12)
    draft.add_line("crack", 1.5 - 0.5j, 2.2 + 0.9j, elements=6)
    draft.add_region("plane", "rock", ["wall"], infinite=True, cracks=["crack"])
    draft.add_region("core", "rock", ["wall"])
    draft["interfaces"]["crack"] = {"friction": 0.8}
    field = still(ROCK, uniform(AT_REST))
    add_rest(draft, field, "rock")
    points = [0.2 + 0.3j, 1.7 - 0.6j]
    check = check_uniform(setting, field, ["plane", "core"], points, 5.0)
    return Trial(draft.case(), check)


@condition("stress at rest in a plane that grows")
def growing_rest_in_a_plane(setting: Setting) -> Trial:
    """The same with weight; the tunnel is dug in the next stage, and its wall is free of traction."""
    draft = Draft(setting)
    draft.add_material("rock", ROCK, 1.0)
    sides = [draft.add_line(f"side{k}", CORNERS[k], CORNERS[(k + 1) % 4], elements=4) for k in range(4)]
    draft.add_region("plane", "rock", sides, infinite=True)
    draft.add_region("core", "rock", sides)
    weight = 0.5
    unit = setting.place.stress / setting.place.size
    draft["gravity"].update(setting.place.pair(-1j * weight, unit, "gx", "gy"))
    field = Field(ROCK, ZERO, ZERO, initial=(np.array([[-3.0, 0.2]]), np.array([[-5.0, weight]]), ZERO))
    add_rest(draft, field, "rock")
    draft.tables["stages"] = [{"name": "rest", "steps": 1}, {"name": "dig", "steps": 1, "remove": ["core"]}]

    def check(results: Results) -> Iterator[Figure]:
        place, tolerance = setting.place, exact(setting, 10.0)
        yield from inside(results, place, field, [0.2 + 0.1j, 2 + 0.5j], tolerance, step=0, scale=5.0)
        moved = np.abs(results.displacement[0] @ [1, 1j]).max() / place.size
        yield Figure("u at rest", float(moved) / (5.0 / ROCK.young), tolerance)
        t = results.traction[1][own(results, "plane")] @ [1, 1j] / place.stress
        yield Figure("wall", float(np.abs(t).max()) / 5.0, tolerance)

    return Trial(draft.case(), check)


@condition("press fit of a ring on a shaft")
def press_fit(setting: Setting) -> Trial:
    """Lame, plane stress: outlines that overlap."""
    bore, fit, outside, depth = 0.5, 1.0, 1.6, 1e-4
    steel, brass = Elastic(2e3, 0.3, "stress"), Elastic(1e3, 0.25, "stress")
    draft = Draft(setting)
    draft.add_material("steel", steel)
    draft.add_material("brass", brass)
    count = 48
    for name, radius in (("bore", bore), ("shaft", fit + depth), ("hole", fit), ("outside", outside)):
        draft.add_circle(name, 0.3 - 0.2j, radius, count)
    draft.add_region("shaft", "steel", ["bore", "shaft"])
    draft.add_region("ring", "brass", ["hole", "outside"])
    allowed = 2 * depth * setting.place.size
    draft["contacts"]["fit"] = {"between": ["shaft", "hole"], "friction": 0.2, "overlap": allowed}
    soft = fit * ((fit**2 + bore**2) / (fit**2 - bore**2) - steel.poisson) / steel.young
    soft += fit * ((outside**2 + fit**2) / (outside**2 - fit**2) + brass.poisson) / brass.young
    pressure = depth / soft

    def check(results: Results) -> Iterator[Figure]:
        found = results.contact["fit"].traction_n[-1] / setting.place.stress
        yield Figure("pressure", off(found, -pressure, pressure), {1: 5e-2, 2: 1e-3, 3: 1e-3}[setting.order])

    return Trial(draft.case(), check, lacks=1e-2)


# -- families ---------------------------------------------------------------------------------------------------------


def enter_family(name: str, table: dict[str, Any], stage: dict[str, Any] | None = None) -> None:
    """Random inclusions or cracks that the stress of the plane does not feel, as they are of its material, or stick."""

    def make(setting: Setting) -> Trial:
        place = setting.place
        draft = lay_plane(setting, **far(setting, (-3.0, -2.0, 0.2)))
        sides = ("region", "name", "kind", "count", "elements", "seed")
        sizes = ("radius", "half_length", "distance")
        lengths = {key: value * place.size for key, value in table.items() if key in sizes}
        x, y = place.at(0j)
        draft.tables["generate"] = [{
            **{key: value for key, value in table.items() if key in sides or key in ("material", "law", "friction")},
            **lengths, "density": 0.05 / place.size**2, "center": [x, y], "region": "plane",
        }]  # fmt: skip
        draft.add_region("plane", "rock", [], infinite=True)
        if stage is not None:
            draft.tables["stages"] = [{"name": "one", "steps": 1}, {"name": "two", "steps": 1, **stage}]
        field = stressed(ROCK, (-3.0, -2.0, 0.2))

        def check(results: Results) -> Iterator[Figure]:
            tolerance = exact(setting, 30.0) if table["kind"] == "cracks" else CURVED[setting.order]
            yield from inside(results, place, field, [30 + 0j, -25 + 20j], tolerance)
            step = 0 if stage is not None else -1
            names = list(results.contact)
            yield Figure("count", abs(len(names) - table["count"]), 0.5)
            for each in names:
                jump = np.hypot(results.contact[each].opening[step], results.contact[each].slip[step]) / place.size
                yield Figure("jump", float(jump.max()) / (3.0 / ROCK.young), tolerance)

        return Trial(draft.case(), check, lacks=1e-2)

    CONDITIONS[name] = make


CRACKS = {"kind": "cracks", "name": "c", "count": 6, "elements": 4, "half_length": 1.0, "distance": 0.5,
          "friction": 0.9}  # fmt: skip
enter_family("generated cracks that stick", CRACKS)
enter_family("generated inclusions", {"kind": "inclusions", "name": "g", "count": 4, "elements": 8, "radius": 0.8,
                                      "distance": 0.5, "material": "rock"})  # fmt: skip
enter_family("generated cracks, closed by a stage", CRACKS, {"close": ["c"]})
