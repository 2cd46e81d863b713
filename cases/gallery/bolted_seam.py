"""A strap that is bolted to a bar under load."""

import numpy as np

from pbem.results.reader import Results

TITLE = "A strap bolted to a bar under load"
SUBJECT = "contact"
PROBLEM = """A bar is stretched by 100 MPa. An unstressed strap beside it is then bolted to it: from then on the seam
keeps the slip of 0.05 mm at its end. Another 50 MPa on both stretch both by a further 0.025 mm, and the seam carries
no traction. When 100 MPa are removed from the ends of both, they shorten by 0.05 mm: a stress of 50 MPa remains in the
bar and of -50 MPa in the strap, and the seam keeps its slip (Poisson's ratio is 0)."""
SOURCE = """Superposition: what comes after the bolting is a uniform stress of both bars, u = s x/E."""
EXPECTED = {
    "slip at the end of the seam when bolted, mm": (0.05, 1e-6),
    "displacement of the strap's end when both are stretched, mm": (0.025, 1e-6),
    "slip that is left in the end, mm": (0.05, 1e-6),
    "displacement of the bar's end in the end, mm": (0.025, 1e-6),
}
PICTURES = [("displaced, with the bolts in place: the seam keeps its slip", ["plot", "--step", "2"])]


def compute(results: Results) -> dict[str, float]:
    """The slip at the last pairs, carried on to the end of the seam."""
    seam, moved = results.contact["seam"], results.evaluate([[100.0, 5.0], [100.0, 15.0]]).displacement[:, :, 0]

    def find_end(step: int) -> float:
        line = np.polyfit(seam.arc_length, np.abs(seam.slip[step]), 1)
        return float(np.polyval(line, 100.0))

    return {
        "slip at the end of the seam when bolted, mm": find_end(0),
        "displacement of the strap's end when both are stretched, mm": moved[1, 1],
        "slip that is left in the end, mm": find_end(-1),
        "displacement of the bar's end in the end, mm": moved[2, 0],
    }
