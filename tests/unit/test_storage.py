"""Whatever ends the process or fills the disk, the file holds the steps before, and a run goes on from them."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import pbem.results.writer
from pbem.errors import LawError, ResultFileError, StorageError
from pbem.results import journal, tail
from pbem.results.output import check_output_path
from pbem.results.reader import open_results
from pbem.results.store import Store, create_store
from pbem.results.writer import ResultWriter
from tests.unit.results_sample import SOURCE, make_mesh, make_model, make_steps

MODEL = make_model()
MESH = make_mesh(MODEL)
STEPS = make_steps(MODEL, MESH)


class Killed(BaseException):
    """Stands for the end of the process: nothing after it writes."""


class Fault:
    """Lets the calls that change a file go well so many times; the next writes half of its bytes, and raises."""

    def __init__(self, patch: pytest.MonkeyPatch, error: Callable[[], BaseException], lasting: bool = True) -> None:
        self.left = -1
        self.calls = 0
        self._error, self._lasting = error, lasting
        self._write = os.pwrite
        patch.setattr(journal.os, "pwrite", self._pwrite)  # one module for all
        for name in ("ftruncate", "fsync"):
            patch.setattr(journal.os, name, self._wrap(getattr(os, name)))

    def allow(self, count: int) -> None:
        """Let so many calls go well from now on; -1: all."""
        self.left, self.calls = count, 0

    def _due(self) -> bool:
        self.calls += 1
        if self.left > 0:
            self.left -= 1
        elif self.left == 0:
            if not self._lasting:
                self.left = -1
            return True
        return False

    def _pwrite(self, disk: int, data: memoryview, at: int) -> int:
        if self._due():
            if self.calls == 1 or self._lasting:
                self._write(disk, data[: len(data) // 2], at)
            raise self._error()
        return self._write(disk, data, at)

    def _wrap(self, whole: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            if self._due():
                raise self._error()
            return whole(*arguments)

        return call


def write(path: Path, count: int = len(STEPS)) -> ResultWriter:
    writer = ResultWriter(path, MODEL, MESH, 1, "3.18.5")
    for step in STEPS[:count]:
        writer.append(step)
    return writer


def expect_steps(path: Path, count: int) -> None:
    """The file holds the first so many steps, each as it was given."""
    results = open_results(path)
    np.testing.assert_array_equal(results.steps.number, np.arange(1, count + 1))
    for k, step in enumerate(STEPS[:count]):
        np.testing.assert_array_equal(results.displacement[k] @ [1, 1j], step.displacement)
        np.testing.assert_array_equal(results.traction[k] @ [1, 1j], step.traction)
    for quantity in ("slip", "traction_n", "mode"):
        together = np.concatenate([getattr(each, quantity) for each in results.contact.values()], axis=1)
        expected = np.array([getattr(step.contact, quantity) for step in STEPS])[:count]
        np.testing.assert_array_equal(together, expected)
    assert len(results.energy.external) == count


@pytest.fixture(scope="module")
def energy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[np.ndarray]:
    """The elastic energy of all steps of a run that nothing disturbs."""
    path = tmp_path_factory.mktemp("whole") / "a.h5"
    write(path).finish()
    yield open_results(path).energy.elastic


def count_calls(fault: Fault, path: Path) -> int:
    fault.allow(-1)
    write(path, 2).finish()
    path.unlink()
    return fault.calls


def test_a_kill_at_any_write_call_costs_at_most_the_step_being_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, energy: np.ndarray
) -> None:
    path = tmp_path / "a.h5"
    fault = Fault(monkeypatch, Killed)
    total = count_calls(fault, path)
    assert total > 20
    seen = set()
    for number in range(total):
        fault.allow(number)
        done, writer = -1, None
        try:
            writer = ResultWriter(path, MODEL, MESH, 1, "3.18.5")
            done = 0
            for step in STEPS[:2]:
                writer.append(step)
                done += 1
            writer.finish()
        except Killed:
            pass
        if writer is not None:
            writer._storage.drop()  # the system closes the files of a process that has ended
        fault.allow(-1)
        if done < 0 and not path.exists():
            continue
        stored = len(open_results(path).steps)
        assert max(done, 0) <= stored <= done + 1
        assert open_results(path).status in ("stopped", "finished" if stored == 2 else "stopped")
        expect_steps(path, stored)
        seen.add(stored - max(done, 0))
        if number % 4 == 0:
            with ResultWriter.resume(path, MODEL, MESH, 1, "3.18.5") as again:
                assert (again.last_step.number if again.last_step else 0) == stored
                for step in STEPS[stored:]:
                    again.append(step)
            expect_steps(path, len(STEPS))
            np.testing.assert_allclose(open_results(path).energy.elastic, energy, rtol=1e-12)
            assert [each.name for each in tmp_path.iterdir()] == ["a.h5"]
        path.unlink()
    assert seen == {0, 1}, "kills before the tail is complete, and after it"


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO])
def test_a_full_disk_leaves_the_steps_before(
    code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, energy: np.ndarray
) -> None:
    """At every write call of a step; then there is room again for the status, as its blocks were kept."""
    path = tmp_path / "a.h5"
    fault = Fault(monkeypatch, lambda: OSError(code, os.strerror(code)), lasting=False)
    for number in range(4):
        fault.allow(-1)
        with pytest.raises(StorageError, match="no room for step 3"), write(path, 2) as writer:
            fault.allow(number)
            writer.append(STEPS[2])
        results = open_results(path)
        assert results.status == "stopped" and os.strerror(code) in results.failure
        expect_steps(path, len(results.steps))
        assert len(results.steps) in (2, 3)
        with ResultWriter.resume(path, MODEL, MESH, 1, "3.18.5") as again:
            for step in STEPS[len(results.steps):]:
                again.append(step)
        expect_steps(path, len(STEPS))
        np.testing.assert_allclose(open_results(path).energy.elastic, energy, rtol=1e-12)
        path.unlink()


SOME = make_model(every=3)
DUE = (2, 3, 6)  # of the stages' six steps


def append_up_to(writer: ResultWriter, first: int, last: int) -> None:
    """Steps first to last, each with an error and a note of its own."""
    for step in STEPS[first - 1 : last]:
        writer.notes = [f"note {number}" for number in range(1, step.number + 1)]
        writer.append(step, {"relative_displacement": np.array(0.01 * step.number)})


def expect_some_steps(path: Path, last: int, energy: np.ndarray) -> None:
    """The file holds the steps up to `last` that are due, that one, and the iterations of all."""
    results = open_results(path)
    numbers = sorted({number for number in DUE if number < last} | {last})
    assert results.steps.number.tolist() == numbers
    of = np.array(numbers) - 1
    np.testing.assert_array_equal(results.displacement @ [1, 1j], [STEPS[k].displacement for k in of])
    np.testing.assert_allclose(results.energy.elastic, energy[of], rtol=1e-12)
    np.testing.assert_allclose(results.errors.relative["displacement"], 0.01 * np.array(numbers))
    with h5py.File(path) as file:
        assert np.unique(file["convergence"]["step"]).tolist() == list(range(1, last + 1))


@pytest.mark.parametrize("number", [4, 5, 6])
def test_a_step_without_room_is_not_stored_when_the_run_ends(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, energy: np.ndarray
) -> None:
    """At every write call of a step the file then ends with the one before, due or not, and has its note."""
    path = tmp_path / "a.h5"
    fault = Fault(monkeypatch, lambda: OSError(errno.ENOSPC, "No space left on device"), lasting=False)
    ends, calls, whole = set(), 0, False
    while not whole:
        fault.allow(-1)
        with suppress(StorageError), ResultWriter(path, SOME, MESH, 1, "3.18.5", force=True) as writer:
            append_up_to(writer, 1, number - 1)
            fault.allow(calls)
            append_up_to(writer, number, number)
            fault.allow(-1)
            whole = True
        results = open_results(path)
        assert whole or f"no room for step {number} (No space left on device)" in results.failure
        last = int(results.steps.number[-1])
        assert number - 1 <= last <= number
        expect_some_steps(path, last, energy)
        assert [note for note in results.notes if note.startswith("note ")] == [f"note {i + 1}" for i in range(number)]
        if not whole and last not in ends:
            ends.add(last)
            with ResultWriter.resume(path, SOME, MESH, 1, "3.18.5") as again:
                append_up_to(again, last + 1, len(STEPS))
            assert {*DUE, last} == set(open_results(path).steps.number.tolist())
            with h5py.File(path) as file:
                assert np.unique(file["convergence"]["step"]).tolist() == list(range(1, len(STEPS) + 1))
        calls += 1
    assert ends == {number - 1, number}, "before the change is complete, and after it"


def test_a_law_that_fails_leaves_the_step_before_with_what_belongs_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, energy: np.ndarray
) -> None:
    path = tmp_path / "a.h5"
    with pytest.raises(LawError, match="made up"), ResultWriter(path, SOME, MESH, 1, "3.18.5") as writer:
        append_up_to(writer, 1, 5)
        monkeypatch.setattr(pbem.results.writer, "find_fault", lambda _: "made up")
        append_up_to(writer, 6, 6)
    expect_some_steps(path, 5, energy)
    with h5py.File(path) as file:
        assert file["former"].attrs["number"] == 4


def test_a_disk_that_stays_full_leaves_a_file_that_can_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.h5"
    fault = Fault(monkeypatch, lambda: OSError(errno.ENOSPC, "No space left on device"))
    with pytest.raises(StorageError, match=r"no room for step 3 \(No space left on device\)"), write(path, 2) as writer:
        fault.allow(1)
        writer.append(STEPS[2])
    results = open_results(path)
    assert results.status == "stopped"
    # Where the journal of the step was complete the step is kept.
    assert len(results.steps) in (2, 3)
    expect_steps(path, len(results.steps))


def test_two_runs_do_not_write_one_file(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with write(path, 2):
        assert open_results(path).status == "running"
        with pytest.raises(ResultFileError, match="is being written by another run"):
            ResultWriter.resume(path, MODEL, MESH, 1, "")
        with pytest.raises(ResultFileError, match="is being written by another run"):
            ResultWriter(path, MODEL, MESH, 1, "", force=True)
    expect_steps(path, 2)
    assert [each.name for each in tmp_path.iterdir()] == ["a.h5"]


def test_a_file_that_appears_in_the_meantime_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with pytest.raises(ResultFileError, match="made by another run"):
        create_store(path, False, lambda file: path.write_text("mine") and None)
    assert path.read_text() == "mine"
    assert [each.name for each in tmp_path.iterdir()] == ["a.h5"]


def test_parts_of_killed_runs_are_removed_and_those_of_others_are_not(tmp_path: Path) -> None:
    path = tmp_path / "a[1].h5"
    (tmp_path / ".a[1].h5.77.part").write_bytes(b"cut off")
    (tmp_path / ".b.h5.77.part").write_bytes(b"cut off")
    living = tmp_path / ".a[1].h5.78.part"
    living.write_bytes(b"")
    with living.open("rb") as held:
        assert journal.lock(held.fileno())
        write(path, 1).finish()
    assert sorted(each.name for each in tmp_path.iterdir()) == [".a[1].h5.78.part", ".b.h5.77.part", "a[1].h5"]


@pytest.mark.parametrize("what", ["a bit", "zeros", "shifted", "the tail"])
def test_damage_is_told_in_one_message(what: str, tmp_path: Path) -> None:
    """At 40 places; never are other numbers read than those that were written."""
    path = tmp_path / "a.h5"
    write(path, 3).fail("mode cycle", "made up")
    whole = path.read_bytes()
    random = np.random.default_rng(3)
    for place in random.integers(0, len(whole) - 64, 5 if what == "the tail" else 40):
        damaged = bytearray(whole)
        if what == "a bit":
            damaged[place] ^= 1 << int(random.integers(8))
        elif what == "zeros":
            damaged[place : place + 64] = b"\1" * 64
        elif what == "shifted":
            del damaged[place]
        else:
            damaged[-30] ^= 4
        path.write_bytes(damaged)
        for use in (open_results, lambda path: ResultWriter.resume(path, MODEL, MESH, 1, "")):
            try:
                use(path)
            except ResultFileError as error:
                assert str(error).count("\n") == 0
                assert "damaged" in str(error) or what in ("shifted", "the tail")
                continue
            expect_steps(path, 3)  # only the checksums were hit
            with path.open("rb") as file:
                assert what == "the tail" or place + 64 > tail.find_length(file.fileno())
            break


def test_a_torn_file_is_read_as_committed_and_left_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between the journal and its pages' places; readers take the pages from the journal."""
    path = tmp_path / "a.h5"
    fault = Fault(monkeypatch, Killed)
    found = 0
    for number in range(20):
        fault.allow(-1)
        writer = write(path, 2)
        fault.allow(number)
        with suppress(Killed):
            writer.append(STEPS[2])
        writer._storage.drop()
        fault.allow(-1)
        torn = path.read_bytes()
        with path.open("rb") as file:
            found += tail.find_unapplied(file.fileno()) is not None
        expect_steps(path, len(open_results(path).steps))
        assert path.read_bytes() == torn
        path.unlink()
    assert found > 0


def test_files_that_others_have_changed_are_read_without_checksums(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    write(path, 3).finish()
    with h5py.File(path, "r+") as file:
        file.attrs["remark"] = "mine"
    with path.open("rb") as disk:
        assert tail.read_tail(disk.fileno()) is None
    expect_steps(path, 3)
    store = Store(path)
    store.close()
    with path.open("rb") as disk:
        assert tail.check_pages(disk.fileno()) is not None
    expect_steps(path, 3)


@pytest.mark.parametrize(("what", "value"), [
    ("configuration", "no JSON"), ("configuration", "[]"), ("laws", ["coulomb"]), ("names", ["joint"]),
])  # fmt: skip
def test_files_that_others_have_spoilt_are_refused_before_they_are_used(
    what: str, value: object, tmp_path: Path
) -> None:
    path = tmp_path / "case.h5"
    write(path, 1).finish()
    assert len(open_results(path).pairs.names) > 1
    with h5py.File(path, "r+") as file:
        (file if what == "configuration" else file["contact"]).attrs[what] = value
    with pytest.raises(ResultFileError, match="is not a complete result file"):
        open_results(path)


def test_output_is_refused_where_it_would_destroy_something(tmp_path: Path) -> None:
    results, case, link = tmp_path / "a.h5", tmp_path / "case.toml", tmp_path / "link.toml"
    write(results, 1).finish()
    case.write_text(SOURCE)
    os.link(case, link)
    for name, flags, said in (
        (results, {}, "holds results; --resume goes on with them, --force replaces them"),
        (results, {"source": "another"}, "holds the results of another case"),
        (results, {"resume": True, "force": True}, "choose one"),
        (case, {}, "not a result file of pbem"), (case, {"force": True}, "not a result file of pbem"),
        (link, {"force": True, "inputs": [case]}, "that the case is read from"),
        (link, {"resume": True, "inputs": [case]}, "that the case is read from"),
        (tmp_path / "none.h5", {"resume": True}, "no such file to resume"),
        ("a\0b.h5", {}, "is no file name"), ("a" * 300, {}, "too long"), ("/dev/null", {}, "not a regular file"),
    ):
        with pytest.raises(ResultFileError, match=said):
            check_output_path(name, **{"source": SOURCE, **flags})
    assert check_output_path(results, force=True) == check_output_path(results, resume=True, source=SOURCE) == results
    results.write_bytes(results.read_bytes()[:5000])
    assert check_output_path(results, force=True) == results, "what was cut off may be replaced"
    assert case.read_text() == SOURCE
