"""A lined tunnel."""

from pbem.results.reader import Results

TITLE = "A lined tunnel under stress from all sides"
SUBJECT = "tunnels and ground"
PROBLEM = """The rock around a lined tunnel (a = 3 m, lining down to b = 2.6 m) is loaded by p = 8 MPa from all sides
(plane strain). Its wall moves inwards by (2 (1 - nu) p - q) a/(2 G) if the lining presses back with q; the lining is
displaced by q a ((1 - 2 nu) a^2 + b^2)/(2 G (a^2 - b^2)) with its own constants. Both together give q and the hoop
stress -2 q a^2/(a^2 - b^2) at the inside of the lining."""
SOURCE = """Lame's solutions for ring and plane; e.g. H. H. Einstein, C. W. Schwartz, Simplified analysis for tunnel
supports, Journal of the Geotechnical Engineering Division ASCE 105 (1979) 499-518 (thin linings)."""
G, g = 10e3 / 2.5, 30e3 / 2.4
RING = ((1 - 2 * 0.2) * 3.0**2 + 2.6**2) / (3.0**2 - 2.6**2)
LOAD = 2 * (1 - 0.25) * 8.0 / (1 + G / g * RING)
EXPECTED = {
    "pressure on the lining, MPa": (LOAD, 1e-3),
    "hoop stress inside the lining, MPa": (-2 * LOAD * 3.0**2 / (3.0**2 - 2.6**2), 1e-3),
}
PICTURES = [
    ("larger compression in rock and lining", ["plot", "--field", "s2", "--box", "-5", "-4.5", "5", "4.5"]),
]


def compute(results: Results) -> dict[str, float]:
    """Mean pressure on the wall; stress along the inside at its right end."""
    around = 2 * 3.141592653589793 * 3.0
    return {
        "pressure on the lining, MPa": -results.contact["wall"].integrate("traction_n")[-1] / around,
        "hoop stress inside the lining, MPa": results.evaluate([[2.6, 0.0]]).stress[-1][0, 1],
    }
