#!/usr/bin/env python3
"""Mutants of cases, result files and command lines: each is accepted, or refused with its place, never a traceback.

    .venv/bin/python scripts/fuzz.py cases --count 20000 [--seed 1]
    .venv/bin/python scripts/fuzz.py results --count 1000
    .venv/bin/python scripts/fuzz.py values --count 1000
    .venv/bin/python scripts/fuzz.py commands --count 2000
    .venv/bin/python scripts/fuzz.py runs --count 3000 [--records FILE]
    .venv/bin/python scripts/fuzz.py ranks --count 200

cases: what `pbem check` does, in this process. results: damaged files, also of a run that was stopped within a search,
are read, described, drawn and resumed in processes of their own, since HDF5 may crash. values: keys and values of
`--set`, of `Case.replace` and of sweeps, and quantities; what is accepted is written and read back. commands: the
command line, but for runs. runs: small cases are computed, each in a process of its own; those that finish have no
values that are not numbers, and their forces balance or a note says that they do not. ranks: what one rank does with
them, two must do: end, statuses, iterations and values. Mutants of more than 800 nodes or 40 steps are passed over, and
not counted. Prints each new kind of failure (exception and place in the program) with the number of the mutant, which
--only makes again; exit code 1 if there are any. Anything that takes more than a minute of processor time is a failure,
and so are control characters in what is said.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import io
import os
import random
import re
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from pbem import cli
from pbem.case.build import make_checked_model, read_checked_model
from pbem.case.case import Case
from pbem.case.changed import label_option
from pbem.case.overrides import read_options, read_overrides, write_overrides
from pbem.errors import CaseError, ConvergenceError, PbemError, StopError, is_control
from pbem.mesh.generate import generate_mesh
from pbem.results.describe import describe_results
from pbem.results.model_text import describe_model
from pbem.results.reader import Results
from pbem.solve.problem.step import SilentReporter, Step
from pbem.sweeps.outcome import list_quantity_names
from pbem.sweeps.quantities import read_quantities
from pbem.sweeps.values import check_combinations, check_values, read_values

ROOT = Path(__file__).resolve().parent.parent
PATIENCE = 60
NUMBERS = ["0", "-1", "1", "2", "0.5", "1e-300", "1e300", "-1e308", "inf", "nan", "1e99", "-0.0", "1e-12", "123456789",
           "9" * 400, "3.0", "1_000", "0x10"]
TEXTS = ['""', '"a"', '"\\u0000"', '"\\u001b[31m"', '"a/b"', '".."', '"\\n"', '"\\u202e"', '"x*y"', '"sin(x"',
         '"' + "a" * 3000 + '"', "'''\n'''",
         '"bonded"', '"custom"', '"x**x**x**9"', '"1/0"', '"$\\\\frac{$"', '"\\ud7ff"']
OTHERS = ["true", "[]", "{}", "[[]]", "[1]", "[1, 2]", "[[0, 0], [1, 1]]", "{ a = 1 }", "1979-05-27", "[nan, inf]",
          "{ expression = \"x\" }", "{ expression = 3 }", "[\"a\", \"a\"]", "[0, 0, 1, 1]", "[" * 60 + "]" * 60]
VALUE = re.compile(r"=\s*([^#\n{\[]+|\[.*\]|\{.*\})")
NUMBER = re.compile(r"(?<![\w.\"])-?\d+\.?\d*(?:e-?\d+)?(?![\w\"])")
WORD = re.compile(r"[A-Za-z_]\w+")


class HangError(Exception):
    """Raised by the alarm."""


@contextlib.contextmanager
def alarm(seconds: int) -> Iterator[None]:
    """Raise HangError in the block after so many seconds."""

    def ring(*_: object) -> None:
        raise HangError

    former = signal.signal(signal.SIGALRM, ring)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, former)


def read_seeds() -> list[str]:
    """The cases of the program that are checked fast, one after the other, and small ones that have what these lack."""
    texts = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "cases").glob("*.toml"))]
    return [text for text in texts if len(text) < 6000] + [SMALL]


SMALL = """\
title = "Everything"
units = { length = "m", stress = "kPa" }
[materials]
m = { young = 1000.0, poisson = 0.2, density = 2.0 }
n = { young = 2000.0, poisson = 0.1, plane = "stress" }
[curves]
bottom = { points = [[0, 0], [2, 0]], elements = 3 }
right = { points = [[2, 0], [2, 1]], elements = 2 }
top = { points = [[2, 1], [0, 1]], elements = [3] }
left = { points = [[0, 1], [0, 0]], size = 0.5 }
hole = { center = [0.5, 0.5], radius = 0.2, elements = 8 }
crack = { points = [[1, 0.3], [1.5, 0.6]], elements = 4, grading = "end", power = 2.0 }
wavy = { expression = ["1.0 + 0.5*t", "0.8 + 0.05*sin(2*pi*t)"], elements = 6 }
base = { points = [[0, -1], [2, -1]], elements = 3 }
side = { points = [[2, -1], [2, -0.5]], elements = 2 }
face = { points = [[2, -0.5], [0, -0.5]], elements = 3 }
wall = { points = [[0, -0.5], [0, -1]], elements = 2 }
[regions.body]
material = "m"
boundary = ["bottom", "right", "top", "left", "hole"]
cracks = ["crack", "wavy"]
[regions.foot]
material = "n"
boundary = ["base", "side", "face", "wall"]
[boundary]
base = { ux = 0.0, uy = 0.0 }
left = { un = 0.0, spring = { ks = 1.0 } }
[interfaces]
crack = { friction_angle = 20.0, cohesion = 0.1, gap = { expression = "0.001*x" } }
wavy = { friction = 0.3, pressure = 0.5, pressurised = "all", tangential_stiffness = 1e5 }
[contacts.seat]
between = ["bottom", "face"]
friction = 0.3
gap = 0.0
[gravity]
gy = -0.1
[initial_stress.m]
syy = -0.2
[[stages]]
name = "press"
steps = 2
[stages.boundary.top]
uy = -0.6
ux = 0.0
[[stages]]
name = "more"
[stages.interfaces.wavy]
pressure = 1.0
[analysis]
scheme = "SST"
order = 2
[solver]
linear = "auto"
min_step = 0.01
[petsc]
ksp_rtol = 1e-12
[output]
interior = { box = [0, 0, 2, 1], shape = [3, 3] }
points = [[0.3, 0.2]]
every = 2
"""

Change = Callable[[random.Random, str, list[str]], str]


def replace_value(chance: random.Random, text: str, seeds: list[str]) -> str:
    """A value by another of any kind."""
    found = list(VALUE.finditer(text))
    if not found:
        return text
    at = chance.choice(found)
    kind = chance.random()
    new = chance.choice(NUMBERS if kind < 0.4 else TEXTS if kind < 0.6 else OTHERS if kind < 0.8 else
                        [each[1] for each in VALUE.finditer(chance.choice(seeds))] or ["1"])
    return f"{text[: at.start()]}= {new}{text[at.end() :]}"


def replace_number(chance: random.Random, text: str, seeds: list[str]) -> str:
    """A number within a value."""
    found = list(NUMBER.finditer(text))
    if not found:
        return text
    at = chance.choice(found)
    scaled = f"{float(at[0]) * chance.choice([-1, 0, 0.5, 2, 1e-9, 1e9, 1 + 1e-9]):.17g}"
    new = chance.choice([*NUMBERS, scaled, scaled, scaled, chance.choice(found)[0]])
    return text[: at.start()] + new + text[at.end() :]


def replace_word(chance: random.Random, text: str, seeds: list[str]) -> str:
    """A name or key by another one."""
    found = list(WORD.finditer(text))
    if not found:
        return text
    at = chance.choice(found)
    new = chance.choice([chance.choice(found)[0], chance.choice(list(WORD.findall(chance.choice(seeds)))), at[0][:-1]])
    return text[: at.start()] + new + text[at.end() :]


def change_lines(chance: random.Random, text: str, seeds: list[str]) -> str:
    """Delete, repeat, move or add lines."""
    lines = text.splitlines()
    if not lines:
        return text
    at, other = chance.randrange(len(lines)), chance.randrange(len(lines))
    kind = chance.randrange(5)
    if kind == 0:
        del lines[at]
    elif kind == 1:
        lines.insert(other, lines[at])
    elif kind == 2:
        lines.insert(other, lines.pop(at))
    elif kind == 3:
        lines.insert(at, chance.choice(chance.choice(seeds).splitlines()))
    else:
        del lines[min(at, other) : max(at, other)]
    return "\n".join(lines) + "\n"


def change_characters(chance: random.Random, text: str, seeds: list[str]) -> str:
    """Delete, insert or repeat some characters."""
    at = chance.randrange(len(text) + 1)
    kind = chance.randrange(4)
    if kind == 0:
        return text[:at] + text[at + chance.randint(1, 5) :]
    if kind == 1:
        return text[:at] + chance.choice("[]{}\"'=.,#\n\\ \t-+eE0\0\x1b\u202e\ufeffä") + text[at:]
    if kind == 2:
        return text[:at] + text[max(0, at - 20) :]
    return text[:at] + ".".join(["a"] * chance.choice([5, 50, 3000])) + " = 1\n" + text[at:]


CHANGES: tuple[Change, ...] = (replace_value, replace_value, replace_number, replace_number, replace_word,
                               change_lines, change_characters)


def nudge_number(chance: random.Random, text: str, seeds: list[str]) -> str:
    """A number by one that is not far from it, or of other size: most mutants of this kind can be computed."""
    # Points that are moved alone mostly open a loop.
    fixed = [each.span() for each in re.finditer(r"points = .*\]\]", text)] if chance.random() < 0.8 else []
    found = [each for each in NUMBER.finditer(text) if not any(a <= each.start() < b for a, b in fixed)]
    if not found:
        return text
    at = chance.choice(found)
    value = float(at[0])
    changed = value * chance.choice([0.5, 0.9, 0.99, 1.01, 1.1, 1.5, 2, 3, -1, 1e-3, 1e3])
    whole = "." not in at[0] and chance.random() < 0.9 and abs(changed) < 1e300
    return text[: at.start()] + (str(round(changed)) if whole else f"{changed:.12g}") + text[at.end() :]


CHANGES_OF_RUNS = (*CHANGES, *[nudge_number] * 21)


def mutate(seed: int, number: int, seeds: list[str], changes: tuple[Change, ...] = CHANGES) -> str:
    """The mutant of this number."""
    chance = random.Random(f"{seed}/{number}")
    text = chance.choice(seeds)
    for _ in range(chance.choice([1, 1, 1, 2, 3, 6])):
        text = chance.choice(changes)(chance, text, seeds)
    return text


def check_case(text: str, folder: Path) -> bool:
    """What `pbem check` does; whether the case is accepted.

    Raises AssertionError if what it says would steer a terminal.
    """
    path = folder / "mutant.toml"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    accepted = True
    try:
        model = read_checked_model(path)
        said = describe_model(model, generate_mesh(model))
    except PbemError as error:
        accepted, said = False, str(error)
        assert said.count("\n  ") >= 1 and ": found " in said, f"a fault without its place: {said}"
    wrong = [f"U+{ord(each):04X}" for each in said if is_control(each) and each != "\n"]
    assert not wrong, f"control characters: {wrong}"
    return accepted


def describe_failure(error: BaseException) -> str:
    """Exception and the last place in the program."""
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "/pbem/" in frame.filename]
    place = f"{Path(frames[-1].filename).name}:{frames[-1].lineno} {frames[-1].name}" if frames else "?"
    return f"{type(error).__name__} at {place}: {str(error)[:120]!r}"


class Failures:
    """The kinds of failures that were found, each with the number of its first mutant."""

    def __init__(self) -> None:
        self.found: dict[str, tuple[str, int]] = {}
        self.count = 0

    def add(self, number: int, error: BaseException) -> None:
        """Keep it if its kind is new."""
        self.count += 1
        text = describe_failure(error)
        kind = text.split(":", 2)[0] + text.split(":", 2)[1] if ":" in text else text
        if kind not in self.found:
            self.found[kind] = (text, number)
            print(f"mutant {number}: {text}", flush=True)


def fuzz_cases(seed: int, numbers: range, failures: Failures) -> int:
    """Check so many mutants; returns how many were accepted."""
    seeds = read_seeds()
    accepted = 0
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("error")
        for number in numbers:
            text = mutate(seed, number, seeds)
            try:
                with alarm(PATIENCE):
                    accepted += check_case(text, Path(name))
            except Exception as error:
                failures.add(number, error)
    return accepted


KEY_PARTS = [*re.findall(r"\S+", """
    interfaces curves boundary stages regions materials analysis output contacts generate remote petsc solver units
    title initial_stress crack wavy seat top bottom m body press more joint 0 1 7 -1 * c* [ [!a]* ? friction elements
    size points young steps ux pressure gap expression box interior every order name law frction spring kn between
    friction_angle cracks = . '' '*' "" "t12.1"
"""), "\x1b[2J", " ", "a b", "9" * 30, "a" * 300, "\udc80"]  # fmt: skip
OBJECTS: list[object] = [
    None, 0, -1, 0.3, 2, True, float("nan"), float("inf"), 10**400, "x", "", "coulomb", "a\x00b", [], {}, [1, 2],
    [[0, 0], [1, 1]], (1, "a"), {1: 2}, {"a": {"b": 1}}, np.float64(0.5), np.array([1.0]), np.array("x"), object(),
    b"bytes", {1, 2}, Path("x"), range(3), 1j, Exception, "\udc80", 1e-320, {"expression": "x"}, [[[[[[[[1]]]]]]]],
]
QUANTITY_PARTS = [*re.findall(r"\S+", """
    reactions contact tips energy steps top bottom crack wavy seat x y moment slip opening traction_n status largest
    max mean open KI J start 0 elastic load_factor * c* ' "a.b" reaction joint_1 joint
"""), ""]  # fmt: skip
KNOWN_KEYS = ["interfaces.crack.cohesion", "interfaces.wavy.friction", "curves.*.elements", "stages.press.steps",
              "stages.0.boundary.top.uy", "materials.m.young", "analysis.order", "curves.crack.points.0.1",
              "contacts.seat.friction", "output.every", "curves.top.points", "interfaces.*", "materials.*.poisson"]


def make_key(chance: random.Random, parts: Sequence[str]) -> str:
    """Parts joined by dots, now and then wrongly."""
    text = ".".join(chance.choice(parts) for _ in range(chance.choice([1, 2, 3, 3, 3, 4, 5, 20])))
    return text + chance.choice(["", "", "", "", ".", " ", "x"])


def make_value(chance: random.Random) -> str:
    """A value of a file, or something like it."""
    text = chance.choice([*NUMBERS, *TEXTS, *OTHERS, "coulomb", "law.py", "a b", "", "0.1:0.9:3", "1:2:x", "1,2", "[1,",
                          "1\n2", "1979-05-27T07:32:00"])
    if chance.random() < 0.2:
        at = chance.randrange(len(text) + 1)
        text = text[:at] + chance.choice(["=", ",", '"', "'", "]", "{", "\\", "\0", "#", "\n"]) + text[at:]
    return text


def try_values(chance: random.Random, case: Case, path: Path) -> bool:
    """Set values by one of the ways; whether they were accepted. Raises anything but a CaseError with places."""
    keys = [chance.choice(KNOWN_KEYS) if chance.random() < 0.5 else make_key(chance, KEY_PARTS) for _ in range(2)]
    keys = keys[: chance.choice([1, 1, 2])]
    if chance.random() < 0.1:
        keys[0] = chance.choice(OBJECTS)  # type: ignore[call-overload]
    way = chance.randrange(4)
    try:
        if way == 0:
            texts = [f"{key}{chance.choice(['=', '=', '=', ''])}{make_value(chance)}" for key in keys]
            changes = read_options(texts)
            model = make_checked_model(path, changes, label_option)
            assert read_overrides(model.overrides).keys() == changes.keys()
            assert write_overrides(read_overrides(model.overrides)) == model.overrides
        elif way == 1:
            new = case.replace({key: chance.choice(OBJECTS) for key in keys if getattr(key, "__hash__", None)})
            new.write(path.with_name("new.toml"))
            assert Case.read(path.with_name("new.toml")) == new or "nan" in new.text
            assert repr(new) and new._repr_html_()
        elif way == 2:
            several = read_values(f"{key}={make_value(chance)},{make_value(chance)}" for key in keys)
            check_combinations(check_values(several))
        else:
            model = make_checked_model(case)
            names = list_quantity_names(model, generate_mesh(model))
            read_quantities([make_key(chance, QUANTITY_PARTS), "steps.number"], names, "-q ")
    except CaseError as error:
        assert str(error).count("\n  ") >= 1 and ": found " in str(error), f"a fault without its place: {error}"
        wrong = [each for each in str(error) if is_control(each) and each != "\n"]
        assert not wrong, f"control characters {wrong}"
        return False
    return True


def fuzz_values(seed: int, numbers: range, failures: Failures) -> int:
    """Set so many mutants of values; returns how many were accepted."""
    accepted = 0
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("error")
        path = Path(name) / "case.toml"
        path.write_text(SMALL, encoding="utf-8")
        case = Case.read(path)
        for number in numbers:
            try:
                with alarm(PATIENCE):
                    accepted += try_values(random.Random(f"{seed}/{number}"), case, path)
            except Exception as error:
                failures.add(number, error)
    return accepted



def damage(chance: random.Random, whole: bytes, other: bytes) -> bytes:
    """The file cut off, with other bits, bytes, pages, with pages of another file, or that one in its place."""
    data = bytearray(whole)
    if chance.random() < 0.05:
        return other
    if chance.random() < 0.3:
        del data[-chance.randint(1, 2000) :]
    for _ in range(chance.choice([1, 1, 2, 8])):
        at = chance.randrange(len(data))
        kind = chance.randrange(8)
        if kind == 0:
            data[at] ^= 1 << chance.randrange(8)
        elif kind == 1:
            data[at] = chance.choice([0, 255, 1, 128])
        elif kind == 2:
            length = chance.choice([8, 64, 512, 4096])
            data[at : at + length] = bytes(len(data[at : at + length]))
        elif kind == 3:
            there = chance.randrange(len(data))
            data[at : at + 512], data[there : there + 512] = data[there : there + 512], data[at : at + 512]
        elif kind == 4:
            del data[at : at + chance.randint(1, 100)]
        elif kind == 5:
            data[at:at] = bytes(chance.randint(1, 100))
        elif kind == 6:
            at, length = at - at % 4096, 4096 * chance.choice([1, 1, 4, 1000])
            data[at : at + length] = other[at : at + length]
        else:
            del data[chance.randrange(len(data)) :]
        if not data:
            break
    return bytes(data)


class Snapshot(SilentReporter):
    """Keeps the file as it is when a step of this number has been accepted: of a run that goes on."""

    def __init__(self, number: int, path: Path) -> None:
        self._number, self._path, self.data = number, path, b""

    def accept(self, step: Step) -> None:
        """Read the file, in which the steps before are."""
        if step.number == self._number:
            self.data = self._path.read_bytes()


class Interruption(SilentReporter):
    """Asks its own process to stop in the iteration of this number, as a batch system does."""

    def __init__(self, number: int) -> None:
        self._left = number

    def iterate(self, _: object) -> None:
        """Count."""
        self._left -= 1
        if self._left == 0:
            os.kill(os.getpid(), signal.SIGUSR1)


def expect_end(case: Path, path: Path, expected: Results) -> None:
    """Raise AssertionError if a run that goes on with the file ends with other numbers than these."""
    import pbem

    found = pbem.run(case, path, resume=True)
    for name in ("displacement", "traction"):
        values, right = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(values, right, rtol=0, atol=1e-9 * np.abs(right).max())


def expect_prefix(path: Path, expected: Sequence[Results]) -> None:
    """Raise AssertionError if the file has other numbers than one of these, or than its first steps.

    Files without checksums, as other programs leave them, are not compared. Raises ResultFileError if it is damaged.
    """
    from pbem.results.reader import open_results
    from pbem.results.tail import read_tail

    found = open_results(path)
    with path.open("rb") as disk:
        if read_tail(disk.fileno()) is None:
            return
    whole = next(each for each in expected if each.case == found.case)
    k = len(found.steps)
    for name in ("displacement", "traction", "hoop_stress"):
        np.testing.assert_array_equal(getattr(found, name), getattr(whole, name)[:k])
    for name in ("slip", "traction_n", "mode", "opening"):
        np.testing.assert_array_equal(getattr(found.contact["seat"], name), getattr(whole.contact["seat"], name)[:k])
    np.testing.assert_array_equal(found.energy.elastic, whole.energy.elastic[:k])


def use_results(path: Path, draw: bool, expected: Sequence[Results], resume: Callable[[], object]) -> None:
    """Read, describe, draw, resume: each may say that the file is damaged."""
    from pbem.results.plots import plot_results
    from pbem.results.reader import open_results

    with contextlib.suppress(PbemError):
        results = open_results(path)
        describe_results(results)
        if draw:
            plot_results(results, path.with_suffix(".png"))
    with contextlib.suppress(PbemError):
        expect_prefix(path, expected)
    with contextlib.suppress(PbemError):
        resume()


def in_child(action: Callable[[], None]) -> BaseException | None:
    """Run the action in a process of its own; what it raised, or how the process ended, None if all was well."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reader)
        code = 0
        # Both end the process, also within HDF5: by its own time, and if it waits for something.
        for number, timer, seconds in ((signal.SIGPROF, signal.ITIMER_PROF, PATIENCE),
                                       (signal.SIGALRM, signal.ITIMER_REAL, 10 * PATIENCE)):
            signal.signal(number, signal.SIG_DFL)
            signal.setitimer(timer, seconds)
        try:
            action()
        except BaseException as error:
            os.write(writer, describe_failure(error).encode()[:4000])
            code = 1
        os._exit(code)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        said = pipe.read().decode(errors="replace")
    _, status = os.waitpid(child, 0)
    if status == 0:
        return None
    return RuntimeError(said if said else f"the process ended with status {status}")


def fuzz_results(seed: int, numbers: range, failures: Failures) -> int:
    """Use so many damaged files; returns how many were used. None may give other numbers than those written."""
    import pbem
    from pbem.results.writer import ResultWriter

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        case, another = folder / "case.toml", folder / "another.toml"
        # All steps are stored: what a run that was stopped has stored besides would remain in the file.
        text = SMALL.replace('name = "more"', 'name = "more"\nsteps = 2').replace("every = 2\n", "")
        case.write_text(text, encoding="utf-8")
        another.write_text(SMALL.replace("uy = -0.6", "uy = -0.5"), encoding="utf-8")
        snapshot = Snapshot(3, folder / "whole.h5")
        expected = (pbem.run(case, folder / "whole.h5", reporter=snapshot), pbem.run(another, folder / "another.h5"))
        for each in expected:  # loaded here, once for all processes
            assert len(each.displacement) == len(each.traction) == len(each.hoop_stress)
            assert len(each.displacement) == len(each.contact["seat"].slip)
        model = read_checked_model(case)
        mesh = generate_mesh(model)
        with contextlib.suppress(StopError):
            pbem.run(case, folder / "stopped.h5", reporter=Interruption(4))
        stopped = (folder / "stopped.h5").read_bytes()
        with h5py.File(folder / "stopped.h5") as file:
            assert "search" in file["unfinished"]
        files = (folder / "whole.h5").read_bytes(), snapshot.data, stopped
        other = (folder / "another.h5").read_bytes()
        path = folder / "mutant.h5"
        for number in numbers:
            chance = random.Random(f"{seed}/{number}")
            begun = chance.choice(files)
            path.write_bytes(damage(chance, begun, other))

            def resume(goes_on: bool = begun is stopped) -> None:
                if goes_on:
                    expect_end(case, path, expected[0])
                    return
                ResultWriter.resume(path, model, mesh, 1, "", (), np.zeros(len(model.interior_points), int)).finish()
                expect_prefix(path, expected[:1])

            error = in_child(partial(use_results, path, chance.random() < 0.03, expected, resume))
            if error is not None:
                failures.add(number, error)
    return len(numbers)


def make_command(chance: random.Random) -> list[str]:
    """A command line of right and wrong pieces, which computes nothing."""
    files = ["case.toml", "none.toml", "a.h5", "none.h5", ".", "", "case.toml/x", "\x1b[31m.toml", "a" * 300, "-", "--",
             "law.py", "\udc80.h5", "/dev/null", "/proc/x.h5", "two_blocks", "b.png", "b.pdf", "x\ny"]
    options = ["--plot", "-o", "--output", "--step", "--field", "--magnify", "--resume", "--force", "--quiet", "--help",
               "--version", "--operator", "--count", "--seed", "--name", "--half-length", "--plate", "-pbem_ksp_rtol",
               "-pbem_", "-pbem_ksp_view=", "--nonsense", "-x", "--young", "--poisson", "--distance", "--density",
               "--explicit", "--orientation", "--exponent", "--largest", "--distribution", "--shape", "--steps"]
    values = ["1", "0", "-1", "nan", "inf", "1e300", "ux", "mises", "dense", "abc", "", "\x1b[2J", "1e-300",
              "99999999999", "power", "lognormal", "square", "uniform", "90", "a\"b\\c", "a b", "ä"]
    command = chance.choice(["check", "info", "plot", "plot", "make", "make", "chek", "", "run"])
    rest = [chance.choice(["cracks", "inclusions"]), "-o", "made.toml", "--count", chance.choice(["1", "5", "0", "x"])]
    parts = rest if command == "make" else [chance.choice([*files, "case.toml", "a.h5", "a.h5"])]
    for _ in range(chance.choice([0, 1, 2, 3, 4])):
        parts.append(chance.choice(options))
        if chance.random() < 0.7:
            parts.append(chance.choice(values + files))
    if command == "run":  # nothing is to be computed here
        parts = [part for part in parts if part not in ("case.toml", "two_blocks", "--resume")] + ["--nonsense"]
    return [command, *parts]


def fuzz_commands(seed: int, numbers: range, failures: Failures) -> int:
    """Try so many command lines; returns how many went well."""
    import pbem

    accepted, here = 0, Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        os.chdir(name)
        try:
            Path("case.toml").write_text(SMALL, encoding="utf-8")
            Path("law.py").write_text("import sys; sys.exit(0)")
            pbem.run("case.toml", "a.h5")
            for number in numbers:
                arguments = make_command(random.Random(f"{seed}/{number}"))
                Path("made.toml").unlink(missing_ok=True)
                out, err = io.StringIO(), io.StringIO()
                try:
                    with alarm(PATIENCE), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                        code = cli.main(arguments)
                    said = out.getvalue() + err.getvalue()
                    assert "Traceback" not in said, f"{arguments}: {said[-300:]}"
                    assert code in (0, 2), f"{arguments}: exit code {code}"
                    wrong = [each for each in said if is_control(each) and each != "\n"]
                    assert not wrong, f"{arguments}: control characters {wrong}"
                    accepted += code == 0
                except (Exception, SystemExit) as error:
                    failures.add(number, error)
        finally:
            os.chdir(here)
    return accepted


MOST_NODES, MOST_STEPS = 800, 40
OUT_OF_BALANCE = 1e-2
DIFFERENCE_OF_RANKS = 1e-6


def read_run_seeds() -> list[str]:
    """Small cases with one of each kind of thing, of few nodes and steps, that are run."""
    return [path.read_text(encoding="utf-8") for path in sorted((ROOT / "scripts" / "fuzz_seeds").glob("*.toml"))]


class Notes(SilentReporter):
    """Keeps what a run notes."""

    def __init__(self) -> None:
        self.texts: list[str] = []

    def note(self, text: str) -> None:
        """Keep it."""
        self.texts.append(text)


def compute_case(path: Path) -> str:
    """Run the case; how it ended: "finished", or the reason.

    Raises AssertionError if what it finished with holds values that are not numbers, or forces that do not balance
    without a note that says so.
    """
    import pbem

    notes = Notes()
    try:
        results = pbem.run(path, path.with_suffix(".h5"), force=True, reporter=notes)
    except CaseError as error:
        assert str(error).count("\n  ") >= 1 and ": found " in str(error), f"a fault without its place: {error}"
        return "refused"
    except ConvergenceError as error:
        assert error.detail, f"{error.reason} without a word"
        return error.reason
    except PbemError as error:
        return type(error).__name__
    expect_numbers(results)
    noted = any("balance" in text for text in notes.texts)
    balance = results.balance
    assert balance is not None
    worst = max(float(np.max(each, initial=0.0)) for each in (balance.relative, balance.whole_relative))
    assert noted or worst <= OUT_OF_BALANCE, f"out of balance by {worst:.1e} without a note"
    return "finished"


def expect_numbers(results: Results) -> None:
    """Raise AssertionError where a result is not a number; but for factors at ends that are no tips, and estimates.

    Regions that a stage has taken away have no displacement and no traction, and interfaces with them no jump.
    """
    steps = len(results.steps)
    gone = np.array([results.find_gone(step) for step in range(steps)]).reshape(steps, -1)
    names = results.nodes.region_names
    known: dict[str, Any] = dict.fromkeys(("displacement", "traction", "hoop stress"), ~gone[:, results.nodes.region])
    values = {
        "displacement": results.displacement, "traction": results.traction, "hoop stress": results.hoop_stress,
        "residual": results.steps.residual,
        **{f"reaction of {name}": each for name, each in results.reactions.items()},
        **{f"energy {name}": getattr(results.energy, name) for name in vars(results.energy)},
    }  # fmt: skip
    for name, contact in results.contact.items():
        values |= {f"{what} of {name}": getattr(contact, what)
                   for what in ("opening", "slip", "traction_n", "traction_s")}
        ends = [names.index(each) for each in (contact.first, contact.second) if each in names]
        there = ~gone[:, ends].any(axis=1)
        known |= {f"{what} of {name}": there for what in ("opening", "slip")}
    if results.interior is not None:
        inside = results.interior.region >= 0
        there = ~gone[:, results.interior.region] & inside
        values |= {"stress inside": results.interior.stress, "displacement inside": results.interior.displacement}
        known |= {"stress inside": there, "displacement inside": there}
    if results.balance is not None:
        values["balance"] = results.balance.relative
    for name, each in values.items():
        assert np.isfinite(each[known.get(name, ...)]).all(), f"{name} is not a number"
    for name, tips in results.tips.items():
        told = np.isfinite(tips.KI)
        assert (told >= told[-1:]).all() and not np.isinf(tips.KI).any(), f"K of {name} is a number now and then"


def fuzz_runs(seed: int, numbers: range, failures: Failures, records: Path | None = None) -> int:
    """Run so many mutants; returns how many were finished. How the others ended is printed, and added to a file."""
    import pbem  # so that each process need not

    assert pbem.run
    seeds = read_run_seeds()
    ends: collections.Counter[str] = collections.Counter()
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("error")
        path = Path(name) / "mutant.toml"
        number = numbers.start
        while sum(ends.values()) < len(numbers):
            path.write_text(mutate(seed, number, seeds, CHANGES_OF_RUNS), encoding="utf-8", errors="surrogatepass")
            end = Path(name) / "end"
            end.unlink(missing_ok=True)

            def compute(end: Path = end) -> None:
                end.write_text("too large" if is_too_large(path) else compute_case(path))

            error = in_child(compute)
            ending = "failure" if error is not None else end.read_text()
            if error is not None:
                failures.add(number, error)
            if records is not None:
                with records.open("a") as file:
                    file.write(f"{seed} {number} {ending if error is None else describe_failure(error)}\n")
            if ending != "too large" or len(numbers) == 1:
                ends[ending] += 1
            number += 1
    print(", ".join(f"{ending} {count}" for ending, count in ends.most_common()))
    return ends["finished"]


def compare_ranks(path: Path) -> str:
    """Run the case on one rank and on two; how it ended, "refused" if there was nothing to be run.

    Raises AssertionError if two ranks end in another way, find other statuses or iterations, or other values.
    """
    import pbem
    from tests.parallel.launch import launch

    ends, found = [], []
    for ranks in (1, 2):
        target = path.with_name(f"{ranks}.h5")
        target.unlink(missing_ok=True)
        done = launch(ranks, "run", path, "-o", target, "--force", timeout=10 * PATIENCE)
        assert "Traceback" not in done.stderr, done.stderr[-1000:]
        reason = re.search(r"not converged: ([\w ]+)", done.stderr)
        ends.append((done.returncode, reason[1] if reason else ""))
        if done.returncode == 2:
            return "refused"
        found.append(pbem.open_results(target) if target.exists() else None)
    assert ends[0] == ends[1], f"one rank ends with {ends[0]}, two with {ends[1]}"
    one, two = found
    if one is not None and two is not None:
        assert len(one.steps) == len(two.steps), f"{len(one.steps)} steps on one rank, {len(two.steps)} on two"
        assert np.array_equal(one.steps.iterations, two.steps.iterations), "other iterations"
        for name, contact in one.contact.items():
            assert np.array_equal(contact.mode, two.contact[name].mode), f"other statuses of {name}"
        for name in ("displacement", "traction"):
            mine, yours = (np.nan_to_num(getattr(each, name), nan=1e300) for each in (one, two))  # of what is removed
            off = float(np.abs(mine - yours).max(initial=0.0)) / max(float(np.abs(mine).max(initial=0.0)), 1e-300)
            assert off < DIFFERENCE_OF_RANKS, f"{name} differs by {off:.1e}"
    return ends[0][1] or "finished"


def fuzz_ranks(seed: int, numbers: range, failures: Failures) -> int:
    """Run so many mutants on one rank and on two; returns how many were finished. Refused ones are not counted."""
    sys.path.insert(0, str(ROOT))
    seeds = read_run_seeds()
    ends: collections.Counter[str] = collections.Counter()
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "mutant.toml"
        number = numbers.start
        while sum(ends.values()) < len(numbers):
            path.write_text(mutate(seed, number, seeds, CHANGES_OF_RUNS), encoding="utf-8", errors="surrogatepass")
            ending = "refused"
            if is_right(path) and not is_too_large(path):
                try:
                    ending = compare_ranks(path)
                except (Exception, pytest_failure()) as error:
                    failures.add(number, error)
                    ending = "failure"
            if ending != "refused" or len(numbers) == 1:
                ends[ending] += 1
            number += 1
    print(", ".join(f"{ending} {count}" for ending, count in ends.most_common()))
    return ends["finished"]


def pytest_failure() -> type[BaseException]:
    """What a launch raises that did not end in its time."""
    import pytest

    return pytest.fail.Exception


def is_right(path: Path) -> bool:
    """Whether the case is accepted."""
    try:
        read_checked_model(path)
    except PbemError:
        return False
    return True


def is_too_large(path: Path) -> bool:
    """Whether a case that is right takes too long to be computed a thousand times."""
    try:
        model = read_checked_model(path)
        nodes = generate_mesh(model).nodes
    except PbemError:
        return False
    return nodes > MOST_NODES or sum(stage.steps for stage in model.stages) > MOST_STEPS


KINDS: dict[str, Callable[[int, range, Failures], int]] = {
    "cases": fuzz_cases, "values": fuzz_values, "results": fuzz_results, "commands": fuzz_commands, "runs": fuzz_runs,
    "ranks": fuzz_ranks,
}


def fuzz(kind: str, count: int, seed: int, only: int | None = None, records: Path | None = None,
         first: int = 0) -> tuple[int, Failures]:
    """Mutants of one kind; how many were accepted, and what failed."""
    os.environ.setdefault("MPLBACKEND", "Agg")
    failures = Failures()
    numbers = range(first, first + count) if only is None else range(only, only + 1)
    action = KINDS[kind] if records is None else partial(fuzz_runs, records=records)
    return action(seed, numbers, failures), failures


def main() -> int:
    """The script; returns its exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kind", choices=KINDS)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="number of one mutant; of cases and runs, its text is printed")
    parser.add_argument("--first", type=int, default=0, help="number of the first mutant")
    parser.add_argument("--records", type=Path, help="of runs: a file to which a line is added for each")
    options = parser.parse_args()
    if options.only is not None and options.kind in ("cases", "runs", "ranks"):
        print(mutate(options.seed, options.only, read_seeds()) if options.kind == "cases" else
              mutate(options.seed, options.only, read_run_seeds(), CHANGES_OF_RUNS))
    records = options.records if options.kind == "runs" else None
    accepted, failures = fuzz(options.kind, options.count, options.seed, options.only, records, options.first)
    print(f"{options.kind}: {options.count} mutants, {accepted} accepted, {failures.count} failures of "
          f"{len(failures.found)} kinds")
    return 1 if failures.count else 0


if __name__ == "__main__":
    sys.exit(main())
