"""Whether contact is admissible between the nodes too, where the equations of contact are not imposed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.closure import find_closure
from pbem.contact.declaration import SLIP_PATH, Slide
from pbem.contact.laws import PairLaws, collect_laws, evaluate_strength, find_creeping
from pbem.contact.loads import evaluate_pressure
from pbem.contact.seat import read_dilation
from pbem.mesh.interpolation import interpolate, interpolate_tips, locate_nodes
from pbem.mesh.mesh import Mesh, sort_pairs
from pbem.model.model import Model
from pbem.solve.problem.step import Step

# Places between a node and the next one on its element, as parts of the way.
PLACES = (0.25, 0.5, 0.75)


@dataclass(frozen=True)
class Violations:
    """By how much interpolated fields break the conditions of contact between the nodes, largest per interface (i,).

    penetration: length by which faces overlap; tension: normal traction beyond the tensile strength; cone: friction
    traction beyond its bound; stress. Zero where they hold, and on bonded interfaces and those that never touch, by law
    or in the stage; cone also where friction creeps, as it then gives way to any traction.
    """

    penetration: Real
    tension: Real
    cone: Real


class BetweenNodes:
    """Reads the fields of the contact pairs between the nodes of their elements."""

    def __init__(self, model: Model, mesh: Mesh) -> None:
        self._model, self._mesh = model, mesh
        self._laws: PairLaws = collect_laws(model, mesh)
        self._interfaces = list(sort_pairs(mesh).values())
        self._pair, self._plain, self._rooted = _place_samples(mesh)

    def find_violations(self, step: Step) -> Violations:
        """Of a step of the run."""
        contact, fluid = step.contact, evaluate_pressure(self._model, self._mesh, step.stage, step.factor)
        laws = self._laws
        checked, creeps = ~(laws.bonded | laws.parted | self._find_held(step.stage)), find_creeping(laws)
        count = laws.count
        penetration, tension, cone = np.zeros(count), np.zeros(count), np.zeros(count)
        for plain, rooted in zip(self._plain, self._rooted, strict=True):
            # Gaps, and what joints have closed by at rest, do not vanish at tips.
            displaced = contact.opening - laws.gap - read_dilation(laws, contact.internal)
            opening = self._read(displaced, rooted) + self._read(laws.gap, plain)
            p_n, p_s, path = (
                self._read(each, plain) for each in (contact.traction_n, contact.traction_s, contact.slip_path)
            )
            pressure, here = self._read_given(fluid, plain), self._read_laws(plain)
            limit = np.where(contact.broken, 0.0, here.tensile_strength)
            penetration = np.maximum(penetration, find_closure(laws, p_n, pressure)[0] - opening)
            tension = np.maximum(tension, p_n + pressure - limit)
            admissible = np.minimum(p_n, limit - pressure)
            slide = Slide(np.zeros(count), {**contact.internal, SLIP_PATH.name: np.maximum(path, 0.0)})
            bound = evaluate_strength(here, admissible, slide, pressure).bound
            cone = np.maximum(cone, np.where(creeps, 0.0, np.abs(p_s) - bound))
        return Violations(*(self._gather(np.where(checked, each, 0.0)) for each in (penetration, tension, cone)))

    def _read_laws(self, weights: Real) -> PairLaws:
        """The laws with the strengths that they have between the nodes, where these vary along an element."""
        groups = []
        for group in self._laws.strengths:
            parameters = {}
            for key, own in group.parameters.items():
                whole = np.full(self._laws.count, np.nan)
                whole[group.pairs] = own
                read = self._read_given(whole, weights)[group.pairs]
                parameters[key] = np.where(np.isfinite(read), np.maximum(read, np.minimum(own, 0.0)), own)
            groups.append(replace(group, parameters=parameters))
        limit = np.maximum(self._read_given(self._laws.tensile_strength, weights), 0.0)
        return replace(self._laws, strengths=tuple(groups), tensile_strength=limit)

    def _read_given(self, values: Real, weights: Real) -> Real:
        """The same of values (m,) that are given; without rounding where an element has one value."""
        same = (values[self._pair] == values[:, None]).all(axis=1)
        return np.where(same, values, self._read(values, weights))

    def _find_held(self, stage: int) -> Bool:
        """The pairs (m,) that a stage has closed or opened, whatever their law."""
        joints = self._model.stages[stage].construction.joints
        held = [number for number, name in enumerate(self._mesh.interface_names) if name in joints]
        return np.isin(self._mesh.pairs.interface, held)

    def _read(self, values: Real, weights: Real) -> Real:
        return np.asarray(np.einsum("mj,mj->m", weights, values[self._pair]))

    def _gather(self, values: Real) -> Real:
        return np.array([values[pairs].max() for pairs in self._interfaces])


def _place_samples(mesh: Mesh) -> tuple[Integer, list[Real], list[Real]]:
    """For every pair the pairs (m, p + 1) on its element and, for each of the PLACES on the way to the next node, the
    weights (m, p + 1) of their values: by polynomials, and with the square root on crack-tip elements.

    The last node of an element, and those of an element with nodes that are no pairs, stand for themselves.
    """
    pairs, per_element = mesh.pairs, mesh.order + 1
    number = np.full(mesh.nodes, -1)
    number[pairs.slave] = np.arange(pairs.count)
    element = pairs.slave // per_element
    mates = number[element[:, None] * per_element + np.arange(per_element)]
    own = pairs.slave % per_element
    alone = (own == mesh.order) | (mates < 0).any(axis=1)
    local, itself = locate_nodes(mesh)[element], np.eye(per_element)[own]
    rows = np.arange(pairs.count)
    here, there = local[rows, own], local[rows, np.minimum(own + 1, mesh.order)]
    tips = np.flatnonzero(mesh.tip[element] > 0)
    plain, rooted = [], []
    for place in PLACES:
        s = (here + place * (there - here))[:, None]
        weights = np.where(alone[:, None], itself, interpolate(local, s)[:, 0])
        plain.append(weights)
        roots = weights.copy()
        if len(tips):
            shapes = interpolate_tips(mesh.tip[element[tips]], local[tips], s[tips])[:, 0]
            roots[tips] = np.where(alone[tips, None], itself[tips], shapes)
        rooted.append(roots)
    return np.where(mates < 0, rows[:, None], mates), plain, rooted
