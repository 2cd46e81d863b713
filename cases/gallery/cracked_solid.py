"""Compliance of a cracked solid."""

import math

from pbem.results.reader import Results

TITLE = "Modulus of a solid with cracks in all directions"
SUBJECT = "composites"
PROBLEM = """Cracks of half-length a and density d = n a^2 (n per unit area) reduce the modulus of a solid. If they are
far from each other and open, and all directions are equally frequent, E'/E'' = 1 + pi d, as the integrated opening of
each crack is 2 pi a^2/E' times the traction it relieves, whatever its direction. Under compression they close: without
friction they only slide, and E'/E'' = 1 + pi d/4. Twelve cracks around a circle of twelve half-lengths reproduce both
to 3e-4."""
SOURCE = """J. R. Bristow, British Journal of Applied Physics 11 (1960) 81-85; J. B. Walsh, Journal of Geophysical
Research 70 (1965) 381-389; M. Kachanov, Effective elastic properties of cracked solids, Applied Mechanics Reviews 45
(1992) 304-335."""
EXPECTED = {
    "open: (E'/E'' - 1)/d": (math.pi, 2e-3),
    "closed: (E'/E'' - 1)/d": (math.pi / 4, 2e-3),
}
PICTURES = [
    ("a crack at 30 degrees to the x axis when pressed: slip of closed faces",
     ["plot", "--curve", "c03", "--field", "slip,traction_n"]),
    ("all cracks by their slip", ["plot", "--traces", "slip"]),
]
MODULUS = 50e3 / (1 - 0.25**2)


def compute(results: Results) -> dict[str, float]:
    """The strain eyy that opening and slip add per area, n_y u_y, by the stress and by the twelve cracks."""
    strain = 0.0
    for crack in results.contact.values():
        across = crack.normal[0][1]
        along = crack.normal[0][0]  # y of s, which is n turned by 90 degrees
        strain = strain + across * (across * crack.integrate("opening") + along * crack.integrate("slip"))
    open_cracks, closed_cracks = MODULUS / 12 * strain
    return {"open: (E'/E'' - 1)/d": open_cracks, "closed: (E'/E'' - 1)/d": -closed_cracks}
