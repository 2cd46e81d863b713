"""The same models elsewhere: shifted, turned, mirrored, in other units; all results against the unmoved ones.

    python scripts/study_places.py [--cases NAME ...] [--moves NAME ...] [-o TABLE.csv]

A row a case and move: the largest difference of displacements, tractions, contact (status, opening, slip), reactions
and stress-intensity factors, each relative to the largest of its kind. Coordinates far away are rounded where they are
written: eps * shift/size is the part of a model's size to which its own shape is known (of a clearance, so much more as
it is smaller), and `allowed` is 1e-7 or ROUNDINGS times that part, as elements shorter than the model see it enlarged.
"""

from __future__ import annotations

import argparse
import cmath
import copy
import csv
import math
import re
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import pbem
from pbem.errors import PbemError, StopError
from pbem.results.reader import Results

ROOT = Path(__file__).parent.parent
# Without generated curves, whose random places do not move with their boxes, custom laws and figures of minutes.
CASES = (
    "cases/block_on_block", "cases/two_blocks", "cases/two_blocks_dbem", "cases/two_blocks_hst",
    "cases/two_blocks_thst", "cases/two_blocks_sticking", "cases/two_blocks_sliding", "cases/two_blocks_sliding_hst",
    "cases/panel_friction_closing", "cases/panel_friction_opening", "cases/panel_frictionless_closing",
    "cases/panel_frictionless_opening", "cases/layers_push", "cases/layers_pull_stiff",
    "tests/defects/tip_graded", "tests/defects/tip_long_neighbour", "tests/defects/pin_small_clearance",
    "tests/defects/pin_finer_first", "tests/defects/thin_body", "tests/defects/thin_ligament", "tests/defects/slot_hst",
    "tests/defects/self_contact_hst", "tests/defects/shallow_crack", "tests/defects/shallow_t",
    "tests/defects/loose_middle_block", "tests/defects/loose_pin", "tests/defects/loose_inclusion_tension",
    "tests/defects/gravity_far_from_origin", "tests/defects/inclusion_far_from_origin",
    "tests/defects/gap_expression_check", "tests/defects/weakening_energy",
    *(f"scripts/fuzz_seeds/{name}" for name in ("cracked", "dilating", "fitted", "loose", "points", "pressed", "rigid",
                                                "rough", "softening", "staged", "timed", "tool")),
    "cases/gallery/sawtooth_joint", "cases/gallery/hertz", "cases/gallery/press_fit_overlap",
    "cases/gallery/punch_flat", "cases/gallery/tunnel_excavated", "cases/gallery/k0_tunnel",
)  # fmt: skip
ROUNDINGS = 1e3
# Of the largest stress at the faces of a model: tractions that are less are measured by it.
ROUNDED = 1e-2
# Clearances, as a part of the size: gaps of which the pressure is a function are known to less than the bodies.
CLEARANCES = {"pin_small_clearance": 1e-7, "pin_finer_first": 1e-5, "loose_pin": 1e-3, "loose_middle_block": 1e-3,
              "fitted": 1e-4, "press_fit_overlap": 1e-5, "tool": 1e-4, "loose": 3e-4, "hertz": 1e-3, "points": 2e-5}
TURNED = cmath.exp(1j * math.radians(90.0))


@dataclass(frozen=True)
class Move:
    """z becomes length * turn * (z or its mirror image) + shift * size; stresses are multiplied by `stress`."""

    name: str
    shift: complex = 0j
    turn: complex = 1 + 0j
    mirror: bool = False
    length: float = 1.0
    stress: float = 1.0

    def place(self, point: complex, size: float) -> complex:
        return self.length * (self.direct(point) + self.shift * size)

    def direct(self, vector: Any) -> Any:
        return self.turn * (-np.conj(vector) if self.mirror else vector)


MOVES = (
    Move("shift 1e2", 1e2 * (1 - 0.7j)), Move("shift 1e4", 1e4 * (-0.6 + 1j)), Move("shift 1e6", 1e6 * (1 + 0.3j)),
    Move("shift 1e8", 1e8 * (-1 - 0.9j)), Move("turn 90", turn=TURNED),
    Move("turn 30", turn=cmath.exp(1j * math.pi / 6)), Move("mirror", mirror=True),
    Move("1e-9 lengths", length=1e-9), Move("1e9 lengths", length=1e9),
    Move("1e-9 stresses", stress=1e-9), Move("1e9 stresses", stress=1e9),
    Move("all", 1e3 * (1 + 1j), TURNED, True, 1e-3, 1e6),
)  # fmt: skip
# Keys by what they are multiplied with.
LENGTHS = {"size", "radius", "slip_distance", "dilation_slip", "peak_slip", "closure", "overlap", "reference_rate",
           "end_n", "end_s"}
STRESSES = {"young", "cohesion", "tensile_strength", "pressure", "tn", "ts", "traction", "jcs"}
STIFFNESSES = {"kn", "ks", "kx", "ky", "normal_stiffness", "tangential_stiffness"}
ENERGIES = {"fracture_energy", "fracture_energy_shear"}
# What changes its sign in a mirror.
HANDED = {"us", "ts", "end_s", "moment", "rotation"}
# What varies and is seen to by what it belongs to.
MOVED_LATER = {"gap", "sxx", "syy", "sxy", "ux", "uy", "un", "us", "tx", "ty", "fx", "fy"}
# What stages leave out stays as it was.
KEPT = {"ux", "uy", "tx", "ty", "fx", "fy"}


class NotMovableError(Exception):
    """A case that cannot be written in the moved frame, e.g. rollers at an angle."""


def move_case(case: dict[str, Any], move: Move, size: float) -> dict[str, Any]:
    """The tables of a case, moved."""
    result = _scale(copy.deepcopy(case), move, size)
    for table in result["curves"].values():
        _move_curve(table, move, size)
    for law in [*result.get("interfaces", {}).values(), *result.get("contacts", {}).values()]:
        if isinstance(law.get("gap"), dict):
            law["gap"] = {"expression": f"{move.length!r}*({_move_back(law['gap']['expression'], move, size)})"}
        elif "gap" in law:
            law["gap"] = law["gap"] * move.length
    known: dict[str, dict[str, float]] = {"remote": {}, "gravity": {}}
    reached: dict[tuple[str, str], dict[str, Any]] = {}
    for tables in (result, *result.get("stages", [])):
        for key, before in known.items():
            if key in tables:
                before |= tables[key]  # what a stage does not name stays as it was
                tables[key] = _move_field(before, key, move)
        for strain in tables.get("eigenstrain", {}).values():
            strain |= _move_strain(strain, move)
        for kind in ("boundary", "tools", "point_loads", "point_supports"):
            for name, table in tables.get(kind, {}).items():
                _move_condition(table, reached.setdefault((kind, name), {}), move, size)
    for stress in result.get("initial_stress", {}).values():
        stress |= _move_stress(stress, move, size)
    result.pop("output", None)
    # What is compared is the models, not where Newton's method is content.
    result["solver"] = {**result.get("solver", {}), "newton_tolerance": 1e-10}
    return result


def _scale(value: Any, move: Move, size: float) -> Any:
    """Scalars, and varying values, by the dimension of their keys; lengths of places are left to `place`."""
    if isinstance(value, list):
        return [_scale(each, move, size) for each in value]
    if not isinstance(value, dict):
        return value
    result = {}
    for key, each in value.items():
        unit = _find_unit(key, move)
        if unit is not None and isinstance(each, int | float) and not isinstance(each, bool):
            result[key] = each * unit
        elif isinstance(each, dict) and "table" in each and key not in MOVED_LATER:
            result[key] = {"table": [[s * move.length, value * (unit or 1.0)] for s, value in each["table"]]}
        elif isinstance(each, dict) and isinstance(each.get("expression"), str) and key not in MOVED_LATER:
            result[key] = {"expression": f"{unit or 1.0!r}*({_move_back(each['expression'], move, size)})"}
        else:
            result[key] = _scale(each, move, size)
    return result


def _find_unit(key: str, move: Move) -> float | None:
    """What values of a key are multiplied with; None of those that stay, or whose direction is seen to elsewhere."""
    if key in LENGTHS:
        return move.length
    if key in STRESSES:
        return move.stress
    if key in STIFFNESSES or key == "density":
        return move.stress / move.length
    return move.stress * move.length if key in ENERGIES else None


def _move_curve(table: dict[str, Any], move: Move, size: float) -> None:
    def pair(point: list[float]) -> list[float]:
        moved = move.place(complex(*point), size)
        return [moved.real, moved.imag]

    if "points" in table:
        table["points"] = [pair(point) for point in table["points"]]
    if "center" in table:
        table["center"] = pair(table["center"])
    if "center" in table:
        turned = math.degrees(cmath.phase(move.turn))
        begin, end = table.get("angles", [0.0, 360.0])
        table["angles"] = [(180.0 - a if move.mirror else a) + turned for a in (begin, end)]
    if "expression" in table:
        x, y = table["expression"]
        a, b = (-1.0 if move.mirror else 1.0) * move.turn * move.length, 1j * move.turn * move.length
        at = move.shift * size * move.length
        table["expression"] = [
            f"{a.real!r}*({x})+{b.real!r}*({y})+{at.real!r}", f"{a.imag!r}*({x})+{b.imag!r}*({y})+{at.imag!r}"
        ]


def _move_back(text: str, move: Move, size: float) -> str:
    """An expression of x, y in terms of the moved coordinates."""
    at, back = move.shift * size * move.length, 1 / move.turn / move.length
    u, v = f"(x-({at.real!r}))", f"(y-({at.imag!r}))"
    sign = -1.0 if move.mirror else 1.0
    new = {"x": f"({sign!r}*({back.real!r}*{u}-({back.imag!r})*{v}))",
           "y": f"({back.imag!r}*{u}+({back.real!r})*{v})", "s": f"(s/{move.length!r})"}
    return re.sub(r"\b[xys]\b", lambda found: new[found[0]], text)


def _move_condition(table: dict[str, Any], reached: dict[str, Any], move: Move, size: float) -> None:
    """The conditions of a curve, a tool or a point; reached: what they were at the end of the stage before."""
    for part in ("rigid", "force"):
        if part in table:
            _move_condition(table[part], reached.setdefault(part, {}), move, size)
    reached |= {key: value for key, value in table.items() if key in KEPT}
    table |= {key: value for key, value in reached.items() if key in KEPT}
    for key in ("at", "about"):
        if key in table:
            moved = move.place(complex(*table[key]), size)
            table[key] = [moved.real, moved.imag]
    for first, second, factor in (("ux", "uy", move.length), ("tx", "ty", move.stress),
                                  ("fx", "fy", move.stress * move.length)):
        if first in table or second in table:
            _move_pair(table, first, second, factor, move)
    for key in ("un", "us"):
        if isinstance(table.get(key), dict | list):
            raise NotMovableError("a component that varies")
        if key in table:
            table[key] = table[key] * move.length
    if "moment" in table:
        table["moment"] *= move.stress * move.length**2
    for key in HANDED & set(table):
        if move.mirror:
            table[key] = -table[key]


def _move_pair(table: dict[str, Any], first: str, second: str, factor: float, move: Move) -> None:
    if any(isinstance(table.get(key), dict | list) for key in (first, second)):
        raise NotMovableError("a component that varies")
    given = [key in table for key in (first, second)]
    vector = factor * complex(table.pop(first, 0.0), table.pop(second, 0.0))
    moved = complex(move.direct(vector))
    if all(given) or (first in ("tx", "fx") and "ux" not in table and "uy" not in table):
        table |= {first: moved.real, second: moved.imag}
        return
    along = complex(move.direct(1.0 if given[0] else 1j))
    if abs(along.real) < 1e-9:
        table[second] = moved.imag
    elif abs(along.imag) < 1e-9:
        table[first] = moved.real
    else:
        raise NotMovableError("a component that is known along x or y alone")


def _move_field(table: dict[str, float], key: str, move: Move) -> dict[str, float]:
    if key == "gravity":
        moved = complex(move.direct(complex(table.get("gx", 0.0), table.get("gy", 0.0))))
        return {"gx": moved.real, "gy": moved.imag}
    sxx, syy, sxy = (table.get(name, 0.0) * move.stress for name in ("sxx", "syy", "sxy"))
    mean, deviator = 0.5 * (sxx + syy), 0.5 * (sxx - syy) + 1j * sxy
    deviator = complex((np.conj(deviator) if move.mirror else deviator) * move.turn**2)
    return {"sxx": mean + deviator.real, "syy": mean - deviator.real, "sxy": deviator.imag}


def _move_stress(table: dict[str, Any], move: Move, size: float) -> dict[str, Any]:
    """In-situ stress, which may be linear in x and y: each component by what all of them are where it was."""
    names = ("sxx", "syy", "sxy")
    if not any(isinstance(table.get(name), dict) for name in names):
        return dict(_move_field(table, "remote", move))
    moved: dict[str, list[str]] = {name: [] for name in names}
    for name in names:
        value = table.get(name, 0.0)
        text = _move_back(value["expression"], move, size) if isinstance(value, dict) else repr(value)
        for other, part in _move_field({name: 1.0}, "remote", move).items():
            moved[other].append(f"{part!r}*({text})")
    return {name: {"expression": " + ".join(parts)} for name, parts in moved.items()}


def _move_strain(table: dict[str, float], move: Move) -> dict[str, float]:
    """The same of a tensor of strain."""
    names = {"exx": "sxx", "eyy": "syy", "exy": "sxy"}
    moved = _move_field({names[key]: value for key, value in table.items() if key in names}, "remote",
                        replace(move, stress=1.0))
    return {key: moved[name] for key, name in names.items()}


def write_toml(case: dict[str, Any]) -> str:
    """A case as TOML, one top-level key a line."""
    return "\n".join(f"{_key(key)} = {_value(value)}" for key, value in case.items()) + "\n"


def _key(name: str) -> str:
    return '"' + name.replace('"', '\\"') + '"'


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(key)} = {_value(each)}" for key, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ") + '"'
    return repr(float(value)) if isinstance(value, float) else repr(value)


def compare(moved: Results, still: Results, move: Move, young: float) -> dict[str, float]:
    """Largest differences at the last step, relative to the largest of each kind; pairs whose status differs.

    young: the largest modulus of the unmoved model (stress).
    """
    length, stress = move.length, move.stress

    def vectors(values: np.ndarray) -> np.ndarray:
        return np.asarray(move.direct(values @ [1, 1j]))

    def differ(one: np.ndarray, other: np.ndarray, scale: float = 0.0) -> float:
        largest = max(float(np.nanmax(np.abs(other), initial=0.0)), scale)
        return float(np.nanmax(np.abs(one - other), initial=0.0)) / largest if largest else 0.0

    # Elements of a mirrored model are travelled the other way: nodes by their places.
    order = _match(moved, still, move)
    u, t = (getattr(moved, name)[-1][order] @ [1, 1j] for name in ("displacement", "traction"))
    # Around open holes all stress is along the faces: tractions and factors are small by that.
    largest_traction = float(np.abs(still.traction[-1]).max())
    stressed = max(largest_traction, float(np.nanmax(np.abs(still.hoop_stress[-1]), initial=0.0)))
    # Bodies in which the stress is in balance from the beginning move by rounding alone.
    strain = stressed / young
    result = {
        "displacement": differ(u / length, vectors(still.displacement[-1]), strain * measure_size(still)),
        "traction": differ(t / stress, vectors(still.traction[-1]), ROUNDED * stressed),
    }
    forces = {name: (vectors(force[-1]), moved.reactions[name][-1] @ [1, 1j] / (length * stress))
              for name, force in still.reactions.items()}
    if forces:
        # Of what is in balance there is no reaction but rounding.
        scale = largest_traction * measure_size(still)
        result["reactions"] = differ(*(np.array([each[k] for each in forces.values()]) for k in (1, 0)), scale)
    largest: dict[str, float] = {"opening": 0.0, "slip": 0.0, "traction_n": 0.0, "traction_s": 0.0}
    off, status = dict(largest), 0
    for name, contact in still.contact.items():
        other = moved.contact[name]
        for kind in largest:
            factor = stress if kind.startswith("traction") else length
            one, two = getattr(other, kind)[-1] / factor, getattr(contact, kind)[-1]
            if kind in ("slip", "traction_s"):
                one, two = np.abs(one), np.abs(two)
            # Not a number where a stage has taken one of the regions away.
            largest[kind] = max(largest[kind], float(np.nanmax(np.abs(two), initial=0.0)))
            off[kind] = max(off[kind], float(np.nanmax(np.abs(one - two), initial=0.0)))
        status += int((other.mode[-1] != contact.mode[-1]).sum())
    jumps, tractions = max(largest["opening"], largest["slip"]), max(largest["traction_n"], largest["traction_s"])
    # Faces without friction that lie against each other carry rounding.
    tractions = max(tractions, ROUNDED * stressed)
    if still.contact:
        result["jumps"] = max(off["opening"], off["slip"]) / jumps if jumps else 0.0
        result["contact tractions"] = max(off["traction_n"], off["traction_s"]) / tractions if tractions else 0.0
        result["statuses"] = status
    factor = stress * math.sqrt(length)
    known = [(np.abs(getattr(moved.tips[name], kind)[-1]) / factor, np.abs(getattr(tip, kind)[-1]))
             for name, tip in still.tips.items() for kind in ("KI", "KII")]
    if known:
        scale = ROUNDED * stressed * math.sqrt(measure_size(still))
        result["K"] = differ(*(np.array([pair[k] for pair in known]) for k in (0, 1)), scale)
    return result


def _match(moved: Results, still: Results, move: Move) -> np.ndarray:
    """Which node of the moved model is which of the unmoved one (n,)."""
    count = len(still.nodes.position)
    if not move.mirror:
        return np.arange(count)
    middle = [np.mean(each.elements.vertices.reshape(-1, 2), axis=0) @ [1, 1j] for each in (moved, still)]
    one = (moved.nodes.position @ [1, 1j] - middle[0]) / move.length
    other = move.direct(still.nodes.position @ [1, 1j] - middle[1])
    facing = [moved.nodes.normal @ [1, 1j], move.direct(still.nodes.normal @ [1, 1j])]
    size = float(np.abs(other).max())
    order = np.empty(count, dtype=int)
    for node in range(count):
        alike = (moved.nodes.region == still.nodes.region[node]) & (moved.nodes.curve == still.nodes.curve[node])
        far = np.abs(one - other[node]) / size + 1e-3 * np.abs(facing[0] - facing[1][node])
        order[node] = int(np.argmin(np.where(alike, far, np.inf)))
    return order


def measure_size(results: Results) -> float:
    return float(np.ptp(results.elements.vertices.reshape(-1, 2), axis=0).max())


def study(name: str, moves: list[Move], folder: Path) -> Iterator[dict[str, Any]]:
    """A row for each move of one case."""
    case = tomllib.loads((ROOT / f"{name}.toml").read_text(encoding="utf-8"))
    try:
        still = _run(move_case(case, Move("still"), 1.0), folder / "still")
    except NotMovableError as error:
        print(f"{name}: passed over, {error}", flush=True)
        return
    young = max(table["young"] for table in case["materials"].values())
    size, middle = measure_size(still), np.mean(still.elements.vertices.reshape(-1, 2), axis=0) @ [1, 1j]
    for move in moves:
        row: dict[str, Any] = {"case": name.split("/")[-1], "move": move.name}
        away = abs(complex(move.direct(middle)) / size + move.shift)
        known = float(np.finfo(float).eps) * max(away, 1.0) / CLEARANCES.get(row["case"], 1.0)
        row["allowed"] = max(1e-7, ROUNDINGS * known)
        try:
            found = compare(_run(move_case(case, move, size), folder / "moved"), still, move, young)
        except NotMovableError:
            continue
        except StopError:
            raise
        except PbemError as error:
            row |= {"worst": math.inf, "what": str(error).split("\n")[-1][:120]}
            yield row
            continue
        statuses = found.pop("statuses", 0.0)
        what = max(found, key=lambda kind: found[kind])
        yield row | {"worst": found[what], "what": what, "statuses": int(statuses)}


def _run(case: dict[str, Any], path: Path) -> Results:
    path.with_suffix(".toml").write_text(write_toml(case), encoding="utf-8")
    return pbem.run(path.with_suffix(".toml"), path.with_suffix(".h5"), force=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", nargs="*", default=list(CASES))
    parser.add_argument("--moves", nargs="*", default=[move.name for move in MOVES])
    parser.add_argument("-o", "--output", type=Path)
    options = parser.parse_args()
    moves = [move for move in MOVES if move.name in options.moves]
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for name in options.cases:
            for row in study(name, moves, Path(folder)):
                rows.append(row)
                beyond = "" if row["worst"] <= row["allowed"] else "  BEYOND"
                print(f"{row['case']:28s} {row['move']:14s} {row['worst']:8.1e} ({row['what']}), allowed "
                      f"{row['allowed']:.1e}, statuses {row.get('statuses', 0)}{beyond}", flush=True)
    beyond = [row for row in rows if not row["worst"] <= row["allowed"]]
    print(f"{len(rows)} moved models, {len(beyond)} beyond what the rounding of coordinates allows")
    if options.output:
        with options.output.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, ["case", "move", "worst", "what", "allowed", "statuses"])
            writer.writeheader()
            writer.writerows(rows)
    return 1 if beyond else 0


if __name__ == "__main__":
    sys.exit(main())
