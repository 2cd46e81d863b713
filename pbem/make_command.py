"""The command `pbem make`: its options, and the case file that they ask for."""

from __future__ import annotations

import argparse
import math
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pbem.errors import printable

if TYPE_CHECKING:
    from pbem.case.make import Plan, Value

# The schema is imported where it is used, so that help comes at once.

# Up to so many every crack or inclusion is written out, beyond a table [[generate]] stands for them all.
MOST_WRITTEN = 50
NOTES = f"""\
Places are drawn at random from the seed until each keeps its distance from all others. Up to {MOST_WRITTEN} are written
one by one, more as one table [[generate]]; --explicit and --compact ask for either."""


def add_make_commands(parser: argparse.ArgumentParser) -> None:
    """Add `cracks` and `inclusions` to the command `make`."""
    kinds = parser.add_subparsers(dest="kind", required=True, metavar="cracks|inclusions")
    cracks = kinds.add_parser("cracks", help="random straight cracks", epilog=NOTES)
    _add_common(cracks, 8)
    _add_sizes(cracks, "--half-length", "--length-spread", "of the half-lengths")
    cracks.add_argument("--orientation", default="uniform", type=_read_orientation, metavar="ANGLE",
                        help="degrees from the x axis, or uniform: all directions alike (default)")
    cracks.add_argument("--orientation-spread", type=float, metavar="S", help="degrees: uniform in ANGLE +- S")
    _add_area(cracks)
    inclusions = kinds.add_parser("inclusions", help="random circular inclusions", epilog=NOTES)
    _add_common(inclusions, 16)
    _add_sizes(inclusions, "--radius", "--radius-spread", "of the radii")
    inclusions.add_argument("--inclusion-young", type=float, metavar="E", help="default: ten times that of the host")
    inclusions.add_argument("--inclusion-poisson", type=float, metavar="NU", help="default: that of the host")
    inclusions.add_argument("--law", choices=("bonded", "coulomb"), default=None,
                            help="of the interfaces (default: coulomb if a friction coefficient is given, else bonded)")
    _add_area(inclusions).add_argument("--fraction", type=float, metavar="F",
                                       help="or the fraction of the area that they cover (default: 0.2)")


def _add_common(parser: argparse.ArgumentParser, elements: int) -> None:
    add = parser.add_argument
    add("-o", "--output", required=True, metavar="FILE.toml", help="case file to be written")
    add("--force", action="store_true", help="write over a file that is there")
    add("--count", type=int, required=True, metavar="N")
    add("--name", metavar="NAME", help="of the curves: NAME_1, NAME_2, ... (default: crack, inclusion)")
    add("--distance", type=float, metavar="D", help="smallest distance between any two (default: a tenth of the size)")
    add("--elements", type=int, default=elements, metavar="N", help=f"on each (default: {elements})")
    add("--order", type=int, default=2, help="of the polynomials on an element (default: 2)")
    add("--friction", type=float, metavar="F", help="friction coefficient")
    add("--cohesion", type=float, metavar="C")
    add("--sxx", type=float, default=0.0, help="stress far away, or on the sides of a plate (default: 0)")
    add("--syy", type=float, default=-1.0, help="(default: -1)")
    add("--sxy", type=float, default=0.0, help="far away only (default: 0)")
    add("--steps", type=int, default=1, help="load steps (default: 1)")
    add("--seed", type=int, default=1, help="of the random numbers (default: 1)")
    add("--young", type=float, default=1000.0, metavar="E", help="Young's modulus (default: 1000)")
    add("--poisson", type=float, default=0.2, metavar="NU", help="Poisson's ratio (default: 0.2)")
    add("--plane", choices=("strain", "stress"), default="strain")
    add("--plate", type=float, metavar="SIDE", help="in a square plate on walls instead of an infinite plane")
    add("--plate-elements", type=int, default=20, metavar="N", help="on each side of the plate (default: 20)")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--compact", dest="explicit", action="store_false", default=None)
    form.add_argument("--explicit", dest="explicit", action="store_true", default=None)


def _add_sizes(parser: argparse.ArgumentParser, size: str, spread: str, what: str) -> None:
    parser.add_argument(size, dest="size", type=float, default=1.0, metavar="A", help="(default: 1)")
    parser.add_argument("--distribution", choices=("uniform", "lognormal", "power"), help=f"{what} (default: uniform)")
    parser.add_argument(spread, dest="spread", type=float, metavar="S",
                        help="uniform: in A (1 +- S); lognormal: standard deviation of the logarithm, median A")
    parser.add_argument("--exponent", type=float, metavar="X", help="power: numbers fall like size^-X from A on")
    parser.add_argument("--largest", type=float, metavar="B", help="power: the largest size")


def _add_area(parser: argparse.ArgumentParser) -> Any:
    parser.add_argument("--shape", choices=("square", "disc"), help="of the area of the centres (default: square)")
    area = parser.add_mutually_exclusive_group()
    area.add_argument("--density", type=float, metavar="D", help="number per unit area"
                      + (" (default: 0.1 / A^2)" if "cracks" in parser.prog else ""))
    return area


def read_finite(text: str) -> float:
    """An argument that is a number, not infinite nor NaN."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"found {text!r}; expected a finite number")
    return value


def _read_orientation(text: str) -> float | None:
    if text == "uniform":
        return None
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"'{text}' is neither an angle nor uniform") from None


def make(options: argparse.Namespace) -> Path:
    """Write the case file that the options of the command line ask for; returns its path.

    Raises ValueError for options that do not go together and for a file that is there already, CaseError for values
    that a case cannot have and if there is no room for so many.
    """
    from pbem.case.make import make_case

    target = Path(options.output)
    if target.exists() and not options.force:
        raise ValueError(f"{target} is there already; --force writes over it")
    plan = read_plan(options, options.arguments[1:])
    text = make_case(plan, options.count <= MOST_WRITTEN if options.explicit is None else options.explicit)
    target.write_text(text, encoding="utf-8")
    return target


def read_plan(options: argparse.Namespace, arguments: Sequence[str]) -> Plan:
    """What the options ask for; arguments: as they were given, for the file's first comment.

    Raises ValueError for options that do not go together.
    """
    from pbem.case.make import Plan

    cracks = options.kind == "cracks"
    fraction = None if cracks else options.fraction
    if options.plate is not None:
        given = [key for key in ("density", "fraction", "shape") if getattr(options, key, None) is not None]
        if given:
            raise ValueError(f"--{given[0]} with --plate, whose area and count say it")
        if options.sxy:
            raise ValueError("--sxy with --plate, whose walls bear no shear")
    elif options.density is None and fraction is None:
        fraction = None if cracks else 0.2
    density = options.density
    if cracks and options.plate is None and density is None and options.size > 0:
        density = 0.1 / options.size**2
    name = options.name or options.kind[:-1]
    size = "half_length" if cracks else "radius"
    table: dict[str, Any] = {"kind": options.kind, "name": name, "count": options.count, size: options.size}
    table |= {key: getattr(options, key) for key in ("distribution", "spread", "exponent", "largest")}
    if cracks:
        table |= {"orientation": options.orientation, "orientation_spread": options.orientation_spread}
    else:
        table["material"] = "filling"
    table |= {"density": density, "fraction": fraction, "shape": options.shape}
    table["distance"] = 0.1 * options.size if options.distance is None else options.distance
    table |= {"elements": options.elements, "seed": options.seed}
    host: dict[str, Value] = {"young": options.young, "poisson": options.poisson, "plane": options.plane}
    filling: dict[str, Value] = {}
    if not cracks:
        young, poisson = options.inclusion_young, options.inclusion_poisson
        filling = {"young": 10 * options.young if young is None else young,
                   "poisson": options.poisson if poisson is None else poisson, "plane": options.plane}
    place = "an infinite plane" if options.plate is None else "a square plate"
    return Plan(
        title=f"{options.count} random {options.kind} in {place}",
        table={key: value for key, value in table.items() if value is not None},
        host=host, filling=filling, remote=(options.sxx, options.syy, options.sxy), order=options.order,
        steps=options.steps, plate=options.plate, plate_elements=options.plate_elements,
        command=printable(shlex.join(["pbem", "make", *arguments])), law=_read_law(options, cracks),
    )


def _read_law(options: argparse.Namespace, cracks: bool) -> dict[str, Value]:
    friction = options.friction
    if friction is None and cracks:
        friction = 0.6
    strengths: dict[str, Value] = {
        key: value for key, value in (("friction", friction), ("cohesion", options.cohesion)) if value is not None
    }
    if cracks:
        return strengths
    law = options.law or ("coulomb" if strengths else "bonded")
    return {"law": law, **strengths}
