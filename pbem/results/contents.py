"""The contents of a result file as frozen arrays: nodes, elements, steps, stress-intensity factors, energies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from pbem.arrays import Bool, Integer, Real
from pbem.geometry import elements as geometry


@dataclass(frozen=True)
class Units:
    """Labels of the units of length and stress, as the case gives them."""

    length: str
    stress: str


@dataclass(frozen=True)
class Nodes:
    """Collocation nodes of all regions, both faces of every crack: position, normal (n, 2); indices (n,)."""

    position: Real
    normal: Real
    region: Integer
    curve: Integer
    element: Integer
    order: int
    region_names: tuple[str, ...]
    curve_names: tuple[str, ...]


@dataclass(frozen=True)
class Elements:
    """vertices (e, 2, 2): start and end point in the direction of travel; region, curve (e,); crack (e,) bool.
    sweep (e,): the signed angle (radians, counter-clockwise positive) of an arc, 0 if straight.
    tip (e,): 1 or 2 where the jump has the square-root shape of a crack tip at the start or end of the element, else 0.

    The nodes of element i are i * (order + 1) and the `order` that follow.
    """

    vertices: Real
    sweep: Real
    region: Integer
    curve: Integer
    crack: Bool
    tip: Integer

    @cached_property
    def geometry(self) -> geometry.Elements:
        """Their places, directions and lengths."""
        start, end = (self.vertices[..., 0] + 1j * self.vertices[..., 1]).T
        return geometry.Elements.by_ends(start, end, self.sweep)


@dataclass(frozen=True)
class Tips:
    """At the start and at the end of a crack, over the k stored steps: KI, KII, J, T (k, 2). NaN if there is no tip.

    KI, KII: stress-intensity factors, stress times the root of length. KI >= 0 opens. KII > 0 if the face on the left
    of the crack's direction moves along it, at both ends. J: J-integral, stress times length, the energy released per
    length of growth straight ahead; (KI^2 + KII^2)/E' if the mesh is fine enough. T: T-stress, the finite part of the
    normal stress along the crack at the tip. plane_modulus: E', stress.
    """

    KI: Real
    KII: Real
    J: Real
    T: Real
    plane_modulus: float


@dataclass(frozen=True)
class Energies:
    """Over the k stored steps (k,), per unit of thickness (stress times length squared), from the unloaded state.

    external: work of loads and conditions; elastic: stored; dissipated: by friction and by failed bonds; released: set
    free where faces moved unstably within a step; removed: taken out where stages open faces or remove regions.
    external = elastic + dissipated + released + removed.
    """

    external: Real
    elastic: Real
    dissipated: Real
    released: Real
    removed: Real


@dataclass(frozen=True)
class Errors:
    """Estimated discretisation errors over the k stored steps; NaN where there is no estimate (`missing` says why).

    reactions: for each outer curve (k, 2), force. opening, slip: for each interface (k,), largest error, length;
    traction_n, traction_s: root mean square error along it, stress. KI, KII: for each crack (k, 2), at start and end.
    displacement (k,): largest error. relative: `reactions`, `jumps`, `tractions`, `factors`, `displacement` (k,), the
    largest error of each kind divided by the largest value in the model so far.
    """

    reactions: Mapping[str, Real]
    opening: Mapping[str, Real]
    slip: Mapping[str, Real]
    traction_n: Mapping[str, Real]
    traction_s: Mapping[str, Real]
    KI: Mapping[str, Real]
    KII: Mapping[str, Real]
    displacement: Real
    relative: Mapping[str, Real]
    missing: str


@dataclass(frozen=True)
class Linearities:
    """Magnitude of strains, rotations and slips, over the k stored steps.

    regions, interfaces: their names. strain, rotation (k, regions): strain along the boundary and its rotation
    (radians), the value exceeded on 1 % of its length. slip (k, interfaces): the largest slip relative to the mean
    length of the elements. NaN where not known.
    """

    regions: tuple[str, ...]
    interfaces: tuple[str, ...]
    strain: Real
    rotation: Real
    slip: Real


@dataclass(frozen=True)
class Balances:
    """Imbalance of the forces on r regions, over the k stored steps.

    names: of the regions. resultant (k, r, 3): force along x and y (stress times length) and moment about the centre of
    the region, the mean of its boundary; includes weight and in-situ stress. relative (k, r): the larger of force and
    moment, relative to the sums of the magnitudes of their parts; for infinite regions, which may carry a moment, only
    the force. carried (k, r): the part carried by the condition on the mean motion of a body that nothing else holds;
    0 for other bodies. part_names (p,): parts cut off by cracks. part_resultant (k, p, 3), part_relative (k, p): the
    same for these parts, with the tractions on the crack faces. whole (k, 3), whole_relative (k,): the same for all
    external forces (on outer curves, and weight), about the middle of the model. NaN where not known.
    """

    names: tuple[str, ...]
    resultant: Real
    relative: Real
    carried: Real
    part_names: tuple[str, ...]
    part_resultant: Real
    part_relative: Real
    whole: Real
    whole_relative: Real


@dataclass(frozen=True)
class Steps:
    """For every stored step (k,): its number (from 1), stage (index), factor in (0, 1], Newton iterations, residual.

    stage_names: names of all stages; removed: regions that have been removed by each stage, if any are.
    """

    number: Integer
    stage: Integer
    factor: Real
    iterations: Integer
    residual: Real
    stage_names: tuple[str, ...]
    removed: tuple[tuple[str, ...], ...] = ()

    def __len__(self) -> int:
        return len(self.factor)
