"""Passes of one run, each from rest on a finer mesh than the last: what follows a pass whose contacts do not settle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pbem.errors import ConvergenceError, PbemError
from pbem.geometry.junction import format_point
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.end_grading import MOST_UNKNOWNS, ContactEnd, grade_ends
from pbem.model.model import Model
from pbem.model.refinement import Fractions, bisect_elements, count_elements, impose_fractions, mark_near
from pbem.results.accuracy import Pass
from pbem.wording import count

# A run whose contacts do not settle is tried again so many times, with so many times the elements at most, and no more
# than MOST_UNKNOWNS.
MOST_TRIES = 3
MOST_GROWTH = 3.0
# A pass of so many iterations went on for long before it came to what failed: all of that would be done again, as often
# as there are tries.
MOST_ITERATIONS = 400
# Elements are graded towards the ends of contact so many times, with so many times the elements at most; the second
# time only where the pressure still falls by more than STILL_COARSE of the largest over the element of an end: it was
# not where it was looked for, or not known well enough for shorter elements.
MOST_GRADED = 3
MOST_GROWN = 4
STILL_COARSE = 0.08
# A pass that was not asked for is given up at a step that is to be halved after so many times the iterations of the
# former one, and so many more.
PATIENCE, FIRST_PATIENCE = 2, 40
# So many places are named.
MOST_NAMED = 3


@dataclass(frozen=True)
class Target:
    """The result file, and whether to go on with it or to replace it."""

    path: Path
    resume: bool
    force: bool


@dataclass(frozen=True)
class Finer:
    """A model with shorter elements where contacts did not settle, or end, and a sentence that says so.

    most: iterations after which the run on it is given up where it comes to halve a step; None for any number. mesh: of
    the model, if it was made.
    """

    model: Model
    note: str
    most: int | None = None
    mesh: Mesh | None = None


def plan_finer(
    first: Model, model: Model, unknowns: int, tries: int, error: ConvergenceError, iterations: int = 0
) -> Finer | None:
    """What to solve in place of a model whose contacts did not settle; None if that is how the run ends.

    first: the model before any such try; unknowns, iterations: of this one; tries: how many there were.
    """
    if not error.places or tries >= MOST_TRIES or unknowns > MOST_UNKNOWNS or iterations > MOST_ITERATIONS:
        return None
    marked = mark_near(model, error.places)
    finer = bisect_elements(model, marked)
    had, before, after = (_count_all(each) for each in (first, model, finer))
    if after == before or after > MOST_GROWTH * had or unknowns * after > MOST_UNKNOWNS * before:
        return None
    try:
        generate_mesh(finer)
    except PbemError:
        return None
    note = (
        f"Contacts did not settle ({error.reason}) near {_list_places(model, error.places)}. Elements there are "
        f"halved, {count(after, 'element')} in place of {before}, and the run starts again from rest."
    )
    return Finer(replace(finer, refined=True, notes=(*model.notes, note)), note)


def plan_graded(
    model: Model, ends: Sequence[ContactEnd], graded: int, unknowns: int = 0, iterations: int = 0, shared: bool = False
) -> Finer | None:
    """The model with elements graded towards the ends of contact, or as it is with the reason in the note; None if
    there is nothing to be graded. graded: how often that was done; unknowns, iterations: of this pass; shared: other
    runs have the same mesh, which is left as it is unless grading is asked for."""
    ends = [end for end in ends if end.fall > STILL_COARSE or not graded]
    auto = model.analysis.grade_contact_ends == "auto"
    if not ends or (auto and shared):
        return None
    where = _name_ends(model, ends)
    finer = grade_ends(model, ends)
    before, after = _count_all(model), _count_all(finer)
    # What is not asked for must not cost more than a user would wait for.
    large = auto and unknowns * after > MOST_UNKNOWNS * before
    long = auto and iterations > MOST_ITERATIONS
    if graded >= MOST_GRADED or (graded and (large or long)):
        fall = f"{max(end.fall for end in ends):.0%} of the largest pressure"
        return Finer(model, f"{where}, within elements over which the pressure still falls by {fall}: they were graded "
                            f"{count(graded, 'time')}.")  # fmt: skip
    if large or long:
        what = f"took {iterations} iterations" if long else f"would have {unknowns * after // before} unknowns"
        return Finer(model, f"{where}, within elements that are long for the fall of the pressure there; they are not "
                            f"graded, as the run {what}: analysis.grade_contact_ends = true does.")  # fmt: skip
    lost = [end for end in ends if not end.located]
    left = f" {_name_ends(model, lost)}: where in the elements there is not known, they are left as they are."
    left = left if lost else ""
    if after == before:
        return Finer(model, left.strip()) if lost else None
    where = _name_ends(model, [end for end in ends if end.located])
    if after > MOST_GROWN * before:
        return Finer(
            model, f"{where}; grading towards these ends would take {after} elements in place of {before}.{left}"
        )
    try:
        mesh = generate_mesh(finer)
    except PbemError as error:
        return Finer(model, f"{where}; with elements graded towards these ends there is no mesh: {error}")
    note = (
        f"{where}, where the pressure falls like a root. Elements are graded towards these ends, "
        f"{after} in place of {before}, and the run starts again.{left}"
    )
    most = FIRST_PATIENCE + PATIENCE * iterations if model.analysis.grade_contact_ends == "auto" else None
    return Finer(replace(finer, refined=True, notes=(*model.notes, note)), note, most, mesh)


def _name_ends(model: Model, ends: Sequence[ContactEnd]) -> str:
    names = ", ".join(f"'{name}'" for name in {end.contact: None for end in ends})
    return f"Contact of {names} ends near {_list_places(model, [end.place for end in ends])}"


def _count_all(model: Model) -> int:
    return sum(count_elements(curve) for curve in model.curves.values())


def _list_places(model: Model, places: Sequence[complex]) -> str:
    named = ", ".join(format_point(z + model.origin) for z in places[:MOST_NAMED])
    more = len(places) - MOST_NAMED
    return named + (f" and {count(more, 'more place')}" if more > 0 else "")


def recall_mesh(model: Model, fractions: Fractions, finished: int) -> Model:
    """The model with the element ends of a file that is gone on with; as it is if that is of other curves, which is
    told where all of both is compared. finished: of how many stages the file holds all; a note says where more were
    added that these ends were chosen without them."""
    added = model.analysis.accuracy is None and 0 < finished < len(model.stages)
    note = (
        "Elements that were refined where contacts ended, or did not settle, in the stages before are kept for those "
        "that were added; a run of all stages refines them where contacts end at its end. Results differ by about the "
        "estimated errors: --force computes all stages anew."
    )
    try:
        return replace(impose_fractions(model, fractions), refined=model.analysis.accuracy is None,
                       notes=(*model.notes, note) if added else model.notes)
    except ValueError:
        return model


def blame_tries(error: ConvergenceError, tries: int, unknowns: int) -> ConvergenceError:
    """Says that shorter elements did not help either."""
    if not tries or not error.places:
        return error
    return ConvergenceError(
        error.reason,
        f"{error.detail}; elements near pairs that did not settle were halved {count(tries, 'time')} already, up to "
        f"{unknowns} unknowns",
    )


def blame_pass(error: BaseException, one: Pass, unknowns: int) -> BaseException:
    """Says which pass of `analysis.accuracy` it was that did not converge, and what the file holds."""
    if not isinstance(error, ConvergenceError) or error.reason == "accuracy":
        return error
    return ConvergenceError(
        error.reason,
        f"with the mesh refined for analysis.accuracy, pass {one.number} of {unknowns} unknowns, {error.detail}; the "
        f"file holds pass {one.number - 1}, which was solved, but is not as accurate as requested",
    )
