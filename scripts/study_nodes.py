"""Where to put the collocation nodes of crack elements: errors on a Griffith crack under tension, in an infinite plane.

For several node positions and meshes of equal elements with tip shapes, the relative error of the stress-intensity
factor and the largest error of the opening, relative to its maximum. pbem.mesh.shape_functions.CRACK_NODES holds the
choice.

usage: .venv/bin/python scripts/study_nodes.py
"""

from __future__ import annotations

import numpy as np

from pbem.case.build import parse_model
from pbem.mesh import shape_functions
from pbem.mesh.generate import generate_mesh
from pbem.parallel import world
from pbem.solve.problem.step import SilentReporter
from pbem.solve.steps.march import march
from pbem.solve.system.assembly import assemble_problem

GAUSS = {order: tuple(shape_functions.place_nodes(order)) for order in (1, 2, 3)}
TRIALS = {
    1: [GAUSS[1], *[(-a, a) for a in (0.62, 0.65, 0.675, 0.7, 0.75)]],
    2: [GAUSS[2], *[(-a, 0.0, a) for a in (0.80, 0.82, 0.84, 0.849, 0.86, 0.88)]],
    3: [GAUSS[3], *[(-a, -b, b, a) for a in (0.90, 0.92, 0.94) for b in (0.36, 0.398, 0.42)]],
}
ELEMENTS = (4, 8, 16)

CASE = """
materials.rock = {{ young = 1.0, poisson = 0.2 }}
curves.crack = {{ points = [[-1, 0], [1, 0]], elements = {elements} }}
regions.plane = {{ material = "rock", infinite = true, cracks = ["crack"] }}
remote.syy = 1.0
analysis = {{ order = {order}, steps = 1 }}
"""


def measure(order: int, nodes: tuple[float, ...], elements: int) -> tuple[float, float]:
    """Relative errors of KI and of the opening with the given nodes (order + 1,) in [-1, 1]."""
    shape_functions.CRACK_NODES[order] = nodes
    _, model = parse_model(CASE.format(elements=elements, order=order))
    mesh = generate_mesh(model)
    (step,) = march(assemble_problem(model, mesh, world), SilentReporter())
    modulus = model.regions[0].material.plane_modulus
    exact = 4 / modulus * np.sqrt(1 - mesh.pairs.position.real**2)
    coefficient = shape_functions.tip_shapes(nodes)[0][0] @ step.contact.opening[: order + 1]
    factor = modulus / 8 * np.sqrt(2 * np.pi / abs(mesh.end[0] - mesh.start[0])) * coefficient
    return factor / np.sqrt(np.pi) - 1, float(np.abs(step.contact.opening - exact).max() / exact.max())


def main() -> None:
    """Print the table."""
    chosen = dict(shape_functions.CRACK_NODES)
    heads = "".join(f"{f'{count} elements: K, opening':>28s}" for count in ELEMENTS)
    print(f"{'order':5s}  {'nodes (positive ones)':24s}{heads}")
    for order, trials in TRIALS.items():
        for nodes in trials:
            errors = [measure(order, nodes, elements) for elements in ELEMENTS]
            mark = "Gauss" if nodes == GAUSS[order] else "chosen" if nodes == chosen[order] else ""
            text = ", ".join(f"{node:.4g}" for node in nodes if node > 0)
            print(f"{order:5d}  {text:16s}{mark:8s}" + "".join(f"{k:16.1e}{opening:12.1e}" for k, opening in errors))


if __name__ == "__main__":
    main()
