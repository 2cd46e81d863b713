"""From the case file to the model: every name resolved, every loop closed, every fault found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pbem.description.case import Case
from pbem.errors import CaseError, Fault, KeyPath
from pbem.geometry.curve import Curve
from pbem.geometry.junction import find_crossings, split_at_junctions
from pbem.geometry.loop import Loops, find_loops
from pbem.model.approach import find_closing
from pbem.model.coincidence import find_coincidences
from pbem.model.construction import arrange_model, check_gone_points, group_stages
from pbem.model.crack import (
    check_inside,
    check_near_misses,
    check_tip_elements,
    describe_closing,
    describe_near_misses,
    divide_for_tips,
    find_tips,
)
from pbem.model.cutting import Cut, cut_cracks
from pbem.model.fitting import fit_curves
from pbem.model.grading import check_turning, grade_curves
from pbem.model.in_situ import AT_REST, LinearStress
from pbem.model.interior import check_interior_points, list_interior_points
from pbem.model.kinks import list_varying, split_at_kinks
from pbem.model.law import check_along
from pbem.model.load_notes import note_jumps, note_loads
from pbem.model.loading import Loading, list_held, read_loading
from pbem.model.loads_along import check_loads
from pbem.model.material import Material
from pbem.model.model import Analysis, Model, Region, SolverOptions, Stage
from pbem.model.net_force import check_plane
from pbem.model.origin import move_to_own_origin
from pbem.model.overlap import check_contacts, find_overlaps, list_apart
from pbem.model.piece_faults import check_interface_along
from pbem.model.point_loads import PointLoads, place_point_loads, split_at_points
from pbem.model.point_supports import PointSupport, place_point_supports
from pbem.model.pulled import check_pulled
from pbem.model.recall import Recall
from pbem.model.resultants import describe_unbalance
from pbem.model.rigid_body_modes import (
    RigidBodyMode,
    find_least_stiffness,
    find_rigid_body_modes,
    list_hold,
)
from pbem.model.roles import Roles, resolve_roles
from pbem.model.shaping import shape_curves
from pbem.model.sight import check_facing, split_opposite_ends
from pbem.model.spread_forces import spread_forces
from pbem.model.steep_loads import shorten_under_loads
from pbem.model.support_motions import check_independent
from pbem.model.thin_bodies import list_bonded
from pbem.model.tools import check_tools, divide_tools, make_tool_regions, orient_tools
from pbem.model.traces import find_traces
from pbem.model.varying import Varying
from pbem.wording import list_names

# Faults shown of what one table [[generate]] made.
MOST_FAULTS = 5


@dataclass(frozen=True)
class _Topology:
    curves: Mapping[str, Curve]
    breaks: Mapping[str, tuple[complex, ...]]
    opposite: Mapping[str, Mapping[complex, tuple[str, complex]]]
    loops: Loops
    tips: Mapping[str, tuple[bool, bool]]
    size: float
    points: PointLoads
    supports: Mapping[str, PointSupport]
    notes: tuple[str, ...]
    faults: tuple[Fault, ...]
    overlaps: Mapping[str, float]


def build_model(case: Case) -> Model:
    """Resolve and check a case. Raises CaseError with every fault of names, topology, laws, loads and support."""
    model, faults = examine(case)
    if model is None or faults:
        raise CaseError(case.source, limit_faults(faults))
    return model


def limit_faults(faults: Sequence[Fault]) -> tuple[Fault, ...]:
    """Each fault once; of many at the same table [[generate]] the first few, and how many more there are."""
    shown: list[Fault] = []
    counts: Counter[str] = Counter()
    for fault in dict.fromkeys(faults):
        generated = fault.place.startswith("generate[")
        counts[fault.place] += generated
        if not generated or counts[fault.place] <= MOST_FAULTS:
            shown.append(fault)
    shown += [
        Fault(place, f"{count - MOST_FAULTS} more of such faults", "none")
        for place, count in counts.items() if count > MOST_FAULTS
    ]
    return tuple(shown)


def examine(
    case: Case, conditions_known: bool = True, recall: Recall | None = None
) -> tuple[Model | None, list[Fault]]:
    """The model, if any, and all that is wrong with it; conditions_known: whether support can be judged.

    recall: what was found of the curves of the last case, for this one if it has the same.
    """
    model, case, faults = _examine(case, conditions_known, recall or Recall())
    return model, [case.trace(fault) for fault in faults]


def _examine(case: Case, conditions_known: bool, recall: Recall) -> tuple[Model | None, Case, list[Fault]]:
    """As above, with the case in which cracks that cross are cut."""
    roles = resolve_roles(case)
    shown = (roles, case.curves, case.regions, case.analysis, case.origin)
    shapes = recall.find("shapes", shown, lambda: shape_curves(case, roles))
    cut = cut_cracks(case, roles, shapes)
    case, roles = cut.case, cut.roles
    loading = read_loading(case, roles)
    overlaps = [(name, table.between, table.overlap) for name, table in case.contacts.items()]
    in_stages = [stage.point_loads for stage in case.stages]
    kinked = [(loc, given) for loc, _, given in list_varying(case)]
    pointed = (case.point_loads, in_stages, case.point_supports, list_held(loading.conditions), kinked)
    drawn = (*shown, cut.notes, cut.faults, case.curves, pointed, case.tools, overlaps)
    topology = recall.find("topology", drawn, lambda: _find_topology(cut, loading))
    interior, wrong = list_interior_points(case)
    faults = [*roles.faults, *check_tools(case, roles), *topology.faults, *loading.faults, *wrong,
              *check_gone_points(case, topology.points.loads, topology.supports)]
    if faults:
        return None, case, faults
    model, faults = _compose(case, roles, loading, topology, recall)
    model = replace(model, interior_points=interior)
    turning = recall.find("turning", (case.curves, model.curves), lambda: check_turning(case, model.curves))
    faults += [*turning, *check_facing(model), *check_interior_points(case, model)]
    varying = [
        fault for name, interface in model.interfaces.items()
        for fault in check_interface_along(case, name, interface, model.curves[name])
    ]
    varying += [
        fault for name, contact in model.contacts.items()
        for fault in check_along(("contacts", name), contact.law, model.curves[contact.first])
    ]
    varying += check_loads(case, model)
    faults += varying
    radii = {name: table.radius for name, table in case.curves.items() if table.radius is not None}
    model = move_to_own_origin(model, radii)
    if conditions_known and not varying:
        model = replace(model, closing=find_closing(model))
        wrong, notes = _check_support(model, recall)
        faults += wrong
        model = replace(model, notes=(*model.notes, *notes))
    return model, case, faults


def _find_topology(cut: Cut, loading: Loading) -> _Topology:
    case, roles, shapes = cut.case, cut.roles, cut.shapes
    apart = list_apart(case, roles)
    split = split_at_junctions(shapes.curves, shapes.tolerance, apart)
    curves: Mapping[str, Curve]
    loaded = [complex(*table.at) for table in case.point_loads.values()]
    curves, places = split_at_points(split_at_kinks(case, split.curves), shapes.tolerance, loaded)
    opposite: Mapping[str, Mapping[complex, tuple[str, complex]]] = {}
    cracks = {name: region for name, region in roles.cracks.items() if name in curves}
    # Two bodies may touch anywhere along their curves in contact; one body may not touch itself.
    touching = apart | {
        frozenset(pair) for pair in roles.contacts.values() if roles.outer[pair[0]] != roles.outer[pair[1]]
    }
    crossings = [*cut.faults] or find_crossings(curves, cracks, shapes.tolerance, touching)
    boundaries = {name: table.boundary for name, table in case.regions.items()}
    infinite = {name for name, table in case.regions.items() if table.infinite}
    loops, wrong = find_loops(boundaries, infinite, curves, shapes.tolerance, check_nesting=not crossings)
    faults = [*shapes.faults, *crossings, *wrong]
    overlaps: dict[str, float] = {}
    notes = [*cut.notes, *shapes.notes, *split.notes]
    if not crossings:
        faults += find_overlaps(case, curves, loops, roles, shapes.tolerance)
        overlaps, pressed, wrong = check_contacts(case, curves, loops, roles, shapes.tolerance)
        faults += wrong
        notes += pressed
        faults += check_inside(case, curves, cracks, loops)
        faults += check_near_misses(curves, cracks)
        loops = {**loops, **orient_tools(case, curves, loops, roles)}
        faults += find_coincidences(curves, loops, roles)
        notes += describe_closing(curves, cracks, loops)
    if not faults:
        written = {name for name in curves if case.curves[name].expression}
        seats = split_opposite_ends(curves, loops, roles.contacts, written)
        curves, opposite = seats.curves, seats.opposite
        notes += seats.notes
    points = PointLoads({}, (), ())
    if not faults:
        points = place_point_loads(case, roles, curves, loops, places, list_held(loading.conditions))
        faults += points.faults
        notes += points.notes
    supports, wrong = place_point_supports(case, roles, curves)
    faults += wrong
    tips = find_tips(curves, cracks)
    curves = divide_tools(case, divide_for_tips(case, curves, tips))
    notes += describe_near_misses(case, curves, tips)
    faults += check_tip_elements(case, curves, tips)
    return _Topology(
        curves, split.breaks, opposite, loops, tips, shapes.size, points, supports, tuple(notes), tuple(faults),
        overlaps,
    )


def _compose(case: Case, roles: Roles, loading: Loading, topology: _Topology, recall: Recall
             ) -> tuple[Model, list[Fault]]:
    loading = spread_forces(loading, topology.curves)
    behaviour: dict[str, Hashable] = {
        # A load that jumps is a change of condition, too.
        name: (roles.outer[name], condition.frame, condition.known, condition.stiffness,
               tuple((stage.boundary.get(name, (0.0, 0.0)), stage.ends.get(name)) for stage in loading.stages))
        for name, condition in loading.conditions.items()
    }
    behaviour |= {
        name: (interface.first, interface.second, interface.law,
               tuple(stage.construction.joints.get(name) for stage in loading.stages))
        for name, interface in loading.interfaces.items()
    }
    behaviour |= {curve: ("contact", name) for curve, name in roles.in_contact.items()}
    with_tips = frozenset(roles.cracks) if case.analysis.tips else frozenset()
    partners = {curve: other for pair in roles.contacts.values() for curve, other in (pair, pair[::-1])}
    curves, grading = grade_curves(
        case, topology.curves, topology.breaks, behaviour, with_tips, partners, topology.opposite
    )
    materials = {
        name: Material(name, table.young, table.poisson, table.plane, table.density)
        for name, table in case.materials.items()
    }
    regions = tuple(
        Region(name, materials[table.material], topology.loops[name], tuple(table.cracks), table.infinite)
        for name, table in case.regions.items()
    )
    tools = make_tool_regions(case, curves, loading.rigid.bodies, topology.loops)
    jointed = frozenset(loading.interfaces) | frozenset(roles.in_contact)
    bonded = list_bonded(loading.interfaces, loading.stages)
    loads = tuple(topology.points.loads.values())
    fitted = shorten_under_loads(case, loading.stages, recall.find(
        "lengths", (case.curves, case.analysis, curves, regions, topology.tips, jointed, roles.contacts, loads, bonded),
        lambda: fit_curves(case, curves, regions, topology.tips, jointed, roles.contacts, loads, bonded),
    ), topology.tips)
    model = Model(
        title=case.title, units_length=case.units.length, units_stress=case.units.stress, source="",
        regions=(*regions, *tools), curves=fitted.curves, interfaces=loading.interfaces, conditions=loading.conditions,
        crack_tips=topology.tips, stages=loading.stages,
        analysis=Analysis(
            case.analysis.scheme, case.analysis.order, case.analysis.tips, case.analysis.accuracy,
            case.analysis.grade_contact_ends,
        ),
        solver=SolverOptions(
            linear=case.solver.linear, operator=case.solver.operator, tolerance=case.solver.tolerance,
            newton_tolerance=case.solver.newton_tolerance, newton_max_iterations=case.solver.newton_max_iterations,
            min_step=case.solver.min_step, petsc=dict(case.petsc),
        ),
        output_every=case.output.every, size=topology.size,
        interior_grid=case.output.interior.shape if case.output.interior else None,
        notes=(*topology.notes, *grading, *fitted.notes, *_note_choices(case)),
        given_gradings=frozenset(
            name for name, table in case.curves.items() if table.grading != "auto" or table.expression),
        initial_stress=loading.initial_stress,
        rest_gravity=loading.rest_gravity,
        contacts={name: replace(each, overlap=topology.overlaps.get(name, 0.0))
                  for name, each in loading.contacts.items()},
        rigid=loading.rigid.bodies,
        groups=case.groups, traces=find_traces(case, fitted.curves),
        ties=fitted.ties,
        point_loads=topology.points.loads,
        point_supports=topology.supports,
    )
    stages = tuple(_center_remote(stage, model.middle) for stage in model.stages)
    model = replace(model, stages=stages)
    return replace(model, notes=(*model.notes, *note_loads(model), *note_jumps(model))), list(fitted.faults)


def _center_remote(stage: Stage, middle: complex) -> Stage:
    """The stress far away as that at the middle of the model and what it grows by from there."""
    growth = stage.remote_growth
    if growth.is_uniform:
        return replace(stage, remote_growth=AT_REST)
    value = growth.evaluate(np.array([middle]))[0]
    remote = (float(value[0]), float(value[1]), float(value[2]))
    return replace(stage, remote=remote, remote_growth=LinearStress((0.0, 0.0, 0.0), growth.by_x, growth.by_y, middle))


def _note_choices(case: Case) -> list[str]:
    notes = []
    used = {table.material for table in case.regions.values()}
    unused = [f"'{name}'" for name in case.materials if name not in used]
    if unused:
        notes.append(f"Materials that no region uses: {list_names(unused)}.")
    return notes


def _has_soft_springs(model: Model, names: Sequence[str], soft: float) -> bool:
    curves = {side.curve for region in model.regions if region.name in names
              for loop in region.loops for side in loop.sides}
    return any(not isinstance(stiffness, Varying) and 0 < stiffness <= soft
               for name, condition in model.conditions.items() if name in curves for stiffness in condition.stiffness)


def _check_hold(
    model: Model, now: Model, stages: Sequence[int], motions: Sequence[RigidBodyMode], later: bool
) -> tuple[list[Fault], list[str]]:
    """Of stages with the same construction: faults for bodies that nothing holds, and motions whose loads balance.

    now: the model as it is there, with free motions. later: these are not the first stages.
    """
    faults, balanced = [], []
    regions = {region.name: region for region in model.regions}
    for motion in motions:
        found = f"a free rigid motion ({motion.text})"
        unbalance = describe_unbalance(now, motion, [regions[name] for name in motion.regions], stages)
        if unbalance is None:
            balanced.append(motion.text)
            continue
        soft = max(find_least_stiffness(model, regions[name]) for name in motion.regions)
        springs = f"springs stiffer than {soft:.2g}" if _has_soft_springs(model, motion.regions, soft) else "springs"
        expected = f"displacement conditions, {springs}, or bonded or touching neighbours, that prevent it"
        if later:
            found = f"from stage '{model.stages[stages[0]].name}' on {found}"
        if regions[motion.regions[0]].rigid:
            expected = "a motion in place of the force (ux, uy, rotation), or a contact that stops it"
        free = motion.regions[0]
        loc: KeyPath = ("tools" if regions[free].rigid else "regions", free)
        faults.append(Fault.at(loc, f"{found}: {unbalance}", expected))
    return faults, balanced


def _check_support(model: Model, recall: Recall) -> tuple[list[Fault], list[str]]:
    """Faults for bodies that nothing holds; notes for those that stay at rest because their loads balance."""
    faults = list(check_pulled(model))
    if faults:
        return faults, []
    balanced: list[str] = []
    free: dict[str, RigidBodyMode] = {}
    groups = group_stages(model)
    free_of = recall.find("motions", list_hold(model), lambda: [
        find_rigid_body_modes(arrange_model(model, stages[0])) for stages in groups
    ])
    for stages, motions in zip(groups, free_of, strict=True):
        number = stages[0]
        now = arrange_model(model, number)
        wrong, resting = _check_hold(model, now, stages, motions, faults == [] and number > 0)
        faults += wrong
        balanced += resting
        free |= {motion.text: motion for motion in motions}
    faults += check_independent(list(model.point_supports.values()), list(free.values()))
    balanced = [*dict.fromkeys(balanced)]
    notes = []
    if model.closing:
        names = list_names([f"'{name}'" for name in sorted(model.closing)])
        notes.append(f"Nothing but {names} holds what the loads move, which does not touch yet: the search for its "
                     "contact begins where it first touches.")
    wrong, told = check_plane(model)
    faults += wrong
    notes += told
    chosen = "as far as no point support says otherwise, " if model.point_supports else ""
    sentence = ("Nothing prevents: {}. The loads balance, and " + chosen +
                "the mean displacement and rotation are set to zero.")
    listed = [*balanced[:6], *([f"and {len(balanced) - 6} more"] if len(balanced) > 6 else [])]
    return faults, [*([sentence.format("; ".join(listed))] if balanced else []), *dict.fromkeys(notes)]
