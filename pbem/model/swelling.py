"""Strain without stress: what a region would take by itself, by its temperature or by an eigenstrain."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from pbem.arrays import Complex, Real
from pbem.description.case import Case
from pbem.description.schema import MaterialTable, StageTable
from pbem.description.varying import ExpressionTable
from pbem.errors import Fault, KeyPath
from pbem.geometry.expression import ExpressionError
from pbem.geometry.junction import format_point
from pbem.model.linear import fit_linear
from pbem.model.roles import unknown_name

NONE = (0.0, 0.0, 0.0)
NO_GROWTH = (0j, 0j, 0j)
# What is linear in x and y: the value at the lower left corner of the case, and both slopes.
Linear = tuple[float, float, float]


@dataclass(frozen=True)
class Swelling:
    """strain: exx, eyy, exy in the plane, as where nothing resists; growth: what each of them grows by with x and with
    y (complex), from `center`, where the displacement vanishes. across, across_growth: the strain across the plane,
    which plane strain holds back, alike."""

    strain: tuple[float, float, float] = NONE
    growth: tuple[complex, complex, complex] = NO_GROWTH
    center: complex = 0j
    across: float = 0.0
    across_growth: complex = 0j

    @property
    def is_zero(self) -> bool:
        return not (any(self.strain) or any(self.growth) or self.across or self.across_growth)

    def strain_across(self, point: Complex) -> Real:
        """The strain across the plane at points, as where nothing resists."""
        return np.asarray(self.across + (np.conj(self.across_growth) * (point - self.center)).real)

    def displacement(self, point: Complex) -> Complex:
        """Displacement (complex) at points, which leaves the region without stress (theory, 86)."""
        exx, eyy, exy = self.strain
        by_xx, by_yy, by_xy = self.growth
        away = point - self.center
        x, y = away.real, away.imag
        along = 0.5 * by_xx.real * x**2 + by_xx.imag * x * y + (by_xy.imag - 0.5 * by_yy.real) * y**2
        up = 0.5 * by_yy.imag * y**2 + by_yy.real * x * y + (by_xy.real - 0.5 * by_xx.imag) * x**2
        return np.asarray(exx * x + exy * y + along + 1j * (exy * x + eyy * y + up))

    def strain_along(self, point: Complex, direction: Complex) -> Real:
        """Its normal strain at points (n,) along unit vectors (n,)."""
        away = point - self.center
        exx, eyy, exy = (
            value + (np.conj(by) * away).real for value, by in zip(self.strain, self.growth, strict=True)
        )
        x, y = direction.real, direction.imag
        return np.asarray(exx * x**2 + eyy * y**2 + 2 * exy * x * y)

    def mix(self, other: Swelling, part: float) -> Swelling:
        """So much of the way to another one; one that is zero may have any centre."""
        center = other.center if self.is_zero else self.center
        return Swelling(
            tuple(a + part * (b - a) for a, b in zip(self.strain, other.strain, strict=True)),  # type: ignore[arg-type]
            tuple(a + part * (b - a) for a, b in zip(self.growth, other.growth, strict=True)),  # type: ignore[arg-type]
            center,
            self.across + part * (other.across - self.across),
            self.across_growth + part * (other.across_growth - self.across_growth),
        )

    def describe(self, origin: complex) -> str:
        """In words; origin: of the model, in the user's coordinates."""
        text = "exx, eyy, exy = {:g}, {:g}, {:g}".format(*self.strain)
        if not any(self.growth):
            return text
        grown = [
            f"{slope:+g} per {axis}" if len(set(self.growth)) == 1 else f"{name} {slope:+g} per {axis}"
            for name, by in zip(("exx", "eyy", "exy"), self.growth, strict=True)
            for axis, slope in (("x", by.real), ("y", by.imag)) if slope
        ]  # fmt: skip
        return ", ".join([f"{text} at {format_point(self.center + origin)}", *grown])

    def move(self, shift: complex) -> Swelling:
        """The same about another origin: the places of the model have become less by the shift."""
        return replace(self, center=self.center - shift)


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
    temperature: dict[str, Linear] = {}
    eigenstrain: dict[str, dict[str, Linear]] = {}
    faults: list[Fault] = []
    stages = []
    places: list[tuple[KeyPath, Case | StageTable]] = [((), case)]
    places += [(("stages", number), stage) for number, stage in enumerate(case.stages)]
    for loc, tables in places:
        for name, given in tables.temperature.items():
            faults += _check_region(case, (*loc, "temperature", name), name, heated=True)
            faults += _enter(temperature, name, given, (*loc, "temperature", name), corners)
        for name, table in tables.eigenstrain.items():
            faults += _check_region(case, (*loc, "eigenstrain", name), name, heated=False)
            for key in sorted(table.model_fields_set):
                place = (*loc, "eigenstrain", name, key)
                faults += _enter(eigenstrain.setdefault(name, {}), key, getattr(table, key), place, corners)
        stages.append({} if faults else {
            name: _combine(case.materials[case.regions[name].material], temperature.get(name, NONE),
                           eigenstrain.get(name, {}), complex(corners[0]))
            for name in {**temperature, **eigenstrain} if case.regions[name].material in case.materials
        })  # fmt: skip
    return Swellings(tuple(stages[1:] or stages), tuple(faults))


def _enter(
    values: dict[str, Linear], name: str, given: float | ExpressionTable, loc: KeyPath, corners: Complex
) -> Iterator[Fault]:
    """Puts what is given among the values, with a fault for what is not linear."""
    try:
        values[name] = (given, 0.0, 0.0) if isinstance(given, float) else fit_linear(given.expression, corners)
    except ExpressionError as error:
        yield Fault.at(loc, error.found, error.expected)


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
    material: MaterialTable, temperature: Linear, eigenstrain: Mapping[str, Linear], center: complex
) -> Swelling:
    """The strain in the plane of both; in plane strain what is held across the plane pushes out into it."""
    held = material.poisson if material.plane == "strain" else 0.0
    heat = material.expansion * np.array(temperature)
    exx, eyy, exy, ezz = (np.array(eigenstrain.get(key, NONE)) for key in ("exx", "eyy", "exy", "ezz"))
    own = (1 + held) * heat + held * ezz
    inside, across = (own + exx, own + eyy, exy), heat + ezz
    return Swelling(
        tuple(float(each[0]) for each in inside),  # type: ignore[arg-type]
        tuple(complex(each[1], each[2]) for each in inside),  # type: ignore[arg-type]
        center, float(across[0]), complex(across[1], across[2]),
    )  # fmt: skip
