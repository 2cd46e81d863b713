"""Where a model lies: coordinates about a point of its own where it is far from the origin.

Coordinates are known to so many digits of the largest of them. What is computed from differences of places - positions
of nodes within elements, kernels, expansions, levers of moments - would lose as many digits as the distance from the
origin is longer than an element. So a model far away is moved, exactly, as soon as it is complete, and what is shown,
written or asked of the user's expressions is moved back.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import replace

from pbem.geometry.curve import Leg
from pbem.geometry.elements import Elements
from pbem.model.model import Model
from pbem.model.tools import move_tool

# A model is moved if its middle is further away than so many times its size.
FAR = 4.0
# A point of a circle far away is known to so many roundings of its coordinates.
ROUNDINGS = 8


def move_to_own_origin(model: Model, radii: Mapping[str, float]) -> Model:
    """The same model in coordinates about `origin`, a point near its middle, if it is far from 0.

    The origin has few digits, so that no coordinate is rounded. radii: of circular curves as they were written; the
    ends of their legs, which were rounded far away, are put back on the circle.
    """
    points = Elements.collect([leg for curve in model.curves.values() for leg in curve.legs]).extremes()
    middle = complex(0.5 * (points.real.min() + points.real.max()), 0.5 * (points.imag.min() + points.imag.max()))
    if abs(middle) <= FAR * model.size:
        return model
    unit = 2.0 ** math.floor(math.log2(model.size))
    origin = complex(unit * round(middle.real / unit), unit * round(middle.imag / unit))
    return _move(model, origin, _list_rounded(model, radii, origin))


def move_back(model: Model) -> Model:
    """The same model in the coordinates of the user."""
    return _move(model, -model.origin, {}) if model.origin else model


def _list_rounded(model: Model, radii: Mapping[str, float], origin: complex) -> dict[complex, complex]:
    """Ends of circular legs, to where they are about the origin: on the circle, which they missed by rounding."""
    most = ROUNDINGS * sys.float_info.epsilon * abs(origin)
    places: dict[complex, complex] = {}
    for name, curve in model.curves.items():
        for leg in curve.legs if name in radii else ():
            moved = leg.kind.move(leg, origin, 1.0)
            for end, local in ((leg.start, moved.start), (leg.end, moved.end)):
                on_circle = leg.kind.restore(moved, local, radii[name])
                if abs(on_circle - local) <= most:
                    places.setdefault(end, on_circle)
    return places


def _move(model: Model, origin: complex, places: Mapping[complex, complex]) -> Model:
    """places: where points are about the origin, if not at the difference."""

    def shift(leg: Leg) -> Leg:
        start, end = (places.get(point, point - origin) for point in (leg.start, leg.end))
        moved = leg.kind.move(leg, origin, 1.0)._replace(start=start, end=end)
        return replace(leg, **moved._asdict())

    curves = {name: replace(curve, legs=tuple(map(shift, curve.legs))) for name, curve in model.curves.items()}
    return replace(
        model, curves=curves, origin=model.origin + origin,
        regions=tuple(move_tool(region, origin) for region in model.regions),
        ties=tuple(replace(tie, corner=tie.corner - origin) for tie in model.ties),
        interior_points=tuple(point - origin for point in model.interior_points),
        stages=tuple(
            replace(stage, swelling={name: each.move(origin) for name, each in stage.swelling.items()},
                    remote_growth=stage.remote_growth.move(origin))
            for stage in model.stages
        ),
        point_loads={name: load.move(origin) for name, load in model.point_loads.items()},
        point_supports={name: support.move(origin) for name, support in model.point_supports.items()},
        initial_stress={name: stress.move(origin) for name, stress in model.initial_stress.items()},
    )
