"""Case files that tests start from, and their change by replacing a piece of text."""

from __future__ import annotations

from pbem.case.build import parse_model
from pbem.errors import CaseError, Fault
from pbem.model.model import Model

MATERIAL = """
[materials.soft]
young = 2000.0
poisson = 0.3
"""

SQUARE = f"""{MATERIAL}
[curves]
bottom = {{ points = [[0, 0], [2, 0]], elements = 8 }}
right = {{ points = [[2, 0], [2, 2]], elements = 8 }}
top = {{ points = [[2, 2], [0, 2]], elements = 8 }}
left = {{ points = [[0, 2], [0, 0]], elements = 8 }}
[regions.body]
material = "soft"
boundary = ["bottom", "right", "top", "left"]
[boundary.bottom]
ux = 0.0
uy = 0.0
[boundary.top]
ty = -1.0
"""

BLOCKS = f"""{MATERIAL}
[curves]
bottom = {{ points = [[0, 0], [2, 0]], elements = 8 }}
right_lower = {{ points = [[2, 0], [2, 1]], elements = 4 }}
left_lower = {{ points = [[0, 0], [0, 1]], elements = 4 }}
interface = {{ points = [[0, 1], [2, 1]], elements = 16 }}
right_upper = {{ points = [[2, 1], [2, 2]], elements = 4 }}
left_upper = {{ points = [[0, 1], [0, 2]], elements = 4 }}
top = {{ points = [[2, 2], [0, 2]], elements = 8 }}
[regions.lower]
material = "soft"
boundary = ["bottom", "right_lower", "interface", "left_lower"]
[regions.upper]
material = "soft"
boundary = ["top", "right_upper", "interface", "left_upper"]
[boundary.bottom]
ux = 0.0
uy = 0.0
[boundary.top]
ux = 0.001
uy = -0.001
[interfaces.interface]
law = "coulomb"
friction = 0.5
"""


def change(text: str, *pairs: tuple[str, str]) -> str:
    """Replace the first piece of each pair, which must be there, by the second."""
    for old, new in pairs:
        assert old in text, f"the sample has no {old!r}"
        text = text.replace(old, new, 1)
    return text


def add_curves(text: str, curves: str, uses: str = "") -> str:
    """Add lines at the end of [curves], and lines at the end of the first region."""
    text = change(text, ("[regions.", f"{curves}\n[regions."))
    head, tail = text.split("boundary = [", 1)
    line, rest = tail.split("\n", 1)
    return f"{head}boundary = [{line}\n{uses}\n{rest}"


def build(text: str) -> Model:
    """The model of a right file."""
    return parse_model(text)[1]


def find_faults(text: str) -> tuple[Fault, ...]:
    """All faults of a wrong file."""
    try:
        parse_model(text)
    except CaseError as error:
        return error.faults
    raise AssertionError("the file was taken as right")


def find_only_fault(text: str) -> str:
    """The one fault of a wrong file, as it is told."""
    faults = find_faults(text)
    assert len(faults) == 1, "\n".join(map(str, faults))
    return str(faults[0])
