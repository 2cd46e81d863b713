"""Fields that satisfy equilibrium by themselves: linear stress and gravity. They enter the equations as known parts.

The field of a region under them is total = particular solution + elastic, and only the elastic part obeys the
integral equations without source. In a finite region the particular solution is the in-situ stress (without
displacement) and gravity. In an infinite region the remote stress, with the displacement of its strain, is what
the equations tend to far away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Complex, Real
from pbem.bem.point_field import PointField
from pbem.model.in_situ import AT_REST, LinearStress, Stress
from pbem.model.material import Material
from pbem.model.swelling import NO_SWELLING, Swelling


@dataclass(frozen=True)
class ParticularSolution:
    """remote: uniform stress sxx, syy, sxy with the displacement of its strain; initial: the in-situ stress, without.

    force: body force per volume, complex, beyond what the in-situ stress balances; carried: what that balances.
    center: where the displacement of remote stress and force vanishes, and the stress of the force. One near the region
    keeps rounding as small as the region. Any will do for the force, as fields of uniform pressure obey the integral
    equations too. To the remote strain it is the place that does not move. swelling: strain without stress. points:
    fields of forces and moments at single points. growth: a stress that grows from 0, with the displacement of its
    strain.
    """

    material: Material
    remote: Stress = (0.0, 0.0, 0.0)
    initial: LinearStress = AT_REST
    force: complex = 0.0
    carried: complex = 0.0
    center: complex = 0.0
    swelling: Swelling = NO_SWELLING
    points: tuple[PointField, ...] = ()
    growth: LinearStress = AT_REST

    @property
    def is_zero(self) -> bool:
        fields = any(self.remote) or self.force or self.points
        return not fields and self.initial.is_zero and self.swelling.is_zero and self.growth.is_zero

    @property
    def of_points(self) -> ParticularSolution:
        """The part of forces and moments at single points."""
        return ParticularSolution(self.material, points=self.points)

    def displacement(self, point: Complex) -> Complex:
        """Displacement (complex) at points: of remote strain about the center, gravity and swelling (theory, 5, 6, 86).

        Gravity's stress is isotropic, -(b . (x - center)), so that its displacement is an analytic function of x.
        """
        kappa, shear_modulus = self.material.kappa, self.material.shear_modulus
        sxx, syy, sxy = self.remote
        mean, deviator = 0.5 * (sxx + syy), 0.5 * (syy - sxx) + 1j * sxy
        lever = point - self.center
        linear = 0.5 * (kappa - 1) * mean * lever - np.conj(deviator * lever)
        weight = -0.25 * (kappa - 1) * np.conj(self.force) * lever**2
        grown = 0j if self.growth.is_zero else self._integrate_growth(point)
        smooth = (linear + weight + grown) / (2 * shear_modulus) + self.swelling.displacement(point)
        return smooth + sum(each.displacement(point, self.material) for each in self.points)

    def stress(self, point: Complex) -> Real:
        """sxx, syy, sxy (n, 3) at points (theory, 6)."""
        isotropic = -(np.conj(self.force) * (point - self.center)).real
        linear = self.initial.evaluate(point) + (0.0 if self.growth.is_zero else self.growth.evaluate(point))
        smooth = np.array(self.remote) + linear + isotropic[:, None] * np.array([1.0, 1.0, 0.0])
        return np.asarray(smooth + sum(each.stress(point, self.material) for each in self.points))

    def _integrate_growth(self, point: Complex) -> Complex:
        """2 G u of the strain of the growing stress, which neither moves nor turns its center (theory, 103)."""
        (xx, xy), (yx, yy) = (((0.5 * (by[0] + by[1])), 0.5 * (by[0] - by[1]) + 1j * by[2])
                              for by in (self.growth.by_x, self.growth.by_y))
        p, q, mean = 0.5 * (xy - 1j * yy), 0.5 * (xy + 1j * yy), complex(xx, yx)
        away = point - self.growth.center
        back = np.conj(away)
        analytic = 0.5 * (self.material.kappa - 1) * np.conj(mean) - np.conj(p)
        return np.asarray(p * away * back + 0.5 * q * back**2 + 0.5 * analytic * away**2)

    def traction(self, point: Complex, normal: Complex) -> Complex:
        """Traction (complex) on unit normals at points."""
        sxx, syy, sxy = self.stress(point).T
        return sxx * normal.real + sxy * normal.imag + 1j * (sxy * normal.real + syy * normal.imag)
