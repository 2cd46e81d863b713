"""Construction in stages: faces that open, close and follow their law again, regions that are taken away, and what
conditions, supports and loads do before and after."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from pbem.results.reader import Results
from scripts.conditions.draft import Draft, Setting
from scripts.conditions.field import ZERO, Elastic, Field
from scripts.conditions.rest import add_rest, still, uniform
from scripts.conditions.trial import Figure, Trial, condition, exact, off, own

# Without contraction: free sides disturb no tension along the height.
CORK = Elastic(1e3, 0.0)
PULL, SHEAR = 2.0, 0.5


def lay_stack(setting: Setting, count: int = 2, law: dict[str, Any] | None = None, material: Elastic = CORK) -> Draft:
    """Layers b0, b1, ... of 2 by 1 on each other with joints j1, j2, ...; the sides are free, the foot is b0_foot."""
    draft = Draft(setting)
    draft.add_material("m", material, 1.0)
    for k in range(count + 1):
        name = "foot" if k == 0 else "head" if k == count else f"j{k}"
        draft.add_line(name, 1j * k, 2 + 1j * k)
    for k in range(count):
        right = draft.add_line(f"right{k}", 2 + 1j * k, 2 + 1j * (k + 1))
        left = draft.add_line(f"left{k}", 1j * (k + 1), 1j * k)
        low = "foot" if k == 0 else f"j{k}"
        high = "head" if k == count - 1 else f"j{k + 1}"
        draft.add_region(f"b{k}", "m", [low, right, high, left])
    for k in range(1, count):
        if law is not None:
            draft["interfaces"][f"j{k}"] = dict(law)
    return draft


def add_stages(draft: Draft, *stages: dict[str, Any]) -> None:
    draft.tables["stages"] = [{"name": f"stage {k}", "steps": 1, **stage} for k, stage in enumerate(stages)]


def load(setting: Setting, curve: str, **local: float) -> dict[str, Any]:
    """A condition in a stage: tx, ty or ux, uy in the model's own axes and units."""
    place = setting.place
    given: dict[str, float] = {}
    for unit, x, y in ((place.stress, "tx", "ty"), (place.size, "ux", "uy")):
        if x in local or y in local:
            given |= place.pair(complex(local.get(x, 0.0), local.get(y, 0.0)), unit, x, y)
    return {curve: given}


def expect(
    results: Results, setting: Setting, region: str, step: int, shift: complex, slope: complex, name: str,
    scale: float = PULL / 1e3,
) -> Iterator[Figure]:
    """u = shift + slope y in a region at a step."""
    nodes = own(results, region)
    z = setting.place.local(results.nodes.position[nodes])
    u = setting.place.back(results.displacement[step][nodes]) / setting.place.size
    yield Figure(f"{name}: u {region}", off(u, shift + slope * z.imag, scale), exact(setting, 30.0))


def expect_stress(
    results: Results, setting: Setting, point: complex, step: int, stress: Sequence[float], name: str,
    scale: float = PULL,
) -> Iterator[Figure]:
    found = results.evaluate([setting.place.at(point)], steps=[step]).stress[0, 0]
    exact_stress = np.array(list(setting.place.stress_components((stress[0], stress[1], stress[2])).values()))
    yield Figure(f"{name}: stress", off(found, exact_stress, scale * setting.place.stress), exact(setting, 30.0))


HELD = {"foot": {"ux": 0.0, "uy": 0.0}}
STRAIN = 1j * PULL / CORK.young


@condition("stages: open under tension")
def open_under_tension(setting: Setting) -> Trial:
    """Half of the stress is left half of the way, then none; the upper layer goes with the top."""
    draft = lay_stack(setting)
    draft["boundary"].update({**HELD, **load(setting, "head", uy=0.0)})
    add_stages(draft, {"boundary": load(setting, "head", uy=2 * STRAIN.imag)}, {"open": ["j1"], "steps": 2})

    def check(results: Results) -> Iterator[Figure]:
        for step, share in enumerate((1.0, 0.5, 0.0)):
            yield from expect(results, setting, "b0", step, 0j, share * STRAIN, f"step {step}")
            yield from expect(results, setting, "b1", step, 2 * (1 - share) * STRAIN, share * STRAIN, f"step {step}")
            yield from expect_stress(results, setting, 1 + 0.5j, step, (0, share * PULL, 0), f"step {step}")

    return Trial(draft.case(), check)


@condition("stages: close a gap")
def close_a_gap(setting: Setting) -> Trial:
    """The gap stays when the top is pressed back."""
    draft = lay_stack(setting, law={"law": "coulomb", "friction": 0.3})
    draft["boundary"].update({**HELD, **load(setting, "head", uy=0.0)})
    lift = 3 * STRAIN
    add_stages(draft, {"boundary": load(setting, "head", uy=lift.imag)}, {"close": ["j1"]},
               {"boundary": load(setting, "head", uy=lift.imag - 2 * STRAIN.imag), "steps": 2})

    def check(results: Results) -> Iterator[Figure]:
        for step in (0, 1):
            yield from expect(results, setting, "b0", step, 0j, 0j, f"step {step}")
            yield from expect(results, setting, "b1", step, lift, 0j, f"step {step}")
        yield from expect(results, setting, "b0", 3, 0j, -STRAIN, "pressed")
        yield from expect(results, setting, "b1", 3, lift, -STRAIN, "pressed")
        opening = results.contact["j1"].opening[-1] / setting.place.size
        yield Figure("opening", off(opening, lift.imag, abs(lift)), exact(setting, 30.0))

    return Trial(draft.case(), check)


@condition("stages: release a weld")
def release_a_weld(setting: Setting) -> Trial:
    """Closed faces bear shear beyond their friction; released they bear what friction allows."""
    layer = Elastic(1e3, 0.0)
    friction = 0.2
    draft = Draft(setting)
    draft.add_material("m", layer)
    draft.add_line("foot", 0j, 2 + 0j)
    draft.add_line("j1", 1j, 2 + 1j)
    draft.add_line("head", 2 + 2j, 2j)
    for k in (0, 1):
        draft.add_line(f"right{k}", 2 + 1j * k, 2 + 1j * (k + 1))
        draft.add_line(f"left{k}", 1j * (k + 1), 1j * k)
    draft.add_region("b0", "m", ["foot", "right0", "j1", "left0"])
    draft.add_region("b1", "m", ["j1", "right1", "head", "left1"])
    draft["interfaces"]["j1"] = {"law": "coulomb", "friction": friction}
    # Simple shear between sides that keep their height and bear the pressure: us is along the sides.
    pressed = -PULL / layer.young
    sheared = 2 * 1.0 / layer.shear
    for name in ("right0", "left0", "right1", "left1"):
        draft["boundary"][name] = {"tn": 0.0, "us": {"expression": "0"}}
    for name in ("right0", "left0", "right1", "left1"):
        field = Field(layer, np.array([[0.0]]), np.array([[0.0, pressed]]))
        values = draft.polynomials(field, name, "un")[1]
        draft["boundary"][name] = {"tn": 0.0, "us": draft.value(name, values, "u", "xy")}
    draft["boundary"].update({**HELD, **load(setting, "head", ux=0.0)})
    top = load(setting, "head", ux=sheared, uy=2 * pressed)
    add_stages(draft, {"close": ["j1"], "boundary": top}, {"release": ["j1"]})
    after = friction * PULL / layer.shear

    def check(results: Results) -> Iterator[Figure]:
        for step, slope, jump in ((0, sheared / 2, 0.0), (1, after, sheared - 2 * after)):
            each = slope + 1j * pressed
            yield from expect(results, setting, "b0", step, 0j, each, f"step {step}", sheared)
            yield from expect(results, setting, "b1", step, complex(jump), each, f"step {step}", sheared)
        yield Figure("slips", float((results.contact["j1"].mode[-1] != 1).sum()), 0.5)

    return Trial(draft.case(), check, releases=True)


@condition("stages: remove what pulls")
def remove_what_pulls(setting: Setting) -> Trial:
    """Without the loaded upper layer the lower one is free of stress; half of the way half is left."""
    draft = lay_stack(setting)
    draft["boundary"].update({**HELD, **load(setting, "head", ty=0.0)})
    add_stages(draft, {"boundary": load(setting, "head", ty=PULL)}, {"remove": ["b1"], "steps": 2})

    def check(results: Results) -> Iterator[Figure]:
        for step, share in enumerate((1.0, 0.5, 0.0)):
            yield from expect(results, setting, "b0", step, 0j, share * STRAIN, f"step {step}")
        gone = results.displacement[-1][own(results, "b1")]
        yield Figure("gone", float(np.isfinite(gone).sum()), 0.5)

    return Trial(draft.case(), check)


@condition("stages: remove, then press on the wall")
def press_on_a_wall(setting: Setting) -> Trial:
    draft = lay_stack(setting)
    draft["boundary"].update({**HELD})
    add_stages(draft, {"remove": ["b1"]},
               {"boundary": {"j1": {"pressure": PULL * setting.place.stress}}, "steps": 2})

    def check(results: Results) -> Iterator[Figure]:
        for step, share in enumerate((0.0, 0.5, 1.0)):
            yield from expect(results, setting, "b0", step, 0j, -share * STRAIN, f"step {step}")

    return Trial(draft.case(), check)


@condition("stages: excavate at rest")
def excavate(setting: Setting) -> Trial:
    """Stress at rest under weight; a layer is taken away, and what lies under it rises by its weight."""
    material = Elastic(1e3, 0.0)
    weight = 1.0
    draft = lay_stack(setting, material=material)
    unit = setting.place.stress / setting.place.size
    draft["gravity"].update(setting.place.pair(-1j * weight, unit, "gx", "gy"))
    field = still(material, (np.array([[-0.8, 0.4]]), np.array([[-2.0 * weight, weight]]), ZERO))
    add_rest(draft, field)
    for k in (0, 1):
        for side in (f"left{k}", f"right{k}"):
            draft["boundary"][side] = {"un": 0.0}
    draft["boundary"]["foot"] = {"ux": 0.0, "uy": 0.0}
    add_stages(draft, {}, {"remove": ["b1"], "steps": 2})

    def check(results: Results) -> Iterator[Figure]:
        rise = 1j * weight / material.young
        for step, share in enumerate((0.0, 0.5, 1.0)):
            yield from expect(results, setting, "b0", step, 0j, share * rise, f"step {step}", abs(rise))
            stress = (-0.6, -1.5 + share, 0.0)
            yield from expect_stress(results, setting, 1 + 0.5j, step, stress, f"step {step}")

    return Trial(draft.case(), check)


@condition("stages: dismantle a stack")
def dismantle(setting: Setting) -> Trial:
    """Three layers under a load; one after the other is taken away and the wall below is loaded instead."""
    draft = lay_stack(setting, 3)
    draft["boundary"].update({**HELD, **load(setting, "head", ty=-PULL)})
    push = {"pressure": PULL * setting.place.stress}
    add_stages(draft, {}, {"remove": ["b2"], "boundary": {"j2": push}},
               {"remove": ["b1"], "boundary": {"j1": push}, "steps": 2})

    def check(results: Results) -> Iterator[Figure]:
        for step in range(len(results.steps.number)):
            yield from expect(results, setting, "b0", step, 0j, -STRAIN, f"step {step}")

    return Trial(draft.case(), check)


@condition("stages: tension after an opening elsewhere")
def open_one_of_two(setting: Setting) -> Trial:
    """A crack that stays closed opens by a stage; the field goes through as there is nothing to carry."""
    draft = lay_stack(setting)
    draft.add_line("crack", 0.6 + 0.5j, 1.4 + 0.5j, elements=6)
    draft["regions"]["b0"]["cracks"] = ["crack"]
    draft["interfaces"]["crack"] = {"friction": 0.5}
    draft["boundary"].update({**HELD, **load(setting, "head", ty=0.0)})
    add_stages(draft, {"boundary": load(setting, "head", ty=-PULL)}, {"close": ["crack"]},
               {"boundary": load(setting, "head", ty=PULL), "steps": 2}, {"boundary": load(setting, "head", ty=0.0)},
               {"open": ["crack"]})

    def check(results: Results) -> Iterator[Figure]:
        for step, share in enumerate((-1.0, -1.0, 0.0, 1.0, 0.0, 0.0)):
            yield from expect(results, setting, "b0", step, 0j, share * STRAIN, f"step {step}")

    return Trial(draft.case(), check)


# -- bodies that nothing holds ----------------------------------------------------------------------------------------


def lay_free(setting: Setting, supports: dict[str, tuple[complex, str]], law: dict[str, Any] | None = None) -> Draft:
    draft = lay_stack(setting, law=law)
    draft["boundary"].update({**load(setting, "head", ty=PULL), **load(setting, "foot", ty=-PULL)})
    for name, (z, keys) in supports.items():
        pair = setting.place.pair(0j, 1.0, "ux", "uy")
        draft["point_supports"][name] = {"at": setting.place.at(z), **{key: pair[key] for key in keys.split()}}
    return draft


def shift_support(setting: Setting, shift: complex) -> dict[str, float]:
    return setting.place.pair(shift, setting.place.size, "ux", "uy")


MOVED = 0.03 - 0.02j


@condition("stages: supports move, then faces open")
def supports_then_open(setting: Setting) -> Trial:
    """A free stack is unloaded, moved by its support, and cut: both layers stay where they are."""
    draft = lay_free(setting, {"p": (0j, "ux uy"), "q": (2 + 0j, "ux uy" if setting.place.angle else "uy")})
    if setting.place.angle:
        # Along the axes of the case either component would do; the one that turns the body is taken.
        turned = setting.place.turn
        draft["point_supports"]["q"] = {"at": setting.place.at(2 + 0j),
                                        "uy" if abs(turned.real) > abs(turned.imag) else "ux": 0.0}
    second = draft["point_supports"]["q"]
    moved = shift_support(setting, MOVED)
    shifts = {"p": moved, "q": {key: moved[key] for key in second if key != "at"}}
    free = {**load(setting, "head", ty=0.0), **load(setting, "foot", ty=0.0)}
    add_stages(draft, {}, {"boundary": free}, {"point_supports": shifts}, {"open": ["j1"], "steps": 2}, {})

    def check(results: Results) -> Iterator[Figure]:
        for step, (shift, slope) in enumerate([(0j, STRAIN), (0j, 0j), (MOVED, 0j), (MOVED, 0j), (MOVED, 0j),
                                               (MOVED, 0j)]):
            for region in ("b0", "b1"):
                yield from expect(results, setting, region, step, shift, slope, f"step {step}", abs(MOVED))

    return Trial(draft.case(), check)


@condition("stages: a free layer is taken away")
def remove_from_free(setting: Setting) -> Trial:
    """Of a free stack the layer with the supports is taken away, and the other stays where it is."""
    draft = lay_free(setting, {"p": (0j, "ux uy")})
    free = {**load(setting, "head", ty=0.0), **load(setting, "foot", ty=0.0)}
    add_stages(draft, {}, {"boundary": free, "point_supports": {"p": shift_support(setting, MOVED)}},
               {"remove": ["b0"], "steps": 2})

    def check(results: Results) -> Iterator[Figure]:
        for step in (1, 2, 3):
            yield from expect(results, setting, "b1", step, MOVED, 0j, f"step {step}", abs(MOVED))

    return Trial(draft.case(), check)


@condition("stages: rest set free by opening")
def rest_set_free(setting: Setting) -> Trial:
    """Stress at rest along the height, borne by what holds both ends; a joint that opens sets it free."""
    material = Elastic(1e3, 0.0)
    draft = lay_stack(setting, material=material)
    add_rest(draft, still(material, uniform((0.0, PULL, 0.0))))
    draft["boundary"].update({**HELD, **load(setting, "head", uy=0.0)})
    add_stages(draft, {}, {"open": ["j1"], "steps": 2})

    def check(results: Results) -> Iterator[Figure]:
        for step, share in enumerate((0.0, 0.5, 1.0)):
            yield from expect(results, setting, "b0", step, 0j, -share * STRAIN, f"step {step}")
            yield from expect_stress(results, setting, 1 + 0.5j, step, (0, (1 - share) * PULL, 0), f"step {step}")

    return Trial(draft.case(), check)




def hold_along(setting: Setting, z: complex, along: complex = 0j) -> dict[str, float]:
    """A support that holds a point along the x axis of the model, by the axis of the case that is nearest to it."""
    key = "ux" if abs(setting.place.turn.real) > abs(setting.place.turn.imag) else "uy"
    value = shift_support(setting, along)[key]
    return {"at": setting.place.at(z), key: value}  # type: ignore[dict-item]


@condition("point support of a block that slides")
def support_of_a_sliding_block(setting: Setting) -> Trial:
    """Its point is on the seam; the lower block, which comes first, is held already."""
    draft = lay_stack(setting, law={"law": "frictionless"})
    draft["boundary"].update({**HELD, **load(setting, "head", ty=-PULL)})
    shift = 0.004
    draft["point_supports"]["peg"] = hold_along(setting, 1j, shift - STRAIN)
    draft["analysis"]["steps"] = 2

    def check(results: Results) -> Iterator[Figure]:
        for step, share in enumerate((0.5, 1.0)):
            yield from expect(results, setting, "b0", step, 0j, -share * STRAIN, f"step {step}", shift)
            yield from expect(results, setting, "b1", step, complex(share * shift), -share * STRAIN, f"step {step}",
                              shift)  # fmt: skip
        slip = results.contact["j1"].slip[-1] / setting.place.size
        yield Figure("slip", off(slip, -shift, shift), exact(setting, 30.0))

    return Trial(draft.case(), check)


@condition("stages: a support on a wall that is bared")
def support_on_a_bared_wall(setting: Setting) -> Trial:
    """The first of its two bodies is taken away; the support goes on with the other."""
    draft = lay_free(setting, {"p": (1j, "ux uy")})
    free = {**load(setting, "head", ty=0.0), **load(setting, "foot", ty=0.0)}
    add_stages(draft, {}, {"boundary": free}, {"remove": ["b0"]},
               {"point_supports": {"p": shift_support(setting, MOVED)}, "steps": 2})

    def check(results: Results) -> Iterator[Figure]:
        for step, share in ((1, 0.0), (2, 0.0), (3, 0.5), (4, 1.0)):
            yield from expect(results, setting, "b1", step, share * MOVED, 0j, f"step {step}", abs(MOVED))

    return Trial(draft.case(), check)
