"""The compiled passes: against their formulas in NumPy, and against the rows of the elements, which know no series."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pbem.bem.expansion import FieldPoints, carry, lift, lower, place_densities
from pbem.bem.farfield import count_terms
from pbem.bem.hierarchical import assemble_hierarchical, choose_terms, name_media, prepare_sources, sort_elements
from pbem.bem.near import LeafRows, choose_weak, pack_rows
from pbem.bem.operator import assemble_rows
from pbem.bem.seen_entries import take_elements
from pbem.bem.sharing import keep_whole
from pbem.bem.tree import RATIO, build_forest, find_interactions
from pbem.case.build import parse_model
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.mesh.numbering import list_nodes
from pbem.model.material import Material
from tests.unit.far_sample import TEXTS, list_vectors, make_sample, shrink_leaves
from tests.unit.series_twin import Medium, apply_l2l, apply_m2l, apply_m2m, form_l2p, form_p2m, shift_matrices

orders = pytest.mark.parametrize("order", [1, 2, 3])
each_model = pytest.mark.parametrize("name", ["inclusions", "cracks", "infinite"])


@pytest.fixture(autouse=True)
def small_leaves(monkeypatch: pytest.MonkeyPatch) -> None:
    shrink_leaves(monkeypatch)


def make_mesh(name: str, order: int) -> tuple[Mesh, list[Material], float]:
    """One of the models with elements of an order, its materials and its size."""
    text = TEXTS[name]().replace("[analysis]", f"[analysis]\norder = {order}")
    model = parse_model(text)[1]
    return generate_mesh(model), [region.material for region in model.regions], model.size


def make_values(mesh: Mesh) -> np.ndarray:
    return np.random.default_rng(1).standard_normal(4 * mesh.nodes)


@orders
@each_model
def test_coefficients_are_those_of_the_formulas(name: str, order: int) -> None:
    mesh, materials, _ = make_mesh(name, order)
    parts = sort_elements(mesh, materials, 27)
    v, forest, leaves = make_values(mesh), parts.forest, parts.forest.leaves
    everything = np.ones(4 * mesh.nodes, dtype=bool)
    sources = prepare_sources(parts, everything, keep_whole(mesh.elements))
    found = sources.collect(take_elements(v, sources.elements, sources.width))
    for leaf in leaves:
        elements, region = forest.items(leaf), int(forest.region[leaf])
        chosen = parts.sources[region].select(elements - parts.first_element[region])
        matrix = form_p2m(chosen, forest.center[leaf], forest.radius[leaf], 27)
        at = (2 * list_nodes(mesh, elements)[:, None] + np.arange(2)).ravel()
        columns = np.concatenate([at, 2 * mesh.nodes + at])[: matrix.shape[1]]
        exact = (matrix @ v[columns]).view(complex).reshape(2, 28)
        # Of arcs a few integration points less bring less than the expansion does.
        curved = parts.sources[region].geometry.sweep.any()
        np.testing.assert_allclose(found[leaf], exact, rtol=0, atol=(1e-8 if curved else 1e-12) * np.abs(exact).max())


def make_trees(random: np.random.Generator) -> tuple:
    """Two trees over points, and pairs of their clusters that are well apart."""
    own, other = (random.uniform(-1, 1, (90, 2)) @ (1, 1j) + place for place in (0, 0.7 + 0.4j))
    most, region = np.array([4]), np.zeros(90, dtype=np.int64)
    targets, sources = (build_forest(at - 1e-3, at + 1e-3, np.zeros(90), region, most) for at in (own, other))
    return targets, sources, find_interactions(targets, sources, 0.55)


@pytest.mark.parametrize("terms", [1, 2, 9, 30, 60])
def test_passes_between_clusters_are_those_of_the_formulas(terms: int) -> None:
    random = np.random.default_rng(terms)
    targets, sources, met = make_trees(random)
    shape = (2, terms + 1)
    moments = random.normal(size=(sources.clusters, *shape)) + 1j * random.normal(size=(sources.clusters, *shape))
    lifted, expected = moments.copy(), moments.copy()
    lift(sources, lifted)
    for child in range(sources.clusters - 1, 0, -1):
        parent = sources.parent[child]
        step = np.array([sources.center[child] - sources.center[parent]])
        small, large = sources.radius[[child]], sources.radius[[parent]]
        shift = shift_matrices(step, small, large, terms)
        expected[parent] += apply_m2m(expected[[child]], shift, step, small, large)[0]
    np.testing.assert_allclose(lifted, expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    length = np.full(targets.clusters, 7.0)
    fields = np.zeros((targets.clusters, *shape), dtype=complex)
    carry(targets, length, met.far_target, sources, met.far_source, moments, fields, (terms, terms))
    expected = np.zeros_like(fields)
    np.add.at(expected, met.far_target, apply_m2l(
        moments[met.far_source], targets.center[met.far_target] - sources.center[met.far_source],
        sources.radius[met.far_source], targets.radius[met.far_target], length[met.far_target],
    ))  # fmt: skip
    np.testing.assert_allclose(fields, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    for seen, kept in ((terms // 3 + 1, terms), (terms, terms // 2 + 1), (max(1, terms - 1), max(1, terms - 2))):
        some = np.zeros_like(fields)
        carry(targets, length, met.far_target, sources, met.far_source, moments, some, (seen, kept))
        expected = np.zeros_like(fields)
        # One more term of fields is there before the series of psi is moved than after: it is left out.
        left = moments[met.far_source] * (np.arange(terms + 1) <= seen)
        np.add.at(expected, met.far_target, apply_m2l(
            left, targets.center[met.far_target] - sources.center[met.far_source],
            sources.radius[met.far_source], targets.radius[met.far_target], length[met.far_target], kept,
        ))  # fmt: skip
        np.testing.assert_allclose(some, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    wanted = np.arange(targets.clusters) % 5 > 0
    moved = fields.copy()
    lower(targets, wanted, moved)
    expected = fields.copy()
    for child in range(1, targets.clusters):
        parent = targets.parent[child]
        step = np.array([targets.center[child] - targets.center[parent]])
        matrix = shift_matrices(step, targets.radius[[child]], targets.radius[[parent]], terms)
        if wanted[child]:
            expected[child] += apply_l2l(expected[[parent]], matrix, step, targets.radius[[parent]])[0]
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("terms", [12, 20, 31])
def test_pairs_far_apart_lose_no_more_by_fewer_terms_than_those_just_apart(terms: int) -> None:
    """Against three times as many; sources as large as there can be in their circle, values on the target's rim."""
    random = np.random.default_rng(terms)
    targets, sources, met = make_trees(random)
    used = count_terms(targets, met.far_target, sources, met.far_source, terms)
    assert used.max() == terms and (used < terms).mean() > 0.5 and (used >= 1).all()
    phase = np.exp(2j * np.pi * random.random((sources.clusters, 2, 3 * terms + 1)))
    rim = np.exp(2j * np.pi * np.arange(40) / 40)
    lost = np.zeros(used.shape[1])
    for pair, (target, source, count) in enumerate(zip(met.far_target, met.far_source, used.T, strict=True)):
        values = []
        for each in (tuple(count.tolist()), (3 * terms, 3 * terms)):
            fields = np.zeros((targets.clusters, 2, 3 * terms + 1), dtype=complex)
            one = np.array([target]), sources, np.array([source])
            carry(targets, np.ones(targets.clusters), *one, phase, fields, each)
            own = fields[target, 0]
            slope = (own[1:] * np.arange(1, 3 * terms + 1)) @ rim ** np.arange(3 * terms)[:, None]
            size = np.abs(targets.center[target] - sources.center[source]) / targets.radius[target]
            values.append((own @ rim ** np.arange(3 * terms + 1)[:, None], slope / terms * size))
        lost[pair] = max(np.abs(one - other).max() for one, other in zip(*values, strict=True))
    assert lost.max() <= 1.01 * lost[(used == terms).any(axis=0)].max() < 2 * RATIO**terms


@pytest.mark.parametrize("count", [1, 3, 4, 9])
def test_values_at_points_are_those_of_the_formulas(count: int) -> None:
    random = np.random.default_rng(count)
    targets, _, _ = make_trees(random)
    fields = random.normal(size=(targets.clusters, 2, 13)) + 1j * random.normal(size=(targets.clusters, 2, 13))
    cluster = np.array([3, 0, 5])
    first = np.array([0, count, count, 3 * count])
    owner = np.repeat(cluster, np.diff(first))
    point = targets.center[owner] + 0.6 * targets.radius[owner] * np.exp(1j * np.arange(3 * count))
    normal = np.where(np.arange(3 * count) % 2, np.exp(0.4j * np.arange(3 * count)), 0)
    kappa, modulus = np.array([1.6, 2.0, 2.4]), np.array([3e4, 1.0, 1e-3])
    found = FieldPoints(cluster, first, point, normal, kappa, modulus).evaluate(fields, targets)
    for k in range(3 * count):
        j = int(np.searchsorted(first, k, side="right")) - 1
        n = None if normal[k] == 0 else normal[[k]]
        matrix = form_l2p(point[[k]], n, Medium(kappa[j], modulus[j]), targets.center[cluster[j]],
                          targets.radius[cluster[j]], 12)  # fmt: skip
        exact = matrix @ fields[cluster[j]].view(float).ravel()
        limit = 1e-11 * np.abs(matrix).max()
        np.testing.assert_allclose([found[k].real, found[k].imag], exact, rtol=0, atol=limit)


@pytest.mark.parametrize("shift", [0.0, 1e7 - 2e7j])
@orders
@each_model
def test_products_are_those_of_the_rows_wherever_the_model_lies(name: str, order: int, shift: complex) -> None:
    mesh, materials, size = make_mesh(name, order)
    mesh = replace(mesh, **{key: getattr(mesh, key) + shift for key in ("start", "end", "center", "position")})
    everything = np.ones(4 * mesh.nodes, dtype=bool)
    parts = sort_elements(mesh, materials, choose_terms(1e-8))
    sources = prepare_sources(parts, everything, keep_whole(mesh.elements))
    operator = assemble_hierarchical(parts, sources, np.arange(mesh.nodes), everything, size)
    assert len(operator.targets.target) > mesh.elements
    v = make_values(mesh)
    v[2 * mesh.nodes :] *= materials[0].shear_modulus / size
    exact = assemble_rows(mesh, materials, 0, mesh.nodes, everything, size).apply(v)
    # So far away places are known to 4e-9.
    assert np.linalg.norm(operator.apply(v) - exact) <= (1e-8 if shift == 0 else 1e-6) * np.linalg.norm(exact)


def test_arguments_of_wrong_lengths_are_refused() -> None:
    targets, sources, met = make_trees(np.random.default_rng(0))
    moments = np.zeros((sources.clusters, 2, 8), dtype=complex)
    with pytest.raises(ValueError, match="bytes, expected"):
        carry(targets, np.ones(3), met.far_target, sources, met.far_source, moments, np.zeros_like(moments), (7, 7))
    with pytest.raises(ValueError, match="terms; expected 1 to"):
        lift(sources, np.zeros((sources.clusters, 2, 200), dtype=complex))
    length, fields = np.ones(targets.clusters), np.zeros((targets.clusters, 2, 8), dtype=complex)
    for used, fault in (((8, 7), "8 and 7 terms of 7"), ((7, 0), "0 terms; expected 1 to")):
        with pytest.raises(ValueError, match=fault):
            carry(targets, length, met.far_target, sources, met.far_source, moments, fields, used)
    mesh, materials, _ = make_mesh("cracks", 2)
    densities = place_densities(mesh, np.arange(3), 5, np.ones(3))
    kappa, modulus = name_media(sort_elements(mesh, materials, 5), np.zeros(1, dtype=np.int64))
    with pytest.raises(ValueError, match="bytes, expected"):
        first, center = np.array([0, 2, 3]), np.zeros(1, dtype=complex)
        densities.sum_up(make_values(mesh), first, center, np.ones(1), kappa, modulus, 5)


@pytest.mark.parametrize("at", [-1, 1])
def test_numbers_of_what_is_not_there_are_refused(at: int) -> None:
    """One before the first and one behind the last of what there is."""
    targets, sources, met = make_trees(np.random.default_rng(0))
    terms, ends = 7, np.array([0, 3, 5])
    moments = np.zeros((sources.clusters, 2, terms + 1), dtype=complex)
    fields = np.zeros((targets.clusters, 2, terms + 1), dtype=complex)

    def move(numbers: np.ndarray, count: int) -> np.ndarray:
        moved = numbers.copy()
        moved[-1] = -1 if at < 0 else count
        return moved

    length = np.ones(targets.clusters)
    for target, source in ((move(met.far_target, targets.clusters), met.far_source),
                           (met.far_target, move(met.far_source, sources.clusters))):
        with pytest.raises(IndexError, match="argument"):
            carry(targets, length, target, sources, source, moments, fields, (terms, terms))
    wrong = replace(sources, parent=np.where(sources.parent < 0, -2 if at < 0 else sources.clusters, sources.parent))
    with pytest.raises(IndexError, match="expected -1 to"):
        lift(wrong, moments)
    with pytest.raises(IndexError, match="expected -1 to"):
        lower(wrong, np.ones(sources.clusters, dtype=bool), moments)
    points = FieldPoints(np.array([1, 2]), ends, np.zeros(5, complex), np.zeros(5, complex), np.ones(2), np.ones(2))
    for changed in ({"cluster": move(points.cluster, targets.clusters)}, {"first": move(ends, 6)}):
        with pytest.raises(IndexError, match="argument"):
            replace(points, **changed).evaluate(fields, targets)
    with pytest.raises(ValueError, match="falls"):
        replace(points, first=np.array([4, 3, 5])).evaluate(fields, targets)


@pytest.mark.parametrize("key", ["begin", "points", "shapes", "number", "first"])
@pytest.mark.parametrize("below", [True, False])
def test_elements_that_are_not_there_are_refused(key: str, below: bool) -> None:
    mesh, _, _ = make_mesh("cracks", 2)
    densities, first, ones = place_densities(mesh, np.arange(3), 5, np.ones(3)), np.array([0, 3]), np.ones(1)
    arguments = (np.zeros(1, dtype=complex), ones, ones, ones, 5)
    densities.sum_up(make_values(mesh), first, *arguments)
    changed = (first if key == "first" else getattr(densities, key)).copy()
    beyond = {"number": mesh.elements, "first": 4}.get(key, 4000)
    changed[-1] = -4 if below else beyond
    if key == "first":
        first = changed
    else:
        densities = replace(densities, **{key: changed})
    with pytest.raises(IndexError, match=r"argument|integration points"):
        densities.sum_up(make_values(mesh), first, *arguments)


def test_weak_entries_lose_less_than_a_part_in_ten_billion_of_the_largest() -> None:
    random = np.random.default_rng(5)
    rows, elements, width = 10, 30, 6
    fall = 10.0 ** -random.uniform(0, 4, elements)
    near = random.normal(size=(rows, 2 * elements * width)) * np.repeat(np.tile(fall, 2), width)
    # Tractions act by numbers of another unit, and rows of small elements are large.
    near[:, elements * width :] *= 1e-12
    near *= 10.0 ** random.uniform(-3, 3, rows)[:, None]
    columns = np.concatenate([np.arange(elements * width), 5000 + np.arange(elements * width)])
    packed = pack_rows(np.arange(rows), columns, near, width, 5000, 0.05)
    assert len(packed.weak) == 2 and packed.nbytes < 0.8 * near.nbytes
    assert sum(each.number.size for each in packed.weak) + packed.near.size == near.size
    v = np.zeros(5000 + elements * width)
    for k, column in enumerate(columns):
        v[column] = 1.0
        largest = np.abs(near[:, columns >= 5000 if column >= 5000 else columns < 5000]).max(axis=1)
        error = np.abs(packed.apply(v) - near[:, k])
        assert (error <= 0.05 * largest * 2.0**-31).all()
        v[column] = 0.0
    assert (packed.apply(np.ones(len(v))) - near.sum(axis=1) != 0).any(), "they are weak"


def test_small_models_and_weights_of_nothing_keep_all_entries() -> None:
    assert choose_weak(1e-8, 19_999) == 0.0 < choose_weak(1e-10, 20_000) < choose_weak(1e-8, 10**6) < 0.05
    near = np.random.default_rng(6).normal(size=(4, 12))
    near[:, :6] = 0.0
    for weak in (0.0, 0.01):
        packed = pack_rows(np.arange(4), np.arange(12), near, 6, 12, weak)
        v = np.random.default_rng(7).normal(size=12)
        assert isinstance(packed, LeafRows)
        np.testing.assert_allclose(packed.apply(v), near @ v, rtol=1e-14)


@pytest.mark.parametrize("name", ["cracks", "inclusions", "blocks HST"])
def test_products_with_weak_entries_are_those_of_the_rows(name: str) -> None:
    sample = make_sample(name)
    parts, sources = sample.sort(1e-10)
    nodes = np.arange(sample.mesh.nodes)
    operator = assemble_hierarchical(parts, sources, nodes, sample.needed, sample.model.size, (), 0.03)
    assert sum(len(leaf.weak) for leaf in operator.near.leaves) > 10
    for kind, v in list_vectors(sample).items():
        exact = sample.dense.apply(v)
        # Those of a rigid motion cancel.
        scale = np.linalg.norm(exact - sample.dense.free @ v)
        assert np.linalg.norm(operator.apply(v) - exact) <= 1e-9 * scale, kind
