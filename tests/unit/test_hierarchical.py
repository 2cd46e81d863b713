"""The hierarchical operator and values at many points against the dense rows; leaves are so small that most is far."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from pbem.bem.farfield import count_terms, mark_ancestors
from pbem.bem.hierarchical import (
    Anchoring,
    HierarchicalOperator,
    anchor_rows,
    assemble_hierarchical,
    choose_terms,
    prepare_sources,
)
from pbem.bem.operator import add_anchor, assemble_displacement_rows, assemble_rows
from pbem.bem.pointwise import place_points
from pbem.bem.rows import evaluate_rows
from pbem.bem.seen_entries import take_elements
from pbem.bem.sharing import Ghosts, OneRank, Share, keep_whole
from pbem.bem.tree import RATIO, find_interactions
from pbem.contact.anchor import anchor_motions
from pbem.contact.loads import collect_outer_nodes, find_needed_columns
from pbem.mesh.numbering import list_nodes
from pbem.model.rigid_body_modes import find_rigid_body_modes
from tests.unit.far_sample import TEXTS, Sample, list_vectors, make_sample, read_sample, shrink_leaves

TOLERANCES = [1e-4, 1e-6, 1e-8, 1e-10]
each_sample = pytest.mark.parametrize("name", TEXTS)
tolerances = pytest.mark.parametrize("tolerance", TOLERANCES)
# Products of the dense rows have errors of rounding.
ROUNDING = 1e-13


@pytest.fixture(autouse=True)
def small_leaves(monkeypatch: pytest.MonkeyPatch) -> None:
    shrink_leaves(monkeypatch)


def assemble(sample: Sample, tolerance: float, nodes: np.ndarray | None = None) -> HierarchicalOperator:
    parts, sources = sample.sort(tolerance)
    chosen = np.arange(sample.mesh.nodes) if nodes is None else nodes
    return assemble_hierarchical(parts, sources, chosen, sample.needed, sample.model.size)


@tolerances
@each_sample
def test_products_are_those_of_the_dense_rows(name: str, tolerance: float) -> None:
    sample = make_sample(name)
    operator = assemble(sample, tolerance)
    targets, elements = operator.targets, sample.mesh.elements
    assert len(targets.target) > elements, "far parts"
    stored = sum(leaf.near.size for leaf in operator.near.leaves)
    assert stored < 0.7 * sum(block.matrix.size for block in sample.dense.blocks)
    vectors = list_vectors(sample)
    traction = np.repeat(sample.mesh.traction_equation, 2)
    for rows in (~traction, traction):
        if not rows.any():
            continue
        gain = max(np.linalg.norm(sample.dense.apply(vectors[f"random {kind}"])[rows]) /
                   np.linalg.norm(vectors[f"random {kind}"]) for kind in ("displacements", "tractions"))  # fmt: skip
        for kind, v in vectors.items():
            exact = sample.dense.apply(v)[rows]
            error = np.linalg.norm(operator.apply(v)[rows] - exact)
            # Of what rows of this kind make of vectors of this length ...
            assert error <= tolerance * gain * np.linalg.norm(v), kind
            # ... and of what they make of this one, but for the free terms, which are apart.
            product = np.linalg.norm(exact - (sample.dense.free @ v)[rows])
            if kind != "rigid motion" or rows is not traction:
                assert error <= (tolerance + ROUNDING) * product, kind


def test_more_terms_are_taken_for_smaller_errors() -> None:
    terms = [choose_terms(tolerance) for tolerance in TOLERANCES]
    assert terms == sorted(terms) and terms[0] >= 10 and terms[-1] <= 60
    sample = make_sample("cracks")
    v = list_vectors(sample)["random displacements"]
    exact = sample.dense.apply(v)
    errors = [np.linalg.norm(assemble(sample, tolerance).apply(v) - exact) for tolerance in TOLERANCES]
    for before, after in pairwise(errors):
        assert after < 0.1 * before, "the tolerance matters"


@pytest.mark.parametrize("name", ["blocks HST", "inclusions", "cracks", "infinite"])
@pytest.mark.parametrize("share", [0.02, 0.5])
def test_rows_of_any_nodes_in_any_order(name: str, share: float) -> None:
    sample = make_sample(name)
    random = np.random.default_rng(2)
    nodes = random.permutation(np.flatnonzero(random.random(sample.mesh.nodes) < share))
    rows = (2 * nodes[:, None] + np.arange(2)).ravel()
    whole, part = assemble(sample, 1e-8), assemble(sample, 1e-8, nodes)
    assert part.rows == 2 * len(nodes) > 0
    np.testing.assert_array_equal(part.nodes, nodes)
    for kind, v in list_vectors(sample).items():
        # A rigid motion's product is the rounding of its parts.
        expected, scale = whole.apply(v), measure_parts(whole, v)
        np.testing.assert_allclose(part.apply(v), expected[rows], rtol=0, atol=1e-13 * scale, err_msg=kind)


def measure_parts(operator: HierarchicalOperator, v: np.ndarray) -> float:
    """The largest sum of a row's near parts, each taken positive."""
    return max(float((np.abs(leaf.near) @ np.abs(v[leaf.columns])).max()) for leaf in operator.near.leaves)


def test_rows_of_no_nodes() -> None:
    sample = make_sample("cracks")
    operator = assemble(sample, 1e-6, np.zeros(0, dtype=np.int64))
    assert operator.rows == 0 and operator.apply(list_vectors(sample)["linear field"]).shape == (0,)


@each_sample
def test_columns_that_are_not_needed_are_left_out(name: str) -> None:
    sample = make_sample(name)
    mesh, model = sample.mesh, sample.model
    needed = find_needed_columns(model, mesh, collect_outer_nodes(model, mesh))
    assert not needed.all() or name == "infinite"
    parts, _ = sample.sort(1e-8)
    sources = prepare_sources(parts, needed, keep_whole(mesh.elements))
    operator = assemble_hierarchical(parts, sources, np.arange(mesh.nodes), needed, model.size)
    v = np.where(needed, list_vectors(sample)["random displacements"], 0.0)
    exact = assemble_rows(mesh, sample.materials, 0, mesh.nodes, needed, model.size).apply(v)
    assert np.linalg.norm(operator.apply(v) - exact) <= 1e-8 * np.linalg.norm(exact)
    whole = assemble(sample, 1e-8)
    sizes = [sum(leaf.near.size for leaf in each.near.leaves) for each in (operator, whole)]
    assert sizes[0] < sizes[1] or needed.all()


class OneOfThree(OneRank):
    """A rank whose others are not there: nothing is sent, and nothing comes."""

    def __init__(self, rank: int) -> None:
        self.rank = rank

    def find_ghosts(
        self, numbers: np.ndarray, owner: np.ndarray, own: np.ndarray, kept: np.ndarray | None = None
    ) -> Ghosts:
        assert (owner != self.rank).all()
        return super().find_ghosts(numbers[:0], owner[:0], own, kept)


def test_leaves_shared_by_ranks_add_up() -> None:
    sample = make_sample("inclusions")
    parts, sources = sample.sort(1e-8)
    v = list_vectors(sample)["random tractions"]
    of_element = np.random.default_rng(5).integers(0, 3, sample.mesh.elements)
    together = np.zeros((parts.forest.clusters, 2, parts.terms + 1), dtype=complex)
    owners = np.zeros(parts.forest.clusters)
    for rank in range(3):
        share = prepare_sources(parts, sample.needed, Share(OneOfThree(rank), of_element))
        together[share.clusters.number] += share.collect(take_elements(v, share.elements, share.width))
        mine = share.owner[share.clusters.number] == rank
        owners[share.clusters.number[mine]] += 1
        np.testing.assert_array_equal(np.flatnonzero(~mine), share.partial)
    assert (owners == 1).all()
    whole = sources.collect(take_elements(v, sources.elements, sources.width))
    np.testing.assert_allclose(together, whole, rtol=0, atol=1e-13 * np.abs(whole).max())


class Asked(OneOfThree):
    """Keeps the numbers that were asked for, and which values of them."""

    def __init__(self, rank: int) -> None:
        super().__init__(rank)
        self.asked: list[tuple[np.ndarray, np.ndarray | None]] = []

    def find_ghosts(
        self, numbers: np.ndarray, owner: np.ndarray, own: np.ndarray, kept: np.ndarray | None = None
    ) -> Ghosts:
        self.asked.append((numbers, kept))
        return super().find_ghosts(numbers, owner, own, kept)


def test_of_others_clusters_a_rank_asks_for_the_coefficients_that_its_pairs_use() -> None:
    sample = make_sample("cracks")
    mesh, ranks = sample.mesh, Asked(1)
    share = Share(ranks, np.arange(mesh.elements) * 3 // mesh.elements)
    parts, _ = sample.sort(1e-8)
    sources = prepare_sources(parts, sample.needed, share)
    own = list_nodes(mesh, np.flatnonzero(share.own))
    ranks.asked.clear()
    operator = assemble_hierarchical(parts, sources, own, sample.needed, sample.model.size)
    (numbers, kept), forest = ranks.asked[0], parts.forest
    met = find_interactions(forest, forest, RATIO, mark_ancestors(forest, operator.targets.clusters.number))
    expected = np.zeros((forest.clusters, 2, parts.terms + 1, 2), dtype=bool)
    for target, source in zip(met.far_target.tolist(), met.far_source.tolist(), strict=True):
        if sources.owner[source] != 1:
            used = count_terms(forest, np.array([target]), forest, np.array([source]), parts.terms)[0, 0]
            expected[source, :, : used + 1] = True
    np.testing.assert_array_equal(np.flatnonzero(expected.any(axis=(1, 2, 3))), numbers)
    np.testing.assert_array_equal(expected[numbers].reshape(len(numbers), -1), kept)
    assert len(numbers) and kept is not None and kept.mean() < 0.9


@pytest.mark.parametrize("every", [1, 2])
def test_anchors_of_nodes_side_by_side_or_not(every: int) -> None:
    """What they add to the rows of a body is the product of pattern and functional, and nothing else changes."""
    model, sample = read_sample("floating"), make_sample("floating")
    mesh = sample.mesh
    anchor = anchor_motions(mesh, find_rigid_body_modes(model))[0]
    chosen = slice(1, -1, every)
    nodes, pattern, functional = anchor.nodes[chosen], anchor.pattern[chosen], anchor.functional[chosen]
    given, added = (assemble_rows(mesh, sample.materials, 0, mesh.nodes, sample.needed, model.size) for _ in range(2))
    add_anchor(added, mesh, anchor.region, nodes, pattern, functional)
    at = (2 * nodes[:, None] + np.arange(2)).ravel()
    expected = np.zeros((2 * mesh.nodes, 4 * mesh.nodes))
    parts = [np.stack([each.real, each.imag], axis=1).ravel() for each in (pattern, functional)]
    expected[np.ix_(at, at)] = np.outer(*parts)
    for one, other in zip(given.blocks, added.blocks, strict=True):
        change = expected[np.ix_(one.rows, one.columns)] if one.region == anchor.region else 0.0
        np.testing.assert_array_equal(one.matrix + change, other.matrix)


def test_anchors_are_those_of_the_dense_rows() -> None:
    model, sample = read_sample("floating"), make_sample("floating")
    mesh = sample.mesh
    anchors = anchor_motions(mesh, find_rigid_body_modes(model))
    assert len(anchors) == 3
    dense = assemble_rows(mesh, sample.materials, 0, mesh.nodes, sample.needed, model.size)
    nodes = np.random.default_rng(1).permutation(mesh.nodes)[:101]
    whole, part = assemble(sample, 1e-10), assemble(sample, 1e-10, nodes)
    for anchor in anchors:
        add_anchor(dense, mesh, anchor.region, anchor.nodes, anchor.pattern, anchor.functional)
    added = [Anchoring(each.region, each.nodes, each.pattern, each.functional) for each in anchors]
    whole, part = (anchor_rows(each, added) for each in (whole, part))
    rows = (2 * nodes[:, None] + np.arange(2)).ravel()
    for kind, v in list_vectors(sample).items():
        exact = dense.apply(v)
        scale = np.abs(sample.dense.apply(v) - exact).max() + np.abs(exact).max()
        np.testing.assert_allclose(whole.apply(v), exact, rtol=0, atol=1e-10 * scale, err_msg=kind)
        np.testing.assert_allclose(part.apply(v), exact[rows], rtol=0, atol=1e-10 * scale, err_msg=kind)
    rigid = list_vectors(sample)["rigid motion"]
    assert np.abs(dense.apply(rigid)).max() > 0.1, "anchors see it"


@tolerances
@pytest.mark.parametrize("name", ["panel", "cracks", "infinite"])
def test_displacements_at_crack_nodes_are_those_of_the_dense_rows(name: str, tolerance: float) -> None:
    sample = make_sample(name)
    mesh = sample.mesh
    parts, sources = sample.sort(tolerance)
    cracks = np.flatnonzero(mesh.node_crack)
    blocks = assemble_displacement_rows(mesh, sample.materials, cracks, sample.needed)
    points = place_points(parts, sources, mesh.position[cracks], mesh.node_region[cracks], mesh.node_element[cracks],
                          mesh.node_local[cracks])  # fmt: skip
    assert len(points.met.far_target) > 0
    for kind, v in list_vectors(sample).items():
        exact = np.zeros(2 * len(cracks))
        for block in blocks:
            exact[block.rows] = block.matrix @ v[block.columns]
        found = points.displacement(v)
        error = np.abs(found - (exact[0::2] + 1j * exact[1::2])).max()
        # Nothing is made outside of a hole by its rigid motion.
        assert error <= tolerance * max(np.abs(exact).max(), 0.1 * np.abs(v[: 2 * mesh.nodes]).max()), kind


# What a point near an element or a tree of points can be like.
POINTS = {
    "grid": lambda: (np.linspace(0.3, 9.6, 17)[:, None] + 1j * np.linspace(0.4, 9.7, 13)).ravel(),
    "single": lambda: np.array([5.1 + 2.3j]),
    "coincident": lambda: np.full(40, 3.3 + 8.8j),
    "on a line": lambda: np.linspace(0.01, 9.99, 100) + 1e-3j,
    "near an element": lambda: 4.03 + 1j * 10.0 ** -np.arange(1.0, 9.0),
    "near a corner": lambda: (1 + 2j) * 10.0 ** -np.arange(0.0, 7.0),
}  # fmt: skip


@pytest.mark.parametrize("points", POINTS)
@tolerances
@pytest.mark.parametrize("name", ["cracks", "inclusions"])
def test_the_field_at_points_is_that_of_the_dense_rows(name: str, points: str, tolerance: float) -> None:
    sample = make_sample(name)
    parts, sources = sample.sort(tolerance)
    place = POINTS[points]()
    # With inclusions every other point is taken as one of the first inclusion: the sums are defined everywhere.
    region = np.arange(len(place)) % 2 if name == "inclusions" else np.zeros(len(place), dtype=np.int64)
    off = np.full(len(place), -1)
    found = place_points(parts, sources, place, region, off, np.zeros(len(place)))
    for kind, v in list_vectors(sample).items():
        displacement, stress = evaluate_densely(sample, place, region, v)
        limit = tolerance * np.linalg.norm(displacement) + ROUNDING
        assert np.linalg.norm(found.displacement(v) - displacement) <= limit, kind
        if kind != "rigid motion":
            # Derivatives of expansions lose a little; a single point has no others to share the mean with.
            limit = (5 * tolerance + ROUNDING) * np.linalg.norm(stress)
            assert np.linalg.norm(found.stress(v) - stress) <= limit, kind


def evaluate_densely(
    sample: Sample, point: np.ndarray, region: np.ndarray, v: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Displacement (k,) complex and stress (k, 3) at points, by the kernels."""
    mesh = sample.mesh
    displacement, stress = np.zeros(len(point), dtype=complex), np.zeros((len(point), 3))
    parts, _ = sample.sort(1e-2)
    for number in np.unique(region):
        at = np.flatnonzero(region == number)
        nodes = np.flatnonzero(mesh.node_region == number)
        columns = (2 * nodes[:, None] + np.arange(2)).ravel()
        values = []
        for normal in (None, 1.0, 1j):
            normals = None if normal is None else np.full(len(at), normal, dtype=complex)
            of_u, of_t = evaluate_rows(parts.sources[number], point[at], np.full(len(at), -1), normals)
            assert of_t is not None
            value = of_u @ v[columns] + of_t @ v[2 * mesh.nodes + columns]
            values.append(value[0::2] + 1j * value[1::2])
        displacement[at] = values[0]
        stress[at] = np.stack([values[1].real, values[2].imag, 0.5 * (values[1].imag + values[2].real)], axis=1)
    return displacement, stress


def test_no_points() -> None:
    sample = make_sample("cracks")
    none = np.zeros(0, dtype=np.int64)
    points = place_points(*sample.sort(1e-6), np.zeros(0, dtype=complex), none, none, np.zeros(0))
    v = list_vectors(sample)["linear field"]
    assert points.displacement(v).shape == (0,) and points.stress(v).shape == (0, 3)


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_units_of_length_do_not_matter(size: float) -> None:
    """The same plate in mm and in km."""
    sample = make_sample("cracks")
    mesh = replace(sample.mesh, **{name: size * getattr(sample.mesh, name) for name in
                                   ("start", "end", "center", "position", "weight")})  # fmt: skip
    scaled = Sample(sample.model, mesh, sample.materials, sample.dense)
    parts, sources = scaled.sort(1e-8)
    operator = assemble_hierarchical(parts, sources, np.arange(mesh.nodes), sample.needed, size * sample.model.size)
    plain = assemble(sample, 1e-8)
    for kind, v in list_vectors(sample).items():
        u, t = v[: len(v) // 2], v[len(v) // 2 :]
        found = operator.apply(np.concatenate([size * u, t])) / size
        np.testing.assert_allclose(found, plain.apply(v), rtol=0, atol=1e-12 * measure_parts(plain, v), err_msg=kind)


def test_no_points_have_no_values() -> None:
    """As of a rank that owns no crack."""
    sample = make_sample("cracks")
    parts, sources = sample.sort(1e-8)
    none = np.zeros(0, dtype=np.int64)
    rows = place_points(parts, sources, none.astype(complex), none, none, none.astype(float))
    v = list_vectors(sample)["random displacements"]
    assert rows.displacement(v).shape == (0,) and rows.stress(v).shape == (0, 3)
