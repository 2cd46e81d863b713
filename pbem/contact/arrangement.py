"""A construction on a mesh: pairs that a stage holds otherwise than by their law, and what regions that are gone leave.

Faces that open in a stage bear, besides what their law says, what they carried at its beginning times the part of the
stage that is left; faces that are closed are bonded with their jump at that time as its zero (theory, 95). Regions that
are gone keep their equations, with a state of zero that disturbs no other (theory, 96).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Bool, Integer, Real
from pbem.contact.laws import OPEN, SLIP, STICK, Memory, ModeState, PairLaws, PairState, find_creeping, resists_slip
from pbem.contact.loads import Load, OuterNodes
from pbem.mesh.mesh import Mesh
from pbem.model.construction import list_opened
from pbem.model.model import Model


@dataclass(frozen=True)
class Arrangement:
    """What there is in a stage.

    closed, opened (m,): pairs that are bonded, or never touch, whatever their law; opening (m,): those that open in
    this stage. bared (m,): pairs with a region that is gone on one side or on both. regions (r,): that are gone. nodes
    (k,): theirs on interfaces and cracks; outer (o,): which of the outer nodes are theirs. bare (b,): the nodes of
    other regions on the faces that they have left.
    """

    closed: Bool
    opened: Bool
    opening: Bool
    bared: Bool
    regions: Bool
    nodes: Integer
    outer: Bool
    bare: Integer

    def hold(self, laws: PairLaws, rest: Real) -> PairLaws:
        """The laws of the pairs in the stage; rest (m,): openings of closed pairs without traction."""
        free = ~(self.closed | self.opened)
        return replace(
            laws, bonded=(laws.bonded & ~self.opened) | self.closed, parted=(laws.parted & ~self.closed) | self.opened,
            brittle=laws.brittle & free, rest=np.where(self.closed, rest, laws.rest),
        )

    def blank(self, state: PairState) -> PairState:
        """The state of the pairs without jumps where a side is gone."""
        jumps = (np.where(self.bared, 0.0, each) for each in (state.g_n, state.g_s))
        return PairState(state.p_n, state.p_s, *jumps)

    def adapt(self, load: Load, mesh: Mesh, outer: OuterNodes, carried: Real) -> Load:
        """The load without what acts on regions that are gone; carried (m, 2): what opened pairs still bear."""
        gone = self.regions[mesh.node_region]
        components = np.tile(np.repeat(gone, 2), 2)
        return replace(
            load, values=np.where(self.outer[:, None], 0.0, load.values), known=np.where(components, 0.0, load.known),
            fields=load.fields.without(self.regions), carried=load.carried + carried,
            rigid=_free_what_is_gone(load.rigid, outer, gone),
        )


def _free_what_is_gone(given: Real, outer: OuterNodes, gone: Bool) -> Real:
    """Forces and motions (b, 3) of rigid bodies, none of those that are gone."""
    given = given.copy()
    for body in outer.rigid:
        if gone[body.nodes].all():
            given[body.number] = 0.0
    return given


def find_arrangement(model: Model, mesh: Mesh, outer: OuterNodes, stage: int) -> Arrangement | None:
    """What there is in a stage; None where all is as the laws say."""
    now = model.stages[stage].construction
    if not now.joints and not now.removed:
        return None
    names, of = mesh.interface_names, mesh.pairs.interface

    def choose(wanted: list[str]) -> Bool:
        return np.isin(np.array(names), np.array(wanted, dtype=str))[of] if names else np.zeros(0, dtype=bool)

    gone = np.isin(np.array(mesh.region_names), np.array(now.removed, dtype=str))
    node_gone = gone[mesh.node_region]
    is_outer = np.zeros(mesh.nodes, dtype=bool)
    is_outer[outer.node] = True
    pairs = mesh.pairs
    closed, opened = ([name for name, hold in now.joints.items() if hold == kind] for kind in ("closed", "open"))
    around = choose(opened) & np.isin(of, np.unique(of[node_gone[pairs.first] | node_gone[pairs.second]]))
    bared = around | (pairs.crack & node_gone[pairs.first])
    beside = np.zeros(mesh.nodes, dtype=bool)
    beside[pairs.slave[bared]] = True
    beside[mesh.links.traction_node[bared[mesh.links.traction_pair]]] = True
    return Arrangement(
        closed=choose(closed), opened=choose(opened), opening=choose(list_opened(model.stages, stage)),
        bared=bared, regions=gone, nodes=np.flatnonzero(node_gone & ~is_outer), outer=node_gone[outer.node],
        bare=np.flatnonzero(beside & ~node_gone),
    )


def begin_memory(
    before: Arrangement | None, now: Arrangement | None, laws: PairLaws, memory: Memory, opening: Real
) -> Memory:
    """What the pairs bring into a stage, of which those that are held otherwise than before change their mode.

    laws: by which the faces go where nothing holds them; opening (m,): without that of elastic joints and without
    dilation. Faces that
    follow their law again are open if they lie apart. Brittle bonds of faces that were opened are lost.
    """
    nothing = np.zeros(laws.count, dtype=bool)
    was_closed, was_opened = (nothing, nothing) if before is None else (before.closed, before.opened)
    closed, opened = (nothing, nothing) if now is None else (now.closed, now.opened)
    freed = (was_closed | was_opened) & ~closed & ~opened
    apart = opening > APART * np.abs(opening).max(initial=0.0)
    sticks = laws.bonded | (resists_slip(laws) & ~find_creeping(laws))
    own = np.where(laws.parted | (apart & ~laws.bonded), OPEN, np.where(sticks, STICK, SLIP))
    mode = np.where(freed, own, memory.modes.mode)
    mode = np.where(opened, OPEN, np.where(closed, STICK, mode)).astype(np.int8)
    begun = replace(memory, modes=ModeState(mode[laws.leader], memory.modes.sign))
    return begun.lose(memory.broken | (opened & laws.brittle))


# Openings below this part of the largest are rounding.
APART = 1e-9
