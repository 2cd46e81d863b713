"""Thousands of curves: faults among them, their support, what is told and drawn of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbem.contact.anchor import anchor_motions
from pbem.contact.free_motions import CLOSED_AT_LEAST, close_nearest_pairs, find_ties
from pbem.contact.laws import OPEN, SLIP, STICK, ModeState, collect_laws
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh, list_faces, sort_pairs
from pbem.model.model import Model
from pbem.model.rigid_body_modes import PairTie, find_rigid_body_modes
from pbem.results.describe import describe_results
from pbem.results.model_plot import draw_model
from pbem.results.model_text import describe_model
from pbem.results.plots import draw_results
from pbem.results.reader import Results, open_results
from pbem.results.writer import ResultWriter
from pbem.solve.problem.step import ContactState, Iteration, Step
from tests.unit.case_sample import build, change, find_faults, find_only_fault
from tests.unit.test_generate import CRACKS, INCLUSIONS

MANY_CRACKS = change(CRACKS, ("count = 40", "count = 400"))
MANY_INCLUSIONS = change(INCLUSIONS, ("count = 20", "count = 120"))
LONG = """[curves]
long = { points = [[-9, 0.1], [9, 0]], elements = 40 }
[regions.rock]
cracks = ["long"]
"""


def test_crossings_name_both_curves_and_the_place() -> None:
    faults = [str(fault) for fault in find_faults(change(CRACKS, ("[regions.rock]\n", LONG)))]
    crossing = [fault for fault in faults if "crossing or touching crack 'long' at (" in fault]
    assert len(crossing) >= 3
    assert all("generate[1] (line " in fault and "crack 'crack_" in fault for fault in crossing)


def test_a_generated_inclusion_in_a_hole_is_found() -> None:
    hole = "[curves]\nhole = { center = [0, 0], radius = 3, elements = 16 }\n[regions.rock]\nboundary = [\"hole\"]\n"
    text = change(INCLUSIONS, ("[regions.rock]\n", hole), ("count = 20", "count = 1"))
    fault = find_only_fault(change(text, ("fraction = 0.3", "box = [-1.5, -1.5, 1.5, 1.5]")))
    assert "region" in fault and "grain_1" in fault and "hole" in fault


def test_a_plate_holds_its_cracks_and_inclusions() -> None:
    plate = """[curves]
sides = { points = [[-20, -20], [20, -20], [20, 20], [-20, 20]], elements = 30 }
last = { points = [[-20, 20], [-20, -20]], elements = 10 }
[boundary.last]
ux = 0.0
uy = 0.0
[regions.rock]
boundary = ["sides", "last"]
"""
    second = INCLUSIONS.split("[[generate]]")[1].replace("fraction = 0.3", "box = [-20, -20, 20, 20]")
    both = change(
        f"{CRACKS}[[generate]]{second}", ("[regions.rock]\n", plate), ("infinite = true\n", ""),
        ("[remote]\nsyy = -1.0", ""), ("density = 0.1", "box = [-20, -20, 20, 20]"),
    )  # fmt: skip
    model = build(both)
    assert len(model.crack_tips) == 40 and len(model.regions) == 21
    # Cracks near the sides of a box that is too large lie outside of the plate, or cross its sides.
    outside = find_faults(change(both, ("box = [-20, -20, 20, 20]", "box = [-40, -40, 40, 40]")))
    assert any("outside region 'rock'" in str(fault) for fault in outside)


def make_step(mesh: Mesh, number: int, steps: int) -> Step:
    """A step with invented numbers."""
    faces, pairs = len(list_faces(mesh).position), np.arange(mesh.pairs.count)
    wave = 1e-3 * np.sin(np.arange(faces) + number)
    values = np.cos(pairs + number) - 0.5
    contact = ContactState((pairs % 3).astype(np.int8), np.abs(values), values, -np.abs(values), values,
                           {"slip_path": np.abs(values), "broken": np.zeros(len(pairs), dtype=bool)})
    iteration = Iteration(1, 1e-12, 0, 0, 0, 0, 0.1)
    return Step(number, 0, number / steps, (iteration,), 1e-12, wave + 0j, wave + 0j, contact)


def write(path: Path, model: Model, mesh: Mesh, steps: int = 2) -> Results:
    with ResultWriter(path, model, mesh, 1, "") as writer:
        for number in range(1, steps + 1):
            writer.append(make_step(mesh, number, steps))
    return open_results(path)


@pytest.fixture(scope="module", params=[MANY_CRACKS, MANY_INCLUSIONS], ids=["cracks", "inclusions"])
def computed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Model, Mesh, Results]:
    model = build(request.param)
    mesh = generate_mesh(model)
    return model, mesh, write(tmp_path_factory.mktemp("many") / "many.h5", model, mesh)


def test_a_group_is_told_in_one_line(computed: tuple[Model, Mesh, Results]) -> None:
    model, mesh, results = computed
    (group,) = model.groups
    told = describe_model(model, mesh)
    assert len(told.splitlines()) < 30
    line = next(line for line in told.splitlines() if line.startswith(f"  {group.name}  "))
    assert f"{group.name}_1 to {group.name}_{group.count}" in line and "friction 0.6" in line
    told = describe_results(results)
    assert len(told.splitlines()) < 50
    line = next(line for line in told.splitlines() if f"{group.name} ({group.count} {group.kind})" in line)
    pairs, stick, slip, is_open = map(int, line.split(")")[1].split()[:4])
    assert pairs == mesh.pairs.count == stick + slip + is_open
    assert float(line.split()[-1]) == pytest.approx(np.abs(make_step(mesh, 2, 2).contact.slip).max(), rel=1e-4)


def test_interfaces_are_views_of_all_pairs(computed: tuple[Model, Mesh, Results]) -> None:
    import h5py

    model, mesh, results = computed
    pairs = sort_pairs(mesh)
    steps = [make_step(mesh, number, 2) for number in (1, 2)]
    with h5py.File(results.path, "r", locking=False) as file:
        for name in list(pairs)[::29]:
            group = file["contact"][name]
            assert set(group) == {"position", "normal", "arc_length", "mode", "opening", "slip", "traction_n",
                                  "traction_s"}  # fmt: skip
            for quantity in ("mode", "opening", "slip", "traction_n", "traction_s"):
                expected = np.array([getattr(step.contact, quantity)[pairs[name]] for step in steps])
                np.testing.assert_array_equal(group[quantity][...], expected)
                np.testing.assert_array_equal(getattr(results.contact[name], quantity), expected)
            np.testing.assert_array_equal(group["position"][...] @ [1, 1j], mesh.pairs.position[pairs[name]])
            assert (group.attrs["friction"], group.attrs["law"]) == (0.6, "coulomb")
        assert list(file["contact"].attrs["names"]) == list(pairs)
        for name in list(model.crack_tips)[::29]:
            np.testing.assert_array_equal(file["tips"][name]["KI"][...], results.tips[name].KI)
            assert file["tips"][name]["KII"].shape == (2, 2)
    np.testing.assert_array_equal(results.pairs.at("slip", -1), steps[-1].contact.slip)


def test_pictures_of_many_curves_have_few_parts(computed: tuple[Model, Mesh, Results]) -> None:
    model, mesh, results = computed
    for figure in (draw_model(model, mesh), draw_results(results)):
        axes = figure.axes[0]
        assert len(axes.collections) + len(axes.patches) + len(axes.lines) + len(axes.texts) < 20
        legends = [legend for each in figure.axes if (legend := each.get_legend())]
        assert len(legends) == 1 and len(legends[0].get_texts()) <= 8
    # Lines between neighbouring pairs, none from one interface to the next.
    marks = [each for each in axes.collections if each.get_linewidths()[:1] == [1.6]]
    assert sum(len(each.get_segments()) for each in marks) == mesh.pairs.count - len(model.interfaces)


def test_ties_and_nearest_pairs_of_many_interfaces() -> None:
    model = build(change(MANY_INCLUSIONS, ("count = 120", "count = 42")))
    mesh = generate_mesh(model)
    laws = collect_laws(model, mesh)
    random = np.random.default_rng(1)
    # A third of the interfaces are open altogether, a third slips, the rest is mixed.
    kind = np.arange(42)[mesh.pairs.interface] % 3
    mixed = random.integers(0, 3, mesh.pairs.count)
    modes = ModeState(np.where(kind == 0, OPEN, np.where(kind == 1, SLIP, mixed)).astype(np.int8), np.ones(len(kind)))
    opening = random.random(mesh.pairs.count)
    ties = find_ties(model, mesh, modes)
    closed = close_nearest_pairs(mesh, laws, modes, opening).mode
    for number, name in enumerate(mesh.interface_names):
        own = np.flatnonzero(mesh.pairs.interface == number)
        mode = modes.mode[own]
        tie = ties[name]
        if (mode == STICK).sum() > 1 or (mode == OPEN).all():
            assert tie == ("both" if (mode == STICK).any() else "none")
        else:
            assert isinstance(tie, PairTie)
            np.testing.assert_array_equal(tie.position, mesh.pairs.position[own[mode != OPEN]])
            np.testing.assert_array_equal(tie.sticks, mode[mode != OPEN] == STICK)
        opened, missing = own[mode == OPEN], max(0, CLOSED_AT_LEAST - int((mode != OPEN).sum()))
        nearest = opened[np.argsort(opening[opened])[:missing]]
        assert set(own[closed[own] != mode]) == set(nearest)


def test_each_free_body_has_an_anchor_of_its_own() -> None:
    # Without friction every inclusion can turn in its place, whatever the others do.
    model = build(change(MANY_INCLUSIONS, ("count = 120", "count = 50"), ("friction = 0.6\n", "")))
    mesh = generate_mesh(model)
    motions = find_rigid_body_modes(model)
    anchors = anchor_motions(mesh, motions)
    assert sorted(anchor.region for anchor in anchors) == list(range(1, 51))
    for anchor, motion in zip(anchors, motions, strict=True):
        np.testing.assert_array_equal(anchor.nodes, np.flatnonzero(mesh.node_region == anchor.region))
        shift, spin = motion.velocities[mesh.region_names[anchor.region]]
        velocity = shift + 1j * spin * mesh.position[anchor.nodes]
        assert abs((np.conj(anchor.functional) * velocity).real.sum()) > 1e-3 * np.abs(velocity).max()


def test_notes_of_many_inner_loops_are_one() -> None:
    text = MANY_INCLUSIONS + '[analysis]\nscheme = "HST"\n'
    mesh = generate_mesh(build(text))
    assert len(mesh.notes) == 1 and "on its 120 inner loops" in mesh.notes[0]
    few = generate_mesh(build(change(text, ("count = 120", "count = 3"))))
    assert len(few.notes) == 3 and "inner loop grain_1:" in few.notes[0]
