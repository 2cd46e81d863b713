"""Fields about the tip of a semi-infinite straight crack whose faces are free of traction (Williams' series)."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Complex, Real


def evaluate_eigenfield(
    amplitude: complex, exponent: float, z: Complex, angle: Real, normal: Complex, kappa: float
) -> tuple[Complex, Complex]:
    """Displacement and traction on unit normals, at points z from the tip; the crack lies on the negative real axis.

    Kolosov's potentials are phi = A z^m and psi = (c conj(A) - m A) z^m with m the exponent, a multiple of 1/2, and
    c = 1 if it is not whole, else -1: phi + z conj(phi') + conj(psi) vanishes on both faces (Williams, J. Appl. Mech.
    24, 1957). m = 1/2 with A = (KI - i KII)/sqrt(2 pi) is the field of the stress-intensity factors, m = 1 with
    A = T/4 the uniform stress T along the crack; m = -1/2 and -1 are their duals.
    angle: of each point, continuous on either side of the crack wherever that is. In units of the plane modulus E', so
    that the shear modulus is (kappa + 1)/8: displacements are lengths, tractions are strains.
    (theory, 2, 4, 66)
    """
    radius = np.abs(z)

    def power(exponent: float) -> Complex:
        return np.asarray(radius**exponent * np.exp(1j * exponent * angle))

    half = exponent % 1 != 0
    second = (1 if half else -1) * np.conj(amplitude) - exponent * amplitude
    phi, phi_1 = amplitude * power(exponent), amplitude * exponent * power(exponent - 1)
    phi_2 = amplitude * exponent * (exponent - 1) * power(exponent - 2)
    psi, psi_1 = second * power(exponent), second * exponent * power(exponent - 1)
    displacement = (kappa * phi - z * np.conj(phi_1) - np.conj(psi)) * 4 / (kappa + 1)
    traction = 2 * phi_1.real * normal - np.conj(np.conj(z) * phi_2 + psi_1) * np.conj(normal)
    return np.asarray(displacement), np.asarray(traction)
