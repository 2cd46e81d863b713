"""The numbers that a case file's first comment tells to expect; the grammar is explained in cases/README.md."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.results.lazy import Contact
from pbem.results.reader import Results
from tests.cases.sampling import find_element_ends, sample_contact

MODES = {"stick": STICK, "slip": SLIP, "open": OPEN}
FIELDS = ("opening", "slip", "traction_n", "traction_s")

NUMBER = r"[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?"
LINE = re.compile(
    rf"# expect (?P<quantity>\S+(?: at {NUMBER}| \w+)?)(?: after (?P<stage>\w+))? = (?P<value>{NUMBER})"
    rf"(?: within (?P<tolerance>{NUMBER})(?: (?P<scale>of the largest|absolute))?)?"
)
REACTION = re.compile(r"reactions\.(?P<curve>\w+)\.(?P<axis>[xy])")
AT_PLACE = re.compile(rf"contact\.(?P<name>\w+)\.(?P<field>{'|'.join(FIELDS)}) at (?P<place>{NUMBER})")
LARGEST = re.compile(rf"contact\.(?P<name>\w+|\*)\.(?P<field>{'|'.join(FIELDS)}) largest")
PAIRS = re.compile(r"contact\.(?P<name>\w+|\*)\.(?P<mode>stick|slip|open) (?P<measure>count|share)")
TIP = re.compile(r"tips\.(?P<name>\w+)\.(?P<factor>KI|KII) (?P<end>start|end)")
ZONE = re.compile(r"contact\.(?P<name>\w+)\.(?P<mode>stick|slip|open) (?P<end>start|end)")


@dataclass(frozen=True)
class Expectation:
    """One line. tolerance: relative to the value, to the field's largest magnitude, or absolute, as `scale` says."""

    quantity: str
    stage: str | None
    value: float
    tolerance: float
    scale: str

    def __str__(self) -> str:
        stage = f" after {self.stage}" if self.stage else ""
        return f"{self.quantity}{stage} = {self.value:g} within {self.tolerance:g} {self.scale}"


def parse_expectations(text: str) -> list[Expectation]:
    """All lines "# expect" of a case file. Raises ValueError for one that is not understood."""
    found = []
    for line in text.splitlines():
        if not line.lstrip().lower().startswith(("# expect ", "#expect")):
            continue
        match = LINE.fullmatch(line.rstrip())
        if match is None or not any(kind.fullmatch(match["quantity"]) for kind in READERS):
            raise ValueError(f"not understood: {line}")
        scale = match["scale"] or "relative"
        if scale == "of the largest" and not AT_PLACE.fullmatch(match["quantity"]):
            raise ValueError(f"only a field at a place has a largest value to compare with: {line}")
        value, tolerance = float(match["value"]), float(match["tolerance"] or 0.0)
        found.append(Expectation(match["quantity"], match["stage"], value, tolerance, scale))
    return found


def check_expectation(results: Results, expected: Expectation) -> tuple[float, float]:
    """The value that was found, and its error over the tolerance (at most 1 if all is well).

    An exact value that is missed has an infinite error.
    """
    step = find_step(results, expected.stage)
    reader, match = next((reader, match) for kind, reader in READERS.items()
                         if (match := kind.fullmatch(expected.quantity)))
    value = reader(results, match, step)
    if expected.scale == "absolute":
        scale = 1.0
    elif expected.scale == "of the largest":
        place = AT_PLACE.fullmatch(expected.quantity)
        assert place is not None
        scale = measure_largest([results.contact[place["name"]]], place["field"], step)
    else:
        scale = abs(expected.value)
    error = abs(value - expected.value)
    allowed = expected.tolerance * scale
    return value, error / allowed if allowed > 0 else (np.inf if error else 0.0)


def find_step(results: Results, stage: str | None) -> int:
    """Where the last stored step of a stage is; of the whole run if there is no stage."""
    if stage is None:
        return len(results.steps) - 1
    return int(np.flatnonzero(results.steps.stage == results.steps.stage_names.index(stage))[-1])


def measure_largest(contacts: Sequence[Contact], field: str, step: int) -> float:
    """Largest magnitude of a field at the collocation points."""
    return max(float(np.abs(getattr(contact, field)[step]).max()) for contact in contacts)


def _choose(results: Results, name: str) -> list[Contact]:
    return list(results.contact.values()) if name == "*" else [results.contact[name]]


def _read_reaction(results: Results, match: re.Match[str], step: int) -> float:
    return float(results.reactions[match["curve"]][step]["xy".index(match["axis"])])


def _read_at_place(results: Results, match: re.Match[str], step: int) -> float:
    place = np.array([float(match["place"])])
    return float(sample_contact(results, match["name"], match["field"], place, step)[0])


def _read_largest(results: Results, match: re.Match[str], step: int) -> float:
    return measure_largest(_choose(results, match["name"]), match["field"], step)


def _read_pairs(results: Results, match: re.Match[str], step: int) -> float:
    mode = np.concatenate([contact.mode[step] for contact in _choose(results, match["name"])])
    there = mode == MODES[match["mode"]]
    return float(there.sum() if match["measure"] == "count" else there.mean())


def _read_zone(results: Results, match: re.Match[str], step: int) -> float:
    """Half-way between the outermost pair of a mode and its neighbour; the end of the interface if there is none."""
    contact = results.contact[match["name"]]
    arc_length = contact.arc_length
    length = find_element_ends(results, contact)[-1]
    places = np.array([0.0, *(0.5 * (arc_length[1:] + arc_length[:-1])), length])
    there = np.flatnonzero(contact.mode[step] == MODES[match["mode"]])
    if not len(there):
        raise AssertionError(f"no pair of {match['name']} is in the mode {match['mode']}")
    return float(places[there[0]] if match["end"] == "start" else places[there[-1] + 1])


def _read_tip(results: Results, match: re.Match[str], step: int) -> float:
    factors = getattr(results.tips[match["name"]], match["factor"])
    return float(factors[step][("start", "end").index(match["end"])])


READERS = {
    REACTION: _read_reaction,
    AT_PLACE: _read_at_place,
    LARGEST: _read_largest,
    PAIRS: _read_pairs,
    ZONE: _read_zone,
    TIP: _read_tip,
}
