"""Rock joints: shear strength by the roughness of the faces and the strength of their walls.

Under the normal stress sigma (compression positive; effective) the friction angle is that of smooth faces and what the
asperities add, which are sheared off the more the closer the stress is to the strength of the walls (N. Barton,
V. Choubey, Rock Mechanics 10, 1977):

    tau = sigma tan(phi_r + JRC log10(JCS/sigma)).

The angle is at most 70 degrees, as for Barton and Choubey, and at least phi_r: under stresses above JCS no asperities
are left.
"""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.contact.declaration import FrictionLaw, Parameters, Slide
from pbem.contact.friction_bound import Strength

STEEPEST = 70.0
DEGREE = np.pi / 180


class BartonBandis(FrictionLaw):
    """The law as above; parameters: phi_r and JRC in degrees, JCS (stress); closure (length): see
    pbem.contact.closure."""

    def strength(  # type: ignore[override]
        self, p_n: Real, slide: Slide, /, residual_friction_angle: Real, jrc: Real, jcs: Real,
        closure: Real | None = None,
    ) -> Strength:
        """See FrictionLaw (theory, 111)."""
        stress = np.maximum(-p_n, 0.0)
        part = np.where(stress > 0, stress, 1.0) / jcs
        rough = np.where(stress > 0, -jrc * np.log10(part), np.where(jrc > 0, np.inf, 0.0))
        angle = np.minimum(residual_friction_angle + np.maximum(rough, 0.0), STEEPEST)
        falls = (rough > 0) & (residual_friction_angle + rough < STEEPEST)
        coefficient = np.tan(DEGREE * angle)
        slope = coefficient - np.where(falls, DEGREE * jrc / np.log(10) / np.cos(DEGREE * angle) ** 2, 0.0)
        return Strength(stress * coefficient, np.where(p_n <= 0, -slope, 0.0), np.zeros_like(p_n))

    def find_strongest(self, parameters: Parameters) -> tuple[Real, Real]:
        """That of the steepest angle, which rough faces have under little stress."""
        angle = np.where(parameters["jrc"] > 0, STEEPEST, parameters["residual_friction_angle"])
        return np.tan(DEGREE * angle), np.zeros_like(angle)
