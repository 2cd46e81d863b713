"""How many elements carry a contact: too few do not resolve its pressures, which is said."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.contact.laws import OPEN, Modes, find_joint
from pbem.mesh.mesh import Mesh
from pbem.mesh.mortar_pairs import FEWEST
from pbem.model.model import Contact, Model
from pbem.solve.problem.step import Step
from pbem.wording import count, list_names

# Faces that carry less than this part of what those do that carry most in the run are not named; nor bodies that
# nothing presses, where tractions are rounding: this part of the modulus times displacements over the model's size.
LEAST_CARRIED, ROUNDING = 0.01, 1e-9
# So many are named.
MOST_NAMED = 5


class Coverage:
    """The elements on which faces of two bodies, and those with a gap, are closed in the steps of a run.

    Not those of cracks: what bears there lies within one body.
    """

    def __init__(self, model: Model, mesh: Mesh) -> None:
        """Of this mesh; nothing is known of steps before."""
        names = mesh.interface_names
        self._names, self._last = names, len(model.stages) - 1
        meets = np.array([_can_meet(model, name) for name in names], dtype=bool)
        # In fields of cracks nothing does: large meshes form what is asked for.
        interface = np.asarray(mesh.pairs.interface) if meets.any() else np.zeros(0, dtype=np.int64)
        self._pairs: Integer = np.flatnonzero(meets[interface]) if meets.any() else interface
        own, element = interface[self._pairs], mesh.pairs.slave[self._pairs] // (mesh.order + 1)
        places, self._place = np.unique(np.stack([own, element]), axis=1, return_inverse=True)
        self._place = self._place.ravel()
        self._interface: Integer = places[0].astype(np.int64)
        self._facing = np.bincount(self._interface, minlength=len(names))
        self._weight: Real = np.asarray(mesh.pairs.weight[self._pairs])
        self._modulus = max((region.material.plane_modulus for region in model.regions), default=0.0) / model.size
        # Of interfaces on few elements the last step and all others: number, elements, force; the largest force so far.
        self._few: dict[int, list[tuple[int, int, float]]] = {}
        self._largest = 0.0

    def follow(self, step: Step) -> tuple[str, ...]:
        """After the last step of a run sentences for all that were closed on fewer than FEWEST elements, each of them
        carrying a part of the loads, in it or in a step before; none after other steps."""
        if not self.watches:
            return ()
        self.remember(step.number, step.contact.mode, step.contact.traction_n, step.displacement)
        return self._describe(step.number) if step.last_of_stage and step.stage == self._last else ()

    @property
    def watches(self) -> bool:
        """Whether there are any such faces."""
        return bool(len(self._pairs))

    def remember(self, number: int, mode: Modes, traction_n: Real, displacement: Complex) -> None:
        """Take note of the step of this number: modes and normal tractions (m,) of pairs, displacements of nodes."""
        closed, force = self._measure(mode, traction_n, displacement)
        for few in np.flatnonzero((closed > 0) & (closed < FEWEST) & (self._facing >= FEWEST) & (force > 0)):
            self._few.setdefault(int(few), []).append((number, int(closed[few]), float(force[few])))
        self._largest = max(self._largest, float(force.max(initial=0.0)))

    def _describe(self, last: int) -> tuple[str, ...]:
        """The sentences after the last step, of this number."""
        found = {}
        for number, every in sorted(self._few.items()):
            steps = [each[:2] for each in every if each[2] > LEAST_CARRIED * self._largest]
            if not steps:
                continue
            at, least = steps[-1] if steps[-1][0] == last else min(steps, key=lambda each: each[1])
            more = f" and in {count(len(steps) - 1, 'more step')} on fewer than {FEWEST}" * (len(steps) > 1)
            when, more = ("", "") if at == last else (f"in step {at} ", more)
            found[f"'{self._names[number]}'"] = f"{when}on {least} of its {self._facing[number]} elements{more}"
        notes = [f"{name} is closed {where}, too few to resolve its pressure: {FEWEST} or more are needed."
                 for name, where in found.items()]
        if len(notes) <= MOST_NAMED:
            return tuple(notes)
        return (*notes[:MOST_NAMED], f"The same is true of {list_names([*found][MOST_NAMED:], MOST_NAMED)}.")

    def _measure(self, mode: Modes, traction_n: Real, displacement: Complex) -> tuple[Integer, Real]:
        """How many elements of each interface are closed, and the force that presses them; 0 where it is rounding."""
        size, held = len(self._names), mode[self._pairs] != OPEN
        touched = np.zeros(len(self._interface), dtype=bool)
        touched[self._place[held]] = True
        none = ROUNDING * self._modulus * float(np.abs(displacement).max(initial=0.0))
        pressure = np.where(held, -traction_n[self._pairs], 0.0)
        forces = np.where(pressure > none, pressure, 0.0) * self._weight
        force = np.bincount(self._interface[self._place], forces, size).astype(float)
        return np.bincount(self._interface[touched], minlength=size), force


def _can_meet(model: Model, name: str) -> bool:
    """Whether the faces are those of two bodies, or of a gap, and not bonded or parted for good."""
    joint = find_joint(model, name)
    if joint.law.kind in ("bonded", "open"):
        return False
    return isinstance(joint, Contact) or joint.second is not None or bool(joint.law.gap)
