"""Whether a run is as accurate as was asked for, and which elements to refine if it is not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.mesh.carry import list_curve_elements
from pbem.mesh.mesh import Mesh
from pbem.model.end_grading import ContactEnd
from pbem.model.model import Model
from pbem.model.refinement import TIP_PART, bisect_elements, count_elements
from pbem.results.contact_ends import find_contact_ends
from pbem.results.estimator import Estimator
from pbem.results.rates import list_corner_ends
from pbem.results.stiff_tips import POWER
from pbem.solve.problem.step import ContactState

# What `analysis.accuracy` is asked of, and how it is called.
ASKED = {"reactions": "reactions", "jumps": "slips and openings", "factors": "K"}
# Below this all errors asked for are rounding, and those of the displacements are looked at in their place.
ROUNDING = 1e-13

# The estimates are to be so many times below the accuracy: they are within a factor, and too small more often.
SAFETY = 2.0

# Passes at most, and unknowns at most over those of the first mesh.
MOST_PASSES = 20
MOST_GROWTH = 40.0
# Or this number, if that is more: what a few elements begin with says nothing of what is needed.
LEAST_LIMIT = 4000

# Part of the estimated energy of the error in the elements that are refined: near the goal, and far from it.
PART, LARGE_PART = 0.7, 0.9
# Where only jumps are off, and in single places: there elements are refined in any case.
SMALL_PART = 0.3
FAR = 8.0
# Elements with this part of the largest energy are refined in any case: where errors are spread evenly, to refine some
# of them alone brings nothing.
ALIKE = 0.1
# Far from the goal elements in corners are halved twice where no larger part of all is marked, as else errors come from
# everywhere, and where cracks turn, as the power is known to be small there.
FEW = 0.25
# By their errors elements are halved up to so many times more than once; those of jumps in corners fall with this power
# of the length.
MOST_DEEPER, CORNER_RATE = 3, 0.5
# And those with nearly the energy of the last one that is: what is symmetrical stays so.
AS_LAST = 0.9
# And those whose jumps are off by more than this part of the error that the estimates may have.
LOCAL = 0.5
# Elements shorter by this factor bring the error below the accuracy if it falls with the power order + 1: then there is
# no need to halve.
NEAR = 1.5
# With more than this part of its elements a whole leg is refined: lengths that change by leaps cost more than they
# save.
MOST_OF_LEG = 0.4
# A kind of energy with less than this part of all is left out.
SMALL_KIND = 1e-3
# Of the largest error of a jump: elements beyond are refined.
NEAR_WORST = 0.1


# Why errors are not known that will be on a finer mesh.
UNSEEN = "those of some quantities, as faces in contact meet nowhere on the coarser mesh"


@dataclass(frozen=True)
class Reached:
    """The largest estimated relative errors over the steps, by the names in ASKED (or "displacements")."""

    errors: Mapping[str, float]

    @property
    def worst(self) -> float:
        """The largest of all; NaN if one is unknown."""
        return float(np.max(list(self.errors.values())))

    def __str__(self) -> str:
        return ", ".join(f"{name} {error:.1e}" for name, error in self.errors.items())


def measure_reached(relative: Mapping[str, Real]) -> Reached:
    """The accuracy of a run by its /estimates/relative_... (k,) over the steps.

    Kinds of which the model has none, or whose errors are rounding, are left out; where all are, the displacements are
    looked at.
    """
    errors = {text: float(np.max(relative[kind], initial=0.0)) for kind, text in ASKED.items()}
    kept = {text: error for text, error in errors.items() if not error <= ROUNDING}
    return Reached(kept or {"displacements": float(np.max(relative["displacement"], initial=0.0))})


@dataclass(frozen=True)
class Pass:
    """The number of a pass, from 1 on, and the unknowns of the first one.

    spare: the former pass is finished; if this one does not converge, that one stands.
    """

    number: int
    first_unknowns: int
    spare: bool = False


@dataclass(frozen=True)
class Decision:
    """What follows a pass: sentences for the log; the elements to be halved (gently: see `bisect_elements`; far: those
    in corners twice), None if there is no further pass for the accuracy; why that cannot be reached, empty if it was or
    was not asked for; where contacts end within elements that are too long, if that is asked for. deeper, shorter: how
    often the elements in corners, if few are halved, and those at tips are to be halved again, per curve as `marked`.
    """

    notes: tuple[str, ...] = ()
    marked: Mapping[str, Bool] | None = None
    deeper: Mapping[str, Integer] | None = None
    shorter: Mapping[str, Integer] | None = None
    gently: bool = False
    far: bool = False
    failure: str = ""
    ends: tuple[ContactEnd, ...] = ()


def decide(
    model: Model, mesh: Mesh, relative: Mapping[str, Real], estimator: Estimator, one: Pass,
    contact: ContactState | None = None,
) -> Decision:
    """Whether a pass has met `analysis.accuracy`, and where its contacts end; decided on one rank for all.

    relative: the estimated relative errors (k,) of all stored steps, NaN where unknown. contact: of the last step.
    """
    accuracy = model.analysis.accuracy
    if accuracy is None:
        return Decision() if contact is None else Decision(ends=find_contact_ends(model, mesh, contact))
    reached = measure_reached(relative)
    unknowns = 2 * mesh.nodes
    head = f"accuracy, pass {one.number}: {unknowns} unknowns"
    says = f"{head}; estimated relative errors: {reached} (asked: {SAFETY:g} times these below {accuracy:g})"
    if reached.worst * SAFETY <= accuracy:
        return Decision((says,))
    over = ", ".join(f"{name} {error:.1e}" for name, error in reached.errors.items() if not error * SAFETY <= accuracy)
    failure, most = "", max(MOST_GROWTH * one.first_unknowns, LEAST_LIMIT)
    unknown = bool(np.isnan(reached.worst))
    if unknown and (estimator.missing or one.number >= MOST_PASSES or unknowns > most):
        why = estimator.missing or UNSEEN
        failure = f"errors cannot be estimated ({why}): whether {accuracy:g} is reached is not known"
    elif one.number >= MOST_PASSES or unknowns > most:
        many = f"{MOST_GROWTH:g} times the first unknowns" if most > LEAST_LIMIT else f"{LEAST_LIMIT} unknowns"
        limit = f"{one.number} passes" if one.number >= MOST_PASSES else many
        failure = (
            f"{accuracy:g} is not reached within {limit} ({unknowns} unknowns): {over}; the file holds the last pass"
        )
    if failure:
        return Decision((says,), failure=failure)
    if unknown:
        halved = f"errors cannot be estimated ({UNSEEN}): all elements of contacts are halved"
        return Decision((says, halved), mark_contacts(model))
    comparison = estimator.comparison
    if not comparison.energy.any():  # gone on with after its last step: where errors are is not in the file
        return Decision((says,), {name: np.zeros(count_elements(curve), bool) for name, curve in model.curves.items()})
    local = _spread_to_curves(model, mesh, comparison.local)
    others = max((error for name, error in reached.errors.items() if name != ASKED["jumps"]), default=0.0)
    alone = others * SAFETY <= accuracy and max(each.max(initial=0.0) for each in local.values()) >= 0.5 * reached.worst
    marked = mark_elements(model, mesh, comparison.energy, comparison.local, accuracy, reached.worst, alone)
    deeper = {name: count_halvings(each * SAFETY / accuracy, CORNER_RATE) for name, each in local.items()}
    tip_rate = POWER[model.analysis.order] * np.log2(1 / TIP_PART)
    shorter = {name: count_halvings(each * SAFETY / accuracy, tip_rate)
               for name, each in _spread_to_curves(model, mesh, comparison.at_tips).items()}  # fmt: skip
    near = reached.worst * SAFETY <= NEAR ** (model.analysis.order + 1) * accuracy
    return Decision((says,), marked, deeper, shorter, near, far=reached.worst > FAR * accuracy)


def count_halvings(excess: Real, rate: float) -> Integer:
    """How often elements are to be halved after the first time, by their errors over what they may be; these fall by
    2^rate when an element is."""
    return np.clip(np.ceil(np.log2(np.maximum(excess, 1.0)) / rate) - 1, 0, MOST_DEEPER).astype(np.int64)


def refine_marked(model: Model, decision: Decision) -> Model:
    """The model of the next pass. Where few elements are marked those in corners are halved as often as their errors
    ask for, far from the goal at least twice: there errors fall with a small power of their length, whatever the order.
    See FEW. So are those at tips whose lengths alone make the errors of K.
    """
    assert decision.marked is not None
    finer = bisect_elements(model, decision.marked, decision.gently)
    few = np.concatenate(list(decision.marked.values())).mean() <= FEW
    corners, tips = list_corner_ends(model), _list_tip_elements(model)
    again = np.zeros(len(corners) + len(tips), dtype=np.int64)
    for number, end in enumerate(corners):
        if decision.marked[end.curve][end.element]:
            turns = end.curve in model.crack_tips and end.power < 1
            again[number] = decision.far and (few or turns)
            if few and decision.deeper is not None:
                again[number] = max(again[number], decision.deeper[end.curve][end.element])
    if decision.shorter is not None:
        again[len(corners) :] = [decision.shorter[curve][element] for curve, element in tips]
    while again.any():
        marked = {name: np.zeros(count_elements(curve), dtype=bool) for name, curve in finer.curves.items()}
        places = [(end.curve, end.element) for end in list_corner_ends(finer)] + _list_tip_elements(finer)
        for (curve, element), times in zip(places, again, strict=True):
            marked[curve][element] |= times > 0
        finer = bisect_elements(finer, marked)
        again = np.maximum(again - 1, 0)
    return finer


def _list_tip_elements(model: Model) -> list[tuple[str, int]]:
    """Curve and element (along all its legs) at every tip of a crack."""
    return [(name, (count_elements(model.curves[name]) - 1) * end)
            for name, is_tip in model.crack_tips.items() for end in (0, 1) if is_tip[end]]  # fmt: skip


def _spread_to_curves(model: Model, mesh: Mesh, values: Real) -> dict[str, Real]:
    """Per curve the values (e,) of the mesh's elements, the larger of both sides."""
    by_curve = {name: np.zeros(count_elements(curve)) for name, curve in model.curves.items()}
    for name, elements in list_curve_elements(model, mesh):
        by_curve[name] = np.maximum(by_curve[name], values[elements])
    return by_curve


def mark_contacts(model: Model) -> dict[str, Bool]:
    """Per curve its elements (along all legs): all those of curves in a contact."""
    in_contact = {name for each in model.contacts.values() for name in (each.first, each.second)}
    return {name: np.full(count_elements(curve), name in in_contact) for name, curve in model.curves.items()}


def mark_elements(
    model: Model, mesh: Mesh, energy: Real, jumps: Real, accuracy: float, worst: float, alone: bool = False
) -> dict[str, Bool]:
    """Per curve the elements (along all its legs) to be halved: those with most of the error's energy (Doerfler 1996),
    of the displacements and of the tractions, and those whose jumps are too far off themselves.

    energy (2, e), jumps (e,): of each element of the mesh, see `pbem.results.estimates.Comparison`; both sides of a
    curve count together. accuracy, worst: the largest relative error asked for, and the one that is estimated.
    alone: whether all that is too far off are jumps in single places.
    """
    by_curve = {name: np.zeros((3, count_elements(curve))) for name, curve in model.curves.items()}
    for name, elements in list_curve_elements(model, mesh):
        by_curve[name][:2] += energy[:, elements]
        by_curve[name][2] = np.maximum(by_curve[name][2], jumps[elements])
    *kinds, local = np.concatenate(list(by_curve.values()), axis=1)
    part = SMALL_PART if alone else LARGE_PART if worst > FAR * accuracy else PART
    chosen = local > max(LOCAL * accuracy / SAFETY, NEAR_WORST * local.max(initial=0.0))
    for each in kinds:
        if each.sum() >= SMALL_KIND * energy.sum():
            order = np.argsort(-each, kind="stable")
            last = min(int(np.searchsorted(np.cumsum(each[order]), part * each.sum())), len(order) - 1)
            chosen |= each >= min(AS_LAST * each[order[last]], ALIKE * each.max())
    legs = [leg.elements for curve in model.curves.values() for leg in curve.legs]
    leg = np.repeat(np.arange(len(legs)), legs)
    chosen |= (np.bincount(leg, chosen) > MOST_OF_LEG * np.array(legs))[leg]
    ends = np.cumsum([each.shape[1] for each in by_curve.values()])[:-1]
    return dict(zip(by_curve, np.split(chosen, ends), strict=True))
