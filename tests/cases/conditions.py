"""What every result file has to obey: the layout, and the contact conditions in the file's own numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from pbem.contact.laws import OPEN, SLIP, STICK

# Of the largest length or traction of the interface: rounding, times the condition of the equations.
ROUNDING = 1e-9
# Friction that depends on the rate is known to the tolerance of Newton's method times the change of ln V, where pairs
# move at all: at this part of the largest rate and more.
CREEP, SLOW = 1e-7, 1e-6
# Of the largest reaction: the error of the discretisation, largest with traction equations only.
BALANCE = 1.5e-3

ATTRIBUTES = ("title", "pbem_version", "petsc_version", "case", "units_length", "units_stress", "status", "ranks")
PER_PAIR = ("mode", "opening", "slip", "traction_n", "traction_s")

Array = NDArray[Any]


def find_faults(path: Path) -> list[str]:
    """All that is wrong with a result file of a finished run, every step of which is stored."""
    with h5py.File(path, "r") as file:
        faults = list(_check_layout(file))
        # Numbers are looked at only where the layout says what they are.
        return faults or [*_check_fields(file), *_check_balance(file), *_check_contacts(file)]


def _check_layout(file: h5py.File) -> Iterator[str]:
    yield from (f"attribute {name} is missing" for name in ATTRIBUTES if name not in file.attrs)
    if file.attrs.get("status") != "finished":
        yield f"status {file.attrs.get('status')!r}"
    n, k = (file[name].shape[0] if name in file else 0 for name in ("nodes/position", "steps/factor"))
    expected: dict[str, tuple[int | None, ...]] = {
        "nodes/position": (n, 2), "nodes/normal": (n, 2), "nodes/region": (n,), "nodes/curve": (n,),
        "nodes/element": (n,), "elements/vertices": (None, 2, 2), "steps/stage": (k,), "steps/factor": (k,),
        "steps/iterations": (k,), "steps/residual": (k,), "fields/displacement": (k, n, 2),
        "fields/traction": (k, n, 2), "reactions": (), "convergence": (None,),
    }  # fmt: skip
    expected |= {f"reactions/{name}": (k, 2) for name in file.get("reactions", ())}
    for name, group in file.get("contact", {}).items():
        m = group["arc_length"].shape[0] if "arc_length" in group else 0
        expected |= {f"contact/{name}/position": (m, 2), f"contact/{name}/normal": (m, 2)}
        expected |= {f"contact/{name}/arc_length": (m,)}
        expected |= {f"contact/{name}/{field}": (k, m) for field in PER_PAIR}
    for name, shape in expected.items():
        if name not in file:
            yield f"{name} is missing"
        elif shape and not _fits(file[name].shape, shape):
            yield f"{name} has the shape {file[name].shape}, expected {shape}"
    if n == 0 or k == 0:
        yield "no nodes or no steps"


def _fits(found: tuple[int, ...], expected: tuple[int | None, ...]) -> bool:
    return len(found) == len(expected) and all(b in (None, a) for a, b in zip(found, expected, strict=True))


def _check_fields(file: h5py.File) -> Iterator[str]:
    for name in ("fields/displacement", "fields/traction"):
        if not np.isfinite(file[name][...]).all():
            yield f"{name} is not finite"
    if abs(np.linalg.norm(file["nodes/normal"][...], axis=1) - 1).max() > 1e-12:
        yield "nodes/normal are no unit vectors"
    factor, stage = file["steps/factor"][...], file["steps/stage"][...]
    if not ((factor > 0) & (factor <= 1)).all() or factor[-1] != 1 or (np.diff(stage + factor) <= 0).any():
        yield "steps do not go forward to the end of the last stage"


def _check_balance(file: h5py.File) -> Iterator[str]:
    """The bodies are in equilibrium, in a case without weight and far stresses."""
    forces = np.array([force[...] for force in file["reactions"].values()])
    left = abs(forces.sum(axis=0)).max() / abs(forces).max()
    if left > BALANCE:
        yield f"reactions are out of balance by {left:.1e} of the largest"


def _check_contacts(file: h5py.File) -> Iterator[str]:
    for name, group in file["contact"].items():
        fields = {field: values[...] for field, values in group.items()}
        yield from (f"{name}: {fault}" for fault in _check_contact(fields, group.attrs))


def _find_friction(fields: dict[str, Array], law: Mapping[str, Any]) -> Array:
    """The friction coefficient at the rate and state of each pair; of those all but at rest, what they have."""
    rate, state = fields["slip_rate"], fields["state"]
    moves = rate > SLOW * rate.max()
    logarithms = [np.log(np.where(moves, rate, law["reference_rate"]) / law["reference_rate"]),
                  np.log(law["reference_rate"] * state / law["slip_distance"])]
    friction = law["friction"] + law["rate_effect"] * logarithms[0] + law["state_effect"] * logarithms[1]
    return np.where(moves, friction, abs(fields["traction_s"]) / np.maximum(-fields["traction_n"], 1e-300))


def _check_contact(fields: dict[str, Array], law: Mapping[str, Any]) -> Iterator[str]:
    """Opening >= 0, tension only as far as the law allows, the friction cone, and slip along friction."""
    friction, cohesion, tensile_strength = (law[key] for key in ("friction", "cohesion", "tensile_strength"))
    mode, opening, slip, normal, tangential = (fields[name] for name in PER_PAIR)
    arc_length = fields["arc_length"]
    jump, traction = max(abs(opening).max(), abs(slip).max()), max(abs(normal).max(), abs(tangential).max())
    length, stress = ROUNDING * max(np.ptp(arc_length), jump), ROUNDING * traction
    stick, slips, is_open = (mode == kind for kind in (STICK, SLIP, OPEN))
    if law["law"] == "rate_and_state":
        friction = _find_friction(fields, law)
        stress = max(stress, CREEP * traction)
    bound = np.maximum(cohesion - friction * normal, 0.0)
    increment = np.diff(slip, axis=0, prepend=0.0)
    rules = {
        "an unknown mode": ~(stick | slips | is_open),
        "penetration": opening < -length,
        "opening of a closed pair": ~is_open & (opening > length),
        "tension beyond the strength": ~is_open & (normal > tensile_strength + stress),
        "traction of an open pair": is_open & (np.hypot(normal, tangential) > stress),
        "friction beyond the cone": ~is_open & (abs(tangential) > bound + stress),
        "slip below the cone": slips & (abs(tangential) < bound - stress),
        "slip against friction": slips & (increment * tangential < -ROUNDING * jump * traction),
        "slip of a sticking pair": stick & (abs(increment) > length),
    }
    if (np.diff(arc_length) <= 0).any():
        yield "pairs are not sorted by arc length"
    if abs(np.linalg.norm(fields["normal"], axis=1) - 1).max() > 1e-12:
        yield "normals are no unit vectors"
    for rule, broken in rules.items():
        if broken.any():
            step, pair = np.argwhere(broken)[0]
            yield f"{rule} at {broken.sum()} places, first in step {step + 1} at arc length {arc_length[pair]:.6g}"
