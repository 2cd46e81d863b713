"""Nucleation length of slip-weakening faults."""

import numpy as np

from pbem.results.reader import Results

TITLE = "Nucleation length of a fault that weakens with slip"
SUBJECT = "faults"
PROBLEM = """The strength of a fault decreases with slip, by W per length. Slip on a part of it that is shorter than h
is stable; at the length h it becomes unstable, whatever the distribution of the load: h = 1.158 m*/W, with m* = E'/2
in plane strain. Three faults of 0.90, 0.93 and 0.96 h are loaded by the same stress in excess of their strength. The
ratio of slip to length grows like 1/(h - length), so that extrapolating length over slip to zero gives h."""
SOURCE = """K. Uenishi, J. R. Rice, Universal nucleation length for slip-weakening rupture instability under
nonuniform fault loading, Journal of Geophysical Research 108 (2003) 2042."""
WEAKENING = 20 * (0.6 - 0.4) / 0.3454e-3
EXPECTED = {"h W/m*": (1.158, 2e-3)}
PICTURES = [
    ("slip and shear of the longest fault", ["plot", "--curve", "long", "--field", "slip,traction_s"]),
]


def compute(results: Results) -> dict[str, float]:
    """Length over slip in the middle, taken to zero by a parabola."""
    lengths, slips = np.array([1.80, 1.86, 1.92]), []
    for name in ("short", "middle", "long"):
        fault = results.contact[name]
        slips.append(np.interp(0.0, fault.position[:, 0], np.abs(fault.slip[-1])))
    critical = np.polyval(np.polyfit(lengths / slips, lengths, 2), 0.0)
    return {"h W/m*": critical * WEAKENING / 20e3}
