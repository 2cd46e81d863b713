"""What the commands say to the terminal."""

from __future__ import annotations

import io
import sys

import pytest

from pbem.terminal import say


class Writes(io.RawIOBase):
    """A file that keeps each write call apart."""

    def __init__(self) -> None:
        self.calls: list[bytes] = []

    def writable(self) -> bool:
        return True

    def write(self, data: object) -> int:
        self.calls.append(bytes(data))  # type: ignore[call-overload]
        return len(self.calls[-1])


@pytest.mark.parametrize("text", ["a line", "two\nlines", "three\n\nlines of which one is empty"])
def test_a_message_is_written_at_once(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Launchers read pieces; Open MPI 5 has lost or moved lines whose end came in a piece of its own."""
    writes = Writes()
    monkeypatch.setattr(sys, "stderr", io.TextIOWrapper(io.BufferedWriter(writes), line_buffering=True))
    say(text, 0)
    say("of another rank", 1)
    assert writes.calls == [f"{text}\n".encode()]
