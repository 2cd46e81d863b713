"""Solutions to the default tolerance are near to those of a far smaller one: so two ways to a state agree."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pbem
from tests.unit.far_sample import CRACKS
from tests.unit.test_krylov import PRESSED, many_groups  # noqa: F401

pytestmark = pytest.mark.usefixtures("without_errors")

# Between two solutions this may be twice.
NEAR = 4e-10


@pytest.mark.usefixtures("many_groups")
@pytest.mark.parametrize("text", [CRACKS, PRESSED], ids=["in proportion", "in stages"])
def test_the_tolerance_leaves_less_than_is_asked_of_resumed_runs(text: str, tmp_path: Path) -> None:
    case = tmp_path / "case.toml"
    case.write_text(text + "\n[solver]\nnewton_tolerance = 1e-13\n", encoding="utf-8")
    exact = pbem.run(case, tmp_path / "exact.h5", operator="hierarchical")
    case.write_text(text, encoding="utf-8")
    found = pbem.run(case, tmp_path / "found.h5", operator="hierarchical")
    for field in ("opening", "slip", "traction_n", "traction_s"):
        size = max(float(np.abs(getattr(each, field)).max()) for each in exact.contact.values())
        for name, contact in exact.contact.items():
            np.testing.assert_array_equal(found.contact[name].mode, contact.mode)
            np.testing.assert_allclose(getattr(found.contact[name], field), getattr(contact, field), rtol=0,
                                       atol=NEAR * size)
