"""Contact at corners of a fraction of a degree, with traction equations: the displacement has a kink opposite them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import pbem

pytestmark = pytest.mark.usefixtures("without_errors")


def describe_layer(elements: int) -> dict[str, Any]:
    return {
        "materials": {"soft": {"young": 1.0, "poisson": 0.35}},
        "curves": {
            "bottom": {"points": [[-3, -0.7], [3, -0.7]], "elements": 4 * elements},
            "right": {"points": [[3, -0.7], [3, 0]], "elements": elements},
            "surface": {"points": [[-3, 0], [-1.2, 0], [0.5, 0], [3, 0]],
                        "elements": [elements, 4 * elements, elements]},
            "left": {"points": [[-3, 0], [-3, -0.7]], "elements": elements},
        },
        "regions": {"layer": {"material": "soft", "boundary": ["bottom", "right", "surface", "left"]}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}},
    }  # fmt: skip


def press_wedge(folder: Path, scheme: str, elements: int) -> float:
    """The force of a rigid wedge that rises by 3e-3 to both sides."""
    case = describe_layer(elements) | {
        "tools": {"wedge": {"ux": 0.0, "uy": -1.8e-3, "rotation": 0.02}},
        "contacts": {"seat": {"between": ["surface", "wedge"], "friction": 0.5}},
        "analysis": {"scheme": scheme, "steps": 1},
    }
    case["curves"]["wedge"] = {"points": [[-0.95, 1.8e-3], [-0.35, 0], [0.25, 1.8e-3]], "elements": [3, 3]}
    return float(pbem.run(case, folder / "wedge.h5", force=True).reactions["bottom"][-1, 1])


def press_roof(folder: Path, scheme: str, elements: int) -> float:
    """The force of an elastic block whose lower face has a corner of 0.3 degrees."""
    case = describe_layer(elements)
    case["materials"]["hard"] = {"young": 4.0, "poisson": 0.2}
    case["curves"] |= {
        "roof": {"points": [[-0.95, 1.8e-3], [-0.35, 0], [0.25, 1.8e-3]], "elements": [2 * elements, 2 * elements]},
        "one": {"points": [[0.25, 1.8e-3], [0.25, 0.6]], "elements": elements},
        "top": {"points": [[0.25, 0.6], [-0.95, 0.6]], "elements": elements},
        "other": {"points": [[-0.95, 0.6], [-0.95, 1.8e-3]], "elements": elements},
    }
    case["regions"]["block"] = {"material": "hard", "boundary": ["roof", "one", "top", "other"]}
    case["boundary"]["top"] = {"ux": 0.0, "uy": -2.5e-3}
    case |= {"contacts": {"seat": {"between": ["surface", "roof"], "friction": 0.5}},
             "analysis": {"scheme": scheme, "steps": 1}}
    return float(pbem.run(case, folder / "roof.h5", force=True).reactions["bottom"][-1, 1])


@pytest.mark.parametrize("scheme", ["HST", "THST", "DBEM"])
@pytest.mark.parametrize("press", [press_wedge, press_roof])
def test_forces_of_blunt_corners(press: Callable[[Path, str, int], float], scheme: str, tmp_path: Path) -> None:
    """Against displacement equations on twice the elements; HST and THST were 0.6 to 1.6 % off."""
    force = press(tmp_path, "SST", 12)
    assert press(tmp_path, scheme, 6) == pytest.approx(force, rel=1e-3)
