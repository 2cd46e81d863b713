"""Slip by injection."""

import numpy as np

from pbem.results.reader import Results

TITLE = "Slip on a fault due to fluid injection"
SUBJECT = "injection"
PROBLEM = """A fault under the normal stress s = 50 MPa and the shear t = 27 MPa, with friction f = 0.6, is locked.
Fluid at the pressure p = 10 MPa is injected in its middle and diffuses along it: p erfc(|x|/sqrt(4 D time)). The
slipping half-length a grows with the square root of time. The solution depends only on T = (f s - t)/(f p), here 0.5:
a/sqrt(4 D time) = 0.791607, and the slip in the middle is 0.934648 f p a/E'. D is chosen such that a = 100 m at the
end."""
SOURCE = """R. C. Viesca, Self-similar fault slip in response to fluid injection, Journal of Fluid Mechanics 928
(2021) A29."""
SPREAD, PLANE_MODULUS = 126.3253, 30e3 / (1 - 0.25**2)
EXPECTED = {
    "half-length over sqrt(4 D time)": (0.791607, 5e-3),
    "slip in the middle times E'/(f p a)": (0.934648, 2e-3),
}
PICTURES = [
    ("slip and tractions along the fault",
     ["plot", "--curve", "fault", "--field", "slip,traction_s,traction_n", "--x", "x"]),
    ("shear stress in the rock", ["plot", "--field", "sxy", "--box", "-200", "-120", "200", "120"]),
]


def compute(results: Results) -> dict[str, float]:
    """Near its end the slip falls with the power 3/2 of the distance to it."""
    fault = results.contact["fault"]
    x, slip = fault.position[:, 0], np.abs(fault.slip[-1])
    near = (x > 0) & (slip > 0.002 * slip.max()) & (slip < 0.25 * slip.max())
    half_length = np.polyval(np.polyfit(slip[near] ** (2 / 3), x[near], 3), 0.0)
    middle = np.interp(0.0, x, slip)
    return {
        "half-length over sqrt(4 D time)": half_length / SPREAD,
        "slip in the middle times E'/(f p a)": middle * PLANE_MODULUS / (0.6 * 10 * 100),
    }
