"""Laws of one's own are tried when the case is read: what fails is a fault of the case."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest

from pbem.case.build import read_checked_model
from pbem.contact.custom import CustomLaw, find_fault
from pbem.contact.strength import coulomb
from pbem.errors import CaseError, StopError
from tests.unit.case_sample import BLOCKS, change

GOOD = """
from pbem.contact.strength import Strength

def strength(p_n, slip, friction):
    return Strength(-friction * p_n, 0 * p_n - friction, 0 * p_n)
"""


def write_case(folder: Path, law: str) -> Path:
    (folder / "law.py").write_text(law)
    keys = 'law = "custom"\nfile = "law.py"\nparameters = { friction = 0.5 }'
    text = change(BLOCKS, ("friction = 0.5", keys)) if "friction = 0.5" in BLOCKS else BLOCKS
    path = folder / "case.toml"
    path.write_text(text.replace('law = "coulomb"\n', ""))
    return path


def test_a_sound_law_is_accepted(tmp_path: Path) -> None:
    model = read_checked_model(write_case(tmp_path, GOOD))
    assert [joint.law.kind for joint in model.interfaces.values()] == ["custom"]


@pytest.mark.parametrize(
    ("law", "text"),
    [
        ("import no_such_module", "No module named"),
        ("x = 1", "no function named strength"),
        ("def strength(p_n, slip): return p_n", "unexpected keyword argument"),
        ("def strength(p_n, slip, friction): return -friction * p_n", "bound"),
        (GOOD.replace("-friction * p_n,", "-0.3,"), "a bound of shape () for a p_n of shape (2,)"),
        (GOOD.replace("-friction * p_n,", "0 * p_n + float('nan'),"), "gives bound = nan at p_n = -1"),
    ],
)
def test_a_law_that_fails_is_a_fault_with_its_place(tmp_path: Path, law: str, text: str) -> None:
    with pytest.raises(CaseError) as caught:
        read_checked_model(write_case(tmp_path, law))
    (fault,) = caught.value.faults
    assert fault.place.startswith("interfaces.")
    assert text in fault.found


def test_a_law_that_ends_the_program_is_a_fault(tmp_path: Path) -> None:
    for law in ("import sys; sys.exit(0)", GOOD.replace("return Strength", "raise SystemExit\n    return Strength")):
        with pytest.raises(CaseError, match="SystemExit"):
            read_checked_model(write_case(tmp_path, law))


def make_law(text: str) -> CustomLaw:
    return CustomLaw("my_law.py", "import numpy as np\n" + text)


ARGUMENTS = {"p_n": np.array([-2.0, -1.0, 0.0]), "slip": np.array([0.0, 0.1, 0.2]), "friction": np.full(3, 0.5)}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("p_n *= 0", "read-only"), ("slip += 1", "read-only"), ("friction[0] = 9", "read-only"),
        ("np.ndarray.sort(p_n)", "read-only"), ("1 / 0", "ZeroDivisionError"), ("exit(3)", "SystemExit"),
        ("import os; os._exit(0)", "SystemExit: os._exit(0)"),
        ("import posix; posix._exit(0)", "SystemExit: os._exit(0)"),
        ("import os; os.execl('/bin/true', 'true')", "SystemExit: os.execv('/bin/true'"),
        ("return None", "no attribute 'bound'"), ("friction = friction[:2]; p_n = p_n[:2]", "shape (2,) for a p_n of"),
        ("p_n = np.where(p_n < -1.5, np.nan, p_n)", "bound = nan at p_n = -2 and slip = 0"),
        ("friction = friction / 0", "bound = inf"), ("friction = 'much'", "TypeError: bad operand"),
        ("return Strength(p_n > -1, p_n * 1j, p_n)", "complex numbers"),
        ("raise GeneratorExit('x')", "GeneratorExit: x"),
        ("raise type('Odd', (BaseException,), {})('x')", "Odd: x"), ("friction = friction * 1e200", "bound = 1e+200"),
        ("raise type('Mute', (ValueError,), {'__str__': lambda _: 1 / 0})", "Mute: it cannot be told"),
        ("raise ValueError('y\\n' * 10**6)", "y y y ...); expected"),
    ],
)
def test_what_a_law_does_wrong_is_kept_with_its_file(change: str, said: str) -> None:
    law = make_law(GOOD.replace("    return", f"    {change}\n    return"))
    given = {name: values.copy() for name, values in ARGUMENTS.items()}
    with np.errstate(all="ignore"):
        answer = law(**given)
    assert law.fault.startswith("the law my_law.py ") and said in law.fault, law.fault
    np.testing.assert_array_equal(answer.bound, np.zeros(3))
    for name, values in ARGUMENTS.items():
        np.testing.assert_array_equal(given[name], values)
    assert find_fault([coulomb, law]) == law.fault


def test_a_file_that_fails_later_is_a_fault_of_the_law() -> None:
    # On another rank, or when the file has changed: what others wait for must not be left by an exception.
    for text in ("1 / 0", "exit()", "raise GeneratorExit", "def (", "strength = 3"):
        law = make_law(text)
        assert law.fault.startswith("the law my_law.py "), law.fault
        np.testing.assert_array_equal(law(**ARGUMENTS).bound, np.zeros(3))


def test_a_signal_within_a_law_stops_the_run() -> None:
    for stop in ("KeyboardInterrupt", "StopError('SIGTERM', 'stopped')"):
        text = GOOD.replace("    return", f"    raise {stop}\n    return")
        law = make_law("from pbem.errors import StopError" + text)
        with pytest.raises((KeyboardInterrupt, StopError)):
            law(**ARGUMENTS)
        assert law.fault == ""


def test_what_a_law_sets_for_the_whole_program_is_set_back(tmp_path: Path) -> None:
    folder, filters, treatment = os.getcwd(), list(warnings.filters), np.geterr()
    setting = f"import os, warnings; os.chdir({str(tmp_path)!r}); np.seterr(all='raise')"
    setting += "; warnings.simplefilter('error')"
    law = make_law(setting + GOOD.replace("    return", f"    {setting}\n    return"))
    np.testing.assert_array_equal(law(**ARGUMENTS).bound, [1.0, 0.5, 0.0])
    assert (os.getcwd(), list(warnings.filters), np.geterr(), law.fault) == (folder, filters, treatment, "")


def test_what_a_law_keeps_of_its_answers_does_not_change_them() -> None:
    law = make_law(GOOD.replace("def ", "kept = []\ndef ").replace(
        "return ", "[each.fill(7.0) for each in kept]; bound = -friction * p_n; kept.append(bound); return ").replace(
        "Strength(-friction * p_n,", "Strength(bound,"))
    first = law(**ARGUMENTS)
    law(**ARGUMENTS)
    assert law.fault == ""
    np.testing.assert_array_equal(first.bound, [1.0, 0.5, 0.0])


def test_sums_tell_answers_apart() -> None:
    one, same, other = (make_law(GOOD.replace("0 * p_n - friction", text))
                        for text in ("0 * p_n - friction", "-friction + 0 * slip", "-1.00001 * friction"))
    for law in (one, same, other):
        law(**ARGUMENTS)
    np.testing.assert_array_equal(one.sums, same.sums)
    assert abs(one.sums - other.sums)[1] > 1e-6 * one.sums[3:].max()
    swapped = make_law(GOOD)
    swapped(ARGUMENTS["p_n"][::-1], ARGUMENTS["slip"], friction=ARGUMENTS["friction"])
    assert abs(one.sums - swapped.sums)[0] > 0.1


def test_processes_that_a_law_starts_end_as_ever() -> None:
    text = """
import multiprocessing, os, subprocess
from pbem.contact.strength import Strength

def strength(p_n, slip, friction):
    one = multiprocessing.get_context("fork").Process(target=int)
    one.start()
    one.join()
    assert one.exitcode == 0 and subprocess.run(["false"]).returncode == 1
    child = os.fork()
    if child == 0:
        os._exit(7)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
    return Strength(-friction * p_n, 0 * p_n - friction, 0 * p_n)
"""
    ends = os._exit, os.execv
    law = CustomLaw("my_law.py", text)
    np.testing.assert_allclose(law(**ARGUMENTS).bound, [1.0, 0.5, 0.0])
    assert law.fault == "" and (os._exit, os.execv) == ends
