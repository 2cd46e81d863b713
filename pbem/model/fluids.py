"""What fluids in contacts press on bodies: on either curve, along its own normals, where these meet the other one."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from pbem.arrays import Bool, Complex, Integer, Real
from pbem.geometry.curve import Leg
from pbem.geometry.elements import Elements
from pbem.geometry.loop import Side, side_legs
from pbem.model.model import Contact, Model, Stage
from pbem.model.quadrature import divide_side
from pbem.model.rigid_body_modes import find_bounded
from pbem.model.sight import OVERLAP, REACH, Obstacles
from pbem.model.varying import Moment, Places, blend, find_kinks


def list_fluids(
    model: Model, moving: Collection[str], before: Stage, stage: Stage, now: Moment
) -> Iterator[tuple[str, Complex, Complex]]:
    """Moving region, points (k,) and forces (k,) of the fluid in its contacts, whose pressure is given along the first
    curve (theory, 133)."""
    bounded = find_bounded(model)
    for name, contact in model.contacts.items():
        pressures = before.pressure.get(name, 0.0), stage.pressure.get(name, 0.0)
        if not any(pressures):
            continue
        kinks = find_kinks(pressures)
        first, second = (_Face(model, contact, curve) for curve in (contact.first, contact.second))
        for own, other in ((first, second), (second, first)):
            if bounded[own.side.curve] not in moving:
                continue
            breaks = kinks if own is first else first.project(kinks, second)
            for piece in divide_side(model.curves, own.side, np.concatenate([breaks, own.find_ends(other)])):
                met, places = other.meet(piece.places.point, piece.normals)
                places = piece.places.take(met) if own is first else places
                shifted = Places(places.point + model.origin, places.along)
                pushes = -blend(*pressures, shifted, now) * (piece.normals * piece.weights)[met]
                yield bounded[own.side.curve], piece.places.point[met], pushes


# Places on a leg between which its normals begin or cease to meet another face once at most, and halvings from there.
SAMPLES, HALVINGS = 65, 48


class _Face:
    """A curve of a contact."""

    def __init__(self, model: Model, contact: Contact, curve: str) -> None:
        sides = {side.curve: side for region in model.regions for loop in region.loops for side in loop.sides}
        self.side: Side = sides[curve]
        self._legs = side_legs(model.curves, self.side)
        self._shapes, self._obstacles = Elements.collect(self._legs), Obstacles(self._legs)
        shorter = min(model.curves[contact.first].length, model.curves[contact.second].length)
        self._nearest = -max(OVERLAP * shorter, REACH * contact.overlap)

    def meet(self, points: Complex, normals: Complex) -> tuple[Integer, Places]:
        """The numbers (k,) of those normals from points of the other face that meet this one, and where they do."""
        seen = self._obstacles.look_along(points, normals, self._nearest)
        met = np.flatnonzero((seen.leg >= 0) & (seen.product < 0))
        feet, at = points[met] + seen.distance[met] * normals[met], seen.leg[met]
        shapes, lengths = self._shapes.select(at), self._shapes.lengths
        local = shapes.preimage(feet[:, None]).real
        along = (np.cumsum(lengths) - lengths)[at] + lengths[at] * shapes.fractions(local)[:, 0]
        return met, Places(feet, along if self.side.forward else lengths.sum() - along)

    def find_ends(self, other: _Face) -> Real:
        """The lengths along this face at which its normals begin or cease to meet another one, to rounding."""
        ends, passed = [np.zeros(0)], 0.0
        for leg in self._legs:
            def meets(fractions: Real, leg: Leg = leg) -> Bool:
                met = np.zeros(len(fractions), dtype=bool)
                met[other.meet(leg.point(fractions), leg.normals(leg.point(fractions)))[0]] = True
                return met

            places = np.linspace(0.0, 1.0, SAMPLES)
            met = meets(places)
            change = np.flatnonzero(met[1:] != met[:-1])
            low, high, before = places[change], places[change + 1], met[change]
            for _ in range(HALVINGS if len(change) else 0):
                middle = 0.5 * (low + high)
                same = meets(middle) == before
                low, high = np.where(same, middle, low), np.where(same, high, middle)
            ends.append(passed + leg.length * 0.5 * (low + high))
            passed += leg.length
        travelled = np.concatenate(ends)
        return travelled if self.side.forward else passed - travelled

    def project(self, along: Real, other: _Face) -> Real:
        """The lengths along another face where the normals meet it from lengths along this one."""
        lengths = np.array([leg.length for leg in self._legs])
        ends = np.cumsum(lengths)
        travelled = along if self.side.forward else ends[-1] - along
        inside = travelled[(travelled > 0) & (travelled < ends[-1])]
        leg = np.searchsorted(ends, inside)
        fractions = 1 - (ends[leg] - inside) / lengths[leg]
        points = np.array([self._legs[k].point(t) for k, t in zip(leg, fractions, strict=True)], dtype=complex)
        normals = self._shapes.select(leg).normals_at(points[:, None])[:, 0] if len(leg) else points
        return other.meet(points, normals)[1].along
