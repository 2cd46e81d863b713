"""Places at which a body lies without force: nothing overlaps there, and the pairs that hold it touch."""

from __future__ import annotations

import numpy as np
import pytest

from pbem.contact.resting import Place, find_place

ANGLES = 2 * np.pi * (np.arange(60) + 0.37) / 60


def move(rest: Place, position: np.ndarray, normal: np.ndarray, opening: np.ndarray, slip: np.ndarray) -> np.ndarray:
    """Openings (k,) after the rigid motion that closes the pairs of a rest, and takes back the slip where it sticks."""
    touching = np.concatenate([rest.sticking, rest.sliding])
    lever = (position - position[0]) / np.abs(position - position[0]).max()
    motions = np.stack([np.ones_like(lever), np.full_like(lever, 1j), 1j * lever], axis=1)
    across, along = ((motions * np.conj(each)[:, None]).real for each in (normal, 1j * normal))
    rows = np.concatenate([across[touching], along[rest.sticking]])
    wanted = -np.concatenate([opening[touching], slip[rest.sticking]])
    found, _, _, _ = np.linalg.lstsq(rows, wanted, rcond=None)
    np.testing.assert_allclose(rows @ found, wanted, rtol=0, atol=1e-10 * np.abs(opening).max())
    moved: np.ndarray = opening + across @ found
    return moved


def make_space(shape: str, size: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Pairs between a body and a wider hole that it has been shifted and turned in; normals lead into the body."""
    random = np.random.default_rng(7)
    if shape == "disc":
        position = np.exp(1j * ANGLES)
        normal = -position
        play = 0.02 + 0.008 * np.cos(2 * ANGLES)  # as in a plate under unequal tension
    elif shape == "ellipse":
        position = np.cos(ANGLES) + 0.6j * np.sin(ANGLES)
        normal = -(0.6 * np.cos(ANGLES) + 1j * np.sin(ANGLES))
        normal, play = normal / np.abs(normal), np.full(60, 0.01)
    else:
        side = np.linspace(-0.97, 0.97, 15)
        position = np.concatenate([(side - 1j) * 1j**k for k in range(4)])
        normal = np.repeat(1j * 1j ** np.arange(4), 15)
        play = np.full(60, 0.01)
    a, b, spin = 0.03 * random.standard_normal(3)
    motion = a + 1j * b + 1j * spin * position
    opening = play + (np.conj(normal) * motion).real
    slip = 0.002 * np.sin(ANGLES) + (np.conj(1j * normal) * motion).real
    return 3 + 2j + size * position, normal, size * opening, size * slip


@pytest.mark.parametrize("size", [1.0, 1e-4, 1e6])
@pytest.mark.parametrize("rough", [True, False], ids=["friction", "smooth"])
@pytest.mark.parametrize("shape", ["disc", "ellipse", "square"])
def test_a_body_lies_where_nothing_overlaps(shape: str, rough: bool, size: float) -> None:
    position, normal, opening, slip = make_space(shape, size)
    rest = find_place(position, normal, opening, slip, np.full(60, rough))
    assert rest is not None
    assert (len(rest.sticking), len(rest.sliding)) == ((1, 1) if rough else (0, 2 if shape == "disc" else 3))
    moved = move(rest, position, normal, opening, slip)
    largest = np.abs(opening).max()
    assert moved.min() > -1e-9 * largest
    np.testing.assert_allclose(moved[np.concatenate([rest.sticking, rest.sliding])], 0.0, rtol=0, atol=1e-9 * largest)


def test_a_smooth_body_between_parallel_faces_keeps_the_sense_of_its_slip() -> None:
    along = np.linspace(-1, 1, 9)
    position, normal = np.concatenate([along - 0.5j, along + 0.5j]), np.repeat([1j, -1j], 9)
    opening = 0.01 + (np.conj(normal) * (0.004j + 0.002j * position)).real
    slip = (np.conj(1j * normal) * (0.004 + 0j)).real
    place = find_place(position, normal, opening, slip, np.zeros(18, dtype=bool))
    assert place is not None and len(place.sticking) == 0 and len(place.sliding) == 2
    # It moves across the faces, and turns, until these two pairs close; along the faces it does not move.
    at, into = position[place.sliding], normal[place.sliding]
    rates = np.stack([(np.conj(into) * 1j).real, (np.conj(into) * 1j * at).real], axis=1)
    rise, turn = np.linalg.solve(rates, -opening[place.sliding])
    slipped = slip[place.sliding] + (np.conj(1j * into) * (1j * rise + 1j * turn * at)).real
    np.testing.assert_array_equal(place.sense, np.sign(slipped))


@pytest.mark.parametrize("rough", [True, False], ids=["friction", "smooth"])
def test_a_body_that_two_sides_pinch_lies_nowhere(rough: bool) -> None:
    position, normal, opening, slip = make_space("disc", 1.0)
    pinched = opening - 0.03 * np.cos(2 * ANGLES) ** 2
    assert find_place(position, normal, pinched, slip, np.full(60, rough)) is None


def test_pairs_without_friction_do_not_stick() -> None:
    position, normal, opening, slip = make_space("ellipse", 1.0)
    rough = np.arange(60) == 41
    rest = find_place(position, normal, opening, slip, rough)
    assert rest is not None and rest.sticking.tolist() == [41]


@pytest.mark.parametrize("last_bits", range(4))
def test_of_images_in_a_symmetrical_hole_the_first_is_taken(last_bits: int) -> None:
    at = np.exp(2j * np.pi * (np.arange(40) + 0.5) / 40)
    play = 0.02 + 0.008 * (at**2).real
    noise = 1e-15 * np.random.default_rng(last_bits).standard_normal(40)
    place = find_place(at, -at, play + noise, np.zeros(40), np.ones(40, dtype=bool))
    exact = find_place(at, -at, play, np.zeros(40), np.ones(40, dtype=bool))
    assert place is not None and exact is not None
    assert (place.sticking[0], place.sliding[0]) == (exact.sticking[0], exact.sliding[0])
