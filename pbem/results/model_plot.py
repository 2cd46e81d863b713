"""A picture of a model before it is computed: regions, elements, conditions, contact sides, cracks."""

from __future__ import annotations

import os

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path as OutlinePath
from matplotlib.text import Text

from pbem.arrays import Complex, Integer, Real
from pbem.mesh.generate import generate_mesh
from pbem.mesh.mesh import Mesh
from pbem.model.model import Condition, Model
from pbem.model.origin import move_back
from pbem.model.touching import find_foot
from pbem.model.varying import Places, Value, evaluate
from pbem.results.label_room import part_labels
from pbem.results.model_text import describe_condition
from pbem.results.outline import MANY_ELEMENTS, choose_points, to_columns
from pbem.results.plot_style import FORCE, MOTION, SUPPORT, TOOL_WIDTH, choose_shades, escape, label, style
from pbem.results.refinement_plot import draw_levels

MOST_NAMES = 30
CRACK = "#A51C30"
# Characters of what is prescribed on a curve that stand in one line.
LONGEST = 48


def plot_model(
    model: Model, mesh: Mesh, path: str | os.PathLike[str], levels: Integer | None = None
) -> None:
    """Write the picture of a model; the ending of `path` says the format. levels (e,): see `draw_model`."""
    with style():
        draw_model(model, mesh, levels).savefig(path, dpi=200)


def draw_model(model: Model, mesh: Mesh, levels: Integer | None = None) -> Figure:
    """The figure of `plot_model`; levels (e,): how often each element was halved, to be shown by colours."""
    if model.origin:
        model = move_back(model)
        mesh = generate_mesh(model)
    figure = Figure(figsize=(7.2, 5.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    order = np.argsort(mesh.curve, kind="stable")
    ends = np.searchsorted(mesh.curve[order], np.arange(len(mesh.curve_names) + 1))
    used = {name: order[ends[i]:ends[i + 1]] for i, name in enumerate(mesh.curve_names)}
    _draw_regions(axes, model, mesh)
    _draw_elements(axes, model, mesh)
    for condition in model.conditions.values():
        _draw_condition(axes, model, mesh, condition, used[condition.curve])
    _draw_points(axes, model)
    few = len(model.curves) <= MOST_NAMES
    names = [_name_curve(axes, model, mesh, name, elements) for name, elements in used.items()
             if few and len(elements)]
    _draw_tips(axes, model)
    if len(model.interfaces) <= MOST_NAMES:
        for name in model.interfaces:
            _draw_sides(axes, model, mesh, name)
    axes.autoscale_view()
    axes.margins(0.06)
    axes.set_xlabel(label("$x$", model.units_length))
    axes.set_ylabel(label("$y$", model.units_length))
    axes.set_title(f"{escape(model.title)}\n{mesh.elements} elements of order {mesh.order}, {mesh.nodes} nodes, "
                   f"{mesh.pairs.count} contact pairs", loc="left", fontsize=9)
    handles = _list_handles(model, few)
    if levels is not None:
        handles += draw_levels(axes, mesh, levels)
    axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5))
    part_labels(axes, names)
    return figure


def _draw_regions(axes: Axes, model: Model, mesh: Mesh) -> None:
    """Shade the regions and name those that were written one by one where there is most room; an infinite one is the
    shaded plane."""
    made = {name for group in model.groups for name in group.members}
    shades = choose_shades(mesh.region_names, model.groups)
    lines = _trace_lines(mesh)
    ends = np.searchsorted(mesh.region, np.arange(len(model.regions) + 1))
    cavities: list[OutlinePath] = []
    bodies: list[OutlinePath] = []
    for number, region in enumerate(model.regions):
        own = slice(ends[number], ends[number + 1])
        loops = [OutlinePath(to_columns(loop)) for loop in _list_loops(mesh, lines, own)]
        if region.rigid:
            points = to_columns(lines[own])
            axes.add_collection(LineCollection(list(points), colors="0.15", linewidths=TOOL_WIDTH, zorder=2.5))
            if len(model.curves) > MOST_NAMES:  # else its curve has its name
                middle = points.reshape(-1, 2)[points.shape[0] * points.shape[1] // 2]
                axes.annotate(escape(region.name), middle, xytext=(4, 4), textcoords="offset points", style="italic",
                              color="0.3", zorder=6)
            continue
        if region.infinite:
            axes.set_facecolor(shades[number])
            cavities += loops
            text = f"{escape(region.name)} (infinite)"
            axes.text(0.02, 0.02, text, transform=axes.transAxes, style="italic", color="0.3", zorder=6)
            continue
        bodies.append(OutlinePath.make_compound_path(*(OutlinePath(loop.vertices, closed=True) for loop in loops)))
        if region.name not in made:
            place = _find_room(bodies[-1], np.concatenate([mesh.start, mesh.end]))
            axes.text(
                place.real, place.imag, escape(region.name), ha="center", va="center", style="italic", color="0.3",
                zorder=6,
            )
    shown = [shade for shade, region in zip(shades, model.regions, strict=True)
             if not region.infinite and not region.rigid]
    axes.add_collection(PathCollection(cavities, facecolors="white", edgecolors="none", zorder=0))
    axes.add_collection(PathCollection(bodies, facecolors=shown, edgecolors="none", zorder=0.5))


def _list_loops(mesh: Mesh, lines: Complex, elements: slice) -> list[Complex]:
    """Closed loops (first point repeated) of a region's elements, cracks left out; lines: points on all elements."""
    loops: list[Complex] = []
    points: list[complex] = []
    for e in elements.start + np.flatnonzero(~mesh.crack[elements]):
        points = points or [complex(mesh.start[e])]
        points += [*lines[e, 1:-1], complex(mesh.end[e])]
        if points[-1] == points[0]:
            loops.append(np.array(points))
            points = []
    return loops


def _trace_lines(mesh: Mesh) -> Complex:
    """Points along every element (e, points)."""
    return mesh.geometry.sample(choose_points(mesh.elements))


def _find_room(path: OutlinePath, boundary: Complex) -> complex:
    """The point of a grid inside the path that is farthest from the boundary."""
    low, high = path.vertices.min(axis=0), path.vertices.max(axis=0)
    x, y = np.meshgrid(*(np.linspace(a, b, 23)[1:-1] for a, b in zip(low, high, strict=True)))
    grid = x.ravel() + 1j * y.ravel()
    # The winding number by the angles from point to point: holes, which run the other way, count zero.
    inside = path.contains_points(to_columns(grid))
    grid = grid[inside] if inside.any() else grid
    distance = np.min(np.abs(grid[:, None] - boundary[None, :: max(1, len(boundary) // 2000)]), axis=1)
    return complex(grid[np.argmax(distance)])


def _draw_elements(axes: Axes, model: Model, mesh: Mesh) -> None:
    """Every element, of few with ticks across their ends; cracks heavier."""
    lines = to_columns(_trace_lines(mesh))
    if mesh.elements <= MANY_ELEMENTS:
        _draw_ticks(axes, model, mesh)
    for crack, color, width in ((False, "0.15", 0.9), (True, CRACK, 1.3)):
        axes.add_collection(LineCollection(lines[mesh.crack == crack], colors=color, linewidths=width, zorder=3))


def _draw_ticks(axes: Axes, model: Model, mesh: Mesh) -> None:
    across = 0.006 * model.size * 1j * (mesh.end - mesh.start) / np.abs(mesh.end - mesh.start)
    ends = np.concatenate([mesh.start, mesh.end])
    offset = np.concatenate([across, across])
    ticks = np.stack([to_columns(ends - offset), to_columns(ends + offset)], axis=1)
    axes.add_collection(LineCollection(ticks, colors="0.35", linewidths=0.5, zorder=3))


def _draw_condition(axes: Axes, model: Model, mesh: Mesh, condition: Condition, elements: Integer) -> None:
    """Supports where displacements are held, arrows for displacements and tractions that are not zero."""
    if any(condition.curve in body.curves for body in model.rigid.values()):
        lines = [to_columns(line) for line in _trace_lines(mesh)[elements]]
        axes.add_collection(LineCollection(lines, colors=SUPPORT, linewidths=TOOL_WIDTH, zorder=2.5))
        return
    values = [stage.boundary.get(condition.curve, (0.0, 0.0)) for stage in model.stages]
    place, normal = _spread_points(mesh, elements)
    local = condition.value_frame == "local"
    axes_of_curve = (normal, 1j * normal) if local else (np.ones_like(normal), 1j * np.ones_like(normal))
    held = [quantity == "displacement" and not any(value[i] for value in values)
            for i, quantity in enumerate(condition.known)]
    if all(held):
        _draw_clamp(axes, model, mesh, elements)
    elif any(held):
        direction = axes_of_curve[held.index(True)]
        # The roller stands outside; where the held direction runs along the curve, beside its line all the same.
        outward = np.where((direction * normal.conj()).real < -1e-9, -direction, direction)
        _draw_rollers(axes, model, place, outward)
    for quantity, color in (("traction", FORCE), ("displacement", MOTION)):
        vector = sum(
            (_evaluate_last(model, condition.curve, [value[i] for value in values], place) * axes_of_curve[i]
             for i in range(2) if condition.known[i] == quantity),
            start=np.zeros_like(normal),
        )
        _draw_arrows(axes, model.size, place, normal, vector, color)


def _evaluate_last(model: Model, curve: str, values: list[Value], place: Complex) -> Real:
    """At places of a curve the last value of the history that is not zero, at the end of its stage."""
    number, value = next(((number, value) for number, value in reversed([*enumerate(values)]) if value), (0, 0.0))
    along = np.array([find_foot(model.curves[curve], point)[1] for point in place])
    return evaluate(value, Places(place + model.origin, along), model.find_time(number, 1.0))


def _spread_points(mesh: Mesh, elements: Integer, most: int = 6) -> tuple[Complex, Complex]:
    """About `most` points spread along a curve by length, and the outward normals there."""
    length = np.abs(mesh.end[elements] - mesh.start[elements])
    along = np.concatenate([[0.0], np.cumsum(length)])
    wanted = (np.arange(most) + 0.5) / most * along[-1]
    which = np.clip(np.searchsorted(along, wanted, side="right") - 1, 0, len(elements) - 1)
    chosen = elements[which]
    step = (mesh.end - mesh.start)[chosen]
    place = mesh.start[chosen] + (wanted - along[which]) / length[which] * step
    return place, -1j * step / np.abs(step)


def _draw_clamp(axes: Axes, model: Model, mesh: Mesh, elements: Integer) -> None:
    place, normal = _spread_points(mesh, elements, 24)
    stroke = 0.03 * model.size * normal * np.exp(0.25j * np.pi)
    lines = np.stack([to_columns(place), to_columns(place + stroke)], axis=1)
    axes.add_collection(LineCollection(lines, colors=SUPPORT, linewidths=0.6, zorder=2))


def _draw_rollers(axes: Axes, model: Model, place: Complex, outward: Complex) -> None:
    """Circles on which the curve rolls, with a line behind them."""
    radius = 0.012 * model.size
    for point, direction in zip(place, outward, strict=True):
        circle = OutlinePath.circle(to_columns(np.array([point + radius * direction]))[0], radius)
        axes.add_patch(PathPatch(circle, facecolor="white", edgecolor=SUPPORT, linewidth=0.7, zorder=2.5))
        ground = point + 2 * radius * direction + 1.6 * radius * np.array([-1j, 1j]) * direction
        axes.plot(ground.real, ground.imag, color=SUPPORT, linewidth=0.7, zorder=2.5)


def _draw_arrows(axes: Axes, size: float, place: Complex, normal: Complex, vector: Complex, color: str) -> None:
    """Arrows outside the body: those that press end on the curve, those that pull begin on it."""
    largest = np.abs(vector).max(initial=0.0)
    if largest == 0.0:
        return
    # In a small hole the arrows have to be small as well.
    extent = max(float(np.ptp(place.real)), float(np.ptp(place.imag)))
    arrows = min(0.09 * size, 0.3 * extent) * vector / largest
    pressing = (arrows * normal.conj()).real < -1e-3 * np.abs(arrows)
    sliding = np.abs((arrows * normal.conj()).real) <= 1e-3 * np.abs(arrows)
    gap = min(0.02 * size, 0.07 * extent) * normal
    tail = place + np.where(sliding, gap - arrows / 2, np.where(pressing, gap - arrows, gap))
    axes.quiver(tail.real, tail.imag, arrows.real, arrows.imag, color=color, angles="xy", scale_units="xy", scale=1,
                width=0.003, headwidth=4.5, headlength=5.5, zorder=5)
    # Arrows do not count for the limits of the axes by themselves.
    tips = np.concatenate([tail, tail + arrows])
    axes.update_datalim(to_columns(tips))


def _draw_points(axes: Axes, model: Model) -> None:
    """Arrows and dots of point loads, the last forces that are not zero; triangles of point supports."""
    for name, load in model.point_loads.items():
        forces = [stage.point_forces[name] for stage in model.stages if any(stage.point_forces[name])]
        x, y, moment = forces[-1] if forces else (0.0, 0.0, 0.0)
        force = complex(x, y)
        if force:
            arrow = 0.09 * model.size * force / abs(force)
            # On a boundary a force that pulls begins at its point.
            pulls = load.on_boundary and (force * load.inward.conjugate()).real < 0
            tail = load.place if pulls else load.place - arrow
            axes.quiver(tail.real, tail.imag, arrow.real, arrow.imag, color=FORCE, angles="xy", scale_units="xy",
                        scale=1, width=0.005, headwidth=4.0, headlength=5.0, zorder=5)
            axes.update_datalim(to_columns(np.array([tail, tail + arrow])))
        axes.plot(load.place.real, load.place.imag, "o", color=FORCE, markersize=2.5, zorder=5)
        text = escape(f"{name}, moment {moment:g}" if moment else name)
        axes.annotate(text, (load.place.real, load.place.imag), (4, 4), textcoords="offset points", fontsize=7,
                      color=FORCE, zorder=6)
    for name, support in model.point_supports.items():
        axes.plot(support.place.real, support.place.imag, "^", color=SUPPORT, markersize=5, zorder=5)
        axes.annotate(escape(name), (support.place.real, support.place.imag), (4, -9), textcoords="offset points",
                      fontsize=7, color=SUPPORT, zorder=6)


def _name_curve(axes: Axes, model: Model, mesh: Mesh, name: str, elements: Integer) -> tuple[Text, complex]:
    """The curve's name at its middle, with what is prescribed there, and the direction away from it; beside a steep
    curve the text runs upwards."""
    one_side = elements[mesh.region[elements] == mesh.region[elements[0]]]
    # Curves inside are named off their middle, where other names are likelier to be.
    most, which = (1, 0) if name in model.conditions else (4, 3 if mesh.crack[one_side[0]] else 0)
    place, normal = (complex(values[which]) for values in _spread_points(mesh, one_side, most))
    text, far = name, 0.02
    if name in model.conditions:
        given = describe_condition(model, model.conditions[name])
        loaded = any(any(stage.boundary.get(name, (0.0, 0.0))) for stage in model.stages)
        if given[0] != "free":
            between = ", " if len(given[0]) + len(given[1]) <= LONGEST else "\n"
            text, far = f"{name}\n{given[0]}{between}{given[1]}", 0.14 if loaded else 0.045
    if model.curves[name].closed:
        # Below the curve: inside of a hole there is no room.
        lowest = mesh.start[one_side][np.argmin(mesh.start[one_side].imag)]
        place, normal, far = complex(lowest), -1j, 0.02
    steep = abs(normal.real) > 0.75
    at = place + far * model.size * normal
    written = axes.text(
        at.real, at.imag, escape(text), rotation=90 if steep else 0, fontsize=7, color="0.2", zorder=6, linespacing=1.4,
        ha="left" if normal.real > 0.4 else "right" if normal.real < -0.4 else "center",
        va="center" if steep else "bottom" if normal.imag > 0 else "top",
    )
    room = at + 0.06 * model.size * normal * (1 + text.count("\n"))
    axes.update_datalim(to_columns(np.array([room])))
    return written, normal


def _draw_tips(axes: Axes, model: Model) -> None:
    """Tips of cracks as dots."""
    tips = [
        end for name, ends in model.crack_tips.items()
        for end, is_tip in zip((model.curves[name].start, model.curves[name].end), ends, strict=True) if is_tip
    ]
    if tips:
        size = 4.0 if len(model.crack_tips) < 10 else 2.5 if len(model.crack_tips) < 300 else 1.0
        axes.plot(np.real(tips), np.imag(tips), ".", color=CRACK, markersize=size, zorder=4)


def _draw_sides(axes: Axes, model: Model, mesh: Mesh, name: str) -> None:
    """The normal of the first side, and the numbers of both sides."""
    pairs = np.flatnonzero(mesh.pairs.interface == mesh.interface_names.index(name))
    if not len(pairs):
        return
    along = mesh.pairs.arc_length[pairs]
    pair = pairs[np.argmin(np.abs(along - (along.min() + 0.25 * np.ptp(along))))]
    place, normal = mesh.pairs.position[pair], mesh.pairs.normal[pair]
    axes.quiver(place.real, place.imag, normal.real, normal.imag, angles="xy", scale_units="xy",
                scale=1 / (0.06 * model.size), width=0.003, color="#1B7837", zorder=5)
    for number, side in (("1", -1), ("2", 1)):
        at = place + model.size * (0.025 * side * normal + 0.02j * normal)
        axes.text(at.real, at.imag, number, ha="center", va="center", fontsize=6.5, color="#1B7837", zorder=6)


def _list_handles(model: Model, few: bool) -> list[Line2D]:
    handles = [Line2D([], [], color="0.15", linewidth=0.9, marker="|", markersize=5, label="elements")]
    if model.crack_tips:
        handles.append(Line2D([], [], color=CRACK, linewidth=1.3, label=f"cracks ({len(model.crack_tips)})"))
    if 0 < len(model.interfaces) <= MOST_NAMES:
        handles.append(Line2D([], [], color="#1B7837", marker=r"$\rightarrow$", markersize=8, linestyle="none",
                              label="normal of the first side"))
    for quantity, color in (("traction", FORCE), ("displacement", MOTION)):
        if any(quantity == known and any(stage.boundary.get(name, (0.0, 0.0))[i] for stage in model.stages)
               for name, condition in model.conditions.items() for i, known in enumerate(condition.known)):
            handles.append(Line2D([], [], color=color, marker=r"$\rightarrow$", markersize=8, linestyle="none",
                                  label=f"{quantity}s prescribed"))
    if model.point_loads:
        handles.append(Line2D([], [], color=FORCE, marker="o", markersize=2.5, linestyle="none", label="point loads"))
    if model.point_supports:
        handles.append(Line2D([], [], color=SUPPORT, marker="^", markersize=5, linestyle="none",
                              label="point supports"))
    if model.rigid:
        handles.append(Line2D([], [], color=SUPPORT, linewidth=TOOL_WIDTH, label="rigid"))
    if not few:
        handles.append(Line2D([], [], linestyle="none", label=f"{len(model.curves)} curves, names left out"))
    return handles
