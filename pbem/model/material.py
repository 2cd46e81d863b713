"""Linear elastic, isotropic materials."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class RigidSupport:
    """Of a rigid tool: forced: per motion (along x, along y, rotation about the point `about`) whether its force or
    moment is given, and not the motion itself."""

    forced: tuple[bool, bool, bool]
    about: complex


@dataclass(frozen=True)
class Material:
    """young: Young's modulus (stress, > 0); poisson: Poisson's ratio in (-1, 0.5); plane: strain or stress.

    rigid: of a rigid tool, whose moduli only set the size of numbers; None of what is elastic.
    """

    name: str
    young: float
    poisson: float
    plane: Literal["strain", "stress"] = "strain"
    density: float = 0.0
    rigid: RigidSupport | None = None

    @property
    def shear_modulus(self) -> float:
        """G = E/(2 (1 + nu)) (theory, 1)."""
        return self.young / (2.0 * (1.0 + self.poisson))

    @property
    def kappa(self) -> float:
        """Kolosov's constant: 3 - 4 nu in plane strain, (3 - nu)/(1 + nu) in plane stress (theory, 1)."""
        if self.plane == "strain":
            return 3.0 - 4.0 * self.poisson
        return (3.0 - self.poisson) / (1.0 + self.poisson)

    @property
    def plane_modulus(self) -> float:
        """E' = 8 G / (kappa + 1): E/(1 - nu^2) in plane strain, E in plane stress (theory, 1)."""
        return 8.0 * self.shear_modulus / (self.kappa + 1.0)
