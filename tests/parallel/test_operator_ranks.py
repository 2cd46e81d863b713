"""The hierarchical operator gives the same results on any number of ranks, also where some have nothing to do."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

from pbem.results.reader import open_results
from tests.parallel.launch import launch_snippet
from tests.parallel.test_ranks import Array, find_differences, read_results
from tests.unit.far_sample import TEXTS

INTERIOR = """
[output]
points = [[{place}, 0.51], [{place}, 0.25], [40, 40]]
"""
# Of each kind of model one; leaves and groups of so few elements that they have many.
NAMES = ("blocks HST", "panel", "inclusions", "cracks", "infinite", "floating", "one crack")
ONE_CRACK = """
[materials.rock]
young = 2.0e4
poisson = 0.25
[curves]
crack = { points = [[-1, 0], [1, 0.2]], elements = 2 }
[regions.rock]
material = "rock"
cracks = ["crack"]
infinite = true
[remote]
syy = 1.0
[analysis]
order = 0
steps = 1
"""
DERIVED = ("fields/hoop_stress", "interior/stress")
# The others are without second solutions, to take less time.
ESTIMATED = "cracks"
RUN_ALL = """
import sys
from pathlib import Path
import pbem
import pbem.driver
from pbem.bem import hierarchical
from pbem.parallel import world
from pbem.results.estimator import Estimator
from pbem.solve.preconditioner import subdomains as groups
hierarchical.LEAF_ELEMENTS = hierarchical.SMALL_REGION = 4
groups.ONE_GROUP, groups.GROUP_ELEMENTS = 0, 12
estimated = pbem.driver.make_estimator
for case in sys.argv[3:]:
    pbem.driver.make_estimator = estimated if Path(case).stem == sys.argv[2] else (
        lambda model, mesh, *_: Estimator(model, mesh, None, None, "", world.rank == 0))
    pbem.run(case, Path(sys.argv[1]) / (Path(case).stem + ".h5"), operator="hierarchical", petsc={"ksp_rtol": "1e-13"})
"""


def launch_all(folder: Path, ranks: int, names: Sequence[str] = NAMES) -> Path:
    """Run models on so many ranks; returns the folder."""
    cases = []
    for name in names:
        text = ONE_CRACK if name == "one crack" else TEXTS[name]()
        place = {"inclusions": 3.3, "cracks": 3.3, "infinite": 4.4, "one crack": 0.3}.get(name, 0.4)
        cases.append(folder / f"{name.replace(' ', '_')}.toml")
        cases[-1].write_text(text + INTERIOR.format(place=place), encoding="utf-8")
    run = launch_snippet(ranks, RUN_ALL, folder, ESTIMATED, *cases, timeout=600)
    assert run.returncode == 0, run.stderr
    return folder


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the results of one rank are."""
    return launch_all(tmp_path_factory.mktemp("ranks_1"), 1)


@pytest.mark.parametrize(("ranks", "names"), [(2, NAMES[::2]), (3, (*NAMES[1::2], "one crack"))])
def test_ranks_do_not_change_the_results(ranks: int, names: Sequence[str], alone: Path, tmp_path: Path) -> None:
    launch_all(tmp_path, ranks, names)
    paths = sorted(path.name for path in tmp_path.glob("*.h5"))
    assert len(paths) == len(names)
    if ESTIMATED in names:  # there are estimates to be compared
        errors = open_results(tmp_path / f"{ESTIMATED}.h5").errors
        assert all((errors.relative[kind] > 0).all() for kind in ("jumps", "tractions", "factors", "displacement"))
    faults = {
        name: differences
        for name in paths
        if (differences := compare(read_results(alone / name), read_results(tmp_path / name)))
    }
    assert not faults


def compare(one: dict[str, Array], other: dict[str, Array]) -> list[str]:
    """What differs by more than rounding; derivatives along small elements and beside them magnify that."""
    close = [name for name in one if name not in DERIVED]
    parts = ({name: results[name] for name in close} for results in (one, other))
    return find_differences(*parts) + find_differences(one, other, 1e-8)
