"""Curves along interfaces and cracks against finite elements, away from the singular points."""

from __future__ import annotations

import numpy as np
import pytest

from tests.cases.bundled import CLEARANCE, REFERENCES, Solve, read_reference
from tests.cases.sampling import sample_contact, sample_side

CORNERS = {"layers_push": {"seat_right": (0.0, 0.5, 1.0, 1.5)}}

# Error allowed of each kind of field, of its largest magnitude there: what two meshes of finite elements differ by.
ALLOWED = {"opening": 1e-9, "slip": 1.5e-3, "traction": 1.5e-3, "displacement": 1e-3}
COARSER = {"layers_push": {"traction": 5e-3}}
CURVES = [(case, interface) for case in REFERENCES for interface in read_reference(case)]


@pytest.mark.parametrize(("case", "interface"), CURVES, ids=[f"{case}: {interface}" for case, interface in CURVES])
def test_curves_are_those_of_finite_elements(case: str, interface: str, solve: Solve) -> None:
    results = solve(case)
    columns = read_reference(case)[interface]
    places = columns["arc_length"]
    corners = CORNERS.get(case, {}).get(interface, (0.0, places.max()))
    kept = np.min([np.abs(places - corner) for corner in corners], axis=0) > CLEARANCE
    assert kept.sum() >= 15
    allowed = ALLOWED | COARSER.get(case, {})

    def compare(name: str, kind: str, found: np.ndarray, expected: np.ndarray, scale: float) -> None:
        error = np.abs(found - expected)[kept]
        worst = int(np.argmax(error))
        assert error[worst] <= allowed[kind] * scale, (
            f"{name} at arc length {places[kept][worst]:g}: {found[kept][worst]:.6g} against "
            f"{expected[kept][worst]:.6g}, {error[worst] / scale:.1e} of {scale:.4g}"
        )

    length = np.abs([columns[f"u{axis}_{side}"] for axis in "xy" for side in ("first", "second")]).max()
    stress = np.abs([columns[name][kept] for name in ("traction_n", "traction_s")]).max()
    for name in ("opening", "slip"):
        compare(name, name, sample_contact(results, interface, name, places), columns[name], length)
    for name in ("traction_n", "traction_s"):
        compare(name, "traction", sample_contact(results, interface, name, places), columns[name], stress)
    for number, side in enumerate(("first", "second")):
        displacement = sample_side(results, interface, number, places)
        for axis, found in zip("xy", displacement.T, strict=True):
            compare(f"u{axis}_{side}", "displacement", found, columns[f"u{axis}_{side}"], length)
