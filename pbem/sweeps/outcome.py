"""The state that a run has reached, as far as quantities are taken from it; collected while it goes on, without a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from pbem.arrays import Integer, Real
from pbem.contact.laws import collect_laws
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Faces, Mesh, list_faces, sort_pairs
from pbem.model.model import Model
from pbem.results.absent import Absence
from pbem.results.energy import Energy, EnergyBalance
from pbem.results.interface_tips import list_tip_curves
from pbem.results.pair_weights import weigh_mesh_pairs
from pbem.results.rigid import measure_rigid
from pbem.results.tips import collect_tip_rules
from pbem.solve.problem.step import ContactState, SilentReporter, Step

FACTORS = ("KI", "KII", "J", "T")
Kind = Literal["reactions", "contact", "tips", "rigid"]


class AbsentNameError(LookupError):
    """A case has nothing of a name that another case of the sweep has."""


@dataclass(frozen=True)
class Names:
    """What there is to ask for: outer curves, interfaces and cracks with pairs, cracks with tips; families of several;
    rigid bodies.

    families: the names that stand for more than one, each with its members.
    """

    reactions: tuple[str, ...]
    contact: tuple[str, ...]
    tips: tuple[str, ...]
    families: Mapping[str, tuple[str, ...]]
    rigid: tuple[str, ...] = ()

    def find_members(self, kind: Kind, name: str | None) -> tuple[str, ...]:
        """What a name stands for in this case: itself, or all of its family; None: everything of the kind.

        Cuts give a curve other pieces in one case than in another, so it may be one in one and several in another.
        Raises AbsentNameError where there is nothing of this name.
        """
        known: tuple[str, ...] = getattr(self, kind)
        if name is None or name in known:
            return known if name is None else (name,)
        there, found, open_names = set(known), [], list(self.families.get(name, ()))
        while open_names:
            member = open_names.pop(0)
            if member in there:
                found.append(member)
            elif member != name:  # a generated curve may itself be cut in pieces
                open_names = [*self.families.get(member, ()), *open_names]
        if not found:
            raise AbsentNameError(f"this case has no '{name}' with {kind}")
        return tuple(dict.fromkeys(found))


def list_quantity_names(model: Model, mesh: Mesh) -> Names:
    """The names of a model; a table [[generate]] and a curve that was cut in pieces stand for all their curves."""
    families: dict[str, list[str]] = {group.name: list(group.members) for group in model.groups}
    contact = tuple(sort_pairs(mesh))
    for name in dict.fromkeys((*model.curves, *contact)):
        stem, dot, piece = name.rpartition(".")
        trace = model.traces.get(name, "")  # v1.2 of v1.2.1 where a user calls curves v1.2 and v1.3
        while dot and piece.isdecimal() and stem not in model.curves and len(stem) >= len(trace):
            families.setdefault(stem, []).append(name)
            stem, dot, piece = stem.rpartition(".")  # of a piece that is cut again
    return Names(
        tuple(model.conditions), contact, tuple(list_tip_curves(model, mesh)),
        {name: tuple(members) for name, members in families.items()}, tuple(model.rigid),
    )


class Outcome(SilentReporter):
    """The last step of a run and its energies. A reporter: a run tells `begin` and `accept`.

    step: None as long as there is none; iterations: of Newton's method so far; notes: what was told from the first step
    on, each once; what is said of a model before is seen by checking it.
    """

    model: Model
    mesh: Mesh
    energy: Energy
    _absence: Absence
    _balance: EnergyBalance

    def __init__(self) -> None:
        self.step: Step | None = None
        self.iterations = 0
        self.started = False
        self.notes: dict[str, None] = {}

    def begin(self, model: Model) -> None:
        """A run begins, or a further pass of one."""
        self.expect(model, generate_mesh(model))

    def expect(self, model: Model, mesh: Mesh) -> None:
        """The steps that follow are of this model and mesh."""
        self.__dict__ = {
            "step": None, "iterations": self.iterations, "started": self.started, "notes": self.notes, "model": model,
            "mesh": mesh, "_balance": EnergyBalance(model, mesh, None, None), "energy": Energy(0.0, 0.0, 0.0),
            "_absence": Absence(model, mesh, np.zeros(0, dtype=np.int64)),
        }

    def accept(self, step: Step) -> None:
        """Take a converged step."""
        self.energy = self._balance.add(step)
        self.iterations += len(step.iterations)
        self.step = step
        for name in ("_tips", "contact"):
            self.__dict__.pop(name, None)

    def start_step(self, stage: int, reached: float, target: float) -> None:
        """A step begins."""
        self.started = True

    def note(self, text: str) -> None:
        """Keep it if it is of the steps."""
        if self.started:
            self.notes[text] = None

    @property
    def last(self) -> Step:
        """The last step; there is one."""
        assert self.step is not None
        return self.step

    @cached_property
    def contact(self) -> ContactState:
        """The pairs after the last step, without jumps where a stage has removed a side (NaN), as results have them."""
        return self._absence.blank(replace(self.last, interior=None)).contact

    @cached_property
    def names(self) -> Names:
        """What there is in this case, which another case of the sweep may not have."""
        return list_quantity_names(self.model, self.mesh)

    def find_pairs(self, name: str) -> Integer:
        """The numbers of an interface's pairs. Raises KeyError if there is none of this name."""
        return self._pairs[name]

    @cached_property
    def weights(self) -> tuple[Real, Real]:
        """Of all pairs (m,), for tractions and for jumps: lengths, as `integrate` of results has them."""
        return weigh_mesh_pairs(self.mesh)

    @cached_property
    def gap(self) -> Real:
        """Length (m,): the part of the openings that is there without displacements."""
        return collect_laws(self.model, self.mesh).gap

    @cached_property
    def _pairs(self) -> Mapping[str, Integer]:
        return sort_pairs(self.mesh)

    def sum_reaction(self, curve: str) -> tuple[float, float, float]:
        """Force along x and y of the traction on an outer curve, and its moment about the origin of coordinates."""
        faces, step = self._faces, self.last
        number = self.mesh.curve_names.index(curve)
        on = faces.curve == number
        force = faces.weight[on] * step.traction[on]
        place = faces.position[on] + self.model.origin
        return float(force.real.sum()), float(force.imag.sum()), float((np.conj(place) * force).imag.sum())

    def measure_rigid(self, name: str) -> tuple[float, ...]:
        """Force along x and y and moment on a rigid body, its displacement along x and y and its rotation (degrees)."""
        step, body = self.last, self.model.rigid[name]
        force, motion = measure_rigid(
            self.model, body, self.mesh.curve_names, self._faces, step.displacement, step.traction
        )
        return tuple(float(value) for value in (*force, *motion))

    @cached_property
    def _faces(self) -> Faces:
        return list_faces(self.mesh)

    def find_factors(self, crack: str) -> Mapping[str, Real]:
        """KI, KII, J and T (2,) at the start and the end of a crack; NaN where no tip is.

        Raises KeyError if there is none of this name.
        """
        return self._tips[crack]

    @cached_property
    def _tips(self) -> Mapping[str, Mapping[str, Real]]:
        rules = collect_tip_rules(self.model, self.mesh)
        if not rules.cracks:
            return {}
        values = self._absence.blank_tips(self.last.stage, rules.cracks, rules.evaluate_all(self.last))
        return {name: {kind: values[kind][k] for kind in FACTORS} for k, name in enumerate(rules.cracks)}
