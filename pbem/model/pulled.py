"""Flat rigid tools that their forces pull off the bodies they touch, which nothing can hold."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pbem.arrays import Complex
from pbem.errors import Fault
from pbem.geometry.curve import Leg
from pbem.geometry.junction import format_vector
from pbem.geometry.loop import side_legs
from pbem.model.model import Model, list_timed
from pbem.model.resultants import BALANCED, FRACTIONS
from pbem.model.rigid_body import RigidBody
from pbem.model.rigid_values import list_forces
from pbem.wording import list_names

# A face is flat if its normals differ by less than this.
FLAT = 1e-6
_FRACTIONS = np.linspace(0.0, 1.0, 5)


def check_pulled(model: Model) -> Iterator[Fault]:
    """A fault for every tool with flat faces of one normal whose force points away from what it touches, the first
    stage in which it does. Faces press on it along the normal, whatever friction does; those that bear tension are left
    alone, and tools that move along the normal as is given."""
    for name, body in model.rigid.items():
        normal = _find_normal(model, name) if body.tool and _only_presses(model, body) else None
        if normal is None:
            continue
        held = zip((normal.real, normal.imag), body.known, strict=False)
        if any(abs(part) > FLAT and known != "force" for part, known in held):
            continue
        touched = [each.name for each in model.contacts.values() if {each.first, each.second} & set(body.curves)]
        for number, stage in enumerate(model.stages):
            joints = stage.construction.joints
            if any(contact in joints for contact in touched):
                continue
            fractions = FRACTIONS if list_timed(stage) else (1.0,)
            forces = [complex(*list_forces(model, name, number, fraction)[:2]) for fraction in fractions]
            pulls = [force for force in forces if (np.conj(force) * normal).real < -BALANCED * abs(force)]
            if pulls:
                where = list_names([f"'{contact}'" for contact in touched])
                yield Fault.at(("tools", name), f"a force of {format_vector(pulls[0])} in stage "
                               f"'{stage.name}', which pulls it off {where}",
                               "a force towards what it touches, a motion in its place (ux, uy), or a law that carries "
                               "tension")
                break


def _only_presses(model: Model, body: RigidBody) -> bool:
    """Whether no contact of a tool bears tension."""
    laws = [each.law for each in model.contacts.values() if {each.first, each.second} & set(body.curves)]
    return bool(laws) and all(law.kind == "coulomb" and not law.tensile_strength for law in laws)


def _find_normal(model: Model, name: str) -> complex | None:
    """The normal of all faces of a tool, towards the bodies; None if they have several."""
    region = next(each for each in model.regions if each.name == name)
    legs: list[Leg] = [leg for loop in region.loops for side in loop.sides for leg in side_legs(model.curves, side)]
    normals: Complex = np.concatenate([leg.normals(leg.point(_FRACTIONS)) for leg in legs])
    return complex(normals[0]) if np.abs(normals - normals[0]).max() <= FLAT else None
