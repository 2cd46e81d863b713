"""Rigid motions of bodies in the plane under linear constraints between two of them, or one and the ground."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

import numpy as np

from pbem.arrays import Bool, Real

# First body, second body, rows (k, 3): rows @ (motion of the first - motion of the second) = 0.
Link = tuple[int, int, Real]
GROUND = -1  # the body that does not move

# A motion is free if it violates the constraints by less than this part of their size.
RELATIVE_RANK = 1e-8


def constrain_motions(held: Bool, about: complex, center: complex, scale: float) -> Real:
    """Rows (k, 3) for a body whose displacement along x or y at a point, or whose rotation is given (held (3,)).

    Motions are along x, along y, and the angle times scale about the center.
    """
    lever = (about - center) / scale
    rows = np.array([[1.0, 0.0, -lever.imag], [0.0, 1.0, lever.real], [0.0, 0.0, 1.0]])
    return rows[held]


def find_null_motions(bodies: int, links: Iterable[Link]) -> list[Real]:
    """A basis of the motions (3 bodies,) that no link prevents; see `find_moving_bodies`."""
    motions = []
    for members, vector in find_moving_bodies(bodies, links):
        whole = np.zeros((bodies, 3))
        whole[members] = vector.reshape(-1, 3)
        motions.append(whole.ravel())
    return motions


def find_moving_bodies(bodies: int, links: Iterable[Link]) -> list[tuple[list[int], Real]]:
    """A basis of the motions that no link prevents, with many zeros: rotations are eliminated first.

    Each with the bodies (k,), in rising order, that hang together there, and their motions (3 k,); others are at rest.

    Bodies that links tie to each other in all three motions are made one before anything is solved, so that the work is
    about proportional to the number of links.
    """
    groups = _Groups(bodies)
    for first, second, rows in links:
        groups.link(first, second, rows)
    motions = []
    for members, basis in groups.find_motions():
        for pivot, vector in _make_sparse(basis):
            at = 3 * members[pivot // 3] + pivot % 3
            motions.append(((at % 3 != 2, at), (members, vector)))
    return [motion for _, motion in sorted(motions, key=lambda entry: entry[0])]


class _Groups:
    """Bodies joined into groups that move as one (disjoint sets), with the constraints between the groups."""

    def __init__(self, bodies: int) -> None:
        self.parent = {body: body for body in (GROUND, *range(bodies))}
        self.members: dict[int, list[int]] = {body: [body] for body in self.parent}
        self.rows: dict[int, dict[int, Real]] = defaultdict(dict)  # symmetric: rows[a][b] is rows[b][a]

    def find(self, body: int) -> int:
        while self.parent[body] != body:
            self.parent[body] = self.parent[self.parent[body]]
            body = self.parent[body]
        return body

    def link(self, first: int, second: int, rows: Real) -> None:
        """Add a constraint; groups that it ties completely become one, which may tie further ones."""
        waiting = [(first, second, rows)]
        while waiting:
            first, second, rows = waiting.pop()
            first, second = self.find(first), self.find(second)
            if first == second:
                continue
            rows = _compress([self.rows[first].get(second, np.zeros((0, 3))), rows])
            self.rows[first][second] = self.rows[second][first] = rows
            if _count_free(rows) == 0:
                waiting += self._join(first, second)

    def _join(self, first: int, second: int) -> list[Link]:
        """Make two groups one; the links of the one with fewer are to be added again."""
        if len(self.rows[first]) < len(self.rows[second]):
            first, second = second, first
        self.parent[second] = first
        self.members[first] += self.members.pop(second)
        del self.rows[first][second]
        links = [(first, other, rows) for other, rows in self.rows.pop(second).items() if other != first]
        for _, other, _ in links:
            del self.rows[other][second]
        return links

    def find_motions(self) -> list[tuple[list[int], Real]]:
        """For every set of groups that hang together without the ground: its bodies, and their free motions."""
        result = []
        ground = self.find(GROUND)
        seen = {ground}
        for start in list(self.members):
            if start in seen:
                continue
            seen.add(start)
            connected = [start]
            for group in connected:
                new = [other for other in self.rows[group] if other not in seen]
                seen.update(new)
                connected += new
            result.append(self._solve(connected, ground))
        return result

    def _solve(self, groups: list[int], ground: int) -> tuple[list[int], Real]:
        place = {group: 3 * number for number, group in enumerate(groups)}
        blocks = [np.zeros((1, 3 * len(groups)))]
        for group in groups:
            for other, rows in self.rows[group].items():
                if other == ground or place[other] > place[group]:
                    block = np.zeros((len(rows), 3 * len(groups)))
                    block[:, place[group]:place[group] + 3] = rows
                    if other != ground:
                        block[:, place[other]:place[other] + 3] = -rows
                    blocks.append(block)
        matrix = _compress(blocks)
        free = np.linalg.svd(matrix, full_matrices=True)[2][3 * len(groups) - _count_free(matrix):]
        members = sorted((body, place[group]) for group in groups for body in self.members[group])
        columns = [at + k for _, at in members for k in range(3)]
        return [body for body, _ in members], free[:, columns]


def _compress(blocks: list[Real]) -> Real:
    """As few rows as there are columns, with the same null space."""
    return np.asarray(np.linalg.qr(np.concatenate(blocks), mode="r"))


def _count_free(rows: Real) -> int:
    """Dimension of the null space."""
    singular = np.linalg.svd(rows, compute_uv=False)
    return rows.shape[1] - int(np.sum(singular > RELATIVE_RANK * max(1.0, singular[0])))


def _make_sparse(null: Real) -> list[tuple[int, Real]]:
    """The same space by vectors with many zeros, and their pivots: rotations go first, so that translations remain."""
    basis = null.copy()
    columns = [*range(2, basis.shape[1], 3), *(c for c in range(basis.shape[1]) if c % 3 != 2)]
    pivots: list[int] = []
    for column in columns:
        row = len(pivots)
        if row == len(basis):
            break
        pivot = row + int(np.argmax(np.abs(basis[row:, column])))
        if abs(basis[pivot, column]) < 1e-6:
            continue
        basis[[row, pivot]] = basis[[pivot, row]]
        basis[row] /= basis[row, column]
        others = np.arange(len(basis)) != row
        basis[others] -= np.outer(basis[others, column], basis[row])
        pivots.append(column)
    basis[np.abs(basis) < 1e-9] = 0.0
    return list(zip(pivots, basis, strict=True))
