"""Types of the compiled kernels; see rows.py for shapes and meaning."""

from typing import Any

def rows(
    point: Any, on: Any, on_local: Any, start: Any, end: Any, center: Any, sweep: Any, family: Any, local: Any,
    shape: Any, kappa: float, shear_modulus: float, length: float, displacement: Any,
    normal: Any, traction: Any, /,
) -> None: ...
