"""Friction laws from users' Python files: what they are given cannot be changed, and what they answer is checked.

On several ranks a law that fails on one of them must not leave the others waiting. So a `CustomLaw` does not raise: it
keeps what went wrong and answers with no strength, until all ranks ask together (`pbem.solve.launch.watch`).
"""

from __future__ import annotations

import math
import os
import posix
import sys
import types
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pbem.arrays import Real
from pbem.contact.declaration import FrictionLaw, Slide
from pbem.contact.friction_bound import Strength
from pbem.errors import StopError

PARTS = ("bound", "by_traction", "by_slip")
# Products of two parts have to be numbers.
LARGEST = math.sqrt(sys.float_info.max)
# So many characters are told of what a law says itself when it fails.
MOST_TOLD = 300
# Calls that end the process at once, or put another program in its place: nobody would learn that it had not finished.
ENDING = ("_exit", "execv", "execve")
EXPECTED = "a Strength of bound, by_traction and by_slip, finite arrays with the shape of p_n"


class CustomLaw(FrictionLaw):
    """The function `strength` of a file, asked as any law.

    file: its path; text: its contents, which are run once. fault: what went wrong at the first call that failed, a
    sentence that names the file, "" if none did. sums (6,): weighted sums of the parts of all answers since they were
    set to zero, and of their sizes, to compare with other ranks.
    """

    def __init__(self, file: str, text: str) -> None:
        """A file that does not run, or has no such function, is a fault from the beginning."""
        self.file = file
        self.fault = ""
        self.sums = np.zeros(6)
        self._function: Any = None
        with self._noting_what_fails(), _kept_surroundings():
            self._function = _run(file, text).get("strength")
        if not self.fault and not callable(self._function):
            self.fault = f"the law {file} defines no function named strength; expected {EXPECTED}"

    def strength(self, p_n: Real, slide: Slide, /, **parameters: Real) -> Strength:
        """As of any law, at the slip path so far; of one that fails, zeros (see `fault`)."""
        return self(p_n, slide.path, **parameters)

    def __call__(self, p_n: Real, slip: Real, **parameters: Real) -> Strength:
        """At a slip path (k,)."""
        answer = None if self.fault else self._ask(p_n, slip, parameters)
        if answer is None:
            nothing = np.zeros_like(p_n)
            return Strength(nothing, nothing, nothing)
        parts = np.array([getattr(answer, part) for part in PARTS])
        weight = 1.5 + np.cos(np.arange(len(p_n)))
        self.sums += np.concatenate([parts @ weight, np.abs(parts) @ weight])
        return answer

    def _ask(self, p_n: Real, slip: Real, parameters: Mapping[str, Real]) -> Strength | None:
        parts: dict[str, Real] = {}
        with self._noting_what_fails(), _kept_surroundings():
            answer = self._function(_protect(p_n), _protect(slip),
                                    **{name: _protect(values) for name, values in parameters.items()})
            parts = {name: _read_part(getattr(answer, name)) for name in PARTS}
        if self.fault:
            return None
        for name, values in parts.items():
            wrong = _judge(name, values, p_n, slip)
            if wrong:
                self.fault = f"the law {self.file} {wrong}; expected {EXPECTED}"
                return None
        return Strength(**parts)

    @contextmanager
    def _noting_what_fails(self) -> Iterator[None]:
        """A user's file may raise anything; what stops the run is none of its faults."""
        try:
            yield
        except (StopError, KeyboardInterrupt):
            raise
        except BaseException as error:
            self.fault = f"the law {self.file} fails ({_describe(error)}); expected {EXPECTED}"


def _describe(error: BaseException) -> str:
    try:
        text = " ".join(str(error).split())
    except Exception:  # errors of one's own may fail to say what they are
        text = "it cannot be told"
    return f"{type(error).__name__}: {text if len(text) <= MOST_TOLD else text[:MOST_TOLD].rstrip() + ' ...'}"


@contextmanager
def _kept_surroundings() -> Iterator[None]:
    """What a file may change for the whole program is set back: NumPy's errors, filters of warnings, the directory."""
    folder, filters = _find_folder(), list(warnings.filters)
    try:
        with np.errstate(), _kept_running():
            yield
    finally:
        if folder is not None and _find_folder() != folder:
            os.chdir(folder)
        if warnings.filters != filters:  # `catch_warnings` would make each warning be told again at each call
            warnings.filters[:] = filters  # type: ignore[index]


@contextmanager
def _kept_running() -> Iterator[None]:
    """Within it calls that end this process at once raise SystemExit, as sys.exit does; its children may end."""
    before = [(module, name, getattr(module, name)) for module in (os, posix) for name in ENDING]
    for module, name, ends in before:
        setattr(module, name, _make_refusal(name, ends, os.getpid()))
    try:
        yield
    finally:
        for module, name, ends in before:
            setattr(module, name, ends)


def _make_refusal(name: str, ends: Callable[..., Any], process: int) -> Callable[..., Any]:
    def refuse(*given: Any, **named: Any) -> Any:
        if os.getpid() != process:
            return ends(*given, **named)
        raise SystemExit(f"os.{name}({', '.join(map(repr, given))})")

    return refuse


def _find_folder() -> str | None:
    """The directory of the process; None if it is no longer there."""
    try:
        return os.getcwd()
    except OSError:
        return None


def _run(file: str, text: str) -> dict[str, Any]:
    module = types.ModuleType(Path(file).stem)
    module.__file__ = file
    exec(compile(text, file, "exec"), module.__dict__)
    return module.__dict__


def _protect(values: Real) -> Real:
    """The same values, read-only, in an array of their own."""
    own = np.array(values, dtype=float)
    own.setflags(write=False)
    return own


def _read_part(values: Any) -> Real:
    if np.iscomplexobj(values):
        raise TypeError("complex numbers")
    return np.array(values, dtype=float)


def _judge(name: str, values: Real, p_n: Real, slip: Real) -> str:
    if values.shape != p_n.shape:
        return f"gives a {name} of shape {values.shape} for a p_n of shape {p_n.shape}"
    wrong = np.flatnonzero(~(np.abs(values) < LARGEST))
    if len(wrong):
        first = wrong[0]
        return f"gives {name} = {values[first]:g} at p_n = {p_n[first]:.6g} and slip = {slip[first]:.6g}"
    return ""


def read_law_texts(files: Iterable[str | None]) -> dict[str, str]:
    """The contents of law files, by path. Raises OSError or ValueError if one is no text."""
    return {file: Path(file).read_text(encoding="utf-8") for file in dict.fromkeys(files) if file is not None}


@contextmanager
def asked_by_one_rank(laws: Iterable[FrictionLaw]) -> Iterator[None]:
    """Within it what laws answer is not compared with other ranks, which do not ask."""
    custom = [law for law in laws if isinstance(law, CustomLaw)]
    before = [law.sums.copy() for law in custom]
    try:
        yield
    finally:
        for law, sums in zip(custom, before, strict=True):
            law.sums[:] = sums


def find_fault(laws: Iterable[FrictionLaw]) -> str:
    """What went wrong in a custom law, if it did; else ""."""
    return next((law.fault for law in laws if isinstance(law, CustomLaw) and law.fault), "")
