"""Elements and legs of curves, straight or circular: the only place that asks for the kind of an element.

Another kind is a class with the methods of `kind.Kind`, listed in `array.KINDS`, with its kernels in `pbem.bem`.
"""

from pbem.geometry.elements.array import Elements, choose_kind
from pbem.geometry.elements.kind import Kind, Shape
from pbem.geometry.elements.meeting import cross_carriers

__all__ = ["Elements", "Kind", "Shape", "choose_kind", "cross_carriers"]
