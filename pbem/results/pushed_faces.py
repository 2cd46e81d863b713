"""Faces of a result file that nothing keeps apart and that lie in each other at the last stored step."""

from __future__ import annotations

import json

import numpy as np

from pbem.contact.laws import OPEN
from pbem.results.reader import Results
from pbem.solve.steps.open_faces import PushedFaces, find_pushed


def find_pushed_faces(results: Results) -> list[PushedFaces]:
    """The curves whose faces do, the deepest first; none if no step is stored.

    Only of curves whose law is "open", or that stages have opened up to then: elsewhere elastic joints under a fluid
    are open as well where they are closed by less than it closes them.
    """
    pairs = results.pairs
    if not len(results.steps) or not pairs.names:
        return []
    by_law = np.array([law == "open" for law in pairs.laws])
    opened = _find_opened(results)
    may = by_law | np.array([name in opened for name in pairs.names])
    free = (pairs.at("mode", -1) == OPEN) & may[pairs.interface]
    return find_pushed(pairs.names, by_law, pairs.interface, pairs.position, free, pairs.at("opening", -1),
                       pairs.at("slip", -1))


def _find_opened(results: Results) -> set[str]:
    """The curves that stages keep open at the last stored step; none in files of earlier versions."""
    stages = json.loads(results.configuration or "{}").get("stages", [])
    last = int(results.steps.stage[-1])
    joints = stages[last]["construction"]["joints"] if last < len(stages) else {}
    return {name for name, hold in joints.items() if hold == "open"}
