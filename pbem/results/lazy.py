"""The parts of a result file that are loaded on first access."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from pbem.arrays import Integer, Real
from pbem.results.contents import Elements
from pbem.results.opening import freeze, open_quietly
from pbem.results.pair_weights import find_nodes, weigh_pairs, weigh_values
from pbem.results.trace_names import list_pieces, number_piece
from pbem.wording import suggest

INTEGRABLE = ("opening", "slip", "traction_n", "traction_s")


@dataclass(frozen=True)
class Contact:
    """One interface or crack with its m pairs over the k stored steps.

    position, normal (m, 2), arc_length (m,); mode (k, m): 0 stick, 1 slip, 2 open; opening, slip (k, m): lengths;
    traction_n, traction_s (k, m): traction on the first side, compression negative. Loaded on first access.
    first, second: names of the regions (second is None for a crack). law: its attributes in the file.
    """

    path: Path
    name: str
    first: str
    second: str | None
    law: Mapping[str, Any]
    steps: int
    pairs: int

    @cached_property
    def _arrays(self) -> dict[str, NDArray[Any]]:
        with open_quietly(self.path) as file:
            group = file["contact"][self.name]
            fixed = ("position", "normal", "arc_length")
            return {name: freeze(data[...] if name in fixed else data[: self.steps]) for name, data in group.items()}

    @property
    def position(self) -> Real:
        return self._arrays["position"]

    @property
    def normal(self) -> Real:
        return self._arrays["normal"]

    @property
    def arc_length(self) -> Real:
        return self._arrays["arc_length"]

    @property
    def mode(self) -> NDArray[np.int8]:
        return self._arrays["mode"]

    @property
    def opening(self) -> Real:
        return self._arrays["opening"]

    @property
    def slip(self) -> Real:
        return self._arrays["slip"]

    @property
    def traction_n(self) -> Real:
        return self._arrays["traction_n"]

    @property
    def traction_s(self) -> Real:
        return self._arrays["traction_s"]

    def integrate(self, quantity: str) -> Real:
        """(k,): integral of opening, slip, traction_n or traction_s over the curve.

        Uses the quadrature of the elements; next to crack tips slip and opening, but for a gap, have the square-root
        shape. On a curved contact the component is integrated, which does not give a force. Raises ValueError for an
        unknown quantity.
        """
        if not isinstance(quantity, str) or quantity not in INTEGRABLE:
            raise ValueError(f"found {quantity!r}{suggest(str(quantity), INTEGRABLE)}; expected one of: "
                             f"{', '.join(INTEGRABLE)}")
        return weigh_values(quantity, getattr(self, quantity), self.gap, self._weights).sum(axis=-1)

    @cached_property
    def gap(self) -> Real:
        """Length (m,): the part of the opening that is there without displacements; 0 in files of earlier versions."""
        with open_quietly(self.path) as file:
            return freeze(self._find_gap(file))

    def _find_gap(self, file: h5py.File) -> Real:
        stored = self._select(file, "gap")
        return np.zeros(len(self.arc_length)) if stored is None else np.asarray(stored)

    @cached_property
    def _weights(self) -> tuple[Real, Real]:
        with open_quietly(self.path) as file:
            nodes = file["nodes"]
            position = nodes["position"][...]
            node = self._find_nodes(file, position)
            return weigh_pairs(_read_elements(file), position, int(nodes.attrs["order"]), node)

    def _find_nodes(self, file: h5py.File, position: Real) -> Integer:
        """The nodes (m,) that the pairs belong to."""
        stored = self._select(file, "node")
        return find_nodes(position, self.position) if stored is None else np.asarray(stored, dtype=np.int64)

    def _select(self, file: h5py.File, name: str) -> NDArray[Any] | None:
        """Of what is stored for all pairs under a name what belongs to this one's (m,); None in files without it."""
        together = file["all/contact"]
        if name not in together:
            return None
        number = [str(each) for each in file["contact"].attrs["names"]].index(self.name)
        return np.asarray(together[name][...][together["interface"][...] == number])

    @property
    def internal(self) -> Mapping[str, Real]:
        """The internal variables (k, m) that the law declares, by name."""
        known = ("position", "normal", "arc_length", "mode", "opening", "slip", "traction_n", "traction_s")
        return {name: values for name, values in self._arrays.items() if name not in known}


@dataclass(frozen=True)
class JoinedContact(Contact):
    """A trace that was cut at crossings or by hand: its pieces in order along it, one after the other.

    arc_length continues from piece to piece, from the start of the first; law: attributes common to all pieces;
    otherwise as for one crack, with the internal variables that all pieces have.
    """

    pieces: tuple[Contact, ...] = ()

    @cached_property
    def _arrays(self) -> dict[str, NDArray[Any]]:
        parts = [dict(piece._arrays) for piece in self.pieces]
        for part, start in zip(parts, self.starts, strict=True):
            part["arc_length"] = part["arc_length"] + start
        shared = [name for name in parts[0] if all(name in part for part in parts)]
        axis = {name: 0 if name in ("position", "normal", "arc_length") else 1 for name in shared}
        return {name: freeze(np.concatenate([part[name] for part in parts], axis=axis[name])) for name in shared}

    def _find_nodes(self, file: h5py.File, position: Real) -> Integer:
        return np.concatenate([piece._find_nodes(file, position) for piece in self.pieces])

    def _find_gap(self, file: h5py.File) -> Real:
        return np.concatenate([piece._find_gap(file) for piece in self.pieces])

    @cached_property
    def starts(self) -> list[float]:
        """The arc length of the trace at the start of each piece; what lies between two pieces counts."""
        with open_quietly(self.path) as file:
            elements = _read_elements(file)
            names = [str(name) for name in file["nodes/curve"].attrs["names"]]
        starts, reached, last = [], 0.0, None
        for piece in self.pieces:
            own = elements.curve == names.index(piece.name)
            own &= elements.region == elements.region[own][0]
            # Of a crack the elements of the first face come first.
            chosen = np.flatnonzero(own)
            if piece.second is None:
                chosen = chosen[: len(chosen) // 2]
            begin, end = elements.vertices[chosen[0], 0], elements.vertices[chosen[-1], 1]
            if last is not None:
                # A region travels along some of its curves against their direction.
                begin, end = (begin, end) if _measure(begin - last) <= _measure(end - last) else (end, begin)
                reached += _measure(begin - last)
            starts.append(reached)
            reached, last = reached + float(elements.geometry.select(chosen).lengths.sum()), end
        return starts


@dataclass(frozen=True)
class InteriorPoints:
    """The q interior points: position (q, 2); region (q,), index into `Nodes.region_names`, -1 outside of all.

    displacement (k, q, 2), stress (k, q, 3): sxx, syy, sxy, NaN outside of all regions; loaded at first use.
    """

    path: Path
    position: Real
    region: Integer
    steps: int

    @cached_property
    def displacement(self) -> Real:
        return self._load("displacement")

    @cached_property
    def stress(self) -> Real:
        return self._load("stress")

    def _load(self, name: str) -> Real:
        with open_quietly(self.path) as file:
            return freeze(file["interior"][name][: self.steps])


@dataclass(frozen=True)
class AllPairs:
    """The m pairs of all interfaces, one interface of `names` after the other; `steps` are stored.

    For what looks at all of them: to open thousands of interfaces one by one takes long.
    """

    path: Path
    names: tuple[str, ...]
    steps: int

    @property
    def count(self) -> int:
        return len(self.interface)

    @cached_property
    def interface(self) -> Integer:
        """(m,): place in `names`, rising."""
        return freeze(self._load("interface").astype(np.int64))

    @cached_property
    def position(self) -> Real:
        """(m, 2)."""
        return self._load("position")

    @cached_property
    def normal(self) -> Real:
        """(m, 2)."""
        return self._load("normal")

    @cached_property
    def arc_length(self) -> Real:
        """(m,)."""
        return self._load("arc_length")

    @cached_property
    def node(self) -> Integer:
        """(m,): the node of each pair, of either of its sides, where its tractions are those of the contact."""
        with open_quietly(self.path) as file:
            together = file["all/contact"]
            if "node" not in together:
                return freeze(find_nodes(file["nodes/position"][...], self.position))
            return freeze(together["node"][...].astype(np.int64))

    @cached_property
    def gap(self) -> Real:
        """Length (m,): the part of the opening that is there without displacements; 0 in files of earlier versions."""
        with open_quietly(self.path) as file:
            together = file["all/contact"]
            return freeze(together["gap"][...] if "gap" in together else np.zeros(len(together["interface"])))

    @cached_property
    def laws(self) -> tuple[str, ...]:
        """The kind of law of every interface."""
        with open_quietly(self.path) as file:
            return tuple(str(law) for law in file["contact"].attrs["laws"])

    def at(self, quantity: str, step: int) -> NDArray[Any]:
        """(m,): mode, opening, slip, traction_n or traction_s at one stored step (its place in the file)."""
        if not self.names:
            return np.zeros(0)
        with open_quietly(self.path) as file:
            return freeze(file["all/contact"][quantity][range(self.steps)[step]])

    def _load(self, name: str) -> NDArray[Any]:
        with open_quietly(self.path) as file:
            return freeze(file["all/contact"][name][...])


class Interfaces(Mapping[str, Contact]):
    """The interfaces by name; each is looked up in the file when it is first asked for.

    The name of a trace that was cut into pieces (`t12` of `t12.1`, `t12.2`, ...) gives all of them as one, as if it
    were there; the names that are listed, counted and asked for with `in` are those of the pieces.
    """

    def __init__(self, path: Path, names: tuple[str, ...], steps: int, traces: Mapping[str, str]) -> None:
        """traces: the trace of each, which is itself where it is no piece."""
        self._path = path
        self.traces = traces
        self._names = dict.fromkeys(names)
        self._steps = steps
        self._found: dict[str, Contact] = {}

    def __getitem__(self, name: str) -> Contact:
        if not isinstance(name, str):
            raise KeyError(f"{name!r}: expected the name of an interface, crack or contact")
        if name not in self._found:
            self._found[name] = self._look_up(name) if name in self._names else self._join(name)
        return self._found[name]

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def _look_up(self, name: str) -> Contact:
        with open_quietly(self._path) as file:
            return _read_contact(self._path, file, name, self._steps)

    def _join(self, trace: str) -> JoinedContact:
        names = sorted(list_pieces(trace, self._names, self.traces), key=number_piece)
        if not names:
            raise KeyError(trace)
        pieces = tuple(self[name] for name in names)
        first = pieces[0]
        law = {key: value for key, value in first.law.items()
               if all(key in piece.law and np.array_equal(piece.law[key], value) for piece in pieces)}
        return JoinedContact(
            path=self._path, name=trace, first=first.first, second=first.second, law=law, steps=self._steps,
            pairs=sum(piece.pairs for piece in pieces), pieces=pieces,
        )

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def _measure(offset: Real) -> float:
    return float(np.hypot(*offset))


def _read_elements(file: h5py.File) -> Elements:
    stored = file["elements"]
    return Elements(
        vertices=stored["vertices"][...], sweep=stored["sweep"][...], region=stored["region"][...],
        curve=stored["curve"][...], crack=stored["crack"][...].astype(bool), tip=stored["tip"][...],
    )


def _read_contact(path: Path, file: h5py.File, name: str, steps: int) -> Contact:
    group = file["contact"][name]
    law = {key: value for key, value in group.attrs.items() if key not in ("first", "second")}
    return Contact(
        path=path, name=name, first=str(group.attrs["first"]), second=str(group.attrs["second"]) or None, law=law,
        steps=steps, pairs=len(group["arc_length"]),
    )
