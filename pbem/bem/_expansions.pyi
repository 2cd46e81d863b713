"""Types of the compiled passes; see farfield.py for shapes and meaning."""

from typing import Any

def sum_moments(
    begin: Any, points: Any, shapes: Any, number: Any, family: Any, x: Any, y: Any, dx: Any, dy: Any, weight: Any,
    shape: Any, length: Any, crowd: Any, first: Any, center: Any, radius: Any, kappa: Any, shear_modulus: Any, v: Any,
    out: Any, nodes: int, terms: int, /,
) -> None: ...
def lift(parent: Any, center: Any, radius: Any, moments: Any, terms: int, /) -> None: ...
def carry(
    target: Any, source: Any, target_center: Any, target_radius: Any, length: Any, source_center: Any,
    source_radius: Any, weights: Any, moments: Any, fields: Any, terms: int, /,
) -> None: ...
def lower(parent: Any, wanted: Any, center: Any, radius: Any, fields: Any, terms: int, /) -> None: ...
def evaluate(
    cluster: Any, first: Any, point: Any, normal: Any, center: Any, radius: Any, kappa: Any, shear_modulus: Any,
    fields: Any, out: Any, terms: int, /,
) -> None: ...
def add_whole_rows(number: Any, unit: Any, x: Any, out: Any, /) -> None: ...
