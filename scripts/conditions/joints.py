"""Faces of two layers under one traction: contact, interference, joints, bonds that soften, brittle bonds, rock joints.

Both layers have the height 1; u = a x strain along their height, the same traction everywhere, and one jump.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from pbem.results.reader import Results
from scripts.conditions.draft import Draft, Setting
from scripts.conditions.field import ZERO, Elastic, Field
from scripts.conditions.trial import CONDITIONS, Figure, Trial, compare, exact, inside, off

LOW, UP = Elastic(900.0, 0.2), Elastic(1500.0, 0.35)
OPEN, SLIP, STICK = 2, 1, 0
# Where slip without normal traction may count as either.
ANY = -1
POINTS = {"low": 0.8 + 0.5j, "up": 1.2 + 1.6j}


@dataclass(frozen=True)
class Layered:
    """The normal and shear traction of all faces along x (compression negative), and how far the upper face of the
    joint is from the lower one: along x and y."""

    normal: float
    shear: float
    jump: complex = 0j
    low: Elastic = LOW
    up: Elastic = UP

    def strain(self, material: Elastic) -> complex:
        return complex(self.shear / material.shear, self.normal / (material.lame + 2 * material.shear))

    def fields(self) -> dict[str, Field]:
        a, b = self.strain(self.low), self.strain(self.up)
        shift = a + self.jump - b
        fields = {}
        for name, material, slope, start in (("low", self.low, a, 0j), ("up", self.up, b, shift)):
            fields[name] = Field(material, np.array([[start.real, slope.real]]), np.array([[start.imag, slope.imag]]))
        return fields

    @property
    def top(self) -> complex:
        return self.strain(self.low) + self.strain(self.up) + self.jump


def lay(setting: Setting, layered: Layered, steps: int = 1, apart: float = 0.0, load: str = "u") -> Draft:
    """Two layers with leaning sides under the tractions of the field; the top is moved, or with load "t" loaded.

    apart: so much the upper layer lies above the lower one; then a contact with meshes that differ, else "joint".
    """
    draft = Draft(setting, steps)
    draft.add_material("a", layered.low)
    draft.add_material("b", layered.up)
    lift = 1j * apart
    fields = layered.fields()
    corners = (0j, 2 + 0j, 2.2 + 1j, 0.1 + 1j), (0.1 + 1j, 2.2 + 1j, 2 + 2j, -0.1 + 2j)
    names: dict[str, list[str]] = {}
    for name, points, shift in (("low", corners[0], 0j), ("up", corners[1], lift)):
        own = []
        for k in range(4):
            if (name, k) in (("low", 2), ("up", 0)):
                side = "joint" if not apart else f"{name}_face"
                elements = 4 if name == "low" else 5
                if side not in draft.lines:
                    draft.add_line(side, points[k] + shift, points[(k + 1) % 4] + shift, elements=elements)
                own.append(side)
                continue
            own.append(draft.add_line(f"{name}{k}", points[k] + shift, points[(k + 1) % 4] + shift))
        names[name] = own
        draft.add_region(name, "a" if name == "low" else "b", own)
    for name in ("low", "up"):
        for side in names[name]:
            if side[-1].isdigit() and side not in ("low0", "up2"):
                draft.give(side, fields[name], "t", "number")
    draft.give("low0", fields["low"], "u", "number")
    draft.give("up2", fields["up"], load, "number")
    if load == "u":
        top = setting.place.pair(layered.top, setting.place.size, "ux", "uy")
        draft["boundary"]["up2"] = top
    return draft


def scaled(setting: Setting, **law: Any) -> dict[str, Any]:
    """A law whose lengths and stresses are those of the model: keys say which they are."""
    place = setting.place
    units = {
        "cohesion": place.stress, "tensile_strength": place.stress, "jcs": place.stress, "pressure": place.stress,
        "gap": place.size, "slip_distance": place.size, "closure": place.size, "overlap": place.size,
        "normal_stiffness": place.stress / place.size, "tangential_stiffness": place.stress / place.size,
        "fracture_energy": place.stress * place.size, "fracture_energy_shear": place.stress * place.size,
    }  # fmt: skip
    return {key: value * units[key] if key in units else value for key, value in law.items()}


def check_layers(
    setting: Setting, layered: Layered, mode: int, name: str = "joint", gap: float = 0.0, factor: float = 1.0,
    step: int = -1,
) -> Callable[[Results], Iterator[Figure]]:
    """Fields, tractions and jumps of the joint. gap: what is there at first."""

    def check(results: Results) -> Iterator[Figure]:
        place, tolerance = setting.place, exact(setting, factor)
        stress = max(abs(layered.normal), abs(layered.shear), 1e-2)
        fields = layered.fields()
        length = max(abs(layered.top), abs(layered.jump), stress / 1e3)
        yield from compare(results, place, fields, tolerance, step=step, stress=stress, length=length)
        for region, field in fields.items():
            yield from inside(results, place, field, [POINTS[region]], tolerance, step=step, scale=stress)
        pairs = results.contact[name]
        if mode != ANY:
            yield Figure("mode", float((pairs.mode[step] != mode).sum()), 0.5)
        # The first side is the lower one: n = +y, s = -x.
        yield Figure("opening", off(pairs.opening[step] / place.size, layered.jump.imag + gap, length), tolerance)
        yield Figure("slip", off(pairs.slip[step] / place.size, -layered.jump.real, length), tolerance)
        yield Figure("p_n", off(pairs.traction_n[step] / place.stress, layered.normal, stress), tolerance)
        yield Figure("p_s", off(pairs.traction_s[step] / place.stress, -layered.shear, stress), tolerance)

    return check


def enter(
    name: str, layered: Layered, mode: int, factor: float = 1.0, steps: int = 1, load: str = "u", **law: Any
) -> None:
    """Layers with a law of their joint, moved or loaded on top."""

    def make(setting: Setting) -> Trial:
        draft = lay(setting, layered, steps, load=load)
        draft["interfaces"]["joint"] = scaled(setting, **law)
        return Trial(draft.case(), check_layers(setting, layered, mode, gap=law.get("gap", 0.0), factor=factor))

    CONDITIONS[name] = make


enter("bonded, pulled and sheared", Layered(1.0, -2.0), STICK, law="bonded")
enter("pressed, sticks", Layered(-3.0, 1.0), STICK, law="coulomb", friction=0.5)
enter("pressed, loaded on top", Layered(-3.0, 1.0), STICK, law="coulomb", friction=0.5, load="t")
enter("slips", Layered(-3.0, 1.5, 0.002), SLIP, law="coulomb", friction=0.5)
enter("frictionless", Layered(-3.0, 0.0, -0.002), SLIP, law="frictionless")
enter("parts", Layered(0.0, 0.0, 0.001 + 0.002j), OPEN, law="coulomb", friction=0.5)
enter("open, never touches", Layered(0.0, 0.0, 0.001 + 0.002j), OPEN, law="open")
enter("a gap that closes", Layered(-3.0, 0.6, -0.001j), STICK, law="coulomb", friction=0.5, gap=0.001, factor=10.0)
enter("interference", Layered(-2.0, 0.0, 0.003j), STICK, law="coulomb", friction=0.5, gap=-0.003)
enter("cohesion holds shear", Layered(0.5, 1.2), STICK, law="coulomb", friction=0.5, cohesion=2.0,
      tensile_strength=0.6)
enter("tensile bond holds", Layered(0.5, 0.0), STICK, law="coulomb", cohesion=1.0, tensile_strength=0.501)
enter("tensile bond, weakening cohesion lost", Layered(-1.0, 0.5, 0.004), SLIP, law="coulomb", friction=0.5,
      cohesion=0.7, cohesion_lost=True)  # fmt: skip
enter("fluid in a joint", Layered(-2.0, 0.0, 0.004j), OPEN, law="coulomb", friction=0.5, pressure=2.0)
enter("fluid in closed faces, slips", Layered(-3.0, 0.5, 0.004), SLIP, law="coulomb", friction=0.5, pressure=2.0,
      pressurised="all")  # fmt: skip
enter("elastic joint", Layered(-3.0, 1.0, 1.0 / 400 - 3j / 700), STICK, law="coulomb", friction=0.5,
      normal_stiffness=700.0, tangential_stiffness=400.0)  # fmt: skip
enter("slip weakening", Layered(-3.0, 0.9, 0.008), SLIP, law="coulomb", friction=0.5, friction_dynamic=0.3,
      slip_distance=0.005)  # fmt: skip


def solve_opening(stress_of: Callable[[float], float], total: float, compliance: float) -> float:
    """The jump at which faces and layers share a displacement."""
    return float(brentq(lambda jump: jump + compliance * stress_of(jump) - total, 0.0, total))


COMPLIANCE_N = sum(1 / (each.lame + 2 * each.shear) for each in (LOW, UP))
COMPLIANCE_S = sum(1 / each.shear for each in (LOW, UP))
STRENGTH, ENERGY = 1.5, 0.03
WIDE = 2 * ENERGY / STRENGTH
SOFTENING: dict[str, Callable[[float], float]] = {
    "linear": lambda jump: STRENGTH * max(1 - jump / WIDE, 0.0),
    "exponential": lambda jump: STRENGTH * math.exp(-jump * STRENGTH / ENERGY),
    "constant": lambda jump: STRENGTH if jump < ENERGY / STRENGTH else 0.0,
}


def enter_cohesive(name: str, softening: str, shear: bool) -> None:
    """Bonds that have given way by a third of what they can, alone in tension or in shear; the whole is moved."""

    def make(setting: Setting) -> Trial:
        compliance = COMPLIANCE_S if shear else COMPLIANCE_N
        total = compliance * STRENGTH + 0.3 * ENERGY / STRENGTH
        jump = solve_opening(SOFTENING[softening], total, compliance)
        stress = SOFTENING[softening](jump)
        layered = Layered(0.0, stress, complex(jump)) if shear else Layered(stress, 0.0, 1j * jump)
        draft = lay_straight(setting, layered, 4)
        draft["interfaces"]["joint"] = scaled(
            setting, law="cohesive", softening=softening, tensile_strength=STRENGTH, fracture_energy=ENERGY,
            cohesion=STRENGTH, fracture_energy_shear=ENERGY,
        )  # fmt: skip
        return Trial(draft.case(), check_layers(setting, layered, ANY if shear else OPEN, factor=10.0))

    CONDITIONS[name] = make


def lay_straight(setting: Setting, layered: Layered, steps: int = 1) -> Draft:
    """The layers between rollers along the movement, which keep the traction uniform whatever it is."""
    draft = Draft(setting, steps)
    draft.add_material("a", layered.low)
    draft.add_material("b", layered.up)
    draft.add_line("low0", 0j, 2 + 0j)
    draft.add_line("low1", 2 + 0j, 2 + 1j)
    draft.add_line("joint", 2 + 1j, 1j, elements=4)
    draft.add_line("low3", 1j, 0j)
    draft.add_line("up1", 2 + 1j, 2 + 2j)
    draft.add_line("up2", 2 + 2j, 2j)
    draft.add_line("up3", 2j, 1j)
    draft.add_region("low", "a", ["low0", "low1", "joint", "low3"])
    draft.add_region("up", "b", ["joint", "up1", "up2", "up3"])
    # In shear u = (a y, 0): no normal traction on the sides, and no displacement along them.
    given = {"tn": 0.0, "us": 0.0} if layered.shear else {"un": 0.0}
    for side in ("low1", "low3", "up1", "up3"):
        draft["boundary"][side] = dict(given)
    draft["boundary"]["low0"] = {"ux": 0.0, "uy": 0.0}
    draft["boundary"]["up2"] = setting.place.pair(layered.top, setting.place.size, "ux", "uy")
    return draft


for _softening in SOFTENING:
    enter_cohesive(f"cohesive, tension, {_softening}", _softening, False)
    enter_cohesive(f"cohesive, shear, {_softening}", _softening, True)


def enter_straight(name: str, layered: Layered, mode: int, steps: int = 1, factor: float = 10.0, **law: Any) -> None:
    def make(setting: Setting) -> Trial:
        draft = lay_straight(setting, layered, steps)
        draft["interfaces"]["joint"] = scaled(setting, **law)
        return Trial(draft.case(), check_layers(setting, layered, mode, factor=factor))

    CONDITIONS[name] = make


# sigma = K v/(1 - v/V), v = 0.4 V.
CLOSURE, STIFF = 0.004, 500.0
CLOSED = 0.4 * CLOSURE
enter_straight("barton_bandis closes", Layered(-STIFF * CLOSED / 0.6, 0.0, -1j * CLOSED), STICK, 3,
               law="barton_bandis", residual_friction_angle=28.0, jrc=9.0, jcs=60.0, closure=CLOSURE,
               normal_stiffness=STIFF)  # fmt: skip
_ANGLE = math.radians(28.0 + 9.0 * math.log10(60.0 / 3.0))
enter("barton_bandis slips", Layered(-3.0, 3.0 * math.tan(_ANGLE), 0.004), SLIP, 10.0, law="barton_bandis",
      residual_friction_angle=28.0, jrc=9.0, jcs=60.0)  # fmt: skip
enter_straight("tensile bond breaks", Layered(0.0, 0.0, 0.004j), OPEN, 2, law="coulomb", cohesion=1.0,
               tensile_strength=1.4)  # fmt: skip


def enter_touching(name: str, apart: float, pressed: float, mode: int, **law: Any) -> None:
    """Straight bodies between rollers, pressed by a displacement of the top: stress by the heights as they are drawn.
    """

    def make(setting: Setting) -> Trial:
        draft = Draft(setting)
        place = setting.place
        draft.add_material("a", LOW)
        draft.add_material("b", UP)
        low = draft.add_polygon("low", "a", [0j, 2 + 0j, 2 + 1j, 1j])
        shift = 1j * (1 + apart)
        up = draft.add_polygon("up", "b", [shift, 2 + shift, 2 + 1j + shift, 1j + shift], elements=4)
        for side in (low[1], low[3], up[1], up[3]):
            draft["boundary"][side] = {"un": 0.0}
        draft["boundary"][low[0]] = {"ux": 0.0, "uy": 0.0}
        draft["boundary"][up[2]] = {"un": -pressed * place.size, "ts": 0.0}
        draft["contacts"]["seat"] = {"between": [low[2], up[0]], **scaled(setting, **law)}
        depth = max(pressed - apart, 0.0)
        normal = -depth / COMPLIANCE_N

        def check(results: Results) -> Iterator[Figure]:
            tolerance, scale = exact(setting, 100.0), max(abs(normal), 1.0)
            pairs = results.contact["seat"]
            yield Figure("mode", float((pairs.mode[-1] != mode).sum()), 0.5)
            opening = max(apart - pressed, 0.0)
            yield Figure("opening", off(pairs.opening[-1] / place.size, opening, abs(apart)), tolerance)
            yield Figure("p_n", off(pairs.traction_n[-1] / place.stress, normal, scale), tolerance)
            reaction = place.back(results.reactions[low[0]][-1]) / place.stress / place.size
            yield Figure("reaction", off(np.array(reaction), -2j * normal, scale), tolerance)
            for region, strain in (("low", normal / (LOW.lame + 2 * LOW.shear)),
                                   ("up", normal / (UP.lame + 2 * UP.shear))):
                field = Field(LOW if region == "low" else UP, ZERO, np.array([[0, strain]]))
                yield from inside(results, place, field, [POINTS[region] + 1j * apart], tolerance, scale=scale)

        return Trial(draft.case(), check)

    CONDITIONS[name] = make


enter_touching("contact of two curves", 0.001, 0.003, STICK, friction=0.4)
enter_touching("contact that stays open", 0.004, 0.003, OPEN, friction=0.4)
