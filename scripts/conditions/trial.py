"""A case with what tells how far its results are off; the table of all conditions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from pbem.results.reader import Results
from scripts.conditions.draft import Setting
from scripts.conditions.field import Field
from scripts.conditions.place import Complex, Place, Real

# Of fields that the shapes contain: dense, and with products to 1e-10.
EXACT = {"dense": 1e-8, "hierarchical": 1e-6}


class Figure(NamedTuple):
    """An error relative to the largest of its kind, and what it may be."""

    name: str
    error: float
    tolerance: float


Check = Callable[[Results], Iterator[Figure]]


@dataclass(frozen=True)
class Trial:
    """A case and what its results have to obey; refused: words of the message where it cannot be computed; releases:
    whether faces run away in it, as a step comes upon them that have to slip at once; lacks: what the discrete fields
    may lack of the balance of energies, where the shapes do not contain them."""

    case: dict[str, Any]
    check: Check
    refused: str = ""
    releases: bool = False
    lacks: float = 1e-4


Maker = Callable[[Setting], Trial]
CONDITIONS: dict[str, Maker] = {}


def condition(name: str) -> Callable[[Maker], Maker]:
    """Enters a condition by its name."""

    def enter(maker: Maker) -> Maker:
        assert name not in CONDITIONS
        CONDITIONS[name] = maker
        return maker

    return enter


def exact(setting: Setting, factor: float = 1.0) -> float:
    """Tolerance of fields in the space of the elements; far from the origin coordinates themselves are rounded."""
    place = setting.place
    return factor * EXACT[setting.operator] * max(1.0, 1e-3 * abs(place.shift) / place.size)


def off(found: Complex | Real, expected: Complex | Real | float, scale: float) -> float:
    """The largest difference over a scale; infinite where something is no number."""
    difference = np.abs(np.asarray(found) - expected)
    if difference.size == 0 or not np.isfinite(difference).all():
        return float("inf")
    return float(difference.max() / scale)


def own(results: Results, region: str) -> np.ndarray:
    """The nodes of a region."""
    return np.flatnonzero(results.nodes.region == results.nodes.region_names.index(region))


def compare(
    results: Results, place: Place, fields: Mapping[str, Field], tolerance: float, factor: float = 1.0,
    step: int = -1, stress: float | None = None, length: float | None = None, rigid: bool = False,
) -> Iterator[Figure]:
    """Displacements and tractions at the nodes of regions, and fields inside, against fields times a factor.

    stress, length: scales, by default the largest stress and displacement. rigid: displacements up to a rigid motion.
    """
    biggest = max(np.abs(component).max() for field in fields.values() for component in field.stress())
    stress = stress if stress is not None else biggest * abs(factor)
    for name, field in fields.items():
        nodes = own(results, name)
        z = place.local(results.nodes.position[nodes])
        normal = place.back(results.nodes.normal[nodes])
        u = place.back(results.displacement[step][nodes]) / place.size
        t = place.back(results.traction[step][nodes]) / place.stress
        exact_u = factor * field.displacement_at(z)
        scale = length if length is not None else max(np.abs(exact_u).max(), stress / field.material.young)
        if rigid:
            u = drop_motion(z, u - exact_u) + exact_u
        yield Figure(f"u {name}", off(u, exact_u, scale), tolerance)
        initial = Field(field.material, 0 * field.ux, 0 * field.uy, initial=field.initial)
        change = field.traction_at(z, normal) - initial.traction_at(z, normal)
        yield Figure(f"t {name}", off(t, factor * change + initial.traction_at(z, normal), stress), tolerance)


def drop_motion(z: Complex, u: Complex) -> Complex:
    """Displacements less the rigid motion next to them."""
    columns = np.concatenate([
        np.stack([np.ones_like(z.real), np.zeros_like(z.real), -z.imag], axis=1),
        np.stack([np.zeros_like(z.real), np.ones_like(z.real), z.real], axis=1),
    ])  # fmt: skip
    values = np.concatenate([u.real, u.imag])
    left = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
    return np.asarray(left[: len(z)] + 1j * left[len(z) :])


def inside(
    results: Results, place: Place, field: Field, points: list[complex], tolerance: float, step: int = -1,
    scale: float | None = None,
) -> Iterator[Figure]:
    """Stress at points, against a field at the full load."""
    found = results.evaluate([place.at(z) for z in points], steps=[step]).stress[0]
    z = np.array(points)
    one, other = field.traction_at(z, np.full(len(z), 1 + 0j)), field.traction_at(z, np.full(len(z), 1j))
    expected = np.array([
        list(place.stress_components((a.real, b.imag, a.imag)).values()) for a, b in zip(one, other, strict=True)
    ])  # fmt: skip
    scale = (scale or max(np.abs(each).max() for each in field.stress())) * place.stress
    yield Figure("stress inside", off(found, expected, scale), tolerance)


# Energies below this part of stress times strain times area, or of modulus times displacement squared, are rounding.
NO_ENERGY = 1e-9


def check_energy(results: Results, trial: Trial) -> Iterator[Figure]:
    """Loads do what is stored, dissipated, released and removed; nothing runs away where loads grow steadily."""
    energy = results.energy
    external, elastic = np.asarray(energy.external), np.asarray(energy.elastic)
    if not np.isfinite(external).all():
        return
    young = max(material["young"] for material in trial.case["materials"].values())
    area = float(np.prod(np.ptp(results.nodes.position, axis=0)))
    stress, moved = (float(np.nanmax(np.abs(values))) for values in (results.traction, results.displacement))
    least = NO_ENERGY * (stress**2 * area / young + young * moved**2)
    scale = max(np.abs(external).max(), np.abs(elastic).max(), least)
    left = external - elastic - energy.dissipated - energy.released - energy.removed
    yield Figure("energy", off(left, 0.0, scale), trial.lacks)
    yield Figure("dissipated", float(max(-np.diff(energy.dissipated, prepend=0.0).min(), 0.0)) / scale, 1e-9)
    if not trial.releases:
        yield Figure("released", off(np.asarray(energy.released), 0.0, scale), trial.lacks)
