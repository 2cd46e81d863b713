"""Two rings whose contact is a circle: by rotational symmetry a spring-slider, with a stiffness in closed form.

The inner circle is held, the outer one pressed inwards and turned. With the torque constant through both rings, the
shear stress at radius r is that of the fault times (R/r)^2, and so the fault has k (U R/r3 - slip).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.problem.step import SilentReporter, Step
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem

Real = NDArray[np.float64]

RADII = (1.0, 2.0, 3.0)
CASE = """
title = "Two rings"
[materials.rock]
young = {young!r}
poisson = 0.25
[curves]
inner = {{ center = [0, 0], radius = {radii[0]!r}, elements = {elements} }}
fault = {{ center = [0, 0], radius = {radii[1]!r}, elements = {elements} }}
outer = {{ center = [0, 0], radius = {radii[2]!r}, elements = {elements} }}
[regions.core]
material = "rock"
boundary = ["inner", "fault"]
[regions.ring]
material = "rock"
boundary = ["fault", "outer"]
[boundary.inner]
ux = 0.0
uy = 0.0
[boundary.outer]
un = {pressed!r}
us = 0.0
[interfaces.fault]
law = "rate_and_state"
friction = 0.6
rate_effect = {a!r}
state_effect = {b!r}
reference_rate = {rate!r}
slip_distance = {distance!r}
[analysis]
order = {order}
scheme = "{scheme}"
[solver]
newton_tolerance = 1e-11
operator = "{operator}"
{stages}
"""
STAGE = """
[[stages]]
name = "{name}"
steps = {steps}
duration = {duration!r}
boundary.outer = {{ un = {pressed!r}, us = {turned!r} }}
"""


@dataclass(frozen=True)
class Slider:
    """The rings, in units of length, stress and time that are given in those of the numbers here."""

    a: float = 0.010
    b: float = 0.015
    reference_rate: float = 1e-6
    slip_distance: float = 3e-4
    pressed: float = 1e-3
    elements: int = 8
    order: int = 2
    scheme: str = "SST"
    operator: str = "auto"
    length: float = 1.0
    stress: float = 1.0
    time: float = 1.0

    @property
    def stiffness(self) -> float:
        """Shear stress over slip; that of a ring is 2 G/(R^3 (1/r1^2 - 1/r2^2))."""
        modulus = self.stress / (2 * 1.25)
        inner, _, outer = (radius**-2 for radius in RADII)
        return 2 * modulus / (RADII[1] ** 3 * (inner - outer)) / self.length

    @property
    def pressure(self) -> float:
        """Of Lame's field a + c/r^2 (times 2 G/(1 - 2 nu) and -2 G) that is pressed at the outer circle."""
        inner, fault, outer = RADII
        # u = A r + C/r with u(inner) = 0, u(outer) = -pressed
        first = -self.pressed / (outer - inner**2 / outer)
        second = -first * inner**2
        modulus = self.stress / (2 * 1.25)
        return -2 * modulus * (first / (1 - 2 * 0.25) - second / fault**2)

    @property
    def relative_stiffness(self) -> float:
        """Stiffness over pressure, 1/length in the units of the numbers here."""
        return self.stiffness * self.length / self.pressure

    def load(self, rate: float, slips: float = 12, steps: int = 6) -> list[tuple[str, int, float, float]]:
        """Stages to steady state at a rate: quickly to its traction, and then on by so many slip distances."""
        way = slips * self.slip_distance
        traction = self.find_steady_friction(rate) / self.relative_stiffness
        return [("load", 1, 1.0, traction), ("go", steps, way / rate, way)]

    def run(self, stages: list[tuple[str, int, float, float]]) -> list[Step]:
        """The steps of stages, each with its name, steps, duration and slip of the loading at the fault (length), after
        a stage that presses."""
        turned, text = 0.0, ""
        for name, steps, duration, slip in [("press", 1, 1e-3, 0.0), *stages]:
            turned += slip * RADII[2] / RADII[1]
            text += STAGE.format(name=name, steps=steps, duration=duration * self.time, turned=turned * self.length,
                                 pressed=-self.pressed * self.length)
        case = CASE.format(
            young=self.stress, radii=[radius * self.length for radius in RADII], elements=self.elements, a=self.a,
            b=self.b, rate=self.reference_rate * self.length / self.time, distance=self.slip_distance * self.length,
            order=self.order, scheme=self.scheme, operator=self.operator, pressed=-self.pressed * self.length,
            stages=text,
        )  # fmt: skip
        model = parse_model(case)[1]
        problem = assemble_problem(model, generate_mesh(model), world)
        return list(march(problem, SilentReporter()))

    def find_steady_friction(self, rate: float) -> float:
        return 0.6 + (self.a - self.b) * float(np.log(rate / self.reference_rate))

    def integrate(self, before: float, after: float, times: Real) -> Real:
        """Friction coefficient at some times after a jump of the loading rate from steady state, by a differential
        equation for friction coefficient and logarithm of the state."""
        stiffness = self.relative_stiffness

        def change(_: float, state: Real) -> list[float]:
            theta = np.exp(state[1])
            evolved = self.b * np.log(self.reference_rate * theta / self.slip_distance)
            rate = self.reference_rate * np.exp((state[0] - 0.6 - evolved) / self.a)
            return [stiffness * (after - rate), (1 - rate * theta / self.slip_distance) / theta]

        start = [self.find_steady_friction(before), np.log(self.slip_distance / before)]
        found = solve_ivp(change, (0, times[-1]), start, "Radau", times, rtol=1e-10, atol=1e-13)
        return np.asarray(found.y[0])


def read_friction(steps: list[Step]) -> Real:
    """Friction coefficients (k, m)."""
    return np.array([-step.contact.traction_s / step.contact.traction_n for step in steps])
