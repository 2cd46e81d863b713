"""What the pictures share: fonts, colours that also colour-blind readers tell apart, labels with units."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.font_manager import FontProperties, findfont, get_font

from pbem.contact.laws import OPEN, SLIP, STICK
from pbem.description.generation import GeneratedGroup
from pbem.results.reader import Results


@dataclass(frozen=True)
class ModeStyle:
    """How pairs of one mode are marked: by shape as well as by colour, and by filling; as a line by its stroke."""

    name: str
    marker: str
    face: str
    edge: str
    stroke: str

    @property
    def marks(self) -> dict[str, Any]:
        """Arguments of `scatter`."""
        return {"marker": self.marker, "facecolors": self.face, "edgecolors": self.edge, "linewidths": 0.6}

    @property
    def line(self) -> dict[str, Any]:
        """Arguments of `Line2D`."""
        return {"marker": self.marker, "markerfacecolor": self.face, "markeredgecolor": self.edge,
                "markeredgewidth": 0.6, "markersize": 4.5}


MODES = {
    STICK: ModeStyle("stick", "o", "#0072B2", "#0072B2", "#0072B2"),
    SLIP: ModeStyle("slip", "^", "#E69F00", "#B87D00", "#E69F00"),
    OPEN: ModeStyle("open", "s", "white", "#333333", "black"),
}
def choose_shades(names: Sequence[str], groups: Sequence[GeneratedGroup]) -> list[str]:
    """A shade for every region, by its name: the same for those that were generated together."""
    group_of = {member: group.name for group in groups for member in group.members}
    numbers: dict[str, int] = {}
    chosen = (numbers.setdefault(f"[{group_of[name]}]" if name in group_of else name, len(numbers)) for name in names)
    return [SHADES[number % len(SHADES)] for number in chosen]


SHADES = ("#DCE6EE", "#EFE6D5", "#DFEBDC", "#EADFEA", "#E4E4E4", "#F2DEDA")
POWER, SUPERSCRIPT = r"\^(-?[0-9.]+)", r"$^{\1}$"
TIP = "#A51C30"
# Of the lines of rigid tools and curves, points.
TOOL_WIDTH = 2.2
TITLE_WIDTH = 90
FORCE, MOTION, SUPPORT = "#D55E00", "#0072B2", "#444444"


@contextmanager
def style() -> Iterator[None]:
    """Small type and thin lines while the block runs."""
    with matplotlib.rc_context({
        "font.size": 8, "axes.titlesize": 9, "axes.linewidth": 0.6, "legend.fontsize": 7.5, "legend.frameon": False,
        "xtick.major.width": 0.6, "ytick.major.width": 0.6, "mathtext.default": "it",
        "axes.formatter.use_mathtext": True,
    }):
        yield


def label(quantity: str, unit: str) -> str:
    """`quantity (unit)`; powers in the unit as superscripts."""
    if not unit:
        return quantity
    plain = escape(unit).replace("**", "^")
    return f"{quantity} ({re.sub(POWER, SUPERSCRIPT, plain)})"


def escape(text: str) -> str:
    """Names and titles as they were written: a dollar sign begins no formula, and what the font lacks is marked."""
    known = _list_characters()
    shown = "".join(each if each == "\n" or ord(each) in known else "\N{REPLACEMENT CHARACTER}" for each in text)
    return shown.replace("$", r"\$")


@lru_cache
def _list_characters() -> frozenset[int]:
    """The characters that the font of the pictures has."""
    return frozenset(get_font(findfont(FontProperties(family=["sans-serif"]))).get_charmap())


def scale_axis(axes: Axes, which: str = "y", most: int = 7) -> None:
    """Few ticks; small and large numbers with a common power of ten, digits that all have in common set apart."""
    axes.ticklabel_format(axis=which, style="sci", scilimits=(-3, 4))
    axes.locator_params(axis=which, nbins=most)


def scale_plane(axes: Axes, results: Results, most: int = 6) -> None:
    """Equal scales, and the axes' names and ticks (about `most` at most) of a picture of the plane."""
    axes.set_aspect("equal")
    for which in ("x", "y"):
        scale_axis(axes, which, most)
    axes.set_xlabel(label("$x$", results.units.length))
    axes.set_ylabel(label("$y$", results.units.length))


def describe_step(results: Results, step: int) -> str:
    """Title and load step (its place in the file)."""
    steps = results.steps
    stage = escape(steps.stage_names[int(steps.stage[step])])
    title = "\n".join(textwrap.wrap(escape(results.title), TITLE_WIDTH))
    return f"{title}\nstep {steps.number[step]} ({stage}, factor {steps.factor[step]:.4g})".strip()
