"""Capabilities that meet in one model: construction with softening bonds, tools with point loads, sweeps over them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pbem
from pbem.results.describe import _describe_energy as describe_energy

pytestmark = pytest.mark.usefixtures("without_errors")

Tables = dict[str, Any]


def make_tunnel(law: Tables) -> Tables:
    """A round tunnel in rock under stress, taken away in two steps."""
    return {
        "materials": {"rock": {"young": 20e3, "poisson": 0.25}},
        "curves": {"wall": {"center": [1e5, -3e5], "radius": 3.0, "elements": 16}},
        "regions": {
            "core": {"material": "rock", "boundary": ["wall"]},
            "rock": {"material": "rock", "infinite": True, "boundary": ["wall"]},
        },
        "interfaces": {"wall": law},
        "initial_stress": {"rock": {"sxx": -5.0, "syy": -10.0}},
        "stages": [{"name": "excavate", "steps": 2, "remove": ["core"]}],
    }


def make_block(**tables: Any) -> Tables:
    """A block of 2 by 1 on the ground, on which a rigid flat punch lies."""
    corners = [[0, 0], [2, 0], [2, 1], [0, 1]]
    names = ("bottom", "right", "top", "left")
    curves: Tables = {
        name: {"points": [corners[k], corners[(k + 1) % 4]], "elements": 6} for k, name in enumerate(names)
    }
    return {
        "materials": {"steel": {"young": 2.1e5, "poisson": 0.3}},
        "curves": curves | {"punch": {"points": [[0.6, 1.0], [1.4, 1.0]], "elements": 10}},
        "regions": {"block": {"material": "steel", "boundary": list(names)}},
        "boundary": {"bottom": {"ux": 0.0, "uy": 0.0}},
        "tools": {"punch": {"fy": -10.0, "ux": 0.0, "rotation": 0.0}},
        "contacts": {"seat": {"between": ["punch", "top"], "friction": 0.3}},
        "analysis": {"steps": 1},
    } | tables


def test_a_bond_that_softens_is_released_like_one_that_does_not(tmp_path: Path) -> None:
    """Far below its strength; what is taken away has no bond any more."""
    cohesive = {"law": "cohesive", "tensile_strength": 1e3, "cohesion": 1e3, "fracture_energy": 1.0}
    one, other = (
        pbem.run(make_tunnel(law), tmp_path / f"{law['law']}.h5") for law in ({"law": "bonded"}, cohesive)
    )
    for name in ("displacement", "traction"):
        bonded, softening = (getattr(each, name)[-1] for each in (one, other))
    np.testing.assert_allclose(softening, bonded, atol=1e-9 * np.nanmax(np.abs(bonded)))


def test_tools_and_point_loads_are_borne_together(tmp_path: Path) -> None:
    loads = {"hook": {"at": [2.0, 0.5], "fx": 1.0, "fy": -3.0}}
    case = make_block(point_loads=loads, tools={"punch": {"fy": -10.0, "fx": 0.5, "rotation": 0.0}})
    results = pbem.run(case, tmp_path / "case.h5")
    np.testing.assert_allclose(results.reactions["bottom"][-1], [-1.5, 13.0], atol=2e-3)
    np.testing.assert_allclose(results.rigid["punch"].force[-1][:2], [0.5, -10.0], rtol=1e-6)


def test_a_bottom_that_is_rigid_and_held_is_a_bottom_that_is_held(tmp_path: Path) -> None:
    one = pbem.run(make_block(), tmp_path / "one.h5")
    still = {"bottom": {"rigid": {"ux": 0.0, "uy": 0.0, "rotation": 0.0}}}
    other = pbem.run(make_block(boundary=still), tmp_path / "other.h5")
    scale = np.abs(one.traction).max()
    np.testing.assert_allclose(other.traction, one.traction, atol=1e-9 * scale)


def test_a_sweep_over_places_of_loads_begins_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What sweeps keep of the curves depends on where loads act on them."""
    monkeypatch.chdir(tmp_path)
    case = pbem.Case(**make_block(point_loads={"hook": {"at": [2.0, 0.5], "fx": 0.0, "fy": -3.0}}))
    places = [[2.0, 0.5], [0.0, 0.25]]
    table = pbem.sweep(case, {"point_loads.hook.at": places}, quantities=["rigid.punch.uy"])
    singles = [pbem.run(case.replace({"point_loads.hook.at": at}), f"{at[0]}.h5") for at in places]
    motions = [float(each.rigid["punch"].motion[-1][1]) for each in singles]
    assert abs(motions[0] - motions[1]) > 1e-4 * abs(motions[0])
    np.testing.assert_allclose(table["rigid.punch.uy"], motions, rtol=1e-9)


def make_stack(**tables: Any) -> Tables:
    """Two blocks on each other, of which the upper one may be taken away."""
    case = make_block(**({"tools": {}, "contacts": {}} | tables))
    del case["curves"]["punch"]
    corners = [[2, 1], [2, 2], [0, 2], [0, 1]]
    for k, name in enumerate(("east", "north", "west")):
        case["curves"][name] = {"points": [corners[k], corners[k + 1]], "elements": 6}
    case["regions"]["upper"] = {"material": "steel", "boundary": ["top", "east", "north", "west"]}
    del case["analysis"]
    return case


@pytest.mark.parametrize("said", [{"tn": 3.0, "ts": 1.0}, {"pressure": 5.0}, {"ux": 0.1}])
@pytest.mark.parametrize("first", [{"rigid": {"fx": 1.0}}, {"force": {"fx": 1.0}}])
def test_stages_say_nothing_else_of_what_is_rigid(first: Tables, said: Tables, tmp_path: Path) -> None:
    held = {"bottom": {"ux": 0.0, "uy": 0.0}}
    stages = [{"steps": 1}, {"steps": 1, "boundary": {"east": said}}]
    case = make_stack(boundary=held | {"east": first}, stages=stages)
    with pytest.raises(pbem.CaseError, match=rf"stages\[2\].boundary.east.{next(iter(said))}"):
        pbem.run(case, tmp_path / "case.h5")
    if "rigid" in first:
        case = make_stack(boundary=held | {"west": {"rigid": {"fx": 1.0, "curves": ["east"]}}}, stages=stages)
        with pytest.raises(pbem.CaseError, match="of the rigid body of 'west'"):
            pbem.run(case, tmp_path / "case.h5")


@pytest.mark.parametrize("acting", [
    {"boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "north": {"rigid": {"fy": -1.0}}}},
    {"boundary": {"bottom": {"ux": 0.0, "uy": 0.0}, "north": {"ty": -1.0}},
     "point_loads": {"hook": {"at": [2.0, 1.5], "fx": 1.0, "fy": -1.0}}},
])
def test_what_acts_on_a_region_that_goes_is_gone_with_it(acting: Tables, tmp_path: Path) -> None:
    """Nothing is left of it, and the energies are in balance."""
    stages = [{"steps": 1}, {"steps": 2, "remove": ["upper"]}]
    results = pbem.run(make_stack(stages=stages, **acting), tmp_path / "case.h5")
    external, elastic, dissipated, released, removed = (values[-1] for values in vars(results.energy).values())
    assert abs(elastic) < 1e-9 * abs(external) and abs(results.reactions["bottom"][-1]).max() < 1e-9
    assert removed == pytest.approx(external - elastic - dissipated - released, rel=1e-6)
    assert "rounding" not in str(describe_energy(results))


def test_grains_are_taken_away_by_the_name_of_their_table(tmp_path: Path) -> None:
    case = make_stack(boundary={"bottom": {"ux": 0.0, "uy": 0.0}, "north": {"ty": -1.0}}, generate=[{
        "kind": "inclusions", "name": "grain", "region": "upper", "count": 2, "radius": 0.1, "elements": 8,
        "material": "steel", "box": [0.2, 1.2, 1.8, 1.8], "distance": 0.1,
    }], stages=[{"steps": 1}, {"steps": 1, "remove": ["grain"]}])
    results = pbem.run(case, tmp_path / "case.h5")
    names = np.array(results.nodes.region_names)
    assert list(names[results.find_gone(-1)]) == ["grain_1", "grain_2"] and not results.find_gone(0).any()


def test_a_force_through_the_middle_of_a_rotation_does_not_drive_it(tmp_path: Path) -> None:
    """A pin without friction in a wider hole, pushed along x, may turn freely."""
    case: Tables = {
        "materials": {"steel": {"young": 2.1e5, "poisson": 0.3}},
        "curves": {"outer": {"center": [0.0, 0.0], "radius": 3.0, "elements": 16},
                   "hole": {"center": [0.0, 0.0], "radius": 1.0, "elements": 24},
                   "pin": {"center": [0.0, 0.0], "radius": 0.99, "elements": 24}},
        "regions": {"plate": {"material": "steel", "boundary": ["outer", "hole"]}},
        "boundary": {"outer": {"ux": 0.0, "uy": 0.0}},
        "tools": {"pin": {"fx": 5.0, "fy": 0.2}},
        "contacts": {"seat": {"between": ["pin", "hole"], "law": "frictionless"}},
    }
    results = pbem.run(case, tmp_path / "case.h5")
    assert results.status == "finished"
    np.testing.assert_allclose(results.reactions["outer"][-1], [-5.0, -0.2], atol=5e-3)


@pytest.mark.parametrize("operator", ["dense", "hierarchical"])
def test_a_body_that_conditions_move_as_a_whole_bears_nothing(operator: str, tmp_path: Path) -> None:
    """Its forces are rounding, and no sign of a body that is free to move."""
    moved = {name: {"ux": 0.3, "uy": -20.0} for name in ("bottom", "right", "top", "left")}
    case = make_block(boundary=moved, tools={}, contacts={})
    del case["curves"]["punch"]
    results = pbem.run(case, tmp_path / "case.h5", operator=operator)  # type: ignore[arg-type]
    assert np.abs(results.traction).max() < 1e-9 * 2.1e5
    np.testing.assert_allclose(results.evaluate([1.0, 0.5]).displacement[-1], [[0.3, -20.0]], rtol=1e-10)
