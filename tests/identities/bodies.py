"""Bodies for the tests, written as case files and read as the program reads them, and fields put on their meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pbem.bem.operator import assemble_rows
from pbem.case.build import parse_model
from pbem.exact import PlaneField
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.material import Material
from pbem.model.model import Model

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

ROCK = Material("rock", 4.3, 0.27)


@dataclass(frozen=True)
class Body:
    """A case by its parts; numbers in the text are written with all their digits.

    curves: vertices of each polyline, or (center, radius) of a circle; elements: of every leg, or per curve.
    regions: material and boundary curves; cracks: region of each. conditions, interfaces: their tables.
    """

    curves: Mapping[str, Sequence[complex] | tuple[complex, float]]
    regions: Mapping[str, tuple[Material, Sequence[str]]]
    conditions: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    interfaces: Mapping[str, Mapping[str, float | str]] = field(default_factory=dict)
    cracks: Mapping[str, str] = field(default_factory=dict)
    elements: int | Mapping[str, int] = 4
    grading: str = "none"
    scheme: str = "SST"
    order: int = 2
    steps: int = 1
    tips: bool = False
    circles: frozenset[str] = frozenset()

    def write(self) -> str:
        """The text of the case file."""
        lines = ['title = "body"', "[curves]"]
        for name, points in self.curves.items():
            count = self.elements if isinstance(self.elements, int) else self.elements[name]
            if name in self.circles:
                center, radius = complex(points[0]), float(np.real(points[1]))
                # A circle has no corners to be refined; "none": the elements asked for, whatever is near.
                shape = f"center = {_pair(center)}, radius = {radius!r}"
                grading = "none" if self.grading == "none" else "auto"
                lines.append(f'{name} = {{ {shape}, elements = {count}, grading = "{grading}" }}')
                continue
            vertices = ", ".join(_pair(complex(point)) for point in points)
            counts = [count] * (len(points) - 1)
            lines.append(f'{name} = {{ points = [{vertices}], elements = {counts}, grading = "{self.grading}" }}')
        for name, (material, boundary) in self.regions.items():
            cracks = [crack for crack, region in self.cracks.items() if region == name]
            lines += [
                f"[materials.{name}]", f"young = {material.young!r}", f"poisson = {material.poisson!r}",
                f'plane = "{material.plane}"',
                f"[regions.{name}]", f'material = "{name}"', f"boundary = {list(boundary)}", f"cracks = {cracks}",
            ]  # fmt: skip
        for kind, tables in (("boundary", self.conditions), ("interfaces", self.interfaces)):
            for name, table in tables.items():
                lines.append(f"[{kind}.{name}]")
                lines += [f'{key} = "{value}"' if isinstance(value, str) else f"{key} = {float(value)!r}"
                          for key, value in table.items()]  # fmt: skip
        lines += ["[analysis]", f'scheme = "{self.scheme}"', f"order = {self.order}", f"steps = {self.steps}"]
        return "\n".join(lines)

    def build(self) -> Model:
        """The model, with tip elements if asked for."""
        model = parse_model(self.write())[1]
        return replace(model, analysis=replace(model.analysis, tips=self.tips))


def _pair(z: complex) -> str:
    return f"[{float(z.real)!r}, {float(z.imag)!r}]"


def draw_polygon(random: np.random.Generator, corners: int, size: float = 1.0) -> list[complex]:
    """A star-shaped polygon, not convex in general, about a random place."""
    angle = 2 * np.pi * (np.arange(corners) + random.uniform(-0.3, 0.3, corners)) / corners
    radius = random.uniform(0.5, 1.0, corners)
    center = random.normal(size=2) @ [1, 1j]
    return [complex(size * (center + r * np.exp(1j * a))) for r, a in zip(radius, angle, strict=True)]


def list_edges(vertices: Sequence[complex], prefix: str = "edge") -> dict[str, list[complex]]:
    """Each edge of a polygon as a curve of its own."""
    count = len(vertices)
    return {f"{prefix}{k}": [vertices[k], vertices[(k + 1) % count]] for k in range(count)}


def make_polygon(vertices: Sequence[complex], material: Material = ROCK, **options: object) -> Body:
    """A body of one region; displacements are prescribed (as zero) on the whole of its boundary."""
    edges = list_edges(vertices)
    held = {name: {"ux": 0.0, "uy": 0.0} for name in edges}
    return Body(edges, {"body": (material, list(edges))}, held, **options)  # type: ignore[arg-type]


def sample_field(exact: PlaneField, mesh: Mesh) -> Real:
    """v = (u, t) of an exact field at the nodes of a mesh without cracks."""
    both = np.concatenate([exact.displacement(mesh.position), exact.traction(mesh.position, mesh.normal)])
    return np.stack([both.real, both.imag], axis=1).ravel()


def apply_operator(mesh: Mesh, materials: Sequence[Material], v: Real, traction: bool, length: float) -> Real:
    """B v with the traction equation (else the displacement equation) at every node."""
    mesh = replace(mesh, traction_equation=np.full(mesh.nodes, traction))
    needed = np.ones(4 * mesh.nodes, dtype=bool)
    return assemble_rows(mesh, materials, 0, mesh.nodes, needed, length).apply(v)


def mesh_body(body: Body) -> tuple[Model, Mesh]:
    """The model of a body and its mesh."""
    model = body.build()
    return model, generate_mesh(model)
