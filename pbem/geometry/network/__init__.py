"""Networks of traces that cross, meet and lie on one another: cut into pieces that meet at their ends only."""

from pbem.geometry.network.network import Network, cut_network
from pbem.geometry.network.parts import Block, Change, Junction

__all__ = ["Block", "Change", "Junction", "Network", "cut_network"]
