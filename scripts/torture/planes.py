"""Planes and plates and what loads them: stress far away; a side that is pressed, pulled and sheared."""

from __future__ import annotations

import cmath
import math
import random

from .draft import Draft, draw_log, draw_material, local


def start_plane(rng: random.Random, title: str) -> tuple[Draft, float]:
    """A draft with one material and one infinite region without cracks, and the strain of its loads."""
    draft = Draft(title)
    draft.materials["rock"] = draw_material(rng)
    draft.regions["body"] = {"material": "rock", "boundary": [], "cracks": [], "infinite": True}
    draft.analysis = {"order": rng.choice((1, 2, 2, 2, 3)), "scheme": rng.choice(("SST", "SST", "DBEM"))}
    return draft, draw_log(rng, 1e-5, 3e-3)


def add_plate(draft: Draft, side: float) -> None:
    corners = [0.5 * side * (x + 1j * y) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    for number, name in enumerate(("bottom", "right", "top", "left")):
        draft.add_line(name, corners[number], corners[(number + 1) % 4], elements=8)
    draft.regions["body"]["boundary"] = ["bottom", "right", "top", "left"]


def load_remote(draft: Draft, rng: random.Random, strain: float) -> None:
    """Principal stresses far away, of either sign, in proportion or with a turn of the load's way."""
    first, second = rng.choice(((-1, -rng.random()), (-1, rng.uniform(0, 1)), (-1, rng.uniform(0, 0.2)),
                                (1, rng.random()), (-1, -0.1 * rng.random())))
    turn = cmath.exp(2j * rng.uniform(0, math.pi))

    def stress(first: float, second: float, turn: complex) -> dict[str, float]:
        mean, half = 0.5 * strain * (first + second), 0.5 * strain * (first - second) * turn
        return {"sxx": mean + half.real, "syy": mean - half.real, "sxy": half.imag}

    if rng.random() < 0.5:
        draft.remote = stress(first, second, turn)
        draft.analysis["steps"] = rng.choice((1, 1, 2, 4))
        return
    ways: list[tuple[float, float, complex]] = [(first, second, turn)]
    for _ in range(rng.randint(1, 2)):
        factor = rng.uniform(-0.4, 1.2)
        ways.append((first * factor, second * rng.uniform(0.2, 1.5), turn * cmath.exp(1j * rng.uniform(-0.7, 0.7))))
    draft.stages = [
        {"name": f"s{number}", "steps": rng.randint(1, 3), "remote": stress(*way)} for number, way in enumerate(ways)
    ]


def load_plate(draft: Draft, rng: random.Random, strain: float) -> None:
    """The lower side is held, the upper one pressed, pulled and sheared, by displacements or tractions."""
    height = abs(complex(*draft.curves["left"]["points"][0]) - complex(*draft.curves["left"]["points"][1]))
    draft.boundary["bottom"] = {"un": 0.0, "us": 0.0}
    if rng.random() < 0.4:
        draft.boundary["left"] = {"tn": strain * rng.uniform(-1, 0.3), "ts": 0.0}
        draft.boundary["right"] = dict(draft.boundary["left"])
    press = strain * rng.choice((-1.0, -1.0, -1.0, 0.5))
    shear = strain * rng.uniform(-1, 1)
    if rng.random() < 0.5:
        press_and_shear(draft, rng, ["top"], [1j], 1j * press * height, shear * height)
    else:
        press_and_shear(draft, rng, ["top"], [1j], 1j * press, shear, ("tn", "ts"))


def press_and_shear(
    draft: Draft, rng: random.Random, names: list[str], normals: list[complex], press: complex, shear: complex,
    components: tuple[str, str] = ("un", "us"),
) -> None:
    """Stages that press curves, then shear them, perhaps to and fro; or all at once in proportion."""
    if rng.random() < 0.4:
        draft.analysis["steps"] = rng.choice((1, 2, 4))
        for name, normal in zip(names, normals, strict=True):
            draft.boundary[name] = local(press + shear, normal, *components)
        return
    values = [(1, press), (rng.randint(1, 4), press + shear)]
    for _ in range(rng.choice((0, 1, 1, 2))):
        values.append((rng.randint(1, 3), press * rng.uniform(0.5, 1.2) + shear * rng.uniform(-1, 0.5)))
    draft.boundary |= {name: dict.fromkeys(components, 0.0) for name in names}
    draft.stages = [
        {
            "name": f"s{number}",
            "steps": steps,
            "boundary": {name: local(value, n, *components) for name, n in zip(names, normals, strict=True)},
        }
        for number, (steps, value) in enumerate(values)
    ]
