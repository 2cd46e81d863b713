"""What is taken from each case of a sweep: `reactions.top.x`, `contact.seat.slip.largest`, `tips.crack.KI`."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from pbem.contact.laws import OPEN, SLIP, STICK, find_joint
from pbem.description.replacement import Part, split_key
from pbem.errors import CaseError, Fault
from pbem.model.model import Model
from pbem.model.rigid_body import FORCES, MOTIONS
from pbem.results.pair_weights import weigh_values
from pbem.results.rigid import COMPONENTS as RIGID
from pbem.sweeps.outcome import FACTORS, AbsentNameError, Kind, Names, Outcome
from pbem.wording import list_names, show, suggest

COMPONENTS = ("x", "y", "moment")
FIELDS = ("slip", "opening", "traction_n", "traction_s")
MODES = {"stick": STICK, "slip": SLIP, "open": OPEN}
ENDS = {"start": 0, "end": 1, "0": 0, "1": 1}
ENERGIES = ("external", "elastic", "dissipated", "released", "removed")
STEPS = ("number", "load_factor", "iterations", "residual")
STATISTICS = ("max", "min", "mean", "largest", "integral")
KINDS = {
    "reactions": "reactions.CURVE.x, y or moment",
    "rigid": "rigid.NAME.fx (fx, fy, moment, ux, uy or rotation)",
    "contact": "contact.NAME.slip.largest (FIELD slip, opening, traction_n or traction_s; max, min, mean, largest or "
               "integral), contact.NAME.status.slip (stick, slip or open), without NAME of all",
    "tips": "tips.NAME.KI (KI, KII, J or T), tips.NAME.start.KI or end, without NAME of all",
    "energy": "energy.external, elastic, dissipated, released or removed",
    "steps": "steps.number, load_factor, iterations or residual",
}
# Without a choice: so many interfaces, and so many cracks, have columns of their own.
MOST_INTERFACES, MOST_CRACKS = 10, 5


@dataclass(frozen=True)
class Quantity:
    """A column of the table: its title, and what gives its value.

    Names are those of the first case, what they stand for is found in each: evaluate raises AbsentNameError where a
    case has nothing of a name.
    """

    title: str
    evaluate: Callable[[Outcome], float]
    # Known of a history that ended early as well.
    of_steps: bool = False
    # Needs the mean displacement of the faces of cracks.
    of_faces: bool = False


class WrongQuantityError(ValueError):
    """found and expected, as in a fault."""

    def __init__(self, found: str, expected: str) -> None:
        super().__init__(found, expected)
        self.found, self.expected = found, expected


def read_quantities(texts: Iterable[str], names: Names, option: str = "") -> tuple[Quantity, ...]:
    """The columns for texts; a pattern in a name makes one for each that matches.

    option: what stands before the text in messages. Raises CaseError with all that are wrong.
    """
    columns: dict[str, Quantity] = {}
    faults = []
    for text in texts:
        try:
            columns |= {each.title: each for each in _read(text, names)}
        except WrongQuantityError as error:
            faults.append(Fault(f"{option}{text}" if isinstance(text, str) else "quantities", error.found,
                                error.expected))
    if faults:
        raise CaseError("the quantities", tuple(faults))
    return tuple(columns.values())


def choose_quantities(model: Model, names: Names) -> list[str]:
    """Those that are taken if none are asked for: reactions where displacements are known; slips, openings, factors."""
    held = [name for name, each in model.conditions.items() if "displacement" in each.known]
    held = [name for name in held if not any(name in body.curves for body in model.rigid.values())]
    found = [f"reactions.{quote(name)}.{part}" for name in held for part in ("x", "y")]
    # Of rigid bodies what was not given.
    found += [f"rigid.{quote(name)}.{(MOTIONS if kind == 'force' else FORCES)[axis]}"
              for name, body in model.rigid.items() for axis, kind in enumerate(body.known)]
    loose = [name for name in names.contact if find_joint(model, name).law.kind != "bonded"]
    single = [f".{quote(name)}" for name in loose] if len(loose) <= MOST_INTERFACES else [""]
    found += [f"contact{name}.{part}" for name in single for part in ("slip.largest", "opening.max")]
    cracks = [f".{quote(name)}" for name in names.tips] if len(names.tips) <= MOST_CRACKS else [""]
    found += [f"tips{name}.{part}" for name in cracks for part in ("KI", "KII")]
    return found or ["energy.external"]


def quote(name: str) -> str:
    """A name as it is written in a path."""
    bare = bool(name) and all(each.isalnum() or each in "_-" for each in name)
    if bare or "'" in name:
        return name if bare else '"' + name.replace("\\", "\\\\").replace('"', '\\"') + '"'
    return f"'{name}'" if any(each in name for each in "*?[\"\\") else f'"{name}"'


def _read(text: str, names: Names) -> list[Quantity]:
    parts = split_key(text) if isinstance(text, str) else None
    if parts is None:
        raise WrongQuantityError(show(text), "a quantity such as reactions.top.x")
    kind, *rest = parts
    if kind.text not in KINDS:
        raise WrongQuantityError(f"'{kind.text}'{suggest(kind.text, KINDS)}", "; ".join(KINDS.values()))
    reader = {"reactions": _read_reaction, "contact": _read_contact, "tips": _read_tips,
              "rigid": _read_rigid}.get(kind.text)
    if reader is not None:
        return reader(rest, names)
    known = ENERGIES if kind.text == "energy" else STEPS
    name = _take(rest, known, kind.text)
    if kind.text == "energy":
        return [Quantity(f"energy.{name}", lambda outcome: float(getattr(outcome.energy, name)))]
    return [Quantity(f"steps.{name}", lambda outcome: _find_step(outcome, name), of_steps=True)]


def _take(parts: Sequence[Part], known: Collection[str], kind: str) -> str:
    """The one part that is left, which has to be known."""
    if len(parts) == 1 and parts[0].text in known:
        return parts[0].text
    if len(parts) == 1:
        raise WrongQuantityError(f"'{parts[0].text}'{suggest(parts[0].text, known)}", KINDS[kind])
    raise WrongQuantityError(f"{len(parts)} names after {kind}", KINDS[kind])


def _select(part: Part, names: Names, kind: Kind) -> list[str]:
    """The names of columns that a name or a pattern stands for: of single curves, or of families."""
    known: Sequence[str] = getattr(names, kind)
    try:
        names.find_members(kind, part.text)
        return [part.text]
    except AbsentNameError:
        matched = [] if part.literal else [name for name in known if part.matches(name)]
    if matched:
        return matched
    everything = [*known, *names.families]
    found = f"'{part.text}'{suggest(part.text, everything)}"
    raise WrongQuantityError(found, f"{KINDS[kind]}; names: {list_names(known) or 'none in this case'}")


def _read_reaction(parts: Sequence[Part], names: Names) -> list[Quantity]:
    if len(parts) != 2:
        raise WrongQuantityError(f"{len(parts)} names after reactions", KINDS["reactions"])
    at = COMPONENTS.index(_take(parts[1:], COMPONENTS, "reactions"))

    def make(name: str) -> Quantity:
        return Quantity(f"reactions.{quote(name)}.{COMPONENTS[at]}", lambda outcome: sum(
            outcome.sum_reaction(each)[at] for each in outcome.names.find_members("reactions", name)))

    return [make(each) for each in _select(parts[0], names, "reactions")]


def _read_rigid(parts: Sequence[Part], names: Names) -> list[Quantity]:
    if len(parts) != 2:
        raise WrongQuantityError(f"{len(parts)} names after rigid", KINDS["rigid"])
    what = _take(parts[1:], RIGID, "rigid")

    def make(name: str) -> Quantity:
        def evaluate(outcome: Outcome) -> float:
            (body,) = outcome.names.find_members("rigid", name)
            return outcome.measure_rigid(body)[RIGID.index(what)]

        return Quantity(f"rigid.{quote(name)}.{what}", evaluate)

    return [make(each) for each in _select(parts[0], names, "rigid")]


def _read_contact(parts: Sequence[Part], names: Names) -> list[Quantity]:
    if len(parts) not in (2, 3):
        raise WrongQuantityError(f"{len(parts)} names after contact", KINDS["contact"])
    *whose, field, statistic = parts
    known = (*FIELDS, "status")
    if field.text not in known:
        raise WrongQuantityError(f"'{field.text}'{suggest(field.text, known)}", KINDS["contact"])
    what = _take([statistic], MODES if field.text == "status" else STATISTICS, "contact")

    def make(name: str | None) -> Quantity:
        title = "" if name is None else f".{quote(name)}"
        return Quantity(f"contact{title}.{field.text}.{what}", lambda outcome: _summarise(
            outcome, outcome.names.find_members("contact", name), field.text, what))

    return [make(each) for each in _select(whose[0], names, "contact")] if whose else [make(None)]


def _read_tips(parts: Sequence[Part], names: Names) -> list[Quantity]:
    if len(parts) not in (1, 2, 3):
        raise WrongQuantityError(f"{len(parts)} names after tips", KINDS["tips"])
    kind = _take(parts[-1:], FACTORS, "tips")
    end, place = None, ""
    if len(parts) == 3:
        place = _take(parts[1:2], ENDS, "tips")
        end = ENDS[place]

    def make(name: str | None) -> Quantity:
        title = "" if name is None else f".{quote(name)}"
        at = "" if end is None else f".{'start' if end == 0 else 'end'}"
        return Quantity(f"tips{title}{at}.{kind}", lambda outcome: _find_largest(
            outcome, outcome.names.find_members("tips", name), kind, end), of_faces=kind == "T")

    return [make(None)] if len(parts) == 1 else [make(each) for each in _select(parts[0], names, "tips")]


def _find_step(outcome: Outcome, name: str) -> float:
    step = outcome.last
    values = {"number": step.number, "load_factor": step.factor, "iterations": outcome.iterations,
              "residual": step.residual}
    return float(values[name])


def _summarise(outcome: Outcome, members: tuple[str, ...], field: str, what: str) -> float:
    """A number for the pairs of some interfaces; mean, share and integral are over their length. Jumps are those of
    pairs that have both sides; NaN without any."""
    pairs = np.concatenate([np.zeros(0, dtype=np.int64), *(outcome.find_pairs(name) for name in members)])
    if not len(pairs):
        return math.nan
    contact, weight = outcome.contact, outcome.mesh.pairs.weight[pairs]
    if field == "status":
        return float(weight[contact.mode[pairs] == MODES[what]].sum() / weight.sum())
    values = getattr(contact, field)[pairs]
    there = ~np.isnan(values)
    pairs, weight, values = pairs[there], weight[there], values[there]
    if not len(pairs):
        return math.nan
    if what in ("mean", "integral"):
        plain, rooted = outcome.weights
        whole = float(weigh_values(field, values, outcome.gap[pairs], (plain[pairs], rooted[pairs])).sum())
        return whole / float(weight.sum()) if what == "mean" else whole
    if what == "largest":
        return float(np.abs(values).max())
    return float(values.max() if what == "max" else values.min())


def _find_largest(outcome: Outcome, members: tuple[str, ...], kind: str, end: int | None) -> float:
    """The value that is largest without its sign, with its sign; NaN without tips."""
    found = [outcome.find_factors(name)[kind] for name in members]
    values = np.concatenate([np.zeros(0), *(each if end is None else each[end : end + 1] for each in found)])
    values = values[~np.isnan(values)]
    return float(values[np.argmax(np.abs(values))]) if len(values) else math.nan


def evaluate_all(
    columns: Sequence[Quantity], outcome: Outcome, finished: bool, known: bool
) -> tuple[list[float], list[str]]:
    """The quantities of one case, NaN where they are not known, and what is to be said of those."""
    found, absent = [], []
    for each in columns:
        value = float("nan")
        if known and (finished or each.of_steps):
            try:
                value = float(each.evaluate(outcome))
            except AbsentNameError as error:
                absent.append(f"{each.title}: {error}")
        found.append(value)
    return found, absent
