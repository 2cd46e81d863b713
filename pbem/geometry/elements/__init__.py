"""Elements and legs of curves by their kind, straight or circular: the only place that asks which it is.

A further kind is a class with the methods of `kind.Kind`, listed in `array.KINDS`, and its kernels (pbem.bem).
"""

from pbem.geometry.elements.array import Elements, choose_kind
from pbem.geometry.elements.kind import Kind, Shape
from pbem.geometry.elements.meeting import cross_carriers

__all__ = ["Elements", "Kind", "Shape", "choose_kind", "cross_carriers"]
