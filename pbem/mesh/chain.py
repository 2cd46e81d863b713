"""The elements of one curve as one region sees them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.geometry.carrier import Carriers
from pbem.geometry.elements import Elements
from pbem.mesh.shape_functions import place_crack_nodes, place_nodes


@dataclass(frozen=True)
class Chain:
    """The elements of one curve in a region's order of travel (region on the left).

    forward: travelled in the curve's own direction. traction (elements,): the traction equation is collocated there.
    first_node: number of its first node in the mesh. order: of the shapes on its elements. carriers: of its
    elements, in order; none of curves in no contact. rigid: of a tool.
    """

    region: int
    curve: str
    forward: bool
    crack: bool
    traction: Bool
    elements: Elements
    first_node: int
    order: int
    carriers: Carriers
    rigid: bool = False

    @property
    def local(self) -> Real:
        """Coordinates of the nodes on each of its elements."""
        order = self.order
        return place_crack_nodes(order) if self.crack else place_nodes(order)

    def number_nodes(self) -> Integer:
        """Numbers of its nodes in the order of the curve's own direction."""
        numbers = self.first_node + np.arange(self.elements.count * (self.order + 1))
        return numbers if self.forward else numbers[::-1]
