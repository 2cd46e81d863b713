"""Quantities along one curve: of the contact pairs of an interface or crack, or of the nodes of any curve."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Integer, Real
from pbem.results.contents import Elements
from pbem.results.lazy import Contact, JoinedContact
from pbem.results.outline import to_complex
from pbem.results.reader import Results
from pbem.wording import list_names, suggest

Abscissa = Literal["arc_length", "angle", "x", "y"]
ABSCISSAE: tuple[str, ...] = get_args(Abscissa)

# Quantities of contact pairs: how they are called, and whether they are a length (else a stress).
PAIR_QUANTITIES = {
    "opening": ("opening", True),
    "slip": ("slip", True),
    "traction_n": ("normal traction $t_n$", False),
    "traction_s": ("shear traction $t_s$", False),
}
# Quantities of nodes, of any curve.
NODE_QUANTITIES = {
    "ux": ("$u_x$", True),
    "uy": ("$u_y$", True),
    "u": ("$|u|$", True),
    "tx": ("traction $t_x$", False),
    "ty": ("traction $t_y$", False),
    "normal": ("normal traction $t_n$", False),
    "shear": ("shear traction $t_s$", False),
    "hoop": ("stress along the boundary", False),
}
# From a tip to the node beside it jumps are drawn by so many points.
TIP_POINTS = 8
# Points are on a circle if their distances from its centre differ by less than this part of the radius.
ROUND = 1e-6


@dataclass(frozen=True)
class Profile:
    """A quantity along a curve at one stored step.

    title: of the quantity, as a picture shows it; is_length: its unit. place (m,): abscissae of the nodes, values,
    mode (m,): their status, None of nodes without contact. line_place, line_values (p,): the line through them, which
    goes on to the gap at tips, to zero without one. closed: the curve has no ends.
    """

    name: str
    title: str
    is_length: bool | None
    place: Real
    values: Real
    mode: NDArray[np.int8] | None
    line_place: Real
    line_values: Real
    closed: bool


def list_quantities(results: Results, name: str) -> list[str]:
    """What there is along a curve of this name."""
    contact = results.contact.get(name)
    pairs = [*PAIR_QUANTITIES, *contact.internal] if contact else []
    nodes = list(NODE_QUANTITIES) if name in results.nodes.curve_names else []
    return [*pairs, *(each for each in nodes if each not in pairs)]


def split_quantities(text: str) -> list[str]:
    """The names of quantities in a text with commas between; what is empty names none, as after a last comma."""
    return [name for each in text.split(",") if (name := each.strip())] or [text]


def check_curve(results: Results, name: str) -> None:
    """Raises ValueError, with a near miss, if there is no interface, crack or curve of this name."""
    known = [*results.contact, *(each for each in results.nodes.curve_names if each not in results.contact)]
    if name not in known and results.contact.get(name) is None:
        raise ValueError(f"there is no interface, crack or curve '{name}'{suggest(name, known)}; there are: "
                         f"{list_names(known)}")


def check_abscissa(abscissa: str) -> None:
    """Raises ValueError, with a near miss, if there is none of this name."""
    if abscissa not in ABSCISSAE:
        raise ValueError(f"there is no abscissa '{abscissa}'{suggest(abscissa, ABSCISSAE)}; there are: "
                         f"{', '.join(ABSCISSAE)}")


def read_profile(
    results: Results, name: str, quantity: str, step: int = -1, abscissa: str = "arc_length"
) -> Profile:
    """A quantity along an interface, crack or curve at one stored step (its place in the file).

    abscissa: arc_length, x, y, or angle: degrees about the circle's centre, from the x axis, counter-clockwise. Raises
    ValueError for no such curve or quantity, for an angle along what is no circle, IndexError for no such step.
    """
    check_curve(results, name)
    check_abscissa(abscissa)
    known = list_quantities(results, name)
    if quantity not in known:
        raise ValueError(f"there is no quantity '{quantity}' along '{name}'{suggest(quantity, known)}; there are: "
                         f"{', '.join(known)}")
    at = range(len(results.steps))[step]
    contact = results.contact.get(name)
    if contact and (quantity in PAIR_QUANTITIES or quantity in contact.internal):
        return _read_pairs(results, contact, quantity, at, abscissa)
    return _read_nodes(results, name, quantity, at, abscissa)


def _read_pairs(results: Results, contact: Contact, quantity: str, step: int, abscissa: str) -> Profile:
    if quantity in PAIR_QUANTITIES:
        title, is_length = PAIR_QUANTITIES[quantity]
        values = np.asarray(getattr(contact, quantity)[step], dtype=float)
        kind: bool | None = is_length
    else:
        title, kind, values = quantity, None, np.asarray(contact.internal[quantity][step], dtype=float)
    arc, position = contact.arc_length, contact.position
    ends = find_crack_ends(results, contact) if kind and contact.second is None else []
    arcs, points, jumps = [arc], [position], [values]
    # Gaps are there up to the tip; the rest vanishes there.
    gap = contact.gap if ends and quantity == "opening" else np.zeros(len(values))
    for first, element, arc_at_tip, rooted in ends:
        # From the node beside the tip; the shape there is that of the tip's elements.
        node = 0 if first else len(arc) - 1
        t = np.linspace(0.0, 1.0, TIP_POINTS + 1)[:-1] ** 2
        t = t if first else t[::-1]
        along = arc_at_tip + t * (arc[node] - arc_at_tip)
        own = results.elements.geometry.select(np.array([element]))
        fractions = abs(along - arc_at_tip) / own.lengths[0]
        places = own.place_fractions((fractions if first else 1.0 - fractions)[None])[0]
        shape = np.sqrt(t) if rooted else t
        drawn = along, np.stack([places.real, places.imag], axis=1), gap[node] + (values[node] - gap[node]) * shape
        for parts, part in zip((arcs, points, jumps), drawn, strict=True):
            parts.insert(0 if first else len(parts), part)
    line = np.concatenate(points)
    everywhere = _measure(np.concatenate([line, position]), np.concatenate([*arcs, arc]), abscissa, contact.name)
    closed = contact.second is not None and bool(_is_closed(position))
    return Profile(
        contact.name, title, kind, everywhere[len(line):], values, contact.mode[step], everywhere[: len(line)],
        np.concatenate(jumps), closed,
    )


def find_crack_ends(results: Results, contact: Contact) -> list[tuple[bool, int, float, bool]]:
    """The ends of a crack that are tips: whether it is the first, the element (of the first face), its arc length, and
    whether jumps there have the square-root shape."""
    elements, names = results.elements, results.nodes.curve_names
    if isinstance(contact, JoinedContact):
        # Those of the trace: the start of its first piece, and the end of the last one.
        begin, last = (find_crack_ends(results, contact.pieces[at]) for at in (0, -1))
        moved = [(first, element, arc + contact.starts[-1], rooted) for first, element, arc, rooted in last]
        return [*(each for each in begin if each[0]), *(each for each in moved if not each[0])]
    if contact.name not in names or not len(contact.arc_length):
        return []
    own = first_faces(elements, names.index(contact.name))
    if not len(own):
        return []
    tips = {contact.name: results.tips[contact.name]} if contact.name in results.tips else {}
    factors = tips[contact.name].KI if tips else np.full((1, 2), np.nan)
    ends = []
    for first, element in ((True, int(own[0])), (False, int(own[-1]))):
        if np.isnan(factors[:, 0 if first else 1]).all():  # at all steps: a stage may remove the crack
            continue
        arc = 0.0 if first else float(elements.geometry.select(own).lengths.sum())
        ends.append((first, element, arc, bool(elements.tip[element])))
    return ends


def first_faces(elements: Elements, curve: int) -> Integer:
    """Elements of a crack's first face, in the order of its curve."""
    cracks = np.flatnonzero(elements.crack)
    first = cracks[: len(cracks) // 2]
    return first[elements.curve[first] == curve]


def _read_nodes(results: Results, name: str, quantity: str, step: int, abscissa: str) -> Profile:
    """Of a curve with two sides, the first one: of the first region, of a crack the first face."""
    title, is_length = NODE_QUANTITIES[quantity]
    nodes, elements = results.nodes, results.elements
    own = np.flatnonzero(elements.curve == nodes.curve_names.index(name))
    cracks = np.flatnonzero(elements.crack)
    own = own[~np.isin(own, cracks[len(cracks) // 2 :])]
    own = own[elements.region[own] == elements.region[own[0]]]
    per_element = nodes.order + 1
    which = (own[:, None] * per_element + np.arange(per_element)).ravel()
    values = _evaluate_nodes(results, quantity, which, step)
    position = nodes.position[which]
    geometry = elements.geometry.select(own)
    local = geometry.preimage(to_complex(position).reshape(len(own), -1)).real
    arc = geometry.arc_lengths(local).ravel()
    if _is_backward(results, name, own):
        arc, position, values = geometry.lengths.sum() - arc[::-1], position[::-1], values[::-1]
    place = _measure(position, arc, abscissa, name)
    ends = elements.vertices[own[0], 0], elements.vertices[own[-1], 1]
    return Profile(name, title, is_length, place, values, None, place, values, bool((ends[0] == ends[1]).all()))


def _is_backward(results: Results, name: str, own: Integer) -> bool:
    """Whether elements (e,) along a whole curve, in the order in which a region travels along it, go against its
    direction: lengths are measured from its first point, as those of pairs are. False in files of earlier versions."""
    start, end, tangent = results.find_curve_course(name)
    elements = results.elements.geometry.select(own[[0, -1]])
    first, last = complex(elements.start[0]), complex(elements.end[1])
    if start != end:
        return bool(abs(last - start) < abs(first - start))
    leaving, arriving = elements.directions()
    along, against = leaving[0] / abs(leaving[0]), -arriving[1] / abs(arriving[1])
    return bool(abs(against - tangent) < abs(along - tangent))


def _evaluate_nodes(results: Results, quantity: str, which: Integer, step: int) -> Real:
    normal = results.nodes.normal[which]
    if quantity == "hoop":
        return np.asarray(results.hoop_stress[step][which])
    if quantity in ("ux", "uy", "u"):
        moved = results.displacement_at(step)[which]
        return np.hypot(*moved.T) if quantity == "u" else moved[:, 0 if quantity == "ux" else 1]
    traction = results.traction_at(step)[which]
    if quantity in ("tx", "ty"):
        return np.asarray(traction[:, 0 if quantity == "tx" else 1])
    along = normal if quantity == "normal" else np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    return np.asarray((traction * along).sum(axis=1))


def _measure(position: Real, arc: Real, abscissa: str, name: str) -> Real:
    if abscissa == "arc_length":
        return arc
    if abscissa in ("x", "y"):
        return np.asarray(position[:, 0 if abscissa == "x" else 1])
    return measure_angles(position, arc, name)


def measure_angles(position: Real, arc: Real, name: str) -> Real:
    """Angles (m,) in degrees of points on a circle about its centre, without jumps along the arc, and their middle
    between -180 and 180. Raises ValueError if the points are on no circle."""
    points = to_complex(position)
    middle = points.mean()
    size = float(np.abs(points - middle).max(initial=0.0))
    fault = ValueError(f"'{name}' is no arc of a circle: an angle (abscissa 'angle') is measured along circles")
    if len(points) < 3 or size == 0.0:
        raise fault
    z = (points - middle) / size
    matrix = np.column_stack([z.real, z.imag, np.ones(len(z))])
    solution, _, rank, _ = np.linalg.lstsq(matrix, np.abs(z) ** 2, rcond=1e-10)
    center = 0.5 * complex(solution[0], solution[1])
    radius = np.abs(z - center)
    if rank < 3 or np.ptp(radius) > ROUND * radius.mean() or radius.mean() > 1e4:
        raise fault
    order = np.argsort(arc, kind="stable")
    angles = np.empty(len(points))
    angles[order] = np.degrees(np.unwrap(np.angle(z[order] - center)))
    mean = 0.5 * (angles.min() + angles.max())
    return np.asarray(angles - 360.0 * np.ceil((mean - 180.0 - 1e-9) / 360.0))


def _is_closed(position: Real) -> bool:
    """Whether the line through the pairs comes back to where it began."""
    if len(position) < 6:
        return False
    steps = np.hypot(*np.diff(position, axis=0).T)
    return bool(np.hypot(*(position[-1] - position[0])) <= 2.0 * steps.max())
