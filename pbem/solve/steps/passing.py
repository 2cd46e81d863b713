"""Bodies that are moved into each other where nothing keeps them apart: they have no contact with each other."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Integer, Real
from pbem.geometry.boxes import Boxes
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model

# Depths below this part of the largest displacement come from the outlines, which are polygons here.
SLIGHT = 1e-2
# Of a place that is told, this part of the depth.
ROUNDING = 1e-6


@dataclass(frozen=True)
class Passing:
    """Of two bodies the deepest place (complex) of the first inside of the second, and how deep it lies (length).

    across: whether sides of a gap between two curves are moved into each other, of one body or of two."""

    first: str
    second: str
    depth: float
    place: complex
    across: bool = False
    bared: bool = False

    @property
    def names(self) -> tuple[str, str]:
        """Of the bodies, in the order of the alphabet."""
        return min(self.first, self.second), max(self.first, self.second)


def find_passing(model: Model, mesh: Mesh, displacement: Complex) -> Passing | None:
    """The deepest place where a body has come to lie inside of another one without a contact between them.

    displacement (n,): at the nodes; bodies that share a curve keep each other in place. None if there is none.
    """
    if len(mesh.region_names) == 1:
        return None
    bounding = ~mesh.crack[mesh.node_element]
    largest = float(np.abs(displacement[bounding]).max(initial=0.0))
    nodes = np.flatnonzero(bounding)
    regions = np.split(nodes, np.searchsorted(mesh.node_region[nodes], np.arange(1, len(mesh.region_names))))
    moved = mesh.position + displacement
    worst = None
    for one, other in _pair_near(model, mesh, regions, moved):
        depth = _find_depth(mesh, regions[other], displacement, moved[regions[one]], model.regions[other].infinite)
        least = max(SLIGHT * largest, _measure_sagitta(mesh, other), 0.0 if worst is None else worst.depth)
        if depth.max(initial=0.0) > least:
            at = int(np.argmax(depth))
            place = complex(moved[regions[one][at]]) + model.origin
            worst = Passing(mesh.region_names[one], mesh.region_names[other], float(depth[at]), place)
    return worst


def describe_passing(found: Passing) -> str:
    """A sentence, and what to do."""
    where = f"{found.depth:.3g} deep"
    # What is rounding beside the depth would differ from one number of ranks to the next.
    at = [0.0 if abs(each) < ROUNDING * found.depth else each for each in (found.place.real, found.place.imag)]
    place = f"({at[0]:.6g}, {at[1]:.6g})"
    if found.across:
        whose = f"'{found.first}'" if found.first == found.second else f"'{found.first}' and '{found.second}'"
        what = f"sides of {whose} lie {where} in each other at {place}, across what was a gap: "
    else:
        what = f"'{found.first}' lies {where} inside '{found.second}' at {place}: "
    if found.bared:
        return what + ("nothing keeps the sides apart that a stage has bared; a thin region that is removed can be "
                       "drawn as a crack with a law and its width as `gap`, which one stage closes and a later one "
                       "releases")
    if found.across:
        return what + ("nothing keeps these curves apart; draw the sides as curves of their own, where they are not, "
                       "and add a table [contacts.NAME] between them if they are to touch")
    return what + ("nothing keeps them apart, as they have no contact with each other; add a table [contacts.NAME] "
                   "between their curves if they are to touch")


def _pair_near(model: Model, mesh: Mesh, regions: list[Integer], moved: Complex) -> list[tuple[int, int]]:
    """Bodies by number, and others that they are not joined to, where their boxes meet once they have moved."""
    numbers = {name: number for number, name in enumerate(mesh.region_names)}
    owners = mesh.keep("regions of curves", _list_owners)
    joined = {frozenset(own) for own in owners.values() if len(own) == 2}
    curves = {name: owners.get(number, set()) for number, name in enumerate(mesh.curve_names)}
    joined |= {
        frozenset((a, b)) for contact in model.contacts.values()
        for a in curves.get(contact.first, ()) for b in curves.get(contact.second, ())
    }
    finite = [numbers[each.name] for each in model.regions
              if not (each.infinite or each.rigid or each.removed) and len(regions[numbers[each.name]])]
    around = [(one, numbers[each.name]) for each in model.regions if each.infinite for one in finite]
    if all(frozenset(pair) in joined for pair in itertools.chain(itertools.combinations(finite, 2), around)):
        return []  # wherever they are: as in most models, of which this is asked after every step
    corners = [
        (complex(moved[own].real.min(), moved[own].imag.min()), complex(moved[own].real.max(), moved[own].imag.max()))
        for own in (regions[number] for number in finite)
    ]
    boxes = Boxes.of_corners(corners)
    at, found = boxes.find_meeting(boxes)
    pairs = {(finite[i], finite[j]) for i, j in zip(at.tolist(), found.tolist(), strict=True) if i != j}
    return sorted(pair for pair in pairs.union(around) if frozenset(pair) not in joined)


def _list_owners(mesh: Mesh) -> dict[int, set[int]]:
    """The regions by the numbers of the curves that bound them, or are cracks in them."""
    owners: dict[int, set[int]] = {}
    for curve, region in np.unique(np.column_stack([mesh.curve, mesh.region]), axis=0).tolist():
        owners.setdefault(curve, set()).add(region)
    return owners


def _measure_sagitta(mesh: Mesh, region: int) -> float:
    """How far a region's outline of chords lies from itself, twice, as a displacement bends it a little more."""
    own = mesh.geometry.select((mesh.region == region) & ~mesh.crack)
    return 2 * float(own.rises(mesh.order + 1).max(initial=0.0))


def _find_depth(mesh: Mesh, own: Integer, displacement: Complex, points: Complex, infinite: bool) -> Real:
    """How deep points (p,) lie inside of a body with these nodes, which are displaced; 0 outside."""
    elements = mesh.node_element[own[:: mesh.order + 1]]
    moved = (mesh.position + displacement)[own].reshape(-1, mesh.order + 1)
    # The corners belong to the outline too; they move about as the first nodes do.
    corner = mesh.start[elements] + displacement[own[:: mesh.order + 1]]
    start = np.column_stack([corner, moved]).ravel()
    end = np.column_stack([moved, corner[_find_followers(mesh.start[elements], mesh.end[elements])]]).ravel()
    low, high = complex(start.real.min(), start.imag.min()), complex(start.real.max(), start.imag.max())
    depth = np.zeros(len(points))
    near = np.arange(len(points)) if infinite else np.flatnonzero(
        (points.real > low.real) & (points.real < high.real) & (points.imag > low.imag) & (points.imag < high.imag)
    )
    for number in near:
        point, side = points[number], end - start
        with np.errstate(divide="ignore", invalid="ignore"):
            turns = float(np.nansum(np.angle((end - point) / (start - point)))) / (2 * np.pi)
            along = np.clip(((point - start) * np.conj(side)).real / np.abs(side) ** 2, 0.0, 1.0)
        if abs(turns - (0.0 if infinite else 1.0)) < 0.5:
            depth[number] = np.abs(start + np.nan_to_num(along) * side - point).min()
    return depth


def _find_followers(start: Complex, end: Complex) -> Integer:
    """The element (e,) that begins where each ends, or nearest to there."""
    order = np.argsort(start, kind="stable")
    at = np.clip(np.searchsorted(start[order], end), 0, len(start) - 1)
    follower = order[at]
    for number in np.flatnonzero(start[follower] != end):
        follower[number] = int(np.argmin(np.abs(start - end[number])))
    return follower
