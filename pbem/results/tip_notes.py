"""Sentences about the tips of cracks: where K and J do not agree, and why an end has no stress-intensity factors."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pbem.arrays import Integer
from pbem.contact.laws import OPEN
from pbem.results.reader import Results
from pbem.wording import list_names, write_percent

# K and J follow from different integrals of the same jumps. On meshes whose K is right to 3e-3 they agree within 1 %.
AGREEMENT = 0.02
# Tips that release less than this part of what others release are not compared ...
SMALL = 1e-6
# ... nor those whose K is less than this part of the root of the crack's length times the largest traction: rounding.
ROUNDING = 1e-6
MOST_NAMES = 8
ENDS = ("start", "end")
# K of a tip with an elastic joint is right within 2 % on elements of this part of E' over its stiffness, by the order.
MOST_OF_ZONE = (0.01, 0.15, 0.6, 1.5)
# Joints nearer than this part of their largest closure to it are as stiff as there: no mesh resolves them.
MOST_CLOSED = 1e-3
ALONG = "a crack along an interface ends there, whose field oscillates if the materials differ; J is what it releases"


def doubt_factors(results: Results) -> list[str]:
    """What the user of K and J at the last stored step should know of the elements that they were found on."""
    return [*compare_release(results), *_find_stiff_joints(results)]


def _find_stiff_joints(results: Results) -> list[str]:
    """A sentence if elastic joints take up K within a distance E' over their stiffness from a tip that the elements do
    not resolve: K and J are both too small there, and agree."""
    if not len(results.steps) or not results.tips:
        return []
    stored = json.loads(results.configuration or "{}").get("interfaces", {})
    laws = {name: stored.get(name, {}).get("law", {}) for name in results.tips}
    joints = {name: [law.get(f"{which}_stiffness") or 0.0 for which in ("normal", "tangential")]
              for name, law in laws.items()}
    if not any(any(each) for each in joints.values()):
        return []
    found, ends = [], _find_crack_ends(results)
    allowed = MOST_OF_ZONE[results.nodes.order]
    pairs, is_open = results.pairs, results.pairs.at("mode", -1) == OPEN
    bounds = np.searchsorted(pairs.interface, np.arange(len(pairs.names) + 1))
    beside = {name: (first, last - 1) for name, first, last in zip(pairs.names, bounds, bounds[1:], strict=False)}
    for name, tips in results.tips.items():
        if name not in ends or not any(joints[name]):
            continue
        stiffening = _measure_stiffening(results, name, laws[name])
        for at, length in enumerate(ends[name].lengths):
            present = (joints[name][0] * stiffening[at], joints[name][1])
            stiff = max((joint for joint, K in zip(present, (tips.KI, tips.KII), strict=True)
                         if np.nan_to_num(K[-1, at])), default=0.0)
            # Open faces carry nothing.
            if not is_open[beside[name][at]] and stiff * length > allowed * tips.plane_modulus:
                found.append((tips.plane_modulus / stiff / length, f"'{name}' ({ENDS[at]})"))
    if not found:
        return []
    found.sort()
    names = list_names([name for _, name in found], MOST_NAMES)
    return [
        f"K, J and T at {names} are off: elements there are up to {1 / found[0][0]:.3g} times as long as E' over "
        "the stiffness of the elastic joint, the distance from the tip within which it takes up the stress; K is right "
        f"within 2 % with elements of less than {allowed:g} times that distance (order {results.nodes.order})."
    ]


def _measure_stiffening(results: Results, name: str, law: Mapping[str, Any]) -> tuple[float, float]:
    """How many times as stiff as at first a joint is on the elements at both ends of its crack, at the last stored
    step: where it has closed by v of its largest closure V by (1 - v/V)^-2 (theory, 112)."""
    largest = law.get("parameters", {}).get("closure")
    if law.get("kind") != "barton_bandis" or not largest:
        return 1.0, 1.0
    contact = results.contact[name]
    closed_by = -contact.opening[-1]
    if "dilation" in contact.internal:  # slip has pushed the faces apart
        closed_by = closed_by + contact.internal["dilation"][-1]
    times = (1 - np.clip(closed_by / largest, 0.0, 1 - MOST_CLOSED)) ** -2
    per_element = results.nodes.order + 1
    return float(times[:per_element].max()), float(times[-per_element:].max())


def compare_release(results: Results) -> list[str]:
    """A sentence if J and (KI^2 + KII^2)/E' differ at tips by more than AGREEMENT at the last stored step."""
    if not len(results.steps):
        return []
    largest = max((float(np.nanmax(tips.J[-1], initial=0.0)) for tips in results.tips.values()), default=0.0)
    found = []
    stress = float(np.nanmax(np.abs(results.traction_at(-1)), initial=0.0))
    lengths = _measure_contacts(results)
    for name, tips in results.tips.items():
        least = (ROUNDING * stress) ** 2 * lengths.get(name, 0.0) / tips.plane_modulus
        from_intensity = (tips.KI[-1] ** 2 + tips.KII[-1] ** 2) / tips.plane_modulus
        for end, (J, other) in enumerate(zip(tips.J[-1], from_intensity, strict=True)):
            scale = max(J, other)
            if scale > max(SMALL * largest, least) and abs(J - other) > AGREEMENT * scale:
                found.append((abs(J - other) / scale, f"'{name}' ({ENDS[end]})"))
    if not found:
        return []
    found.sort(reverse=True)
    names = list_names([name for _, name in found], MOST_NAMES)
    return [
        f"J and (KI^2 + KII^2)/E' differ by up to {write_percent(found[0][0])} % at {names}: the elements there are "
        "too long for the tractions on the crack, or those beside the tip too unequal."
    ]


def explain_missing_factors(results: Results) -> list[str]:
    """Sentences that say at which ends of cracks there are no stress-intensity factors, and why."""
    if not len(results.steps):
        return []
    missing = [(name, end) for name, tips in results.tips.items() for end in (0, 1) if np.isnan(tips.KI[-1, end])]
    if not missing:
        return []
    meeting = _collect_vertices(results)
    ends = _find_crack_ends(results)
    reasons: dict[str, list[str]] = defaultdict(list)
    for name, end in missing:
        if name not in ends:
            if not np.isnan(results.tips[name].J[-1, end]):
                reasons[ALONG].append(f"'{name}' ({ENDS[end]})")
        elif (reason := _find_reason(results, name, meeting[ends[name].places[end]])):
            reasons[reason].append(f"'{name}' ({ENDS[end]})")
    return [f"No K at {list_names(names, MOST_NAMES)}: {reason}." for reason, names in reasons.items()]


def _measure_contacts(results: Results) -> dict[str, float]:
    """Lengths of interfaces and cracks, of arcs nearly. Contacts themselves are read one by one, which takes long of
    thousands; both of their sides are among the elements."""
    elements = results.elements
    chords = np.hypot(*(elements.vertices[:, 1] - elements.vertices[:, 0]).T)
    lengths = 0.5 * np.bincount(elements.curve, chords, minlength=len(results.nodes.curve_names))
    names = zip(results.nodes.curve_names, lengths.tolist(), strict=True)
    return {name: length for name, length in names if name in results.contact}


def _collect_vertices(results: Results) -> dict[tuple[float, ...], list[int]]:
    """The elements that end at each point."""
    meeting = defaultdict(list)
    for element, ends in enumerate(results.elements.vertices.tolist()):
        for point in ends:
            meeting[tuple(point)].append(element)
    return meeting


@dataclass(frozen=True)
class _Ends:
    """places: of a crack's start and end; lengths: of the elements there."""

    places: tuple[tuple[float, ...], tuple[float, ...]]
    lengths: tuple[float, float]


def _find_crack_ends(results: Results) -> dict[str, _Ends]:
    elements = results.elements
    first = np.flatnonzero(elements.crack)[: int(elements.crack.sum()) // 2]
    ends = {}
    for number in np.unique(elements.curve[first]):
        own = first[elements.curve[first] == number]  # in the direction of the curve
        first_one, last_one = elements.vertices[own[0]], elements.vertices[own[-1]]
        ends[results.nodes.curve_names[number]] = _Ends(
            (tuple(first_one[0].tolist()), tuple(last_one[1].tolist())),
            (float(np.hypot(*(first_one[1] - first_one[0]))), float(np.hypot(*(last_one[1] - last_one[0])))),
        )
    return ends


def _find_reason(results: Results, name: str, touching: list[int]) -> str:
    """Why the end where these elements meet is no tip; empty where one other crack goes on."""
    elements = results.elements
    numbers = np.array(touching)
    own = np.array([results.nodes.curve_names[curve] == name for curve in elements.curve[numbers]])
    others = numbers[~own]
    cracks = np.unique(elements.curve[others][elements.crack[others]])
    boundary = others[~elements.crack[others]]
    shared = _find_shared(elements.curve[boundary], elements.region[boundary])
    if shared:
        return (f"the crack ends on {_name(results, shared)}, an interface, where the stress grows with another power "
                "of the distance than -1/2 unless both sides are of one material")
    if len(boundary):
        return "the crack ends on a boundary, where the stress is not singular as at a tip"
    if len(cracks) > 1 or len(others) > 2:
        return "cracks meet there, and the stress grows with another power of the distance than -1/2"
    return ""


def _find_shared(curve: Integer, region: Integer) -> list[int]:
    return [int(each) for each in np.unique(curve) if len(np.unique(region[curve == each])) > 1]


def _name(results: Results, curves: list[int]) -> str:
    return list_names([f"'{results.nodes.curve_names[curve]}'" for curve in curves], 3)
