"""Friction laws: the largest tangential traction of a closed pair, one small function each, with its derivatives.

A law is a function  law(p_n, slip, **parameters) -> Strength  of the normal traction (compression negative; less the
fluid pressure where the fluid is inside) and the slip path so far (>= 0), both arrays. A law of one's own is such a
function, named `strength`, in a Python file that the case names: law = "custom", file = "my_law.py".
"""

from __future__ import annotations

import runpy
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbem.errors import CaseError, Fault
from pbem.model.build import read_model
from pbem.model.model import Law, Model

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Strength:
    """bound: largest |p_s|, stress >= 0; by_traction, by_slip: its derivatives by p_n and by the slip path."""

    bound: Real
    by_traction: Real
    by_slip: Real


StrengthLaw = Callable[..., Strength]


def coulomb(p_n: Real, slip: Real, friction: Real, cohesion: Real) -> Strength:
    """|p_s| <= cohesion - friction p_n, and no friction beyond the apex of the cone."""
    bound = cohesion - friction * p_n
    return Strength(np.maximum(bound, 0.0), np.where(bound >= 0, -friction, 0.0), np.zeros_like(p_n))


def slip_weakening(
    p_n: Real, slip: Real, friction: Real, cohesion: Real, friction_dynamic: Real, slip_distance: Real
) -> Strength:
    """Coulomb's law with friction falling linearly to friction_dynamic over the slip distance."""
    weaker = np.clip(slip / slip_distance, 0.0, 1.0)
    static = coulomb(p_n, slip, friction + (friction_dynamic - friction) * weaker, cohesion)
    falling = (slip < slip_distance) & (static.bound > 0)
    by_slip = np.where(falling, (friction - friction_dynamic) / slip_distance * p_n, 0.0)
    return Strength(static.bound, static.by_traction, by_slip)


def choose_strength(law: Law) -> tuple[StrengthLaw, dict[str, float]]:
    """The function and the parameters of an interface's law."""
    if law.kind == "custom":
        assert law.file is not None
        return load_strength(Path(law.file)), dict(law.parameters)
    parameters = {"friction": law.friction, "cohesion": law.cohesion}
    if law.friction_dynamic is None or law.slip_distance is None:
        return coulomb, parameters
    return slip_weakening, parameters | {"friction_dynamic": law.friction_dynamic, "slip_distance": law.slip_distance}


def check_custom_laws(model: Model) -> tuple[Fault, ...]:
    """Faults of laws of one's own: files that do not run, have no such function, or give no strength."""
    faults = []
    joints = {f"interfaces.{name}": joint.law for name, joint in model.interfaces.items()}
    joints |= {f"contacts.{name}": joint.law for name, joint in model.contacts.items()}
    tried: set[int] = set()
    for place, law in joints.items():
        if law.kind != "custom" or id(law) in tried:  # many interfaces that were generated together have one law
            continue
        tried.add(id(law))
        try:
            function, parameters = choose_strength(law)
            result = function(-np.ones(2), np.zeros(2), **{name: np.full(2, v) for name, v in parameters.items()})
            shapes = {np.shape(part) for part in (result.bound, result.by_traction, result.by_slip)}
            if shapes != {(2,)} or not np.all(np.isfinite(result.bound)):
                raise ValueError(f"strength gives {result} at two pairs")
        except Exception as error:  # a user's file may raise anything
            found = f"a law that fails ({type(error).__name__}: {error})"
            expected = "a Python file with a function strength(p_n, slip, **parameters) that gives a Strength of arrays"
            faults.append(Fault(f"{place}.file", found, expected))
    return tuple(faults)


def read_checked_model(path: Path) -> Model:
    """Read a case and build its model. Raises CaseError with its faults; laws of one's own are tried last."""
    _, model = read_model(path)
    faults = check_custom_laws(model)
    if faults:
        raise CaseError(str(path), faults)
    return model


def load_strength(file: Path) -> StrengthLaw:
    """The function `strength` of a Python file. Raises ValueError if the file has none."""
    function = runpy.run_path(str(file)).get("strength")
    if not callable(function):
        raise ValueError(f"{file} defines no function named strength")
    return function  # type: ignore[no-any-return]
