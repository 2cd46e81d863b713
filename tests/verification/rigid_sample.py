"""Models with rigid curves and tools that have exact answers."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pbem.arrays import Bool
from pbem.case.build import parse_model
from pbem.model.model import Model
from pbem.results.reader import Results
from tests.verification.proofs.proof import Complex, Real, Solved, line, write_case

YOUNG, POISSON = 1000.0, 0.3
PLANE_MODULUS = YOUNG / (1 - POISSON**2)


@dataclass(frozen=True)
class Place:
    """Where and how large a model is: turned by `turn` (radians), scaled by size, shifted; stresses times stress."""

    turn: float = 0.0
    shift: complex = 0j
    size: float = 1.0
    stress: float = 1.0

    def put(self, z: complex) -> complex:
        return self.size * z * cmath.exp(1j * self.turn) + self.shift

    def point(self, z: complex) -> list[float]:
        return [self.put(z).real, self.put(z).imag]

    def force(self, x: float, y: float) -> dict[str, float]:
        """fx and fy of a force in the model's own axes."""
        force = complex(x, y) * cmath.exp(1j * self.turn) * self.size * self.stress
        return {"fx": force.real, "fy": force.imag}

    def moment(self, value: float) -> float:
        return value * self.size**2 * self.stress

    def displacement(self, solved: Solved, curve: str) -> tuple[Complex, Complex]:
        """Places and displacements of a curve's nodes, in the model's own axes and units."""
        nodes, turned = solved.nodes(curve), cmath.exp(1j * self.turn)
        place = (solved.mesh.position[nodes] + solved.model.origin - self.shift) / turned / self.size
        return place, solved.last.displacement[nodes] / turned / self.size


UNMOVED = Place()


def circle(radius: float, elements: int) -> dict[str, Any]:
    """A full circle about the origin."""
    return {"center": [0.0, 0.0], "radius": radius, "elements": elements}


# Axial force and moment on a bar, or a block, of length 2 and width 1 that is held along y = 0.
FORCE, MOMENT = -2.0, 0.1


def lay_bar(place: Place, end: str, scheme: str = "SST", operator: str = "auto", order: int = 2) -> Model:
    """A bar without Poisson's ratio; end: "rigid", "force" (linear traction), or "tool", which sticks to the end."""
    corners = {"bottom": (0, 1), "right": (1, 1 + 2j), "top": (1 + 2j, 2j), "left": (2j, 0)}
    count = {"bottom": 3, "top": 3, "right": 4, "left": 4}
    given = {**place.force(0.0, FORCE), "moment": place.moment(MOMENT)}
    tables: dict[str, Any] = {
        "materials": {"m": {"young": YOUNG * place.stress, "poisson": 0.0}},
        "curves": {name: line(*map(place.put, ends), count[name], "none") for name, ends in corners.items()},
        "regions": {"bar": {"material": "m", "boundary": list(corners)}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}},
        "analysis": {"steps": 1, "scheme": scheme, "order": order}, "solver": {"operator": operator},
    }  # fmt: skip
    if end == "tool":
        tables["curves"]["press"] = line(place.put(2j), place.put(1 + 2j), 4, "none")
        tables["tools"] = {"press": given}
        tables["contacts"] = {"seat": {"between": ["top", "press"], "friction": 0.5}}
    else:
        tables["boundary"]["top"] = {end: given | ({"how": "linear"} if end == "force" else {})}
    return parse_model(write_case(tables))[1]


def expect_bar(solved: Solved, place: Place, tolerance: float) -> None:
    """Axial force and pure bending: u = -c y^2/2 + i (e y + c x y), x from the axis."""
    strain, bend = FORCE / YOUNG, 12 * MOMENT / YOUNG
    for curve in ("top", "left", "right"):
        z, moved = place.displacement(solved, curve)
        x, y = z.real - 0.5, z.imag
        exact = -0.5 * bend * y**2 + 1j * (strain * y + bend * x * y)
        np.testing.assert_allclose(moved, exact, atol=tolerance * abs(2 * strain))


def lay_half_plane(
    tool: dict[str, float], shape: dict[str, Any], seat: float, elements: int, far: float, **tables: Any
) -> Model:
    """A large block below y = 0 under a frictionless tool; seat: half the length of the curve that it touches."""
    corners = {"seat": (seat, -seat), "left_top": (-seat, -far), "left": (-far, -far - 1j * far),
               "bottom": (-far - 1j * far, far - 1j * far), "right": (far - 1j * far, far),
               "right_top": (far, seat)}  # fmt: skip
    return parse_model(write_case({
        "materials": {"m": {"young": YOUNG, "poisson": POISSON}},
        "curves": {name: line(*ends, elements if name == "seat" else 4) for name, ends in corners.items()}
        | {"punch": shape},
        "regions": {"block": {"material": "m", "boundary": list(corners)}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}}, "tools": {"punch": tool},
        "contacts": {"seat": {"between": ["seat", "punch"]}}, "analysis": {"steps": 1}, **tables,
    }))[1]  # fmt: skip


# The rim of the pin, and the far edge of its plate; the hub is small enough to be a point.
RADIUS, HUB, EDGE = 1.0, 0.05, 30.0


def lay_pin(
    clearance: float, force: float, direction: float, elements: int, operator: str = "auto", scheme: str = "SST",
    place: Place = UNMOVED,
) -> Model:  # fmt: skip
    """The model of `write_pin`."""
    return parse_model(write_pin(clearance, force, direction, elements, place, operator, scheme=scheme))[1]


def write_pin(
    clearance: float, force: float, direction: float, elements: int, place: Place = UNMOVED, operator: str = "auto",
    *, hub: float = HUB, edge: float = EDGE, **analysis: Any,
) -> str:  # fmt: skip
    """A pin in the middle of a wider hole, pressed by a force on its hub towards a direction (degrees)."""
    push = cmath.rect(force, math.radians(direction))
    around = {"hole": (RADIUS + clearance, elements), "rim": (RADIUS, elements), "hub": (hub, 12), "edge": (edge, 16)}
    return write_case({
        "materials": {"m": {"young": YOUNG * place.stress, "poisson": POISSON}},
        "curves": {name: {"center": place.point(0j), "radius": radius * place.size, "elements": count}
                   for name, (radius, count) in around.items()},
        "regions": {"plate": {"material": "m", "boundary": ["hole", "edge"]},
                    "pin": {"material": "m", "boundary": ["rim", "hub"]}},
        "boundary": {"edge": {"ux": 0.0, "uy": 0.0},
                     "hub": {"rigid": {**place.force(push.real, push.imag), "rotation": 0.0}}},
        "contacts": {"seat": {"between": ["rim", "hole"]}},
        "analysis": {"steps": 1, **analysis}, "solver": {"operator": operator},
    })  # fmt: skip


def evaluate_persson(angle: Real, half_width: float) -> Real:
    """Pressure times radius over force at angles from the middle of a contact of so large a half-angle (radians)."""
    b = math.tan(0.5 * half_width)
    y = np.tan(0.5 * angle)
    inside = np.sqrt(np.maximum(b**2 - y**2, 0.0))
    root = math.sqrt(b**2 + 1)
    tail = np.log((root + inside) / (root - inside)) / (2 * math.pi * b**2 * (b**2 + 1))
    return np.asarray(2 * inside / (math.pi * root * (1 + y**2)) + tail)


def find_persson_force(half_width: float, clearance: float) -> float:
    """The force at which the contact has that half-angle (radians)."""
    b = math.tan(0.5 * half_width)
    return PLANE_MODULUS * clearance * math.pi * b**2 * (b**2 + 1) / (2 - math.log(b**2 + 1) - 2 * b**4)


def compare_pressures(
    results: Results, force: float, half_width: float, direction: float, place: Place = UNMOVED
) -> Real:
    """Pressures of all pairs of a run of `write_pin` less those of Persson, by the largest of these; force in the
    model's own units, half_width in radians, direction in degrees."""
    contact = results.contact["seat"]
    at = (contact.position @ (1, 1j) - place.shift) / place.size
    angle = np.angle(at * cmath.exp(-1j * (math.radians(direction) + place.turn)))
    radius = float(np.abs(at).mean())
    inside = np.abs(angle) < half_width
    exact = np.where(inside, evaluate_persson(np.where(inside, angle, 0.0), half_width), 0.0)
    largest = float(evaluate_persson(np.zeros(1), half_width)[0])
    found = -np.asarray(contact.traction_n[-1]) * radius / (force * place.stress)
    return np.asarray((found - exact) / largest)


@dataclass(frozen=True)
class PinPressure:
    """Pressures of a pin in its hole beside Persson's, over the largest of these, at pairs (m,) and on elements (e,).

    found, exact: at the pairs, by the angle (radians) from the middle of contact; at_end: whether contact ends in the
    pair's element. found_mean, exact_mean: over each element of the curve whose tractions are the unknowns.
    """

    angle: Real
    found: Real
    exact: Real
    at_end: Bool
    found_mean: Real
    exact_mean: Real


def compare_persson(
    solved: Solved, force: float, half_width: float, direction: float, place: Place = UNMOVED
) -> PinPressure:
    """What `lay_pin` gives beside `evaluate_persson`; force in the model's own units, half_width in radians."""
    mesh, pairs = solved.mesh, solved.pairs("seat")
    centre = (mesh.pairs.position[pairs] + solved.model.origin - place.shift) / place.size
    angle = np.angle(centre * cmath.exp(-1j * (math.radians(direction) + place.turn)))
    # The force of a sector is the same on either circle.
    radius = float(np.abs(centre).mean())
    whole = force / radius * float(evaluate_persson(np.zeros(1), half_width)[0])
    found = -solved.last.contact.traction_n[pairs] / (place.stress * whole)

    def expect(at: Real) -> Real:
        inside = np.abs(at) < half_width
        return np.where(inside, force / radius * evaluate_persson(np.where(inside, at, 0.0), half_width), 0.0) / whole

    element, weight = mesh.pairs.slave[pairs] // (mesh.order + 1), mesh.pairs.weight[pairs]
    points, weights = np.polynomial.legendre.leggauss(400)
    at_end, means = np.zeros(len(pairs), dtype=bool), []
    for number in np.unique(element):
        own = np.flatnonzero(element == number)
        middle = own[1]  # of three nodes
        half = 0.5 * weight[own].sum() / (radius * place.size)
        at = angle[middle] + half * points
        means.append((weight[own] @ found[own] / weight[own].sum(), 0.5 * weights @ expect(at)))
        at_end[own] = (np.abs(at) < half_width).any() and (np.abs(at) > half_width).any()
    found_mean, exact_mean = np.array(means).T
    return PinPressure(angle, found, expect(angle), at_end, found_mean, exact_mean)
