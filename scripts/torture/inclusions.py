"""Models of bodies inside of others: inclusions, tight and loose, and a pin in a hole."""

from __future__ import annotations

import cmath
import math
import random

from .draft import Draft, draw_law, draw_laws, draw_log, draw_material
from .planes import add_plate, load_plate, load_remote, press_and_shear, start_plane

MOST_TRIALS = 2000


def draw_tight(rng: random.Random) -> Draft:
    """Round and angular inclusions that fill their holes, softer or stiffer than the plane or plate around them."""
    draft, strain = start_plane(rng, "Tight inclusions")
    _add_inclusions(draft, rng, strain)
    return draft


def draw_loose(rng: random.Random) -> Draft:
    """Inclusions with a clearance of the size of the displacements."""
    draft, strain = start_plane(rng, "Loose inclusions")
    _add_inclusions(draft, rng, strain)
    for law in draft.interfaces.values():
        law["gap"] = strain * draw_log(rng, 0.01, 1.0)
    return draft


def draw_pin(rng: random.Random) -> Draft:
    """A pin in the hole of a plate, with a clearance, that is moved into contact, sideways, and partly back."""
    draft, strain = start_plane(rng, "A pin in a hole")
    draft.title = "A pin in a hole"
    draft.materials["pin"] = draw_material(rng, 0.3, 10.0)
    radius, side = 1.0, rng.uniform(4.0, 8.0)
    add_plate(draft, side)
    clearance = draw_log(rng, 1e-6, 1e-2)
    elements = rng.choice((24, 32, 40))
    draft.add_circle("hole", 0j, radius, elements)
    toward = cmath.exp(1j * rng.uniform(-math.pi, math.pi))
    center, half = clearance * toward, rng.uniform(0.15, 0.4)
    draft.add_circle("shank", center, radius - clearance, elements)
    names = [f"grip{number}" for number in range(4)]
    corners = [center + half * math.sqrt(2) * toward * cmath.exp(0.5j * math.pi * (k + 0.5)) for k in range(4)]
    for number, name in enumerate(names):
        draft.add_line(name, corners[number], corners[(number + 1) % 4], elements=4)
    # Out of the pin is into the square hole by which it is gripped.
    normals = [-toward * cmath.exp(0.5j * math.pi * (number + 1)) for number in range(4)]
    draft.regions["body"] = {"material": "rock", "boundary": ["bottom", "right", "top", "left", "hole"]}
    draft.regions["pin"] = {"material": "pin", "boundary": ["shank", *names]}
    draft.contacts["seat"] = {"between": ["shank", "hole"], **draw_law(rng, strain, strain)}
    for name in ("bottom", "right", "top", "left")[:rng.choice((1, 4))]:
        draft.boundary[name] = {"un": 0.0, "us": 0.0}
    press = strain * toward
    press_and_shear(draft, rng, names, normals, press, press * 1j * rng.uniform(-1, 1))
    return draft


def _add_inclusions(draft: Draft, rng: random.Random, strain: float) -> None:
    count = rng.choice((1, 1, 2, 3))
    finite = rng.random() < 0.4
    side = 3.2 * math.sqrt(count)
    if finite:
        add_plate(draft, side + 1.0)
    places: list[tuple[complex, float]] = []
    least = draw_log(rng, 0.03, 0.5)
    for _ in range(MOST_TRIALS):
        radius = rng.uniform(0.5, 1.0)
        center = complex(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5)) * (side - 2 * radius)
        if all(abs(center - other) > radius + reach + least for other, reach in places):
            places.append((center, radius))
        if len(places) == count:
            break
    draft.materials["grain"] = draw_material(rng, 0.01, 100.0)
    names = []
    for number, (center, radius) in enumerate(places):
        name = f"i{number}"
        names.append(name)
        if rng.random() < 0.6:
            draft.add_circle(name, center, radius, rng.choice((16, 20, 24)))
        else:
            corners = rng.randint(3, 6)
            turn = rng.uniform(0, 2 * math.pi)
            points = [center + radius * cmath.exp(1j * (turn + 2 * math.pi * k / corners)) for k in range(corners)]
            draft.add_line(name, *points, points[0], elements=4 * corners)
        draft.regions[f"g{number}"] = {"material": "grain", "boundary": [name]}
    body = draft.regions.pop("body")
    body |= {"boundary": [*body["boundary"], *names], "infinite": not finite}
    draft.regions["body"] = body
    draft.interfaces = draw_laws(rng, names, strain, strain)
    if finite:
        load_plate(draft, rng, strain)
    else:
        load_remote(draft, rng, strain)


