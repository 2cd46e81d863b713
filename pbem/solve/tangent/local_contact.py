"""What settles its contact by itself in a network of cracks, each made when it is first asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pbem.contact.loads import Load
from pbem.solve.preconditioner.schwarz import SchwarzPreconditioner
from pbem.solve.preconditioner.subdomains import Subdomain
from pbem.solve.problem.problem import Problem
from pbem.solve.tangent.clusters import Clusters
from pbem.solve.tangent.shared_product import SharedProduct
from pbem.solve.tangent.sweeps import Sweeps


class LocalContact:
    """The groups of this rank that settle before solutions, and clusters around pairs that need it, of one problem."""

    def __init__(
        self, problem: Problem, preconditioner: SchwarzPreconditioner, product: SharedProduct,
        groups: Sequence[Subdomain],
    ) -> None:
        self._problem, self._preconditioner, self._product, self._groups = problem, preconditioner, product, groups
        self.forget()

    def forget(self) -> None:
        """Free the storage."""
        self._sweeps: Sweeps | None = None
        self._clusters: Clusters | None = None

    def divide(self, load: Load) -> Sweeps:
        """The groups; under any load of the problem."""
        if self._sweeps is None:
            self._sweeps = Sweeps(self._problem, self._preconditioner, self._product, self._groups, load)
        return self._sweeps

    def find_clusters(self, load: Load, pause: Callable[[], object]) -> Clusters:
        """Clusters; under any load of the problem. pause: see Clusters."""
        if self._clusters is None:
            self._clusters = Clusters(self._problem, self._preconditioner, load, pause)
        return self._clusters
