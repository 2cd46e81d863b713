"""Every key that may vary along a curve, by every kind of value, on curves of every kind, against values at the nodes
that are computed here from the geometry alone; their resultant against the reaction; faults of what cannot vary so."""

from __future__ import annotations

import cmath
import itertools
import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.contact.laws import collect_laws
from pbem.contact.loads import evaluate_pressure
from pbem.description.case import Case
from pbem.mesh.generate import generate_mesh
from pbem.model.build import build_model
from pbem.results.reader import Results
from scripts.conditions.draft import SCHEMES

pytestmark = pytest.mark.usefixtures("without_errors")

# (place z, arc length s, time t) to a value
Function = Callable[[complex, float, float], float]
KINDS = ("number", "xy", "s", "t", "table")
# Of the curve's length: ends of the bits in which values are smooth.
BENDS = (0.1, 0.45, 0.8)
STRESS, LENGTH = 5.0, 1e-3


@dataclass(frozen=True)
class Trace:
    """A curve by its arc length from where it is written to begin: polyline, or arc of a circle."""

    points: tuple[complex, ...] = ()
    center: complex = 0j
    radius: float = 0.0
    start: float = 0.0
    turn: float = 0.0

    @property
    def length(self) -> float:
        return abs(self.turn) * self.radius or float(np.abs(np.diff(self.points)).sum())

    @property
    def corners(self) -> list[float]:
        return [0.0, *np.cumsum(np.abs(np.diff(self.points)))] if self.points else [0.0, self.length]

    def at(self, s: float) -> tuple[complex, complex]:
        """Place and direction."""
        if not self.points:
            sense = math.copysign(1.0, self.turn)
            away = cmath.exp(1j * (self.start + sense * s / self.radius))
            return self.center + self.radius * away, 1j * sense * away
        leg = min(int(np.searchsorted(self.corners, s, side="right")) - 1, len(self.points) - 2)
        along = self.points[leg + 1] - self.points[leg]
        return self.points[leg] + along / abs(along) * (s - self.corners[leg]), along / abs(along)

    def find(self, z: complex) -> float:
        """The arc length of a place on it."""
        if not self.points:
            turned = cmath.phase((z - self.center) * cmath.exp(-1j * self.start)) * math.copysign(1.0, self.turn)
            return turned % (2 * math.pi) * self.radius
        lengths = []
        for leg, (a, b) in enumerate(itertools.pairwise(self.points)):
            on = ((z - a) / (b - a)).real
            place = a + min(max(on, 0.0), 1.0) * (b - a)
            lengths.append((abs(z - place), self.corners[leg] + on * abs(b - a)))
        return min(lengths)[1]

    def table(self, elements: Any) -> dict[str, Any]:
        if self.points:
            return {"points": [[z.real, z.imag] for z in self.points], "elements": elements}
        angles = [math.degrees(self.start), math.degrees(self.start + self.turn)]
        whole = {} if abs(self.turn) > 2 * math.pi - 1e-9 else {"angles": angles}
        return {"center": [self.center.real, self.center.imag], "radius": self.radius, "elements": elements, **whole}


def draw_outline(rng: random.Random) -> tuple[float, dict[str, Trace]]:
    """Size, and curves of a body with a hole, anywhere, turned, in any unit, written in either direction."""
    size, turn = rng.choice((1.0, 25.4, 1e3)), rng.uniform(-3, 3)
    shift, back = size * complex(rng.uniform(-5, 5), rng.uniform(-5, 5)), rng.random() < 0.5

    def place(z: complex) -> complex:
        return shift + size * cmath.exp(1j * turn) * z

    def line(*points: complex) -> Trace:
        placed = tuple(map(place, points))
        return Trace(placed[::-1] if back else placed)

    first, reach = turn + math.atan2(2, 1.5), math.pi - 2 * math.atan2(2, 1.5)
    return size, {
        "foot": line(0j, 3 + 0j), "side": line(3 + 0j, 3.4 + 0.9j, 3 + 2j), "left": line(2j, 0j),
        "roof": Trace((), place(1.5 + 0j), 2.5 * size, *((first + reach, -reach) if back else (first, reach))),
        "hole": Trace((), place(1.5 + 1j), 0.4 * size, 0.0, 2 * math.pi),
    }  # fmt: skip


ELEMENTS = {"foot": 8, "side": [4, 4], "roof": 10, "left": 6, "hole": 12}


def draw_value(kind: str, rng: random.Random, trace: Trace, size: float, scale: float) -> tuple[Any, Function]:
    """What is written, and what it means; positive everywhere, as strengths have to be."""
    a, b, c = (scale * rng.uniform(0.2, 1) for _ in range(3))
    length, origin = trace.length, trace.at(0.0)[0]
    x, y = (f"((x - ({origin.real!r}))/{size!r})", f"((y - ({origin.imag!r}))/{size!r})")
    if kind == "number":
        return a, lambda *_: a
    if kind == "xy":
        text = f"{a!r} + {b!r}*{x}**2 + {c!r}*{y}**2"
        return {"expression": text}, lambda z, *_: (
            a + b * (z - origin).real ** 2 / size**2 + c * (z - origin).imag ** 2 / size**2)
    if kind == "s":
        return {"expression": f"{a!r} + {b!r}*(s/{length!r})**2"}, lambda _, s, __: a + b * (s / length) ** 2
    if kind == "t":
        return {"expression": f"({a!r} + {b!r}*{x}**2)*t**2"}, lambda z, _, t: (
            (a + b * (z - origin).real ** 2 / size**2) * t**2)
    rows = [[part * length, value] for part, value in zip(BENDS, (a, b, c), strict=True)]
    return {"table": rows}, lambda _, s, __: float(np.interp(s, *np.transpose(rows)))


def list_nodes(results: Results, name: str) -> np.ndarray:
    return np.flatnonzero(np.asarray(results.nodes.curve) == results.nodes.curve_names.index(name))


def make_body(rng: random.Random, scheme: str) -> tuple[float, dict[str, Trace], dict[str, Any]]:
    size, traces = draw_outline(rng)
    return size, traces, {
        "materials": {"m": {"young": 1000.0, "poisson": 0.3}},
        "curves": {name: trace.table(ELEMENTS[name]) for name, trace in traces.items()},
        "regions": {"body": {"material": "m", "boundary": list(traces)}},
        "boundary": {"foot": {"ux": 0.0, "uy": 0.0}}, "analysis": {"scheme": scheme, "steps": 2},
    }  # fmt: skip


KEYS = (("tx", "ty"), ("tn", "ts"), ("pressure",), ("ux", "uy"), ("un", "us"), ("un", "ts"), ("us", "tn"))


# With two shifts each key has values of each kind; with both, in other schemes and on other curves, the next key.
@pytest.mark.parametrize(("keys", "shift"), [
    (keys, (number + more) % len(KINDS)) for number, keys in enumerate(KEYS) for more in (0, 3)
])  # fmt: skip
def test_conditions_at_the_nodes(keys: tuple[str, ...], shift: int, tmp_path: Path) -> None:
    """The four curves have four kinds of values, in turn; from a file, or in Python."""
    rng = random.Random(f"{keys} {shift}")
    size, traces, case = make_body(rng, SCHEMES[shift % 4])
    given: dict[str, dict[str, Function]] = {}
    for number, name in enumerate(each for each in traces if each != "foot"):
        kind = KINDS[(number + shift) % len(KINDS)]
        values = {key: draw_value(kind, rng, traces[name], size, LENGTH * size if key[0] == "u" else STRESS)
                  for key in keys}
        case["boundary"][name] = {key: value for key, (value, _) in values.items()}
        # What does not depend on the time grows with it.
        given[name] = {key: (each if kind == "t" else lambda z, s, t, each=each: t * each(z, s, t))
                       for key, (_, each) in values.items()}
    if shift % 2:
        pbem.Case(**case).write(tmp_path / "case.toml")
    results = pbem.run(tmp_path / "case.toml" if shift % 2 else case, tmp_path / "case.h5")
    for step, time in enumerate((0.5, 1.0)):
        for name, functions in given.items():
            nodes = list_nodes(results, name)
            z, n = (values[nodes] @ [1, 1j] for values in (results.nodes.position, results.nodes.normal))
            u, t = (values[step][nodes] @ [1, 1j] for values in (results.displacement, results.traction))
            found = {"ux": u.real, "uy": u.imag, "un": (u / n).real, "us": (u / n).imag, "tx": t.real, "ty": t.imag,
                     "tn": (t / n).real, "ts": (t / n).imag, "pressure": -(t / n).real}
            for key, function in functions.items():
                expected = [function(each, traces[name].find(each), time) for each in z]
                scale = LENGTH * size if key[0] == "u" else STRESS
                np.testing.assert_allclose(found[key], expected, rtol=0, atol=1e-10 * scale, err_msg=f"{name} {key}")
    if keys[0][0] != "u" and keys[-1][0] != "u":
        total = sum(sum_up(traces[name], results, name, functions) for name, functions in given.items())
        assert abs(complex(*results.reactions["foot"][-1]) + total) < 1e-3 * STRESS * 8 * size


def sum_up(trace: Trace, results: Results, name: str, given: dict[str, Function]) -> complex:
    """The resultant of the tractions at the end, by Gauss's rule between corners and bends."""
    node = list_nodes(results, name)[0]
    z, normal = complex(*results.nodes.position[node]), complex(*results.nodes.normal[node])
    outward = normal / trace.at(trace.find(z))[1]  # -i or i: to the right, or the left, of the curve
    outward = 1j * round(outward.imag)
    ends = sorted({*trace.corners, *(part * trace.length for part in BENDS)})
    points, weights = np.polynomial.legendre.leggauss(20)
    total = 0j
    for start, end in itertools.pairwise(ends):
        for point, weight in zip(points, weights, strict=True):
            s = 0.5 * (start + end) + 0.5 * (end - start) * point
            place, along = trace.at(s)
            values = {key: function(place, s, 1.0) for key, function in given.items()}
            n = outward * along
            traction = (complex(values["tx"], values["ty"]) if "tx" in values
                        else n * complex(values["tn"], values["ts"]) if "tn" in values else -n * values["pressure"])
            total += 0.5 * (end - start) * weight * traction
    return total


@pytest.mark.parametrize("shift", range(len(KINDS)))
def test_springs_at_the_nodes(shift: int, tmp_path: Path) -> None:
    """tn = own tn - kn (un - end_n), ts alike, with stiffnesses, ends and tractions of all kinds."""
    rng = random.Random(f"springs {shift}")
    size, traces, case = make_body(rng, SCHEMES[(shift + 1) % 4])
    scales = {"kn": 300.0 / size, "ks": 100.0 / size, "end_n": LENGTH * size, "end_s": LENGTH * size,
              "tn": STRESS, "ts": STRESS}  # fmt: skip
    given: dict[str, dict[str, tuple[str, Function]]] = {}
    for number, name in enumerate(each for each in traces if each != "foot"):
        drawn = {}
        for offset, (key, scale) in enumerate(scales.items()):
            kind = KINDS[(number + shift + offset) % len(KINDS)]
            if kind == "t" and key[0] == "k":
                kind = "s"
            drawn[key] = (kind, *draw_value(kind, rng, traces[name], size, scale))
        case["boundary"][name] = {key: value for key, (_, value, _) in drawn.items() if key[0] != "k"}
        case["boundary"][name]["spring"] = {key: drawn[key][1] for key in ("kn", "ks")}
        given[name] = {key: (kind, function) for key, (kind, _, function) in drawn.items()}
    results = pbem.run(case, tmp_path / "case.h5")
    for step, time in enumerate((0.5, 1.0)):
        for name, own in given.items():
            nodes = list_nodes(results, name)
            z, n = (values[nodes] @ [1, 1j] for values in (results.nodes.position, results.nodes.normal))
            u, t = (values[step][nodes] @ [1, 1j] / n for values in (results.displacement, results.traction))
            value = {key: np.array([function(each, traces[name].find(each), time) for each in z])
                     * (1.0 if kind == "t" or key[0] == "k" else time) for key, (kind, function) in own.items()}
            expected = {axis: value["t" + axis] - value["k" + axis] * (moved - value["end_" + axis])
                        for axis, moved in (("n", u.real), ("s", u.imag))}
            np.testing.assert_allclose(t.real, expected["n"], rtol=0, atol=1e-8 * STRESS)
            np.testing.assert_allclose(t.imag, expected["s"], rtol=0, atol=1e-8 * STRESS)


# Keys of laws, with others that they need.
LAW_KEYS: dict[str, dict[str, Any]] = {
    "friction": {}, "cohesion": {"friction": 0.1}, "tensile_strength": {"cohesion": 1e3, "friction": 0.1},
    "friction_dynamic": {"friction": 99.0, "slip_distance": 1.0}, "dilation_angle": {"friction": 99.0},
    "gap": {"friction": 0.1}, "pressure": {"friction": 0.1},
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("key", LAW_KEYS)
def test_laws_at_the_pairs(key: str, kind: str) -> None:
    """Cracks of every kind of curve, and an interface around a region; `s` from where the curve is written to begin."""
    rng = random.Random(f"{key} {kind}")
    size, _ = draw_outline(rng)
    traces = {"bent": Trace((0j, 2 * size + 1j * size, 3 * size + 0j)), "line": Trace((-size - size * 1j, -3j * size)),
              "arc": Trace((), -3 * size + 1j * size, size, 2.0, -1.5),
              "ring": Trace((), 2 * size - 4j * size, size, 0.0, 2 * math.pi)}
    drawn = {name: draw_value(kind, rng, trace, size, 1.0) for name, trace in traces.items()}
    case = {
        "materials": {"m": {"young": 1000.0, "poisson": 0.3}},
        "curves": {name: trace.table(8) for name, trace in traces.items()},
        "regions": {"plane": {"material": "m", "infinite": True, "boundary": ["ring"],
                              "cracks": ["bent", "line", "arc"]}, "core": {"material": "m", "boundary": ["ring"]}},
        "interfaces": {name: {"law": "coulomb", key: value, **LAW_KEYS[key]} for name, (value, _) in drawn.items()},
        "remote": {"syy": -1.0},
    }  # fmt: skip
    if kind == "t" and key != "pressure":
        with pytest.raises(pbem.CaseError, match="unknown name 't'") as raised:
            build_model(Case(**case))
        assert len(raised.value.faults) == len(traces)
        return
    model = build_model(Case(**case))
    mesh = generate_mesh(model)
    laws = collect_laws(model, mesh)
    if key in ("gap", "tensile_strength"):
        found = getattr(laws, key)
    elif key == "pressure":
        found = evaluate_pressure(model, mesh, 0, 1.0)
    else:
        found = np.full(mesh.pairs.count, np.nan)
        for group in laws.strengths:
            found[group.pairs] = group.parameters[key]
    z = mesh.pairs.position + model.origin
    expected = [drawn[name][1](each, traces[name].find(each), 1.0)
                for each, name in zip(z, np.array(mesh.interface_names)[mesh.pairs.interface], strict=True)]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


WALL = {"s": {"expression": "2*s"}, "table": {"table": [[0, 1], [1, 2]]}, "list": [[0, 1], [1, 2]], "text": "2*x",
        "no value": {"expression": "sqrt(-1 - t)"}}
SQUARE: dict[str, Any] = {
    "materials": {"m": {"young": 1000.0, "poisson": 0.3, "expansion": 1e-5}},
    "curves": {name: {"points": points, "elements": 2} for name, points in {
        "foot": [[0, 0], [1, 0]], "right": [[1, 0], [1, 1]], "head": [[1, 1], [0, 1]], "left": [[0, 1], [0, 0]],
    }.items()},
    "regions": {"body": {"material": "m", "boundary": ["foot", "right", "head", "left"]}},
    "boundary": {"foot": {"ux": 0.0, "uy": 0.0}},
}  # fmt: skip
LINEAR = 'a number, or { expression = "..." }, linear in x and y'
VARYING = 'a number, or { expression = "..." } or { table = [[s, value], ...] }'
FAULTS = [
    ("boundary.right.pressure", "list", VARYING), ("boundary.right.pressure", "text", VARYING),
    ("boundary.right.pressure", "no value", "no finite value"),
    ("boundary.right.force.fx", "table", "expression of the time"), ("boundary.right.force.fx", "s", "of the time"),
    ("boundary.right.force.fy", "no value", "a force without a finite value"),
    ("boundary.right.rigid.moment", "s", "of the time"),
    ("boundary.right.rigid.fx", "no value", "a force or motion without a finite value"),
    ("temperature.body", "table", LINEAR), ("temperature.body", "list", LINEAR), ("temperature.body", "s", "'s'"),
    ("eigenstrain.body.exy", "table", LINEAR), ("eigenstrain.body.exx", "no value", "unknown name 't'"),
    ("initial_stress.m.sxx", "text", LINEAR), ("initial_stress.m.sxx", "table", LINEAR),
    ("point_loads.p.fx", "s", "expected a number"), ("point_supports.p.ux", "table", "expected a number"),
]  # fmt: skip


@pytest.mark.parametrize(("key", "kind", "words"), FAULTS)
def test_what_cannot_vary_so_is_told(key: str, kind: str, words: str, tmp_path: Path) -> None:
    """One fault alone, at its place, which says what may stand there."""
    case = {**SQUARE, "boundary": {**SQUARE["boundary"]}}
    *tables, last = key.split(".")
    into: dict[str, Any] = case
    for each in tables:
        into[each] = dict(into.get(each, {}))
        into = into[each]
    into[last] = WALL[kind]
    if tables[0].startswith("point"):
        into["at"] = [0.0, 1.0]
        if tables[0] == "point_supports":
            case["boundary"] = {}
    with pytest.raises(pbem.CaseError) as raised:
        pbem.run(case, tmp_path / "case.h5")
    (fault,) = raised.value.faults
    place = ".".join(map(str, fault.path))
    assert key.startswith(place) and place.count(".") >= key.count(".") - 1
    assert words in str(raised.value)
