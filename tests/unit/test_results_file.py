"""The result file: what is written is read back, at every moment of a run, and nothing else is accepted."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from pbem.contact.laws import OPEN
from pbem.errors import ConvergenceError, ResultFileError, StopError
from pbem.mesh.mesh import list_faces
from pbem.results.output import check_output_path
from pbem.results.reader import open_results
from pbem.results.tips import collect_tip_rules
from pbem.results.writer import ResultWriter
from tests.unit.results_sample import SOURCE, make_mesh, make_model, make_steps

MODEL = make_model()
MESH = make_mesh(MODEL)
STEPS = make_steps(MODEL, MESH)


def write(path: Path, steps: int = len(STEPS), every: int = 1) -> ResultWriter:
    writer = ResultWriter(path, make_model(every), MESH, 2, "3.18.5", ["-pbem_ksp_rtol", "1e-8"])
    for step in STEPS[:steps]:
        writer.append(step)
    return writer


def test_fields_of_every_step_are_read_back(tmp_path: Path) -> None:
    write(tmp_path / "a.h5").finish()
    results = open_results(tmp_path / "a.h5")
    faces = list_faces(MESH)
    assert results.displacement.shape == results.traction.shape == (6, len(faces.position), 2)
    for k, step in enumerate(STEPS):
        np.testing.assert_array_equal(results.displacement[k] @ [1, 1j], step.displacement)
        np.testing.assert_array_equal(results.traction[k] @ [1, 1j], step.traction)
    np.testing.assert_array_equal(results.nodes.position @ [1, 1j], faces.position)
    np.testing.assert_array_equal(results.nodes.normal @ [1, 1j], faces.normal)
    assert [results.nodes.region_names[i] for i in results.nodes.region] == \
        [MESH.region_names[i] for i in faces.region]
    np.testing.assert_array_equal(results.elements.vertices[:, 1] @ [1, 1j], faces.end)
    np.testing.assert_array_equal(results.elements.curve[results.nodes.element], results.nodes.curve)
    crack = MESH.crack
    np.testing.assert_array_equal(results.elements.sweep, np.concatenate([MESH.sweep, -MESH.sweep[crack]]))
    assert results.elements.crack.sum() == 2 * MESH.crack.sum() > 0
    np.testing.assert_array_equal(results.displacement_at(-2), results.displacement[-2])


def test_attributes_tell_where_the_numbers_come_from(tmp_path: Path) -> None:
    write(tmp_path / "a.h5").finish()
    results = open_results(tmp_path / "a.h5")
    assert (results.title, results.status, results.case, results.ranks) == ("Made-up blocks", "finished", SOURCE, 2)
    assert (results.units.length, results.units.stress) == ("m", "kN/m^2")
    assert results.petsc_version == "3.18.5"
    configuration = json.loads(results.configuration)
    assert configuration["solver"]["newton_tolerance"] == 1e-9
    assert configuration["regions"][0]["material"]["young"] == 2e3
    with h5py.File(tmp_path / "a.h5") as file:
        assert file.attrs["petsc_options"] == "-pbem_ksp_rtol 1e-8"
        assert file["contact/joint"].attrs["friction"] == 0.5


def test_contact_arrays_follow_the_interface(tmp_path: Path) -> None:
    # The pairs are shuffled: the writer, not the mesh, promises the order.
    order = np.random.default_rng(1).permutation(MESH.pairs.count)
    mesh = replace(MESH, pairs=replace(MESH.pairs, **{k: v[order] for k, v in vars(MESH.pairs).items()}))
    with ResultWriter(tmp_path / "a.h5", MODEL, mesh, 1, "3.18.5") as writer:
        contact = STEPS[0].contact
        shown = {name: values[order] for name, values in vars(contact).items() if name != "internal"}
        internal = {name: values[order] for name, values in contact.internal.items()}
        writer.append(replace(STEPS[0], contact=replace(contact, **shown, internal=internal)))
    results = open_results(tmp_path / "a.h5")
    assert list(results.contact) == ["joint", "crack"]
    for number, interface in enumerate(results.contact.values()):
        mine = np.flatnonzero(MESH.pairs.interface == number)
        mine = mine[np.argsort(MESH.pairs.arc_length[mine])]
        assert (np.diff(interface.arc_length) > 0).all()
        np.testing.assert_array_equal(interface.position @ [1, 1j], MESH.pairs.position[mine])
        np.testing.assert_array_equal(interface.normal @ [1, 1j], MESH.pairs.normal[mine])
        for quantity in ("mode", "opening", "slip", "traction_n", "traction_s"):
            np.testing.assert_array_equal(getattr(interface, quantity), [getattr(contact, quantity)[mine]])
    assert (results.contact["joint"].first, results.contact["joint"].second) == ("lower", "upper")
    assert results.contact["crack"].second is None
    assert results.contact["crack"].law["friction"] == 0.3
    assert "elsewhere" not in results.contact


def test_reactions_are_integrals_over_outer_curves(tmp_path: Path) -> None:
    write(tmp_path / "a.h5").finish()
    results = open_results(tmp_path / "a.h5")
    assert set(results.reactions) == set(MODEL.conditions)
    # The invented traction is constant on a straight curve: 10 conj(n) (1 - i/2) times the length of the curve.
    np.testing.assert_allclose(results.reactions["top"][-1], [-10.0, -20.0], rtol=1e-13)
    np.testing.assert_allclose(results.reactions["right_lower"][2], [5.0, -2.5], rtol=1e-13)


def test_every_nth_step_is_stored_and_the_last_of_each_stage(tmp_path: Path) -> None:
    write(tmp_path / "a.h5", every=4).finish()
    results = open_results(tmp_path / "a.h5")
    np.testing.assert_array_equal(results.steps.number, [2, 4, 6])
    np.testing.assert_array_equal(results.steps.stage, [0, 1, 1])
    np.testing.assert_array_equal(results.steps.factor, [1.0, 0.5, 1.0])
    assert results.steps.stage_names == ("press", "shear")
    np.testing.assert_array_equal(results.steps.iterations, [3, 3, 3])
    np.testing.assert_array_equal(results.displacement[1] @ [1, 1j], STEPS[3].displacement)
    np.testing.assert_array_equal(results.convergence["step"], np.repeat(np.arange(1, 7), 3))
    np.testing.assert_array_equal(results.convergence["residual"][:3], [1.0, 1e-5, 1e-10])
    assert results.convergence["open"][0] == (STEPS[0].contact.mode == OPEN).sum()


def test_a_failed_run_keeps_the_last_step_reached(tmp_path: Path) -> None:
    with pytest.raises(ConvergenceError), write(tmp_path / "a.h5", steps=5, every=100):
        raise ConvergenceError("mode cycle", "joint near (1, 1); try more steps")
    results = open_results(tmp_path / "a.h5")
    assert results.status == "failed"
    assert results.failure == "mode cycle: joint near (1, 1); try more steps"
    np.testing.assert_array_equal(results.steps.number, [2, 5])


@pytest.mark.parametrize(
    ("error", "said", "status"),
    [(KeyboardInterrupt(), "interrupted", "stopped"), (ZeroDivisionError("by 0"), "by 0", "failed"),
     (MemoryError("no 9 GB"), "no 9 GB", "stopped"), (StopError("SIGTERM", "told so"), "SIGTERM: told so", "stopped")],
)
def test_leaving_by_any_exception_is_kept(tmp_path: Path, error: BaseException, said: str, status: str) -> None:
    with pytest.raises(type(error)), write(tmp_path / "a.h5", steps=1):
        raise error
    results = open_results(tmp_path / "a.h5")
    assert (results.status, len(results.steps)) == (status, 1)
    assert said in results.failure


def test_a_running_file_can_be_read_while_it_grows(tmp_path: Path) -> None:
    with write(tmp_path / "a.h5", steps=1) as writer:
        before = open_results(tmp_path / "a.h5")
        writer.append(STEPS[1])
        after = open_results(tmp_path / "a.h5")
        assert before.status == after.status == "running"
        assert (len(before.steps), len(after.steps)) == (1, 2)
        # Loaded after the file has grown, and still of one piece.
        assert before.displacement.shape[0] == before.contact["joint"].slip.shape[0] == 1
    assert open_results(tmp_path / "a.h5").status == "finished"


@pytest.mark.parametrize("locking", [None, True, False, "best-effort"])
def test_a_file_that_this_process_has_open_otherwise_is_read(tmp_path: Path, locking: bool | str | None) -> None:
    """HDF5 refuses a file that it has open with other locks; that was told as if the file were no HDF5 file."""
    path = tmp_path / "a.h5"
    write(path).finish()
    with h5py.File(path, "r", locking=locking) as file:
        results = open_results(path)
        assert np.array_equal(results.displacement, file["fields/displacement"][()])
    results = open_results(path)
    with h5py.File(path, "r", locking=locking) as file:
        assert np.array_equal(results.traction, file["fields/traction"][()])


def test_nothing_but_the_result_file_is_left_behind(tmp_path: Path) -> None:
    write(tmp_path / "a.h5").finish()
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


def test_a_header_that_fails_leaves_the_old_file_alone(tmp_path: Path) -> None:
    write(tmp_path / "a.h5").finish()
    with pytest.raises(AttributeError):
        ResultWriter(tmp_path / "a.h5", MODEL, replace(MESH, pairs=None), 1, "", force=True)  # type: ignore[arg-type]
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]
    assert len(open_results(tmp_path / "a.h5").steps) == 6


def test_resuming_goes_on_after_the_last_stored_step(tmp_path: Path) -> None:
    write(tmp_path / "whole.h5").finish()
    write(tmp_path / "cut.h5", steps=4).fail("interrupted", "")
    writer = ResultWriter.resume(tmp_path / "cut.h5", MODEL, MESH, 1, "3.18.5")
    last = writer.last_step
    assert last is not None
    assert (last.number, last.stage, last.factor) == (4, 1, 0.5)
    before, after = STEPS[3].contact, last.contact
    for quantity in ("mode", "opening", "slip", "traction_n", "traction_s", "slip_path", "broken"):
        np.testing.assert_array_equal(getattr(after, quantity), getattr(before, quantity))
    assert list(after.internal) == ["slip_path", "broken"]
    np.testing.assert_array_equal(last.displacement, STEPS[3].displacement)
    np.testing.assert_array_equal(last.traction, STEPS[3].traction)
    with writer:
        for step in STEPS[4:]:
            writer.append(step)
    whole, cut = open_results(tmp_path / "whole.h5"), open_results(tmp_path / "cut.h5")
    assert (cut.status, cut.failure, cut.ranks) == ("finished", "", 1)
    np.testing.assert_array_equal(cut.displacement, whole.displacement)
    np.testing.assert_array_equal(cut.contact["joint"].slip, whole.contact["joint"].slip)
    np.testing.assert_array_equal(cut.reactions["top"], whole.reactions["top"])
    np.testing.assert_array_equal(cut.convergence, whole.convergence)


def test_resuming_drops_a_step_that_was_cut_in_the_middle(tmp_path: Path) -> None:
    write(tmp_path / "a.h5", steps=3).fail("interrupted", "")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        field = file["fields/displacement"]
        field.resize(4, axis=0)
        file["convergence"].resize(12, axis=0)
        file["convergence"][9:] = np.array([(4, 1, 1.0, 0, 0, 0, 0, 0.0, 0)] * 3, dtype=file["convergence"].dtype)
    assert open_results(tmp_path / "a.h5").displacement.shape[0] == 3
    with ResultWriter.resume(tmp_path / "a.h5", MODEL, MESH, 1, "3.18.5") as writer:
        writer.append(STEPS[3])
    results = open_results(tmp_path / "a.h5")
    np.testing.assert_array_equal(results.displacement[3] @ [1, 1j], STEPS[3].displacement)
    np.testing.assert_array_equal(results.convergence["step"], np.repeat([1, 2, 3, 4], 3))


def test_resuming_a_file_without_steps_starts_at_the_beginning(tmp_path: Path) -> None:
    write(tmp_path / "a.h5", steps=0).fail("interrupted", "")
    with ResultWriter.resume(tmp_path / "a.h5", MODEL, MESH, 1, "3.18.5") as writer:
        assert writer.last_step is None


def test_resuming_refuses_another_case_and_another_mesh(tmp_path: Path) -> None:
    write(tmp_path / "a.h5").finish()
    other = replace(MODEL, source="title = 'x'", output_every=MODEL.output_every + 1)
    with pytest.raises(ResultFileError, match=r"another case, .*: output_every was \d+ and is \d+;"):
        ResultWriter.resume(tmp_path / "a.h5", other, MESH, 1, "3.18.5")
    moved = replace(MESH, position=MESH.position + 1e-6)
    with pytest.raises(ResultFileError, match="another mesh"):
        ResultWriter.resume(tmp_path / "a.h5", MODEL, moved, 1, "3.18.5")
    with pytest.raises(ResultFileError, match="no such file"):
        ResultWriter.resume(tmp_path / "b.h5", MODEL, MESH, 1, "3.18.5")
    assert open_results(tmp_path / "a.h5").status == "finished"


def test_what_is_no_result_file_is_refused(tmp_path: Path) -> None:
    write(tmp_path / "a.h5").finish()
    whole = (tmp_path / "a.h5").read_bytes()
    (tmp_path / "cut.h5").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.h5").write_text("no numbers here")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["a"] = 1
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        del file["reactions"]
    for name, said in {"cut": "cut off", "text": "not an HDF5", "other": "not a result", "a": "not a complete"}.items():
        with pytest.raises(ResultFileError, match=said):
            open_results(tmp_path / f"{name}.h5")
    for name in ("cut", "text", "other"):
        with pytest.raises(ResultFileError, match=r"is not a result file|was cut off|is not an HDF5 file"):
            ResultWriter.resume(tmp_path / f"{name}.h5", MODEL, MESH, 1, "3.18.5")
    with pytest.raises(ResultFileError, match="no such file"):
        open_results(tmp_path / "none.h5")


def test_bad_output_paths_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    assert check_output_path(tmp_path / "a.h5") == tmp_path / "a.h5"
    with pytest.raises(ResultFileError, match="does not exist"):
        check_output_path(tmp_path / "no" / "a.h5")
    with pytest.raises(ResultFileError, match="is a folder"):
        check_output_path(tmp_path)
    with pytest.raises(ResultFileError, match="not writable"):
        check_output_path("/proc/a.h5")
    assert list(tmp_path.iterdir()) == []


def test_groups_can_be_copied_to_other_files(tmp_path: Path) -> None:
    # Copied in another process: what went wrong here was a crash of HDF5.
    write(tmp_path / "a.h5").finish()
    code = ("import h5py, sys\n"
            "with h5py.File(sys.argv[1]) as old, h5py.File(sys.argv[2], 'w') as new:\n"
            "    [old.copy(name, new) for name in old]")
    done = subprocess.run([sys.executable, "-c", code, tmp_path / "a.h5", tmp_path / "b.h5"], capture_output=True)
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "b.h5") as file:
        assert file["contact/joint"].attrs["law"] == "coulomb"


def test_long_lists_of_names_and_texts_are_stored(tmp_path: Path) -> None:
    names = tuple(f"curve number {i}" for i in range(6000))
    mesh = replace(MESH, curve_names=MESH.curve_names + names)
    with ResultWriter(tmp_path / "a.h5", make_model(source="#" * 100_000), mesh, 1, "3.18.5"):
        pass
    results = open_results(tmp_path / "a.h5")
    assert len(results.case) == 100_000
    assert results.nodes.curve_names[-1] == names[-1]


def test_stress_intensity_factors_are_those_of_the_jump_at_the_tips(tmp_path: Path) -> None:
    write(tmp_path / "a.h5").finish()
    results = open_results(tmp_path / "a.h5")
    rules = collect_tip_rules(MODEL, MESH)
    assert list(results.tips) == ["crack"]
    for k, step in enumerate(STEPS):
        KI, KII = rules.evaluate(step.contact)["crack"]
        np.testing.assert_allclose(results.tips["crack"].KI[k], KI, rtol=1e-13)
        np.testing.assert_allclose(results.tips["crack"].KII[k], KII, rtol=1e-13)
    assert results.tips["crack"].KI.shape == (6, 2)
    # The invented crack is open at its start and closed at its end.
    assert (results.tips["crack"].KI[:, 0] != 0).all()
    assert (results.tips["crack"].KI[:, 1] == 0).all()
    # A second face runs the other way, and its tips with it.
    second = results.elements.crack.nonzero()[0][MESH.crack.sum():]
    assert results.elements.tip[MESH.crack.nonzero()[0]].tolist() == [1, 0, 0, 0, 0, 2]
    assert results.elements.tip[second].tolist() == [2, 0, 0, 0, 0, 1]
