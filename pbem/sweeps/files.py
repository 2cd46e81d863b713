"""The names of the result files that a sweep keeps."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from typing import Any

from pbem.sweeps.values import write_cell

MOST_LETTERS = 120
_PLAIN = re.compile(r"[\w.+=,-]+\Z")


def name_results(values: Mapping[str, Any]) -> str:
    """A file name from the values, friction=0.3,sxx=-5.h5; of the last names of the keys where these tell them apart.

    Values that are no part of a file name are told by a short mark.
    """
    short = [re.split(r"\.", key)[-1].strip("\"' ") for key in values]
    keys = short if len(set(short)) == len(short) else list(values)
    name = ",".join(f"{key}={write_cell(value)}" for key, value in zip(keys, values.values(), strict=True))
    if _PLAIN.match(name) and len(name) <= MOST_LETTERS and name.isascii():
        return f"{name}.h5"
    whole = "\0".join(f"{key}={write_cell(value)}" for key, value in values.items())
    return f"case-{hashlib.sha256(whole.encode('utf-8', 'surrogatepass')).hexdigest()[:16]}.h5"
