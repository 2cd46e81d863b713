"""The clock of a run's pieces: every moment is in one piece, and all of them are the whole."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from pbem.clock import OTHER, PIECES, Clock, sum_up


class Hands:
    """Time that passes only when it is told to."""

    def __init__(self) -> None:
        self.seconds = 100.0

    def __call__(self) -> float:
        return self.seconds


@pytest.fixture
def hands() -> Hands:
    return Hands()


@pytest.fixture
def clock(hands: Hands) -> Clock:
    return Clock(hands, lambda: 0.5 * hands.seconds)


def test_a_piece_has_the_time_in_which_none_within_it_runs(clock: Clock, hands: Hands) -> None:
    hands.seconds += 1
    with clock.piece("steps", 8.0):
        hands.seconds += 2
        with clock.piece("product", 16.0):
            hands.seconds += 4
        hands.seconds += 8
    with clock.piece("steps"):
        hands.seconds += 16
    whole, shares = clock.read()
    assert whole == 31
    assert {name: (share.seconds, share.processor, share.calls, share.bytes) for name, share in shares.items()} == {
        "steps": (26, 13, 2, 8.0), "steps/product": (4, 2, 1, 16.0), OTHER: (1, 0.5, 1, 0.0),
    }
    assert sum_up(shares) == dict.fromkeys(PIECES, 0.0) | {"steps": 30.0, OTHER: 1.0}


def test_pieces_end_with_an_exception(clock: Clock, hands: Hands) -> None:
    with pytest.raises(ZeroDivisionError), clock.piece("steps"), clock.piece("product"):
        hands.seconds += 1
        raise ZeroDivisionError
    hands.seconds += 2
    whole, shares = clock.read()
    assert whole == 3 and shares["steps/product"].seconds == 1 and shares[OTHER].seconds == 2


def test_what_is_done_with_items_is_none_of_the_piece_that_makes_them(clock: Clock, hands: Hands) -> None:
    def make() -> Iterator[int]:
        for number in range(2):
            hands.seconds += 1
            yield number
        hands.seconds += 4

    for _ in clock.each("steps", make()):
        hands.seconds += 16
    _, shares = clock.read()
    assert shares["steps"].seconds == 6 and shares[OTHER].seconds == 32


def test_time_before_the_clock_can_be_added(clock: Clock, hands: Hands) -> None:
    clock.add("start", 5.0, 2.0)
    hands.seconds += 1
    whole, shares = clock.read()
    assert whole == 6 and shares["start"].seconds == 5 and shares[OTHER].seconds == 1
    assert shares["start"].processor == 2 and shares[OTHER].processor == 0.5


def test_a_clock_can_be_set_back_within_a_piece(clock: Clock, hands: Hands) -> None:
    with clock.piece("steps"):
        hands.seconds += 1
        clock.restart()
        hands.seconds += 2
    whole, shares = clock.read()
    assert whole == 2 and set(shares) == {OTHER}


def test_a_listener_is_told_of_every_piece(clock: Clock) -> None:
    told: list[tuple[str, tuple[str, ...]]] = []

    class Listener:
        def enter(self, path: tuple[str, ...]) -> None:
            told.append(("enter", path))

        def leave(self, path: tuple[str, ...]) -> None:
            told.append(("leave", path))

    clock.listener = Listener()
    with clock.piece("steps"), clock.piece("product"):
        pass
    steps, product = ("steps",), ("steps", "product")
    assert told == [("enter", steps), ("enter", product), ("leave", product), ("leave", steps)]
