"""Models of every kind that the hierarchical operator is tried on, small ones, and its parts with small leaves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from pbem.bem import hierarchical
from pbem.bem.farfield import SourceTree
from pbem.bem.hierarchical import Sorted, choose_terms, prepare_sources, sort_elements
from pbem.bem.operator import RowOperator, assemble_rows
from pbem.bem.sharing import keep_whole
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.material import Material
from pbem.model.model import Model
from tests.cases.bundled import CASES

Real = NDArray[np.float64]

PLATE = """
[materials.plate]
young = 1.0e3
poisson = 0.2
[curves]
bottom = { points = [[0, 0], [10, 0]], elements = 10, grading = "both" }
right  = { points = [[10, 0], [10, 10]], elements = 10, grading = "both" }
top    = { points = [[10, 10], [0, 10]], elements = 10, grading = "both" }
left   = { points = [[0, 10], [0, 0]], elements = 10, grading = "both" }
[regions.plate]
material = "plate"
boundary = ["bottom", "right", "top", "left"]
[boundary.bottom]
uy = 0.0
[boundary.left]
ux = 0.0
[boundary.top]
ty = -1.0
[boundary.right]
tx = 0.3
[analysis]
steps = 2
"""

INCLUSIONS = PLATE + """
[materials.grain]
young = 5.0e3
poisson = 0.3
[[generate]]
kind = "inclusions"
name = "grain"
region = "plate"
material = "grain"
count = 6
elements = 12
radius = 1.0
spread = 0.2
box = [0, 0, 10, 10]
distance = 0.3
law = "coulomb"
friction = 0.3
"""

CRACKS = PLATE + """
[[generate]]
kind = "cracks"
name = "crack"
region = "plate"
count = 16
elements = 5
half_length = 0.8
box = [0, 0, 10, 10]
distance = 0.3
friction = 0.4
"""

INFINITE = """
[materials.rock]
young = 2.0e4
poisson = 0.25
[curves]
tunnel = { center = [0, 0], radius = 2.0, elements = 32 }
[regions.rock]
material = "rock"
boundary = ["tunnel"]
infinite = true
[[generate]]
kind = "cracks"
name = "joint"
region = "rock"
count = 12
elements = 5
half_length = 1.5
box = [3, -8, 15, 8]
distance = 0.4
friction = 0.5
[boundary.tunnel]
pressure = 1.0
[remote]
sxx = -5.0
syy = -10.0
[analysis]
steps = 1
"""

# Two bodies without supports in an infinite sheet's place: only the balance of their loads keeps them at rest.
FLOATING = """
[materials.rock]
young = 50.0
poisson = 0.2
[curves]
bottom = { points = [[0, 0], [2, 0]], elements = 10 }
right  = { points = [[2, 0], [2, 1]], elements = 8 }
left   = { points = [[0, 0], [0, 1]], elements = 8 }
joint  = { points = [[0, 1], [2, 1]], elements = 14 }
right_above = { points = [[2, 1], [2, 3]], elements = 10 }
left_above  = { points = [[0, 1], [0, 3]], elements = 10 }
top    = { points = [[0, 3], [2, 3]], elements = 10 }
[regions.lower]
material = "rock"
boundary = ["bottom", "right", "joint", "left"]
[regions.upper]
material = "rock"
boundary = ["top", "right_above", "joint", "left_above"]
[interfaces.joint]
law = "bonded"
[boundary.top]
ty = -1.0
[boundary.bottom]
ty = -1.0
[analysis]
steps = 1
"""
FLOATING = FLOATING.replace("[boundary.bottom]\nty = -1.0", "[boundary.bottom]\nty = 1.0")


def take_bundled(name: str) -> Callable[[], str]:
    return lambda: CASES[name].read_text(encoding="utf-8")


TEXTS: Mapping[str, Callable[[], str]] = {
    "blocks SST": take_bundled("two_blocks"),
    "blocks DBEM": take_bundled("two_blocks_dbem"),
    "blocks HST": take_bundled("two_blocks_hst"),
    "blocks THST": take_bundled("two_blocks_thst"),
    "layers": take_bundled("layers_pull_stiff"),
    "panel": take_bundled("panel_friction_opening"),
    "inclusions": lambda: INCLUSIONS,
    "inclusions HST": lambda: INCLUSIONS.replace("[analysis]", '[analysis]\nscheme = "HST"'),
    "cracks": lambda: CRACKS,
    "infinite": lambda: INFINITE,
    "floating": lambda: FLOATING,
}


@dataclass(frozen=True)
class Sample:
    """A discretised model, its dense operator with all columns."""

    model: Model
    mesh: Mesh
    materials: tuple[Material, ...]
    dense: RowOperator

    @property
    def needed(self) -> NDArray[np.bool_]:
        return np.ones(4 * self.mesh.nodes, dtype=bool)

    def sort(self, tolerance: float) -> tuple[Sorted, SourceTree]:
        """The cluster trees and the coefficients' matrices of one rank."""
        parts = sort_elements(self.mesh, self.materials, choose_terms(tolerance))
        return parts, prepare_sources(parts, self.needed, keep_whole(self.mesh.elements))


def read_sample(name: str, operator: str = "auto") -> Model:
    """One of the models, to be computed with an operator."""
    model = parse_model(TEXTS[name]())[1]
    return replace(model, solver=replace(model.solver, operator=operator))  # type: ignore[arg-type]


@cache
def make_sample(name: str) -> Sample:
    """One of the models with its dense operator; remembered."""
    model = read_sample(name)
    mesh = generate_mesh(model)
    materials = tuple(region.material for region in model.regions)
    needed = np.ones(4 * mesh.nodes, dtype=bool)
    return Sample(model, mesh, materials, assemble_rows(mesh, materials, 0, mesh.nodes, needed, model.size))


def shrink_leaves(monkeypatch: pytest.MonkeyPatch, elements: int = 3) -> None:
    """Let leaves have so few elements that even small models have far parts."""
    monkeypatch.setattr(hierarchical, "LEAF_ELEMENTS", elements)
    monkeypatch.setattr(hierarchical, "SMALL_REGION", elements)


def join(displacement: NDArray[np.complex128], traction: NDArray[np.complex128]) -> Real:
    """v = (u, t) of complex nodal values (nodes,)."""
    both = np.concatenate([displacement, traction])
    return np.stack([both.real, both.imag], axis=1).ravel()


def list_vectors(sample: Sample) -> dict[str, Real]:
    """Vectors v: random ones, and smooth ones, whose products are small differences of large parts."""
    mesh, size = sample.mesh, sample.model.size
    random = np.random.default_rng(4)
    modulus = np.array([material.shear_modulus for material in sample.materials])[mesh.node_region]
    noise = random.normal(size=(2, mesh.nodes, 2)) @ [1, 1j]
    place = (mesh.position - mesh.position.mean()) / size
    none, crack = 0 * place, mesh.node_crack
    vectors = {
        "random displacements": join(noise[0], none),
        "random tractions": join(none, modulus / size * noise[1]),
        "rigid motion": join(np.where(crack, 0, 1 + 0.5j + 1j * place), none),
        "linear field": join(np.where(crack, 0, place), np.where(crack, 0, 2 * modulus / size * mesh.normal)),
    }
    if crack.any():
        # An ellipse over each crack, opening and slip.
        opening = np.zeros(mesh.nodes, dtype=complex)
        for curve in np.unique(mesh.node_curve[crack]):
            at = np.flatnonzero(mesh.node_curve == curve)
            ends = np.abs(mesh.position[at] - mesh.position[at].mean())
            opening[at] = np.sqrt(1.01 * ends.max() ** 2 - ends**2) * mesh.normal[at] * (1 + 0.5j)
        vectors["elliptic openings"] = join(opening / size, none)
    return vectors
