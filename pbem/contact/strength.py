"""Friction laws: the largest tangential traction of a closed pair, one small function each, with its derivatives.

A law is a function  law(p_n, slip, **parameters) -> Strength  of the normal traction (compression negative; less the
fluid pressure where the fluid is inside) and the slip path so far (>= 0), both arrays. A law of one's own is such a
function, named `strength`, in a Python file that the case names: law = "custom", file = "my_law.py".
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbem.contact.custom import CustomLaw, read_law_texts
from pbem.contact.strength_type import Strength, StrengthLaw
from pbem.errors import CaseError, Fault
from pbem.model.build import read_model
from pbem.model.model import Law, Model

Real = NDArray[np.float64]


def coulomb(p_n: Real, slip: Real, friction: Real, cohesion: Real) -> Strength:
    """|p_s| <= cohesion - friction p_n, and no friction beyond the apex of the cone (theory, 48)."""
    bound = cohesion - friction * p_n
    return Strength(np.maximum(bound, 0.0), np.where(bound >= 0, -friction, 0.0), np.zeros_like(p_n))


def slip_weakening(
    p_n: Real, slip: Real, friction: Real, cohesion: Real, friction_dynamic: Real, slip_distance: Real
) -> Strength:
    """Coulomb's law with friction falling linearly to friction_dynamic over the slip distance (theory, 49)."""
    weaker = np.clip(slip / slip_distance, 0.0, 1.0)
    static = coulomb(p_n, slip, friction + (friction_dynamic - friction) * weaker, cohesion)
    falling = (slip < slip_distance) & (static.bound > 0)
    by_slip = np.where(falling, (friction - friction_dynamic) / slip_distance * p_n, 0.0)
    return Strength(static.bound, static.by_traction, by_slip)


def choose_strength(law: Law, text: str | None = None) -> tuple[StrengthLaw, dict[str, float]]:
    """The function and the parameters of an interface's law; text: of its file, which is read if not given."""
    if law.kind == "custom":
        assert law.file is not None
        return CustomLaw(law.file, read_law_texts([law.file])[law.file] if text is None else text), dict(law.parameters)
    parameters = {"friction": law.friction, "cohesion": law.cohesion}
    if law.friction_dynamic is None or law.slip_distance is None:
        return coulomb, parameters
    return slip_weakening, parameters | {"friction_dynamic": law.friction_dynamic, "slip_distance": law.slip_distance}


def list_laws(model: Model) -> dict[str, Law]:
    """The laws of all interfaces, cracks and contacts, by their place in the case file."""
    laws = {f"interfaces.{name}": joint.law for name, joint in model.interfaces.items()}
    return laws | {f"contacts.{name}": joint.law for name, joint in model.contacts.items()}


def check_custom_laws(model: Model) -> tuple[Fault, ...]:
    """Faults of laws of one's own: files that do not run, have no such function, or give no strength."""
    faults = []
    tried: set[int] = set()
    for place, law in list_laws(model).items():
        if law.kind != "custom" or id(law) in tried:  # many interfaces that were generated together have one law
            continue
        tried.add(id(law))
        found = _try(law)
        if found:
            expected = "a Python file with a function strength(p_n, slip, **parameters) that gives a Strength of arrays"
            faults.append(Fault(f"{place}.file", found, expected))
    return tuple(faults)


def _try(law: Law) -> str:
    """What goes wrong when the law is asked for its strength at two pairs; "" if nothing does."""
    try:
        function, parameters = choose_strength(law)
        assert isinstance(function, CustomLaw)
        function(-np.ones(2), np.zeros(2), **{name: np.full(2, value) for name, value in parameters.items()})
        return function.fault.partition("; expected")[0]
    except Exception as error:  # a user's file may raise anything
        return f"a law that fails ({type(error).__name__}: {error})"


def read_checked_model(path: Path) -> Model:
    """Read a case and build its model, with the texts of its custom laws, which are tried.

    Raises CaseError with its faults; those of laws come last.
    """
    _, model = read_model(path)
    faults = check_custom_laws(model)
    if faults:
        raise CaseError(str(path), faults)
    return replace(model, law_texts=read_law_texts(law.file for law in list_laws(model).values()))
