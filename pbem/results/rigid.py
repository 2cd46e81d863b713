"""Forces on rigid bodies and how they move: measured, in the result file, and shown."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import h5py
import numpy as np

from pbem.arrays import Complex, Real
from pbem.mesh.mesh import Faces
from pbem.model.model import Model
from pbem.model.rigid_body import FORCES, MOTIONS, RigidBody, find_reference, unit_motions
from pbem.results.growing import GrowingRows
from pbem.results.opening import freeze, read_names
from pbem.results.views import create_group, create_growing, set_attribute, set_texts

# Unknown moments and rotations of a single point are told apart from nothing below this part.
SINGULAR = 1e-12
# Coordinates below this part of the model are rounding.
NOTHING = 1e-12
COMPONENTS = (*FORCES, *MOTIONS)


@dataclass(frozen=True)
class RigidMotion:
    """A rigid body over the k stored steps. about (2,): the point of moments and displacements.

    force (k, 3): fx, fy and the moment that act on it, given or as reactions; motion (k, 3): displacement of the point
    along x and y, and rotation in degrees. known (3,): per direction "force" or "motion", which of both was given.
    curves: that are rigid; tool: whether they bound no region.
    """

    name: str
    curves: tuple[str, ...]
    tool: bool
    known: tuple[str, ...]
    about: Real
    force: Real = field(repr=False)
    motion: Real = field(repr=False)


def measure_rigid(
    model: Model, body: RigidBody, curve_names: tuple[str, ...], faces: Faces, displacement: Complex, traction: Complex
) -> tuple[Real, Real]:
    """Force and motion (3,) of a rigid body, of the fields (f,) at the nodes of all faces (theory, 94)."""
    own = np.flatnonzero(np.isin(faces.curve, [curve_names.index(name) for name in body.curves]))
    motions = unit_motions(faces.position[own], find_reference(body, model.curves, model.origin))
    weight = faces.weight[own]
    # What acts on a tool is what holds it against its contacts; a curve of a body passes on what acts.
    sign = -1.0 if body.tool else 1.0
    force = sign * (weight[:, None] * (np.conj(motions) * traction[own, None]).real).sum(axis=0)
    size = float(np.abs(motions[:, 2]).max()) or 1.0
    scaled = motions / np.array([1.0, 1.0, size])
    rows = np.concatenate([scaled.real, scaled.imag])
    values = np.concatenate([displacement[own].real, displacement[own].imag])
    motion = np.linalg.lstsq(rows, values, rcond=SINGULAR)[0] / np.array([1.0, 1.0, size])
    motion[2] = np.degrees(motion[2])
    return force, motion


def create_rigid(file: h5py.File, model: Model) -> None:
    """Create a group for each rigid body, without entries; nothing without any."""
    if not model.rigid:
        return
    group = create_group(file.id, "rigid")
    set_texts(group, "names", list(model.rigid))
    for name, body in model.rigid.items():
        own = create_group(group, name)
        about = find_reference(body, model.curves, model.origin) + model.origin
        # The middle of a circle about 0 is that but for rounding.
        place = [0.0 if abs(part) < NOTHING * model.size else part for part in (about.real, about.imag)]
        set_attribute(own, "about", np.array(place))
        set_texts(own, "curves", body.curves)
        set_texts(own, "known", body.known)
        set_attribute(own, "tool", body.tool)
        for kind, parts in (("force", FORCES), ("motion", MOTIONS)):
            set_texts(create_growing(own, kind, (3,), np.dtype("f8"), 64), "names", parts)


def append_rigid(
    rows: GrowingRows, model: Model, curve_names: tuple[str, ...], faces: Faces, displacement: Complex,
    traction: Complex,
) -> None:
    """Add a step's entries."""
    for name, body in model.rigid.items():
        values = measure_rigid(model, body, curve_names, faces, displacement, traction)
        for kind, row in zip(("force", "motion"), values, strict=True):
            rows.append(f"rigid/{name}/{kind}", row)


def read_rigid(file: h5py.File, steps: int) -> dict[str, RigidMotion]:
    """The rigid bodies over the first steps."""
    if "rigid" not in file:
        return {}
    made = {}
    for name in read_names(file["rigid"]):
        group = file["rigid"][name]
        made[name] = RigidMotion(
            name, tuple(map(_read_text, group.attrs["curves"])), bool(group.attrs["tool"]),
            tuple(map(_read_text, group.attrs["known"])), freeze(group.attrs["about"][...]),
            freeze(group["force"][:steps]), freeze(group["motion"][:steps]),
        )
    return made


def list_rigid_rows(bodies: Mapping[str, RigidMotion], form: str = ".6g") -> list[list[str]]:
    """Name, point, forces and motions at the last step."""
    return [
        [each.name + (" (tool)" if each.tool else ""), f"({each.about[0]:.6g}, {each.about[1]:.6g})",
         *(f"{value + 0.0:{form}}" for value in (*each.force[-1], *each.motion[-1]))]
        for each in bodies.values()
    ]


def _read_text(text: bytes | str) -> str:
    return text.decode() if isinstance(text, bytes) else str(text)
