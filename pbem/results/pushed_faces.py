"""Faces of a result file that nothing keeps apart and that lie in each other at the last stored step."""

from __future__ import annotations

import numpy as np

from pbem.contact.laws import OPEN
from pbem.results.reader import Results
from pbem.solve.steps.open_faces import PushedFaces, find_pushed


def find_pushed_faces(results: Results) -> list[PushedFaces]:
    """The curves whose faces do, the deepest first; none if no step is stored.

    Pairs that are open without being free to overlap by their law or a stage have an opening that is not negative.
    """
    pairs = results.pairs
    if not len(results.steps) or not pairs.names:
        return []
    by_law = np.array([law == "open" for law in pairs.laws])
    free = pairs.at("mode", -1) == OPEN
    return find_pushed(pairs.names, by_law, pairs.interface, pairs.position, free, pairs.at("opening", -1),
                       pairs.at("slip", -1))
