"""Faces that dilate: slip pushes them apart, as their asperities ride up on each other.

The opening that slip has produced is an internal variable. It grows with the length of the slip in either direction,
never falls, and is not lost as faces open (M. E. Plesha, Int. J. Numer. Anal. Methods Geomech. 11, 1987, without
contraction on the way back).
"""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.contact.declaration import (
    Dilation,
    FrictionLaw,
    InternalVariable,
    Parameters,
    Passage,
    Slide,
    StepEnd,
    keep_value,
)

# It advances with the normal traction, too: see `Dilating.advance`.
DILATION = InternalVariable("dilation", "length", lambda _: 0.0, keep_value, carry="as the jump")
DEGREE = np.pi / 180


class Dilating(FrictionLaw):
    """What all laws have in common that dilate; `dilate` is left to them."""

    variables: tuple[InternalVariable, ...] = (DILATION,)
    linear = False
    dilates = True

    def advance(self, end: StepEnd, parameters: Parameters) -> dict[str, Real]:
        """By the slip of faces in touch, under the traction at the end of the step."""
        return {DILATION.name: end.slide.start[DILATION.name] + self.dilate(end.p_n, end.slide, parameters).opening}

    def dissipate(self, passage: Passage, rubbed: Real, parameters: Parameters) -> Real:
        """Less what is done against the pressure on the faces as they part (theory, 118)."""
        old, new = passage.internal
        pressed = np.minimum(0.5 * (passage.p_n[0] + passage.p_n[1]), 0.0)
        lifted = np.where(passage.slips, pressed * (new[DILATION.name] - old[DILATION.name]), 0.0)
        return np.maximum(rubbed + lifted, 0.0)


class ConstantDilation(Dilating):
    """At a constant angle over a given length of slip; parameters: dilation_angle (degrees), dilation_slip (length).
    """

    def dilate(self, p_n: Real, slide: Slide, parameters: Parameters) -> Dilation:
        """See FrictionLaw (theory, 115)."""
        slope, last, path = np.tan(DEGREE * parameters["dilation_angle"]), parameters["dilation_slip"], slide.path
        opening = slope * (np.minimum(path, last) - np.minimum(path - slide.ahead, last))
        return Dilation(opening, np.zeros_like(p_n), np.where(path < last, slope, 0.0))
