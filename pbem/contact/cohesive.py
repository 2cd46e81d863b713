"""Cohesive faces: tension and shear that fall with opening and slip, until the fracture energies are spent.

Bonds are rigid up to their strengths, sigma in tension and tau in shear. Then the faces separate by (g_n, g_s), with
the separations d_n = factor G_I/sigma, d_s = factor G_II/tau and the largest x = |(g_n/d_n, g_s/d_s)| so far:
tractions are S(x) (sigma g_n/d_n, tau g_s/d_s), S = f(x)/x (V. Tvergaard, Mater. Sci. Eng. A 125, 1990; for f linear:
G. T. Camacho, M. Ortiz, Int. J. Solids Struct. 33, 1996). They part where (p_n/sigma)^2 + (p_s/tau)^2 = 1; along a
constant ratio of opening and slip they spend G_n and G_s with G_n/G_I + G_s/G_II = 1. Unloading is towards the origin.
Faces that are pressed together slide with the friction bound tau f(x) - friction p_n, and x grows with the slip.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Bool, Real
from pbem.contact.declaration import FrictionLaw, InternalVariable, Parameters, Passage, Slide, StepEnd, keep_value
from pbem.contact.friction_bound import Strength
from pbem.contact.softening import SOFTENINGS, Softening

Values = Mapping[str, NDArray[Any]]


def _begin_damage(parameters: Parameters) -> Real:
    return np.where(find_bonded(parameters), 0.0, 1.0)


# Both advance together, with openings too: see `Cohesive.advance`.
SEPARATION = InternalVariable("separation", "none", lambda _: 0.0, keep_value)
DAMAGE = InternalVariable("damage", "none", _begin_damage, keep_value)
# Separations that differ from the largest one so far by less than this part are that.
SAME = 1e-9
# Bonds that have given way by less than this part of their separation are as stiff as there.
RIGID = 1e-10
# The trial stiffness, relative to strength over separation, is at least this: f + stiffness x rises.
LEAST_STIFFNESS = 2.0


def find_bonded(parameters: Parameters) -> Bool:
    """The pairs (k,) that have a bond to begin with: no strength where one of them is zero."""
    return np.asarray((parameters["tensile_strength"] > 0) & (parameters["cohesion"] > 0))


@dataclass(frozen=True)
class Separating:
    """The affine law of separating pairs at some jumps (k, 2): tractions (k, 2), and their change with the jumps
    (k, 2, 2): full, and without softening (secant)."""

    traction: Real
    tangent: Real
    secant: Real


@dataclass(frozen=True)
class Cohesive(FrictionLaw):
    """The law as above, of one shape of softening; parameters: friction, both strengths, and the fracture energies."""

    softening: Softening

    variables = (SEPARATION, DAMAGE)
    bonds = True

    def strength(  # type: ignore[override]
        self, p_n: Real, slide: Slide, /, friction: Real, cohesion: Real, tensile_strength: Real,
        fracture_energy: Real, fracture_energy_shear: Real,
    ) -> Strength:
        """See FrictionLaw: of faces in touch (theory, 108)."""
        bonded = (tensile_strength > 0) & (cohesion > 0)
        shear = np.where(bonded, cohesion, 0.0)
        unit = np.where(bonded, self.softening.factor * fracture_energy_shear / np.where(bonded, cohesion, 1.0), 1.0)
        x = slide.start[SEPARATION.name] + slide.ahead / unit
        bound = shear * self.softening.traction(x) - friction * p_n
        falls = np.where(bound > 0, shear * self.softening.slope(x) / unit, 0.0)
        return Strength(np.maximum(bound, 0.0), np.where(bound >= 0, -friction, 0.0), falls)

    def resists(self, parameters: Parameters) -> Bool:
        """Whether there is a bond or friction."""
        return np.asarray(find_bonded(parameters) | (parameters["friction"] > 0))

    def find_strongest(self, parameters: Parameters) -> tuple[Real, Real]:
        """Of the bond as it was at first."""
        return parameters["friction"], np.where(find_bonded(parameters), parameters["cohesion"], 0.0)

    def find_units(self, parameters: Parameters) -> Real:
        """The separations d_n and d_s (k, 2), lengths; 1 without a bond (theory, 104)."""
        energy = np.stack([parameters["fracture_energy"], parameters["fracture_energy_shear"]], axis=-1)
        own = find_bonded(parameters)[:, None]
        strength = _stack_strengths(parameters)
        return np.where(own, self.softening.factor * energy / np.where(own, strength, 1.0), 1.0)

    def find_live(self, start: Values, parameters: Parameters) -> Bool:
        """The pairs (k,) whose bonds are not lost."""
        return np.asarray(find_bonded(parameters) & (start[SEPARATION.name] < self.softening.end))

    def find_tension(self, start: Values, parameters: Parameters) -> Real:
        """The tension (k,) that the bond still bears."""
        left = self.softening.traction(start[SEPARATION.name])
        return np.where(find_bonded(parameters), parameters["tensile_strength"] * left, 0.0)

    def choose_stiffness(self, least: Real, parameters: Parameters) -> Real:
        """Trial stiffnesses relative to strength over separation, (k,); not below `least` (stress/length)."""
        stiffness = _stack_strengths(parameters) / self.find_units(parameters)
        relative = least[:, None] / np.where(stiffness > 0, stiffness, np.inf)
        return np.maximum(LEAST_STIFFNESS, relative.max(axis=1))

    def find_trial(self, traction: Real, jump: Real, relative: Real, parameters: Parameters) -> Real:
        """Trial values (k, 2) relative to the strengths, of tractions (less the fluid's) and jumps (k, 2)."""
        strength = np.where(find_bonded(parameters)[:, None], _stack_strengths(parameters), 1.0)
        return np.asarray(traction / strength + relative[:, None] * jump / self.find_units(parameters))

    def find_jump(self, trial: Real, relative: Real, start: Values, parameters: Parameters) -> Real:
        """The jumps (k, 2) that belong to trial values; none in compression (theory, 107)."""
        opened = np.stack([np.maximum(trial[:, 0], 0.0), trial[:, 1]], axis=1)
        size = np.hypot(*opened.T)
        x = self.softening.find_separation(size, relative, start[SEPARATION.name])
        return np.asarray(opened * (x / np.where(size > 0, size, 1.0))[:, None] * self.find_units(parameters))

    def measure(self, jump: Real, parameters: Parameters) -> Real:
        """The separation x (k,) of jumps (k, 2)."""
        unit = self.find_units(parameters)
        return np.hypot(np.maximum(jump[:, 0], 0.0) / unit[:, 0], jump[:, 1] / unit[:, 1])

    def separate(self, jump: Real, start: Values, parameters: Parameters) -> Separating:
        """The law of open pairs at some jumps (theory, 105)."""
        unit, before = self.find_units(parameters), start[SEPARATION.name]
        stiffness = np.where(find_bonded(parameters)[:, None], _stack_strengths(parameters), 0.0) / unit
        jump = np.stack([np.maximum(jump[:, 0], 0.0), jump[:, 1]], axis=1)
        x = self.measure(jump, parameters)
        largest = np.maximum(np.maximum(x, before), RIGID)
        held = self.softening.traction(largest) / largest
        secant = np.zeros((len(x), 2, 2))
        secant[:, [0, 1], [0, 1]] = held[:, None] * stiffness
        grows = (x > 0) & (x >= before * (1 - SAME))
        falls = np.where(grows, (self.softening.slope(largest) - held) / largest, 0.0)
        by_jump = jump / unit**2 / np.where(x > 0, x, 1.0)[:, None]
        tangent = secant + (falls[:, None] * stiffness * jump)[:, :, None] * by_jump[:, None, :]
        return Separating(np.einsum("kij,kj->ki", secant, jump), tangent, secant)

    def advance(self, end: StepEnd, parameters: Parameters) -> dict[str, Real]:
        """By the jumps of pairs that are open, and by the slip of faces in touch."""
        before = end.slide.start[SEPARATION.name]
        own = np.where(end.opened, np.maximum(before, self.measure(end.jump, parameters)),
                       before + end.slide.ahead / self.find_units(parameters)[:, 1])
        bonded = find_bonded(parameters)
        own = np.where(bonded, own, before)
        return {SEPARATION.name: own, DAMAGE.name: np.where(bonded, self.softening.find_damage(own), 1.0)}

    def store(self, jump: Real, state: Values, parameters: Parameters) -> Real:
        """What unloading would give back (k,), energy per area (theory, 106)."""
        x = np.maximum(state[SEPARATION.name], RIGID)
        unit = self.find_units(parameters)
        stiffness = np.where(find_bonded(parameters)[:, None], _stack_strengths(parameters), 0.0) / unit
        return np.asarray(0.5 * self.softening.traction(x) / x * (stiffness * jump**2).sum(axis=1))

    def dissipate(self, passage: Passage, rubbed: Real, parameters: Parameters) -> Real:
        """By damage where pairs end open; by the integral of the friction bound, less what is stored more in the bonds,
        where they slide (theory, 109)."""
        (old, new), (before, after) = passage.internal, passage.jump
        opened = self.dissipate_open(before, after, old, new, parameters)
        pressed = -np.minimum(0.5 * (passage.p_n[0] + passage.p_n[1]), 0.0)
        bound = self.work_of_bond(old[SEPARATION.name], new[SEPARATION.name], parameters)
        slid = bound + parameters["friction"] * pressed * np.abs(after - before)[:, 1]
        slid -= passage.stored[1] - passage.stored[0]
        return np.maximum(np.where(passage.opened, opened, np.where(passage.slips, slid, 0.0)), 0.0)

    def dissipate_open(self, before: Real, after: Real, old: Values, new: Values, parameters: Parameters) -> Real:
        """What a step from jumps to jumps (k, 2) of open pairs dissipates (k,), energy per area; of a step with a
        constant ratio of opening and slip exact (theory, 106)."""
        change = self.softening.find_damage(new[SEPARATION.name]) - self.softening.find_damage(old[SEPARATION.name])
        mixture = [self._mix(jump, parameters) for jump in (before, after)]
        mixture[0] = np.where(self.measure(before, parameters) > 0, mixture[0], mixture[1])
        mixture[1] = np.where(self.measure(after, parameters) > 0, mixture[1], mixture[0])
        return np.where(find_bonded(parameters), 0.5 * (mixture[0] + mixture[1]) * change, 0.0)

    def _mix(self, jump: Real, parameters: Parameters) -> Real:
        part = (jump[:, 1] / self.find_units(parameters)[:, 1]) ** 2 / np.maximum(
            self.measure(jump, parameters), RIGID**2) ** 2
        part = np.clip(part, 0.0, 1.0)
        return np.asarray((1 - part) * parameters["fracture_energy"] + part * parameters["fracture_energy_shear"])

    def work_of_bond(self, before: Real, after: Real, parameters: Parameters) -> Real:
        """The integral (k,) of the bond's part of the friction bound over slip, between two separations (k,)."""
        area = self.softening.area(after) - self.softening.area(before)
        whole = self.softening.factor * parameters["fracture_energy_shear"]
        return np.where(find_bonded(parameters), whole * area, 0.0)


def _stack_strengths(parameters: Parameters) -> Real:
    return np.stack([parameters["tensile_strength"], parameters["cohesion"]], axis=-1)


COHESIVE: dict[str, Cohesive] = {shape: Cohesive(softening) for shape, softening in SOFTENINGS.items()}
