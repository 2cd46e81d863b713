"""Words of messages."""

from __future__ import annotations

import pytest

from pbem.wording import write_percent


@pytest.mark.parametrize(("part", "text"), [(1.0, "100"), (0.998, "100"), (0.1234, "12"), (0.00567, "0.57")])
def test_parts_in_percent(part: float, text: str) -> None:
    assert write_percent(part) == text
