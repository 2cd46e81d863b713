"""How stiff the bodies are that pairs lie between: by the length of their interface, and by that of each pair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pbem.arrays import Integer, Real
from pbem.formed import FormedArray, form_runs, form_values
from pbem.mesh.mesh import Mesh
from pbem.uniform import fold_uniform


@dataclass(frozen=True)
class Surroundings:
    """Of pairs (m,): modulus of the softer side, length of their interface, and weight, their own length or that."""

    modulus: Real
    length: Real
    weight: Real

    def stiffen_alone(self, pairs: Integer) -> Real:
        """Modulus over the own length of pairs (k,), stress/length."""
        weight = self.weight[pairs]
        return np.asarray(self.modulus[pairs] / np.where(weight > 0, weight, self.length[pairs]))


def find_surroundings(mesh: Mesh, moduli: Sequence[float]) -> Surroundings:
    """Those of all pairs; moduli (stress): plane moduli of the regions."""
    pairs, material, node_region = mesh.pairs, np.array(moduli), mesh.node_region
    modulus = np.asarray(np.minimum(*(material[node_region[side]] for side in (pairs.first, pairs.second))))
    length = np.bincount(pairs.interface, pairs.weight, minlength=len(mesh.interface_names))[pairs.interface]
    return Surroundings(form_runs(fold_uniform(modulus)), form_runs(np.asarray(length, dtype=float)), pairs.weight)


def stiffen(around: Surroundings, softness: float) -> tuple[Real, Real]:
    """Stiffness (m,) of surroundings as long as the interface, times softness, and as long as each pair alone."""
    stiffness = fold_uniform(softness * around.modulus / around.length)
    own = fold_uniform(around.stiffen_alone(np.arange(len(around.weight))))
    if isinstance(around.weight, FormedArray):
        own = form_values(own, around.stiffen_alone)
    return form_runs(stiffness), own
