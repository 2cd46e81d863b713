"""A shrink fit and its torque."""

import numpy as np

from pbem.results.reader import Results

TITLE = "A shrink fit (Lame), then a torque"
SUBJECT = "contact"
PROBLEM = """A ring of iron (25 to 40 mm) sits on a hollow shaft of steel (10 to 25 mm) that is too large for it by d =
0.02 mm in radius (plane stress). The pressure between them is d over the sum of their radial compliances, R ((R^2 +
r^2)/(R^2 - r^2) - nu)/E of the shaft and R ((r^2 + R^2)/(r^2 - R^2) + nu)/E of the ring. Then shear tractions ts on
the outside of the ring apply a torque: the fit carries ts (40/25)^2, slightly less than friction times pressure."""
SOURCE = """G. Lame, Lecons sur la theorie mathematique de l'elasticite des corps solides (1852); S. P. Timoshenko, J.
N. Goodier, Theory of Elasticity, section 28 (McGraw-Hill, 1970)."""
SHAFT = 25 * ((25**2 + 10**2) / (25**2 - 10**2) - 0.3) / 210e3
RING = 25 * ((40**2 + 25**2) / (40**2 - 25**2) + 0.25) / 100e3
PRESSURE = 0.02 / (SHAFT + RING)
EXPECTED = {
    "pressure of the fit, MPa": (PRESSURE, 2e-4),
    "shear traction in the fit, MPa": (1.95 * (40 / 25) ** 2, 2e-4),
    "elastic energy of the fit, N": (np.pi * 25 * 0.02 * PRESSURE, 5e-4),
}
PICTURES = [
    ("von Mises stress", ["plot", "--field", "mises"]),
    ("tractions around the fit", ["plot", "--curve", "fit", "--field", "traction_n,traction_s", "--x", "angle"]),
]


def compute(results: Results) -> dict[str, float]:
    """Mean tractions after both stages; the energy after the first."""
    fit = results.contact["fit"]
    around = 2 * np.pi * 25
    return {
        "pressure of the fit, MPa": -fit.integrate("traction_n")[0] / around,
        "shear traction in the fit, MPa": abs(fit.integrate("traction_s")[-1]) / around,
        "elastic energy of the fit, N": results.energy.elastic[0],
    }
