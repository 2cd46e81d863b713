"""Friction laws: the largest tangential traction of a closed pair, one small class each, with its derivatives.

What a law declares is said in `pbem.contact.declaration`. A law of one's own is a function

    strength(p_n, slip, **parameters) -> Strength

of the normal traction (compression negative; less the fluid pressure where the fluid is inside) and the slip path so
far (>= 0), both arrays, in a Python file that the case names: law = "custom", file = "my_law.py".
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pbem.arrays import Bool, Real
from pbem.contact.barton_bandis import BartonBandis, DilatingJoint
from pbem.contact.cohesive import COHESIVE
from pbem.contact.custom import EXPECTED, PARTS, CustomLaw, read_law_texts
from pbem.contact.declaration import FrictionLaw, InternalVariable, Parameters, Slide, list_variables
from pbem.contact.dilating import ConstantDilation
from pbem.contact.friction_bound import Strength
from pbem.contact.rate_and_state import RateAndState
from pbem.errors import Fault
from pbem.model.model import Law, Model
from pbem.model.varying import Value


class Coulomb(FrictionLaw):
    """|p_s| <= cohesion - friction p_n, and no friction beyond the apex of the cone."""

    linear = True

    def strength(self, p_n: Real, slide: Slide, /, friction: Real, cohesion: Real) -> Strength:  # type: ignore[override]
        """See FrictionLaw (theory, 48)."""
        return _evaluate_cone(p_n, friction, cohesion)

    def resists(self, parameters: Parameters) -> Bool:
        """Whether there is any friction or cohesion."""
        return (parameters["friction"] > 0) | (parameters["cohesion"] > 0)

    def find_strongest(self, parameters: Parameters) -> tuple[Real, Real]:
        """They do not change."""
        return parameters["friction"], parameters["cohesion"]


class SlipWeakening(FrictionLaw):
    """Coulomb's law with friction falling linearly to friction_dynamic over the slip distance."""

    pivots_at_slip = True

    def strength(  # type: ignore[override]
        self, p_n: Real, slide: Slide, /, friction: Real, cohesion: Real, friction_dynamic: Real, slip_distance: Real
    ) -> Strength:
        """See FrictionLaw (theory, 49)."""
        slip = slide.path
        weaker = np.clip(slip / slip_distance, 0.0, 1.0)
        static = _evaluate_cone(p_n, friction + (friction_dynamic - friction) * weaker, cohesion)
        falling = (slip < slip_distance) & (static.bound > 0)
        by_slip = np.where(falling, (friction - friction_dynamic) / slip_distance * p_n, 0.0)
        return Strength(static.bound, static.by_traction, by_slip)

    def find_strongest(self, parameters: Parameters) -> tuple[Real, Real]:
        """The larger of what they are before and after slip."""
        return np.maximum(parameters["friction"], parameters["friction_dynamic"]), parameters["cohesion"]

    def find_kink(self, path: Real, slip: Real, parameters: Parameters) -> Real:
        """Where friction has fallen to its dynamic value."""
        left = parameters["slip_distance"] - path
        return np.clip(left / np.where(slip > 0, slip, 1.0), 0.0, 1.0)


def _evaluate_cone(p_n: Real, friction: Real, cohesion: Real) -> Strength:
    bound = cohesion - friction * p_n
    return Strength(np.maximum(bound, 0.0), np.where(bound >= 0, -friction, 0.0), np.zeros_like(p_n))


class DilatingCoulomb(ConstantDilation, Coulomb):
    """Coulomb's law of faces that dilate."""

    pivots = True

    def strength(  # type: ignore[override]
        self, p_n: Real, slide: Slide, /, friction: Real, cohesion: Real, dilation_angle: Real, dilation_slip: Real
    ) -> Strength:
        """See Coulomb."""
        return _evaluate_cone(p_n, friction, cohesion)


class DilatingSlipWeakening(ConstantDilation, SlipWeakening):
    """Friction that falls with slip, of faces that dilate."""

    def strength(  # type: ignore[override]
        self, p_n: Real, slide: Slide, /, friction: Real, cohesion: Real, friction_dynamic: Real, slip_distance: Real,
        dilation_angle: Real, dilation_slip: Real,
    ) -> Strength:
        """See SlipWeakening."""
        return SlipWeakening.strength(self, p_n, slide, friction, cohesion, friction_dynamic, slip_distance)


coulomb, slip_weakening = Coulomb(), SlipWeakening()
dilating_coulomb, dilating_slip_weakening, dilating_joint = (
    DilatingCoulomb(), DilatingSlipWeakening(), DilatingJoint()
)  # fmt: skip
# Pressures and slips at which it is seen whether a custom law answers alike when it is asked again.
TRIED_PRESSURES, TRIED_SLIPS = (1e-3, 1.0, 1e3), (0.0, 1e-6, 1.0)
# Further laws by their names in a case; they are given the keys of their own. Shapes of softening are told apart by
# `choose_strength`.
LAWS: Mapping[str, FrictionLaw] = {
    "rate_and_state": RateAndState(), "cohesive": COHESIVE["linear"], "barton_bandis": BartonBandis(),
}  # fmt: skip


def list_model_variables(model: Model) -> tuple[InternalVariable, ...]:
    """The internal variables of all pairs of a model."""
    laws = {id(law): law for law in list_laws(model).values()}  # many that were generated together have one law
    return list_variables(choose_strength(law)[0] for law in laws.values() if law.kind != "custom")


def list_own_variables(law: Law) -> tuple[InternalVariable, ...]:
    """The internal variables that a law has beside the common ones."""
    return () if law.kind == "custom" else choose_strength(law)[0].variables


def choose_strength(law: Law, text: str | None = None) -> tuple[FrictionLaw, dict[str, Value]]:
    """The law and the parameters of an interface; text: of a custom law's file, which is read if not given."""
    if law.softening is not None:
        own = {"friction": law.friction, "cohesion": law.cohesion, "tensile_strength": law.tensile_strength}
        return COHESIVE[law.softening], {**own, **law.parameters}
    if law.kind in LAWS:
        own_law = dilating_joint if "dilation_part" in law.parameters else LAWS[law.kind]
        return own_law, dict(law.parameters)
    if law.kind == "custom":
        assert law.file is not None
        return CustomLaw(law.file, read_law_texts([law.file])[law.file] if text is None else text), dict(law.parameters)
    parameters: dict[str, Value] = {"friction": law.friction, "cohesion": law.cohesion}
    dilates = "dilation_angle" in law.parameters
    if dilates:
        parameters |= {"dilation_slip": np.inf, **law.parameters}
    if law.friction_dynamic is None or law.slip_distance is None:
        return dilating_coulomb if dilates else coulomb, parameters
    parameters |= {"friction_dynamic": law.friction_dynamic, "slip_distance": law.slip_distance}
    return dilating_slip_weakening if dilates else slip_weakening, parameters


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
            expected = "a Python file with a function strength(p_n, slip, **parameters) returning a Strength of arrays"
            faults.append(Fault(f"{place}.file", found, expected))
    return tuple(faults)


def _try(law: Law) -> str:
    """What goes wrong when the law is asked for its strength at two pairs; "" if nothing does."""
    try:
        function, parameters = choose_strength(law)
    except (OSError, ValueError) as error:
        return f"a file that cannot be read ({type(error).__name__}: {error})"
    assert isinstance(function, CustomLaw)
    if not function.fault:
        function(-np.ones(2), np.zeros(2), **{name: np.full(2, value) for name, value in parameters.items()})
    return function.fault.removesuffix(f"; expected {EXPECTED}") if function.fault else _ask_twice(law)


def _ask_twice(law: Law) -> str:
    """By what a law differs from itself when it is asked again, stuck or slipping; "" if by nothing.

    Of a law that is not a function of its arguments no state is a solution: its statuses would change for ever."""
    function, parameters = choose_strength(law)
    assert isinstance(function, CustomLaw)
    pressure, slip = (each.ravel() for each in np.meshgrid(TRIED_PRESSURES, TRIED_SLIPS))
    given = {name: np.full(len(slip), value) for name, value in parameters.items()}
    with np.errstate(all="ignore"):  # it need not be made for what it is asked here
        once, again = (function(-pressure, slip, **given) for _ in range(2))
    for name in () if function.fault else PARTS:
        first, second = getattr(once, name), getattr(again, name)
        differs = np.flatnonzero(first != second)
        if len(differs):
            values = tuple(f"{each[differs[0]]:.6g}" for each in (first, second))
            return f"the law {law.file} answers differently when it is asked again: {name} = {', then '.join(values)}"
    return ""
