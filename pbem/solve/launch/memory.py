"""Whether the nodes of a run have the memory for it, asked before anything is computed."""

from __future__ import annotations

import os
from collections.abc import Sequence

from mpi4py import MPI

from pbem.environment import is_set
from pbem.errors import LaunchError
from pbem.forecast.forecast import exceeds_at_most, make_forecast, note_memory, refuse_memory
from pbem.forecast.limits import OVERRIDE, Limit, read_available, read_limits
from pbem.mesh.mesh import Mesh
from pbem.model.model import Model
from pbem.parallel import broadcast, do_on_first, gather_by_node


def check_memory(comm: MPI.Intracomm, model: Model, mesh: Mesh) -> tuple[str, ...]:
    """Notes on the memory, the same on all ranks. Raises LaunchError, on all alike, where a node grants less than the
    forecast, unless the user wants it so."""
    nodes = gather_by_node(comm, (read_limits(os.environ), read_available()))
    allowed = broadcast(comm, is_set(os.environ, OVERRIDE))
    return do_on_first(comm, LaunchError, lambda: judge_memory(model, mesh, nodes, allowed))


def judge_memory(
    model: Model, mesh: Mesh, nodes: Sequence[Sequence[tuple[Sequence[Limit], float | None]]], allowed: bool
) -> tuple[str, ...]:
    """Notes for the ranks of all nodes, of each what its limits are (the least first) and what can be had now.

    Raises LaunchError. allowed: a refusal is a note.
    """
    ranks = sum(map(len, nodes))
    granted = min((found for node in nodes for limits, free in node for found in
                   (*(limit.bytes / len(node) for limit in limits[:1]), *([free / len(node)] if free else []))),
                  default=None)
    if granted is None or not exceeds_at_most(model, mesh, ranks, granted):
        return ()
    forecast = make_forecast(model, mesh, ranks, timed=False)
    refusals = [text for node in nodes if (text := refuse_memory(forecast, len(node), node[0][0]))]
    if refusals and not allowed:
        raise LaunchError(refusals[0])
    notes = [text for node in nodes if (text := note_memory(forecast, len(node), node[0][1]))]
    return tuple([*(" ".join(text.split()) for text in refusals), *notes][:1])
