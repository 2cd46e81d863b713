"""Every kind of wrong key or value in a case file is told with its place, what was found and what is expected."""

from __future__ import annotations

import pytest

from pbem.case import parse_case
from pbem.errors import CaseError
from tests.unit.case_sample import BLOCKS, SQUARE, add_curves, change, find_faults, find_only_fault

INTERFACE = 'law = "coulomb"\nfriction = 0.5'
BOTTOM = "bottom = { points = [[0, 0], [2, 0]], elements = 8 }"

# What is changed in the sample, into what; then pieces of the one fault that follows.
WRONG = {
    "unknown key": (
        "friction = 0.5",
        "frction = 0.5",
        "interfaces.interface.frction (line 28)",
        "did you mean 'friction'?",
    ),
    "unknown key without a near one": (
        "poisson = 0.3",
        "poisson = 0.3\nqqq = 1",
        "materials.soft.qqq",
        "one of: density, expansion, plane",
    ),
    "unknown table": (
        "[interfaces.interface]\n" + INTERFACE,
        "[boundry]",
        "boundry (line 26)",
        "did you mean 'boundary'?",
    ),
    "text for a number": (
        "young = 2000.0",
        'young = "2000"',
        "materials.soft.young (line 3)",
        'found "2000"; expected a number',
    ),
    "true for a number": ("young = 2000.0", "young = true", "materials.soft.young", "found true; expected a number"),
    "number for a text": ('material = "soft"', "material = 3", "regions.lower.material", "found 3; expected a text"),
    "date for a number": ("young = 2000.0", "young = 2020-01-01", "materials.soft.young", "2020-01-01 (a date"),
    "negative modulus": (
        "young = 2000.0",
        "young = -2000.0",
        "materials.soft.young (line 3)",
        "found -2000.0; expected a number > 0",
    ),
    "zero modulus": ("young = 2000.0", "young = 0", "materials.soft.young", "expected a number > 0"),
    "not a number": ("young = 2000.0", "young = nan", "materials.soft.young", "found nan; expected a finite number"),
    "infinite": ("young = 2000.0", "young = inf", "materials.soft.young", "found inf; expected a finite number"),
    "huge integer": ("young = 2000.0", "young = 1" + 400 * "0", "materials.soft.young", "at most 300 digits"),
    "infinite point": (
        "[[0, 0], [2, 0]]",
        "[[0, 0], [inf, 0]]",
        "curves.bottom.points[2][1] (line 7)",
        "a finite number",
    ),
    "not-a-number displacement": ("ux = 0.001", "ux = nan", "boundary.top.ux", "a finite number"),
    "poisson too large": ("poisson = 0.3", "poisson = 0.5", "materials.soft.poisson", "(-1 < poisson < 0.5)"),
    "poisson too small": ("poisson = 0.3", "poisson = -1", "materials.soft.poisson", "(-1 < poisson < 0.5)"),
    "no poisson": ("poisson = 0.3\n", "", "materials.soft.poisson", "found no poisson"),
    "plane": ("poisson = 0.3", 'poisson = 0.3\nplane = "strian"', "materials.soft.plane", "did you mean 'strain'?"),
    "negative density": ("poisson = 0.3", "poisson = 0.3\ndensity = -1", "materials.soft.density", "a number >= 0"),
    "zero elements": (
        BOTTOM,
        BOTTOM.replace("8", "0"),
        "curves.bottom.elements (line 7)",
        "found 0; expected a whole number from 1",
    ),
    "negative elements": (
        BOTTOM,
        BOTTOM.replace("8", "-3"),
        "curves.bottom.elements",
        "found -3; expected a whole number from 1",
    ),
    "too many elements": (BOTTOM, BOTTOM.replace("8", "1000000"), "curves.bottom.elements", "from 1 to 100000"),
    "elements with a fraction": (
        BOTTOM,
        BOTTOM.replace("8", "8.5"),
        "curves.bottom.elements",
        "found 8.5; expected a whole number",
    ),
    "true elements": (
        BOTTOM,
        BOTTOM.replace("8", "true"),
        "curves.bottom.elements",
        "found true; expected a whole number",
    ),
    "no elements in a list": (
        BOTTOM,
        BOTTOM.replace("8", "[]"),
        "curves.bottom.elements",
        "found []; expected a whole number",
    ),
    "a list of the wrong length": (
        BOTTOM,
        BOTTOM.replace("8", "[4, 4]"),
        "curves.bottom.elements",
        "2 numbers of elements for 1 legs",
    ),
    "fewer elements than legs": (
        BOTTOM,
        "bottom = { points = [[0, 0], [1, 0], [2, 0]], elements = 1 }",
        "curves.bottom.elements",
        "1 elements for 2 legs",
    ),
    "elements and size": (BOTTOM, BOTTOM.replace("8", "8, size = 1"), "curves.bottom.size", "both elements and size"),
    "neither elements nor size": (
        BOTTOM,
        BOTTOM.replace(", elements = 8", ""),
        "curves.bottom (line 7)",
        "neither elements nor size",
    ),
    "size too small": (BOTTOM, BOTTOM.replace("elements = 8", "size = 1e-9"), "curves.bottom.size", "at most 100000"),
    "size zero": (BOTTOM, BOTTOM.replace("elements = 8", "size = 0"), "curves.bottom.size", "a number > 0"),
    "grading": (BOTTOM, BOTTOM.replace("8", '8, grading = "strt"'), "curves.bottom.grading", "did you mean 'start'?"),
    "power": (BOTTOM, BOTTOM.replace("8", "8, power = 0.5"), "curves.bottom.power", "a number >= 1"),
    "one point": ("[[0, 0], [2, 0]]", "[[0, 0]]", "curves.bottom.points", "at least 2 entries"),
    "the same point twice": (
        "[[0, 0], [2, 0]]",
        "[[0, 0], [2, 0], [2, 0]]",
        "curves.bottom.points[3]",
        "a leg without length",
    ),
    "point with one coordinate": (
        "[[0, 0], [2, 0]]",
        "[[0, 0], [2]]",
        "curves.bottom.points[2]",
        "found [2]; expected at least 2",
    ),
    "point with three": ("[[0, 0], [2, 0]]", "[[0, 0], [2, 0, 0]]", "curves.bottom.points[2]", "at most 2 entries"),
    "no shape": (BOTTOM, "bottom = { elements = 8 }", "curves.bottom", "found no shape"),
    "two shapes": (
        BOTTOM,
        BOTTOM.replace("}", ", center = [0, 0], radius = 1 }"),
        "curves.bottom",
        "points and center",
    ),
    "center alone": (BOTTOM, "bottom = { center = [0, 0], elements = 8 }", "curves.bottom", "no radius"),
    "radius alone": (BOTTOM, "bottom = { radius = 1, elements = 8 }", "curves.bottom", "no center"),
    "angles with points": (
        BOTTOM,
        BOTTOM.replace("}", ", angles = [0, 90] }"),
        "curves.bottom.angles",
        "angles with points",
    ),
    "negative radius": (
        BOTTOM,
        "bottom = { center = [0, 0], radius = -1, elements = 8 }",
        "curves.bottom.radius",
        "> 0",
    ),
    "an arc of nothing": (
        BOTTOM,
        "bottom = { center = [0, 0], radius = 1, angles = [90, 90], elements = 8 }",
        "curves.bottom.angles",
        "an arc of 0 degrees",
    ),
    "an arc of more than a circle": (
        BOTTOM,
        "bottom = { center = [0, 0], radius = 1, angles = [0, 400], elements = 8 }",
        "curves.bottom.angles",
        "an arc of 400 degrees",
    ),
    "empty boundary": (
        'boundary = ["bottom", "right_lower", "interface", "left_lower"]',
        "boundary = []",
        "regions.lower.boundary",
        "no boundary",
    ),
    "boundary not a list": (
        'boundary = ["bottom", "right_lower", "interface", "left_lower"]',
        'boundary = "bottom"',
        "regions.lower.boundary",
        "a list",
    ),
    "both quantities along x": ("ux = 0.001", "ux = 0.001\ntx = 0", "boundary.top.tx", "both ux and tx"),
    "both quantities along y": ("uy = -0.001", "uy = 0.001\nty = 0", "boundary.top.ty", "both uy and ty"),
    "both quantities along the normal": (
        "ux = 0.001\nuy = -0.001",
        "un = 0.001\ntn = 0",
        "boundary.top.tn",
        "both un and tn",
    ),
    "both quantities along the curve": (
        "ux = 0.001\nuy = -0.001",
        "un = 0.001\nus = 1\nts = 0",
        "boundary.top.ts",
        "both us and ts",
    ),
    "pressure and normal traction": (
        "ux = 0.001\nuy = -0.001",
        "tn = 1\npressure = 0",
        "boundary.top.pressure",
        "both tn and pressure",
    ),
    "pressure and normal displacement": (
        "ux = 0.001\nuy = -0.001",
        "un = 1\npressure = 0",
        "boundary.top.pressure",
        "both un and pressure",
    ),
    "spring and global displacement": (
        "ux = 0.001\nuy = -0.001",
        "ux = 0.001\nspring = { kn = 1 }",
        "boundary.top.spring",
        "ux together with spring; expected tractions beside a spring",
    ),
    "far end without spring": (
        "ux = 0.001\nuy = -0.001",
        "spring = { ks = 1 }\nend_n = 0.001",
        "boundary.top.end_n",
        "'end_n' without a spring",
    ),
    "negative stiffness somewhere": (
        "ux = 0.001\nuy = -0.001",
        'spring = { ks = { expression = "x - 0.3" } }',
        "boundary.top.spring.ks",
        "a stiffness that is -0.3",
    ),
    "spring and normal displacement": (
        "ux = 0.001\nuy = -0.001",
        "spring = { kn = 1 }\nun = 0",
        "boundary.top.un",
        "both spring.kn and un",
    ),
    "spring and tangential displacement": (
        "ux = 0.001\nuy = -0.001",
        "spring = { ks = 1 }\nus = 0",
        "boundary.top.us",
        "both spring.ks and us",
    ),
    "spring without stiffness": (
        "ux = 0.001\nuy = -0.001",
        "spring = { kn = 0.0, ks = 0 }",
        "boundary.top.spring",
        "a spring without stiffness; expected kn > 0 or ks > 0",
    ),
    "spring of nothing": ("ux = 0.001\nuy = -0.001", "spring = {}", "boundary.top.spring", "without stiffness"),
    "negative spring": (
        "ux = 0.001\nuy = -0.001",
        "spring = { kn = -1 }",
        "boundary.top.spring.kn",
        "a number >= 0",
    ),
    "spring as a number": ("ux = 0.001\nuy = -0.001", "spring = 3", "boundary.top.spring", "expected a table"),
    "spring in other axes": (
        "ux = 0.001\nuy = -0.001",
        "spring = { kx = 1, kn = 2 }",
        "boundary.top.spring.kx",
        "unknown key 'kx'",
    ),
    "spring in a stage": (
        "[materials",
        "[[stages]]\n[stages.boundary.top]\nspring = { kn = 1 }\n[materials",
        "stages[1].boundary.top.spring (line 4)",
        "spring cannot change: it belongs in [boundary.top]",
    ),
    "initial stress nan": (
        "[materials",
        "[initial_stress.soft]\nsyy = nan\n[materials",
        "initial_stress.soft.syy (line 3)",
        "a finite number",
    ),
    "remote stress without an infinite region": (
        "[materials",
        "[remote]\nsyy = -1\n[materials",
        "remote (line 2)",
        "remote stress without an infinite region",
    ),
    "remote stress of a stage without an infinite region": (
        "[materials",
        "[[stages]]\nremote = { sxx = 1 }\n[materials",
        "stages[1].remote (line 3)",
        "remote stress without an infinite region",
    ),
    "component of initial stress": (
        "[materials",
        "[initial_stress.soft]\nsyx = 1\n[materials",
        "initial_stress.soft.syx",
        "unknown key 'syx'; did you mean 's",
    ),
    "gravity on nothing": (
        "[materials",
        "[gravity]\ngy = -1\n[materials",
        "gravity (line 2)",
        "gravity on regions without density; expected a density > 0",
    ),
    "gravity of a stage on nothing": (
        "[materials",
        "[[stages]]\ngravity = { gx = 1 }\n[materials",
        "stages[1].gravity (line 3)",
        "gravity on regions without density",
    ),
    "gravity along z": ("[materials", "[gravity]\ngz = 1\n[materials", "gravity.gz", "unknown key 'gz'"),
    "initial stress of an unknown material": (
        "[materials",
        "[initial_stress.sof]\nsyy = -1\n[materials",
        "initial_stress.sof (line 2)",
        "unknown material 'sof'; did you mean 'soft'?",
    ),
    "initial stress not a number": (
        "[materials",
        "[initial_stress.soft]\nsyy = true\n[materials",
        "initial_stress.soft.syy (line 3)",
        "found true; expected a number",
    ),
    "infinite as a text": (
        'material = "soft"',
        'material = "soft"\ninfinite = "yes"',
        "regions.lower.infinite",
        "true or false",
    ),
    "global and local": ("ux = 0.001\nuy = -0.001", "ux = 1\nun = 0", "boundary.top.un", "ux together with un"),
    "two frictions": (
        "friction = 0.5",
        "friction = 0.5\nfriction_angle = 30",
        "interfaces.interface.friction_angle",
        "both friction and",
    ),
    "friction angle": ("friction = 0.5", "friction_angle = 90", "interfaces.interface.friction_angle", "a number < 90"),
    "negative friction": ("friction = 0.5", "friction = -0.5", "interfaces.interface.friction", "a number >= 0"),
    "negative cohesion": ("friction = 0.5", "cohesion = -0.5", "interfaces.interface.cohesion", "a number >= 0"),
    "gap not a number": ("friction = 0.5", "gap = nan", "interfaces.interface.gap", "a finite number"),
    "unknown law": ('"coulomb"', '"colomb"', "interfaces.interface.law", "did you mean 'coulomb'?"),
    "friction without friction": (
        '"coulomb"',
        '"frictionless"',
        "interfaces.interface.friction",
        'with law "frictionless"',
    ),
    "friction of a bond": ('"coulomb"', '"bonded"', "interfaces.interface.friction", 'no effect with law = "bonded"'),
    "friction of the default bond": (
        INTERFACE,
        "friction = 0.5",
        "interfaces.interface.friction",
        'law = "bonded", the default here',
    ),
    "gap in a bond": (INTERFACE, "gap = 0.5", "interfaces.interface.gap", "no effect"),
    "cohesion of open faces": (INTERFACE, 'law = "open"\ncohesion = 1', "interfaces.interface.cohesion", "no effect"),
    "scheme": ("[materials", '[analysis]\nscheme = "SSt"\n[materials', "analysis.scheme", "did you mean 'SST'?"),
    "order": ("[materials", "[analysis]\norder = 4\n[materials", "analysis.order", "(0, 1, 2 or 3)"),
    "order with a fraction": ("[materials", "[analysis]\norder = 2.0\n[materials", "analysis.order", "a whole number"),
    "no steps": ("[materials", "[analysis]\nsteps = 0\n[materials", "analysis.steps", "a number >= 1"),
    "no newton iterations": (
        "[materials",
        "[solver]\nnewton_max_iterations = 0\n[materials",
        "solver.newton_max_iterations",
        ">= 1",
    ),
    "factors of an operator that is not stored": (
        "[materials",
        '[solver]\noperator = "hierarchical"\nlinear = "mumps"\n[materials',
        "solver.linear (line 4)",
        'found "mumps" with operator = "hierarchical"',
    ),
    "tolerance": ("[materials", "[solver]\nnewton_tolerance = 0.0\n[materials", "solver.newton_tolerance", "> 0"),
    "option with a dash": (
        "[materials",
        "[petsc]\n-ksp_rtol = 1\n[materials",
        "petsc.-ksp_rtol",
        "without the leading dash",
    ),
    "option not a number": ("[materials", "[petsc]\nksp_rtol = nan\n[materials", "petsc.ksp_rtol", "a finite number"),
    "option a table": ("[materials", "[petsc]\nksp.rtol = 1\n[materials", "petsc.ksp", "found a table"),
    "every": ("[materials", "[output]\nevery = 0\n[materials", "output.every", ">= 1"),
    "title": ("[materials", "title = 3\n[materials", "title (line 2)", "a text"),
    "units": ("[materials", "[units]\nlength = 3\n[materials", "units.length", "a text"),
    "name with a slash": (
        "[materials",
        '[materials."a/b"]\nyoung = 1\npoisson = 0\n[materials',
        'materials."a/b"',
        "without '/'",
    ),
    "stage name twice": (
        "[materials",
        '[[stages]]\nname = "a"\n[[stages]]\nname = "a"\n[materials',
        "stages[2].name (line 5)",
        "again",
    ),
    "stage steps": ("[materials", "[[stages]]\nsteps = 0\n[materials", "stages[1].steps (line 3)", ">= 1"),
    "conflict in a stage": (
        "[materials",
        "[[stages]]\n[stages.boundary.top]\nux = 1\ntx = 1\n[materials",
        "stages[1].boundary.top.tx (line 5)",
        "both ux and tx",
    ),
}


@pytest.mark.parametrize(("old", "new", "place", "text"), WRONG.values(), ids=WRONG.keys())
def test_wrong_value_is_told_with_its_place(old: str, new: str, place: str, text: str) -> None:
    fault = find_only_fault(change(BLOCKS, (old, new)))
    assert fault.startswith(place)
    assert text in fault


# Keys that are right and cannot be computed yet.
def test_half_of_slip_weakening_is_a_fault() -> None:
    text = change(BLOCKS, ("friction = 0.5", "friction = 0.5\nslip_distance = 1e-4"))
    assert "friction_dynamic and slip_distance together" in find_only_fault(text)


@pytest.mark.parametrize("value", ["false", ""])
def test_what_is_switched_off_is_accepted(value: str) -> None:
    lines = f"infinite = {value}\n" if value else ""
    tips = f"[analysis]\ntips = {value}\n" if value else ""
    case = parse_case(
        change(BLOCKS, ('material = "soft"\n', f'material = "soft"\n{lines}'), ("[materials", f"{tips}[materials"))
    )
    assert case.regions["lower"].infinite is False
    assert case.analysis.tips is (value != "false")


def test_empty_file() -> None:
    for text in ("", "\n# only a comment\n"):
        assert "the file: found nothing (an empty file); expected the tables" in find_only_fault(text)


def test_missing_tables_are_told_together() -> None:
    assert [fault.place for fault in find_faults('title = "only this"')] == ["materials", "curves", "regions"]


def test_text_that_is_not_toml_is_told_with_line_and_column() -> None:
    fault = find_only_fault("[materials.soft]\nyoung = = 3\n")
    assert fault.startswith("line 2, column 9: found text that is not TOML: invalid value")


def test_key_given_twice_is_told_with_its_line() -> None:
    assert find_only_fault("a = 1\na = 2\n").startswith(
        "line 2, column 6: found text that is not TOML: cannot overwrite"
    )


def test_unclosed_text_at_the_end_of_the_file() -> None:
    assert find_only_fault("a = [1, 2").startswith("end of document: found text that is not TOML")


def test_nesting_without_end_is_a_fault() -> None:
    assert "the file" in find_only_fault("a = " + 100_000 * "[")


def test_all_faults_are_told_at_once_and_in_order_of_lines() -> None:
    text = change(
        BLOCKS,
        ("young = 2000.0", "young = -1"),
        ("poisson = 0.3", "poisson = nan"),
        (BOTTOM, BOTTOM.replace("8", "0")),
        ("friction = 0.5", "frction = 0.5"),
        ("ux = 0.001", 'ux = "a"\ntx = 0'),
    )
    places = [fault.place.split(" (")[0] for fault in find_faults(text)]
    assert places == [
        "materials.soft.young",
        "materials.soft.poisson",
        "curves.bottom.elements",
        "boundary.top.ux",
        "boundary.top.tx",
        "interfaces.interface.frction",
    ]


def test_error_text_lists_source_and_every_fault() -> None:
    with pytest.raises(CaseError) as caught:
        parse_case(change(SQUARE, ("young = 2000.0", "young = -1"), ("poisson = 0.3", "poisson = 7")), "square.toml")
    lines = str(caught.value).splitlines()
    assert lines[0] == "square.toml: 2 faults"
    assert lines[1] == "  materials.soft.young (line 3): found -1; expected a number > 0"
    assert lines[2].startswith("  materials.soft.poisson (line 4): found 7; expected")


def test_faults_of_values_and_of_topology_are_told_together() -> None:
    text = change(SQUARE, ("young = 2000.0", "young = -1"), ("[2, 2], [0, 2]", "[2, 2], [0.5, 2]"))
    faults = "\n".join(map(str, find_faults(text)))
    assert "materials.soft.young (line 3): found -1" in faults
    assert "regions.body (line 11)" not in faults
    assert "regions.body.boundary" in faults and "an open loop: curve 'top' ends at (0.5, 2)" in faults


def test_faults_that_hide_the_rest_raise_no_false_alarm() -> None:
    # Without the bottom's conditions the body is not held; that must not be told of a mistyped key.
    assert "unknown key 'u_x'" in find_only_fault(change(SQUARE, ("ux = 0.0\nuy = 0.0", "u_x = 0.0")))
    assert "unknown key 'boundery'" in find_only_fault(change(SQUARE, ("[boundary.bottom]", "[boundery.bottom]")))
    # Without the curve the loop is open.
    assert "curves.right.radius" in find_only_fault(
        change(
            SQUARE,
            ("right = { points = [[2, 0], [2, 2]]", "right = { center = [2, 1], radius = -1, angles = [-90, 90]"),
        )
    )


def test_circle_with_a_list_of_elements() -> None:
    text = add_curves(SQUARE, "hole = { center = [1, 1], radius = 0.5, elements = [4, 4] }")
    text = change(text, ('"left"]', '"left", "hole"]'))
    assert "a circle or an arc is one leg" in find_only_fault(text)


def test_circle_lost_in_rounding() -> None:
    text = add_curves(SQUARE, "hole = { center = [1, 1], radius = 1e-18, elements = 8 }")
    text = change(text, ('"left"]', '"left", "hole"]'))
    assert "lost in the rounding of the center" in find_only_fault(text)


def test_model_without_extent() -> None:
    text = change(SQUARE, ("[0, 0], [2, 0]", "[0, 0], [2e-200, 0]"), ("[2, 0], [2, 2]", "[2e-200, 0], [0, 2e-200]"))
    text = change(text, ("[2, 2], [0, 2]", "[0, 2e-200], [0, 1e-200]"), ("[0, 2], [0, 0]", "[0, 1e-200], [0, 0]"))
    assert "curves (line 6): found curves with an extent of 2e-200" in "\n".join(map(str, find_faults(text)))


def test_numbers_that_would_overflow() -> None:
    assert "found 1e+300; expected a number <= 1e+100" in find_only_fault(
        change(SQUARE, ("[2, 0], [2, 2]", "[2, 0], [1e300, 2]"))
    )


def test_circle_with_seven_elements() -> None:
    text = add_curves(SQUARE, "hole = { center = [1, 1], radius = 0.5, elements = 7 }")
    text = change(text, ('"left"]', '"left", "hole"]'))
    expected = "curves.hole (line 11): found 7 elements around a circle; expected at least 8: an element may turn by 45"
    assert expected in find_only_fault(text)
