"""Strain without stress: what a region would take by itself, by its temperature or by an eigenstrain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Complex, Real
from pbem.description.case import Case
from pbem.description.field_tables import EigenstrainTable
from pbem.description.schema import MaterialTable, StageTable
from pbem.description.varying import ExpressionTable
from pbem.errors import Fault, KeyPath
from pbem.geometry.expression import ExpressionError
from pbem.geometry.junction import format_point
from pbem.model.linear import fit_linear
from pbem.model.roles import unknown_name

NONE = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Swelling:
    """strain: exx, eyy, exy in the plane, as where nothing resists; growth: what exx and eyy grow by with x and with y
    (complex), from `center`, where the displacement vanishes. across, across_growth: the strain across the plane, which
    plane strain holds back, alike."""

    strain: tuple[float, float, float] = NONE
    growth: complex = 0j
    center: complex = 0j
    across: float = 0.0
    across_growth: complex = 0j

    @property
    def is_zero(self) -> bool:
        return not (any(self.strain) or self.growth or self.across or self.across_growth)

    def strain_across(self, point: Complex) -> Real:
        """The strain across the plane at points, as where nothing resists."""
        return np.asarray(self.across + (np.conj(self.across_growth) * (point - self.center)).real)

    def displacement(self, point: Complex) -> Complex:
        """Displacement (complex) at points, which leaves the region without stress (theory, 86)."""
        mean, deviator = self._split()
        away = point - self.center
        return np.asarray(mean * away + deviator * np.conj(away) + 0.5 * np.conj(self.growth) * away**2)

    def strain_along(self, point: Complex, direction: Complex) -> Real:
        """Its normal strain at points (n,) along unit vectors (n,)."""
        mean, deviator = self._split()
        grown = (np.conj(self.growth) * (point - self.center)).real
        return np.asarray(mean + (deviator * np.conj(direction) ** 2).real + grown)

    def mix(self, other: Swelling, part: float) -> Swelling:
        """So much of the way to another one; one that is zero may have any centre."""
        center = other.center if self.is_zero else self.center
        return Swelling(
            tuple(a + part * (b - a) for a, b in zip(self.strain, other.strain, strict=True)),  # type: ignore[arg-type]
            self.growth + part * (other.growth - self.growth), center,
            self.across + part * (other.across - self.across),
            self.across_growth + part * (other.across_growth - self.across_growth),
        )

    def describe(self, origin: complex) -> str:
        """In words; origin: of the model, in the user's coordinates."""
        text = "exx, eyy, exy = {:g}, {:g}, {:g}".format(*self.strain)
        if not self.growth:
            return text
        slopes = (("x", self.growth.real), ("y", self.growth.imag))
        grown = "".join(f", {slope:+g} per {axis}" for axis, slope in slopes if slope)
        return f"{text} at {format_point(self.center + origin)}{grown}"

    def move(self, shift: complex) -> Swelling:
        """The same about another origin: the places of the model have become less by the shift."""
        return replace(self, center=self.center - shift)

    def _split(self) -> tuple[float, complex]:
        exx, eyy, exy = self.strain
        return 0.5 * (exx + eyy), 0.5 * (exx - eyy) + 1j * exy


NO_SWELLING = Swelling()


@dataclass(frozen=True)
class Swellings:
    """stages: of the regions that have any, by name, at the end of every stage."""

    stages: tuple[Mapping[str, Swelling], ...]
    faults: tuple[Fault, ...]


def read_swellings(case: Case, corners: Complex) -> Swellings:
    """Complete values for every stage; what a stage leaves out keeps the value reached before.

    corners (3,): lower left and right, and upper left, of a rectangle in which the case lies.
    """
    temperature: dict[str, tuple[float, float, float]] = {}
    eigenstrain: dict[str, EigenstrainTable] = {}
    faults: list[Fault] = []
    stages = []
    places: list[tuple[KeyPath, Case | StageTable]] = [((), case)]
    places += [(("stages", number), stage) for number, stage in enumerate(case.stages)]
    for loc, tables in places:
        for name, given in tables.temperature.items():
            faults += _check_region(case, (*loc, "temperature", name), name, heated=True)
            try:
                temperature[name] = (
                    fit_linear(given.expression, corners) if isinstance(given, ExpressionTable) else (given, 0.0, 0.0)
                )
            except ExpressionError as error:
                faults.append(Fault.at((*loc, "temperature", name), error.found, error.expected))
        for name, table in tables.eigenstrain.items():
            faults += _check_region(case, (*loc, "eigenstrain", name), name, heated=False)
            before = eigenstrain.get(name, EigenstrainTable())
            eigenstrain[name] = before.model_copy(update={key: getattr(table, key) for key in table.model_fields_set})
        stages.append({} if faults else {
            name: _combine(case.materials[case.regions[name].material], temperature.get(name, NONE),
                           eigenstrain.get(name), complex(corners[0]))
            for name in {**temperature, **eigenstrain} if case.regions[name].material in case.materials
        })  # fmt: skip
    return Swellings(tuple(stages[1:] or stages), tuple(faults))


def _check_region(case: Case, loc: KeyPath, name: str, heated: bool) -> Iterator[Fault]:
    region = case.regions.get(name)
    if region is None:
        yield unknown_name(loc, name, "region", case.regions)
        return
    if region.infinite:
        what = "a temperature" if heated else "an eigenstrain"
        expected = "a finite region, as the swelling of an infinite one is unbounded"
        yield Fault.at(loc, f"{what} of the infinite region '{name}'", expected)
    material = case.materials.get(region.material)
    if heated and material is not None and not material.expansion:
        found = f"a temperature of a region whose material '{region.material}' does not expand"
        yield Fault.at(loc, found, f"expansion in [materials.{region.material}]")


def _combine(
    material: MaterialTable, temperature: tuple[float, float, float], eigenstrain: EigenstrainTable | None,
    center: complex,
) -> Swelling:
    """The strain in the plane of both; in plane strain what is held across the plane pushes out into it."""
    across = material.poisson if material.plane == "strain" else 0.0
    heat, by_x, by_y = (material.expansion * value for value in temperature)
    table = eigenstrain or EigenstrainTable()
    own, growth = (1 + across) * heat + across * table.ezz, complex(by_x, by_y)
    return Swelling((own + table.exx, own + table.eyy, table.exy), (1 + across) * growth, center,
                    heat + table.ezz, growth)
