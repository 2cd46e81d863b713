"""The arrays that objects hold. On ranks the text of the function is run: see inspect.getsource."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse


def list_arrays(item: Any, seen: set[int]) -> list[np.ndarray]:
    """All arrays of an object, each once; of views the whole that they keep alive. seen: what was listed before."""
    if id(item) in seen:
        return []
    seen.add(id(item))
    if isinstance(item, np.ndarray):
        return list_arrays(item.base, seen) if isinstance(item.base, np.ndarray) else [item]
    if sparse.issparse(item):
        return list_arrays([item.data, item.indices, item.indptr], seen)
    if hasattr(item, "__dict__"):
        item = vars(item)
    parts = item.values() if isinstance(item, dict) else item if isinstance(item, (tuple, list)) else ()
    return [array for part in parts for array in list_arrays(part, seen)]
