"""The fields that pictures show, from displacement and stress."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pbem.arrays import Real

# Displacement (q, 2) and stress sxx, syy, sxy, szz (q, 4) to the field (q,).
Formula = Callable[[Real, Real], Real]


def _deviator(s: Real) -> Real:
    """Largest shear stress in the plane."""
    return np.asarray(np.hypot(0.5 * (s[:, 0] - s[:, 1]), s[:, 2]))


def _mises(u: Real, s: Real) -> Real:
    xx, yy, xy, zz = s.T
    return np.asarray(np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3 * xy**2))


# What `pbem plot --field` offers: title, whether it is a length (else a stress), formula.
FIELDS: dict[str, tuple[str, bool, Formula]] = {
    "ux": ("$u_x$", True, lambda u, s: u[:, 0]),
    "uy": ("$u_y$", True, lambda u, s: u[:, 1]),
    "u": ("$|u|$", True, lambda u, s: np.asarray(np.hypot(*u.T))),
    "sxx": (r"$\sigma_{xx}$", False, lambda u, s: s[:, 0]),
    "syy": (r"$\sigma_{yy}$", False, lambda u, s: s[:, 1]),
    "sxy": (r"$\sigma_{xy}$", False, lambda u, s: s[:, 2]),
    "s1": (r"$\sigma_1$", False, lambda u, s: 0.5 * (s[:, 0] + s[:, 1]) + _deviator(s)),
    "s2": (r"$\sigma_2$", False, lambda u, s: 0.5 * (s[:, 0] + s[:, 1]) - _deviator(s)),
    "shear": (r"$\tau_{max}$", False, lambda u, s: _deviator(s)),
    "mises": (r"$\sigma_{Mises}$", False, _mises),
}
