"""Rock joints: shear strength by the roughness of the faces and the strength of their walls, and dilation.

Under the normal stress sigma (compression positive; effective) the friction angle is that of smooth faces and what the
asperities add, which are sheared off the more the closer the stress is to the strength of the walls (N. Barton,
V. Choubey, Rock Mechanics 10, 1977):

    tau = sigma tan(phi_r + JRC log10(JCS/sigma)).

The angle is at most 70 degrees, as for Barton and Choubey, and at least phi_r: under stresses above JCS no asperities
are left. The dilation angle is a part of what the asperities add, mobilised with the slip as the roughness is
(N. Barton, S. Bandis, K. Bakhtar, Int. J. Rock Mech. Min. Sci. 22, 1985): not before 0.3 of the slip at which the
strength has its peak, most at the peak, and ever less behind it.
"""

from __future__ import annotations

import numpy as np

from pbem.arrays import Bool, Real
from pbem.contact.declaration import (
    Dilation,
    FrictionLaw,
    InternalVariable,
    Parameters,
    Slide,
    StepEnd,
    keep_value,
)
from pbem.contact.dilating import DEGREE, DILATION, Dilating
from pbem.contact.friction_bound import Strength

STEEPEST = 70.0
# How much of the roughness is mobilised, at slips relative to that at the peak; linear in between.
MOBILISED_AT = np.array([0.0, 0.3, 0.6, 1.0, 2.0, 4.0, 10.0, 25.0, 100.0])
MOBILISED = np.array([0.0, 0.0, 0.75, 1.0, 0.85, 0.7, 0.5, 0.4, 0.0])
# At the peak, by the normal traction at the end of the last step; none where faces carried nothing.
DILATION_ANGLE = InternalVariable("dilation_angle", "degrees", lambda _: np.nan, keep_value)
_AREA = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(MOBILISED_AT) * (MOBILISED[1:] + MOBILISED[:-1]))])


def mobilise(x: Real) -> tuple[Real, Real]:
    """The part (0 to 1) of the roughness that is mobilised at slips x relative to that at the peak, and its integral
    over x from 0 (theory, 116)."""
    part = np.interp(x, MOBILISED_AT, MOBILISED)
    piece = np.clip(np.searchsorted(MOBILISED_AT, x, side="right") - 1, 0, len(MOBILISED) - 1)
    beyond = np.minimum(x, MOBILISED_AT[-1]) - MOBILISED_AT[piece]
    return part, _AREA[piece] + 0.5 * beyond * (MOBILISED[piece] + part)


class BartonBandis(FrictionLaw):
    """The law as above; parameters: phi_r and JRC in degrees, JCS (stress); closure (length): see
    pbem.contact.closure."""

    def strength(  # type: ignore[override]
        self, p_n: Real, slide: Slide, /, residual_friction_angle: Real, jrc: Real, jcs: Real,
        closure: Real | None = None,
    ) -> Strength:
        """See FrictionLaw (theory, 111)."""
        stress = np.maximum(-p_n, 0.0)
        rough, falls = _find_roughness(stress, residual_friction_angle, jrc, jcs)
        angle = residual_friction_angle + rough
        coefficient = np.tan(DEGREE * angle)
        slope = coefficient - np.where(falls, DEGREE * jrc / np.log(10) / np.cos(DEGREE * angle) ** 2, 0.0)
        return Strength(stress * coefficient, np.where(p_n <= 0, -slope, 0.0), np.zeros_like(p_n))

    def find_strongest(self, parameters: Parameters) -> tuple[Real, Real]:
        """That of the steepest angle, which rough faces have under little stress."""
        angle = np.where(parameters["jrc"] > 0, STEEPEST, parameters["residual_friction_angle"])
        return np.tan(DEGREE * angle), np.zeros_like(angle)


def _find_roughness(stress: Real, residual_friction_angle: Real, jrc: Real, jcs: Real) -> tuple[Real, Bool]:
    """What the asperities add to the friction angle (k,), degrees, and where that falls with the stress."""
    part = np.where(stress > 0, stress, 1.0) / jcs
    rough = np.where(stress > 0, -jrc * np.log10(part), np.where(jrc > 0, np.inf, 0.0))
    most = STEEPEST - residual_friction_angle
    return np.clip(rough, 0.0, most), (rough > 0) & (rough < most)


class DilatingJoint(Dilating, BartonBandis):
    """The law with dilation; further parameters: the part of what asperities add by which the dilation angle rises, and
    the slip at which the strength has its peak, length."""

    variables = (DILATION, DILATION_ANGLE)
    pivots = True

    def strength(  # type: ignore[override]
        self, p_n: Real, slide: Slide, /, residual_friction_angle: Real, jrc: Real, jcs: Real, dilation_part: Real,
        peak_slip: Real, closure: Real | None = None,
    ) -> Strength:
        """See BartonBandis."""
        return BartonBandis.strength(self, p_n, slide, residual_friction_angle, jrc, jcs)

    def dilate(self, p_n: Real, slide: Slide, parameters: Parameters) -> Dilation:
        """See FrictionLaw (theory, 116)."""
        angle, by_angle = _find_dilation_angle(p_n, parameters)
        known: Real = slide.start[DILATION_ANGLE.name]
        begun = np.isfinite(known)
        slope = np.tan(DEGREE * np.where(begun, known, angle))
        by_traction: Real = np.where(begun, 0.0, DEGREE * by_angle * (1 + slope**2))
        peak = parameters["peak_slip"]
        (_, before), (now, after) = (mobilise(path / peak) for path in (slide.path - slide.ahead, slide.path))
        way = peak * (after - before)
        return Dilation(slope * way, by_traction * way, slope * now)

    def advance(self, end: StepEnd, parameters: Parameters) -> dict[str, Real]:
        """As all faces that dilate, and the dilation angle of the next step."""
        angle, _ = _find_dilation_angle(end.p_n, parameters)
        return {**super().advance(end, parameters), DILATION_ANGLE.name: np.where(end.p_n < 0, angle, np.nan)}


def _find_dilation_angle(p_n: Real, parameters: Parameters) -> tuple[Real, Real]:
    """The angle at the peak (k,), degrees, and its derivative by p_n."""
    stress, jrc, part = np.maximum(-p_n, 0.0), parameters["jrc"], parameters["dilation_part"]
    rough, falls = _find_roughness(stress, parameters["residual_friction_angle"], jrc, parameters["jcs"])
    return part * rough, np.where(falls, part * jrc / np.log(10) / np.where(falls, stress, 1.0), 0.0)
