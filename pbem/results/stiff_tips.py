"""Tips of cracks with elastic joints, which take up the stress within a distance from the tip that elements may not
resolve: then K is off, and that of a second solution nearly as much."""

from __future__ import annotations

import numpy as np

from pbem.arrays import Real
from pbem.contact.closure import find_closure
from pbem.contact.laws import OPEN, PairLaws
from pbem.contact.loads import evaluate_pressure
from pbem.mesh.mesh import Mesh, sort_pairs
from pbem.model.model import Model
from pbem.solve.problem.step import Step

# With x = stiffness times length of the tip's element over E' the error of K is y/(1 + y) of it, y = a x^b, by order:
# measured with joints of x from 0.1 to 11, against 160 elements of order 3.
FACTOR, POWER = (0.9, 0.17, 0.04, 8e-3), (0.75, 1.5, 2.0, 2.0)


class StiffTips:
    """The tips with elastic joints, kept on one rank; those without cost nothing."""

    def __init__(self, model: Model, mesh: Mesh, laws: PairLaws) -> None:
        self._model, self._mesh = model, mesh
        per_element, elastic = mesh.order + 1, (laws.compliance_n > 0) | (laws.compliance_s > 0)
        rows, pairs = [], []
        own = sort_pairs(mesh) if elastic.any() else {}
        for crack, (name, is_tip) in enumerate(model.crack_tips.items()):
            for end in (0, 1):
                if name in own and is_tip[end] and elastic[own[name][-end]]:
                    rows.append((crack, end))
                    pairs.append(own[name][-per_element:] if end else own[name][:per_element])
        self._tips = np.array(rows, dtype=np.int64).reshape(-1, 2).T
        self._pairs = np.array(pairs, dtype=np.int64).reshape(-1, per_element)
        self._laws = laws if rows else None
        moduli = np.array([region.material.plane_modulus for region in model.regions])
        slave = mesh.pairs.slave[self._pairs[:, 0]]
        self._softness = mesh.pairs.weight[self._pairs].sum(axis=1) / moduli[mesh.node_region[slave]]

    def bound(self, step: Step, factors: Real) -> Real:
        """The least errors (2, cracks, 2) of KI and KII at the start and end of each crack (theory, 139); zero without
        joints, and where faces are open, which carry nothing.

        factors (2, cracks, 2): KI and KII.
        """
        least = np.zeros(factors.shape)
        if self._laws is None:
            return least
        laws, contact, at = self._laws, step.contact, self._pairs
        pressure = evaluate_pressure(self._model, self._mesh, step.stage, step.factor)
        given = np.stack([find_closure(laws, contact.traction_n, pressure)[1], laws.compliance_s])[:, at]
        closed = contact.mode[at] != OPEN
        # The stiffest on the element.
        stiffness = np.where(closed & (given > 0), 1 / np.where(given > 0, given, 1.0), 0.0).max(axis=2)
        y = FACTOR[self._mesh.order] * (stiffness * self._softness) ** POWER[self._mesh.order]
        crack, end = self._tips
        least[:, crack, end] = y / (1 + y) * np.abs(factors[:, crack, end])
        return least
