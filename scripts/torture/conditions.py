"""What a settled run has to obey, from its stored numbers: contact conditions, balance of each body, energy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pbem.model.sliver import Tie
from pbem.results.reader import Results

from .history import evaluate_loads

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Tables = Mapping[str, Any]

STICK, SLIP, OPEN = 0, 1, 2

# A body that carries less than this part of all forces is as good as without loads.
LIGHT = 1e-3


# Of the largest traction: what rounding leaves of none.
NOTHING = 1e-10


@dataclass(frozen=True)
class Scales:
    """Largest traction of the run, with the stress far away; largest jump of any pair, with the strain's share."""

    stress: float
    jump: float


def measure_scales(results: Results, tables: Tables) -> Scales:
    """The scales of a run, by which violations are divided."""
    stress = max(float(np.abs(results.traction).max(initial=0.0)), find_stress_far_away(tables))
    jumps = [
        np.abs(values).max(initial=0.0) for each in results.contact.values() for values in (each.opening, each.slip)
    ]
    vertices = results.elements.vertices.reshape(-1, 2)
    size = float(np.ptp(vertices, axis=0).max())
    hardest = max(material["young"] for material in tables["materials"].values())
    return Scales(stress, max(*map(float, jumps), stress / hardest * size))


def find_stress_far_away(tables: Tables) -> float:
    """The largest component of the stress far away in any stage; 0 if there is none."""
    everywhere = (tables, *tables.get("stages", ()))
    return max((abs(value) for table in everywhere for value in table.get("remote", {}).values()), default=0.0)


def measure_contact(
    results: Results, tables: Tables, scales: Scales, ties: Sequence[Tie] = ()
) -> dict[str, float]:
    """The largest violation of each condition over all steps, relative to the scales (0: none).

    ties: bits of curves in the corners of narrow wedges, whose pairs take the mode of their neighbour, are left out.
    """
    worst: dict[str, float] = {}
    first = 0
    for name in results.pairs.names:
        contact = results.contact[name]
        own = slice(first, first + contact.mode.shape[1])
        first = own.stop
        broken = np.array([results.pairs.at("broken", step)[own] for step in range(len(results.steps))])
        law = {**tables.get("interfaces", {}), **tables.get("contacts", {})}.get(name, {})
        pressure = np.array([
            evaluate_loads(tables, int(stage), float(factor)).pressure.get(name, 0.0)
            for stage, factor in zip(results.steps.stage, results.steps.factor, strict=True)
        ])  # fmt: skip
        tied = np.zeros(contact.mode.shape[1], dtype=bool)
        for tie in ties:
            if tie.curve in (name, contact.first):
                tied |= (contact.arc_length > tie.start) & (contact.arc_length < tie.end)
        found = _measure_pairs(contact, law, broken, pressure[:, None], ~tied, NOTHING * scales.stress)
        for rule, (value, is_length) in found.items():
            relative = value / (scales.jump if is_length else scales.stress)
            worst[rule] = max(worst.get(rule, 0.0), relative)
    return worst


def _measure_pairs(
    contact: Any, law: Tables, broken: NDArray[np.bool_], pressure: Real, counted: NDArray[np.bool_], nothing: float
) -> dict[str, tuple[float, bool]]:
    """Largest violations at the counted pairs (m,) of one curve, and whether they are lengths (or stresses).

    nothing: friction of no more than this stress has no sense, as of bodies that lie on pairs which carry nothing.
    """
    mode, p_n, p_s = contact.mode, contact.traction_n, contact.traction_s
    stick, slips, is_open = (mode == kind for kind in (STICK, SLIP, OPEN))
    rigid_n = contact.opening - (p_n / law["normal_stiffness"] if "normal_stiffness" in law else 0.0)
    rigid_s = contact.slip - (p_s / law["tangential_stiffness"] if "tangential_stiffness" in law else 0.0)
    increment = np.diff(rigid_s, axis=0, prepend=0.0)
    path = np.cumsum(np.where(slips, np.abs(increment), 0.0), axis=0)
    friction = np.full(mode.shape, law.get("friction", 0.0))
    if "slip_distance" in law:
        part = np.clip(path / law["slip_distance"], 0.0, 1.0)
        friction = friction + (law["friction_dynamic"] - friction) * part
    cohesion = np.where(broken, 0.0, law.get("cohesion", 0.0))
    limit = np.where(broken, 0.0, law.get("tensile_strength", 0.0))
    bound = np.maximum(cohesion - friction * p_n, 0.0)
    intact = ~broken & bool(law.get("cohesion_lost"))
    healed = np.diff(broken.astype(int), axis=0, prepend=0) < 0
    far = np.where(intact, np.inf, 0.0)  # an intact bond neither slips nor parts

    def largest(values: Real, where: NDArray[np.bool_]) -> float:
        return float(np.max(values, where=where & counted, initial=0.0))

    return {
        "penetration": (largest(-contact.opening, np.ones(mode.shape, dtype=bool)) if "normal_stiffness" not in law
                        else largest(-rigid_n, np.ones(mode.shape, dtype=bool)), True),
        "closed pair open": (largest(np.abs(rigid_n), ~is_open), True),
        "tension": (largest(p_n + pressure - limit, ~is_open), False),
        "open pair loaded": (largest(np.abs(p_n + pressure) + np.abs(p_s), is_open), False),
        "cone": (largest(np.abs(p_s) - bound, ~is_open), False),
        "slip below the cone": (largest(bound - np.abs(p_s), slips), False),
        "slip along friction": (largest(-increment * np.sign(p_s), slips & (bound > nothing)), True),
        "stick moves": (largest(np.abs(increment), stick), True),
        "bond": (largest(far, (mode != STICK) | healed), True),
    }


def measure_balance(results: Results, tables: Tables) -> float:
    """The largest force or moment left over on a body, relative to the sum of the forces on its elements.

    Of bodies that hardly carry anything it is relative to a part of the forces on the whole model.
    """
    worst = 0.0
    elements, order = results.elements, results.nodes.order
    position = results.nodes.position[:, 0] + 1j * results.nodes.position[:, 1]
    traction = results.traction[..., 0] + 1j * results.traction[..., 1]
    weight = _weigh_nodes(results, position)
    whole = max(np.abs(weight * traction).sum(axis=1).max(), find_stress_far_away(tables) * weight.sum())
    for number, name in enumerate(results.nodes.region_names):
        table = tables["regions"][name]
        own = np.flatnonzero((elements.region == number) & ~elements.crack)
        if table.get("infinite") or not len(own):
            continue
        nodes = (own[:, None] * (order + 1) + np.arange(order + 1)).ravel()
        origin = position[nodes].mean()
        arm = position[nodes] - origin
        start, end = (elements.vertices[own, side] @ [1, 1j] - origin for side in (0, 1))
        cross = 0.5 * (np.conj(start) * end).imag
        area, lever = cross.sum(), (cross * (start + end) / 3).sum()
        density = tables["materials"][table["material"]].get("density", 0.0)
        for step, (stage, factor) in enumerate(zip(results.steps.stage, results.steps.factor, strict=True)):
            pull = density * evaluate_loads(tables, int(stage), float(factor)).gravity
            forces = weight[nodes] * traction[step, nodes]
            left = abs(forces.sum() + pull * area)
            moment = abs((np.conj(arm) * forces).imag.sum() + (np.conj(lever) * pull).imag)
            scale = np.abs(forces).sum() + abs(pull * area) + LIGHT * whole
            if scale > 0:
                worst = max(worst, left / scale, moment / scale / np.abs(arm).max())
    return float(worst)


def _weigh_nodes(results: Results, position: Complex) -> Real:
    """Weights of the rule through the nodes of each element; the faces of cracks cancel and count nothing."""
    elements, count = results.elements, results.nodes.order + 1
    start, end = (elements.vertices[:, side] @ [1, 1j] for side in (0, 1))
    nodes = position.reshape(-1, count)
    sweep = elements.sweep
    is_arc = sweep != 0
    turn = np.where(is_arc, sweep, 1.0)
    center = 0.5 * (start + end) + 0.5j * (end - start) / np.tan(0.5 * turn)
    angle = np.angle((nodes - center[:, None]) / (start - center)[:, None] * np.exp(-0.5j * turn)[:, None])
    along = ((nodes - 0.5 * (start + end)[:, None]) / (0.5 * (end - start))[:, None]).real
    s = np.where(is_arc[:, None], angle / (0.5 * turn)[:, None], along)
    half = np.where(is_arc, 0.5 * np.abs(sweep) * np.abs(start - center), 0.5 * np.abs(end - start))
    powers = np.arange(count)
    moments = np.where(powers % 2 == 0, 2.0 / (powers + 1), 0.0)
    weight = np.linalg.solve(s[:, None, :] ** powers[None, :, None], np.broadcast_to(moments, s.shape)[..., None])
    return np.asarray((np.where(elements.crack, 0.0, half)[:, None] * weight[..., 0]).ravel())


def measure_energy(results: Results, tables: Tables) -> float:
    """How much dissipation is taken back, or elastic energy negative, relative to the largest energy.

    The energy of an infinite region is counted from that of the stress far away alone, and may be negative.
    """
    energy = results.energy
    kinds = (energy.external, energy.elastic, energy.dissipated)
    scale = max(float(np.abs(values).max(initial=0.0)) for values in kinds)
    infinite = any(table.get("infinite") for table in tables["regions"].values())
    taken = max(0.0, -float(np.diff(energy.dissipated, prepend=0.0).min(initial=0.0)))
    negative = 0.0 if infinite else max(0.0, -float(energy.elastic.min(initial=0.0)))
    return max(taken, negative) / scale if scale > 0 else 0.0


def is_finite(results: Results) -> bool:
    """Whether all displacements, tractions and energies are numbers."""
    energy = results.energy
    arrays = (results.displacement, results.traction, energy.external, energy.elastic, energy.dissipated)
    return all(bool(np.isfinite(values).all()) for values in arrays)
