"""What each trace, crack or interface did: its length, slip, opening and moment; pieces of a trace are summed."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Real
from pbem.model.material import Material
from pbem.results.pair_weights import weigh_pairs, weigh_values
from pbem.results.reader import Results


@dataclass(frozen=True)
class TraceTotals:
    """pieces: how many interfaces it is made of. length; mean_slip, mean_opening: over the length, slip with its sign;
    largest_slip: of all pairs, without sign; largest_opening: with its sign, negative where all are pushed into each
    other or closed by elastic joints. moment: shear modulus times the integral of the slip,
    stress times length squared (per unit of thickness), with its sign."""

    name: str
    pieces: int
    length: float
    mean_slip: float
    largest_slip: float
    mean_opening: float
    largest_opening: float
    moment: float


def list_traces(results: Results, step: int = -1) -> list[TraceTotals]:
    """All traces at a stored step (its place in the file), those of the largest moments first.

    The shear modulus is that of the region of the first side; NaN in files of earlier versions.
    """
    pairs = results.pairs
    if not pairs.names or not len(results.steps):
        return []
    nodes = results.nodes
    plain, rooted = weigh_pairs(results.elements, nodes.position, nodes.order, pairs.node)
    numbers: dict[str, int] = {}
    of = np.array([numbers.setdefault(results.contact.traces[name], len(numbers)) for name in pairs.names])
    trace, count = of[pairs.interface], len(numbers)
    slip, opening = pairs.at("slip", step), pairs.at("opening", step)
    modulus = _find_moduli(results)[pairs.interface]
    length = np.bincount(trace, plain, count)
    integral = np.bincount(trace, rooted * slip, count)
    volume = np.bincount(trace, weigh_values("opening", opening, pairs.gap, (plain, rooted)), count)
    moment = np.bincount(trace, modulus * rooted * slip, count)
    largest = [np.full(count, -np.inf) for _ in range(2)]
    for values, kept in zip((np.abs(slip), opening), largest, strict=True):
        np.maximum.at(kept, trace, values)
    pieces = np.bincount(of, minlength=count)
    found = [
        TraceTotals(name, int(pieces[i]), float(length[i]), float(integral[i] / length[i]), float(largest[0][i]),
              float(volume[i] / length[i]), float(largest[1][i]), float(moment[i]))
        for name, i in numbers.items()
    ]
    return sorted(found, key=lambda each: -abs(each.moment) if each.moment == each.moment else 0.0)


def _find_moduli(results: Results) -> Real:
    """The shear modulus on the first side of every interface: of its curve's first region."""
    if not results.configuration:
        return np.full(len(results.pairs.names), np.nan)
    stored = json.loads(results.configuration)
    moduli = np.array([Material(**region["material"]).shear_modulus for region in stored["regions"]])
    region_of: dict[str, int] = {}
    elements = results.elements
    for curve, region in zip(elements.curve.tolist(), elements.region.tolist(), strict=True):
        region_of.setdefault(results.nodes.curve_names[curve], region)
    contacts = {name: each["first"] for name, each in stored.get("contacts", {}).items()}
    names = [contacts.get(name, name) for name in results.pairs.names]
    return np.array([moduli[region_of[name]] if name in region_of else np.nan for name in names])
