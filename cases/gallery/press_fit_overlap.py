"""A ring on a shaft that is drawn too large for it."""

from pbem.results.reader import Results

TITLE = "A press fit by geometry (Lame)"
SUBJECT = "contact"
PROBLEM = """A brass ring (radii 25 and 40 mm) sits on a hollow steel shaft (10 and 25.0005 mm): the shaft is drawn too
large, and the contact allows the overlap. The pressure of the fit follows from Lame's solution for both, and the
stored energy is half of its work on the interference. Then a shear traction on the outside of the ring applies a
torque, which the friction of the fit has to carry."""
SOURCE = """G. Lame, Lecons sur la theorie mathematique de l'elasticite des corps solides (1852); Timoshenko, Goodier,
Theory of Elasticity, section 28 (McGraw-Hill, 1970)."""
BORE, FIT, OUT, DEPTH = 10.0, 25.0, 40.0, 5e-4
SOFT = FIT * ((FIT**2 + BORE**2) / (FIT**2 - BORE**2) - 0.3) / 2.1e5
SOFT += FIT * ((OUT**2 + FIT**2) / (OUT**2 - FIT**2) + 0.25) / 1e5
PRESSURE = DEPTH / SOFT
EXPECTED = {
    "pressure of the fit, MPa": (PRESSURE, 1e-4),
    "energy stored by the fit, N mm per mm": (3.141592653589793 * FIT * DEPTH * PRESSURE, 1e-4),
    "friction that carries the torque, MPa": (0.04 * (OUT / FIT) ** 2, 1e-3),
}
PICTURES = [
    ("Mises stress of the fit and the torque", ["plot", "--field", "mises"]),
    ("pressure and friction along the fit", ["plot", "--curve", "fit", "--field", "traction_n,traction_s"]),
]


def compute(results: Results) -> dict[str, float]:
    """Means over the pairs of the fit, which lie at equal distances."""
    fit = results.contact["fit"]
    return {
        "pressure of the fit, MPa": -float(fit.traction_n[0].mean()),
        "energy stored by the fit, N mm per mm": float(results.energy.elastic[0]),
        "friction that carries the torque, MPa": abs(float(fit.traction_s[-1].mean())),
    }
