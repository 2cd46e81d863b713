"""Regions with stress-free strain, uniform and linear in x and y, free and held."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pbem.results.reader import Results
from scripts.conditions.draft import Setting
from scripts.conditions.field import ZERO, Field, add, linear, quadratic, strained
from scripts.conditions.rest import plain
from scripts.conditions.trial import CONDITIONS, Figure, Trial, compare, exact, inside
from scripts.conditions.values import INSIDE, SIDES, lay_blocks

MISFIT = (1e-3, -4e-4, 6e-4, 5e-4)


def enter_misfit(name: str, held: bool) -> None:
    def make(setting: Setting) -> Trial:
        material = plain(setting)
        exx, eyy, exy, ezz = MISFIT
        across = material.poisson * ezz if material.plane == "strain" else 0.0
        field = strained(material, (exx + across, eyy + across, exy), eigenstrain=MISFIT)
        if held:
            field = linear(material, setting.rng(name), eigenstrain=MISFIT)
        draft = lay_blocks(setting, material)
        for region in ("low", "up"):
            draft["eigenstrain"][region] = {**setting.place.strain_components((exx, eyy, exy)), "ezz": ezz}
        if held:
            for k, side in enumerate(SIDES):
                draft.give(side, field, ("u", "un ts", "t")[k % 3], "xy")
        scale = material.young * 1e-3

        def check(results: Results) -> Iterator[Figure]:
            fields = {"low": field, "up": field}
            yield from compare(results, setting.place, fields, exact(setting), stress=scale, rigid=not held)
            yield from inside(results, setting.place, field, INSIDE, exact(setting), scale=scale)

        return Trial(draft.case(), check)

    CONDITIONS[name] = make


enter_misfit("eigenstrain, free", False)
enter_misfit("eigenstrain, held", True)


def enter_graded_misfit(name: str, held: bool) -> None:
    """Strain that is linear in x and y: that of a displacement, which is what a free body then has."""

    def make(setting: Setting) -> Trial:
        material, rng = plain(setting), setting.rng(name)
        freely = (linear if setting.order < 2 else quadratic)(material, rng)
        ezz = add([[4e-4]]) if setting.order < 2 else 1e-3 * rng.uniform(-1, 1, (2, 2)) * [[1, 1], [1, 0]]
        held_back = -material.poisson * ezz if material.plane == "strain" else ZERO
        exx, eyy, exy = freely.strain()
        given = (add(exx, held_back), add(eyy, held_back), exy, ezz)
        field = Field(material, *(freely.ux, freely.uy) if not held else (ZERO, ZERO), eigenstrain=given)
        draft = lay_blocks(setting, material, field.weight())
        turned = setting.place.strain_components(tuple(add(np.zeros((2, 2)), each) for each in given[:3]))
        texts = {key: {"expression": setting.place.text(each)} for key, each in {**turned, "ezz": ezz}.items()}
        for region in ("low", "up"):
            draft["eigenstrain"][region] = texts
        if held:
            for k, side in enumerate(SIDES):
                draft.give(side, field, ("u", "un ts", "t")[k % 3], "xy")
        scale = material.young * 1e-3

        def check(results: Results) -> Iterator[Figure]:
            fields = {"low": field, "up": field}
            yield from compare(results, setting.place, fields, exact(setting), stress=scale, rigid=not held,
                               length=1e-3)
            yield from inside(results, setting.place, field, INSIDE, exact(setting), scale=scale)

        return Trial(draft.case(), check)

    CONDITIONS[name] = make


enter_graded_misfit("eigenstrain that varies, free", False)
enter_graded_misfit("eigenstrain that varies, held", True)
