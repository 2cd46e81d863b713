"""Every bundled case runs, obeys the contact conditions, and gives the numbers that it tells to expect."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.cases.bundled import CASES, FOLDER, Solve
from tests.cases.conditions import find_faults
from tests.cases.expectations import Expectation, check_expectation, parse_expectations
from tests.cases.sampling import sample_contact

EXPECTATIONS = {name: parse_expectations(path.read_text(encoding="utf-8")) for name, path in CASES.items()}
LISTED = [(name, expected) for name, every in EXPECTATIONS.items() for expected in every]
each_case = pytest.mark.parametrize("name", CASES)


@each_case
def test_the_file_says_what_it_is_and_what_to_expect(name: str) -> None:
    comment = CASES[name].read_text(encoding="utf-8").split("\n\n")[0].splitlines()
    assert all(line.startswith("#") for line in comment)
    assert re.match(r"# [A-Z].*", comment[0]), "the first line says what the problem is"
    assert any(line.startswith("# Numbers: ") for line in comment), "where the numbers come from"
    assert EXPECTATIONS[name], "no number to expect"
    readme = (FOLDER / "README.md").read_text(encoding="utf-8")
    stems = re.findall(r"`(\w+)`", readme)
    assert name in stems or any(name == f"{stem}{tail}" for stem in stems for tail in ("_dbem", "_hst", "_thst"))


@each_case
def test_the_result_obeys_the_contact_conditions(name: str, solve: Solve) -> None:
    faults = find_faults(solve(name).path)
    assert not faults, "\n".join(faults)


@pytest.mark.parametrize(("name", "expected"), LISTED, ids=[f"{name}: {expected}" for name, expected in LISTED])
def test_the_expected_number_is_found(name: str, expected: Expectation, solve: Solve) -> None:
    value, error = check_expectation(solve(name), expected)
    assert error <= 1, f"found {value:.7g}, {error:.2g} times the tolerance off"


@pytest.mark.parametrize("family", ["two_blocks", "two_blocks_sliding"])
def test_the_schemes_of_a_family_have_the_same_data(family: str) -> None:
    tables = {scheme: read_table(f"{family}_{scheme.lower()}".removesuffix("_sst")) for scheme in
              ("SST", "DBEM", "HST", "THST")}  # fmt: skip
    assert {scheme: table["analysis"].pop("scheme") for scheme, table in tables.items()} == {key: key for key in tables}
    for table in tables.values():
        del table["title"]
        assert table == tables["SST"]


def read_table(name: str) -> dict:
    """The tables of a case file."""
    return tomllib.loads(CASES[name].read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("family", "force", "slip"), [("two_blocks", 4e-4, 2e-3), ("two_blocks_sliding", 7e-4, 1.2e-2)]
)
def test_the_schemes_agree(family: str, force: float, slip: float, solve: Solve) -> None:
    first = solve(family)
    places = np.linspace(0.1, 1.9, 19)
    for scheme in ("dbem", "hst", "thst"):
        other = solve(f"{family}_{scheme}")
        np.testing.assert_allclose(other.reactions["top"][-1], first.reactions["top"][-1], rtol=force, err_msg=scheme)
        expected, found = (sample_contact(each, "interface", "slip", places) for each in (first, other))
        np.testing.assert_allclose(found, expected, rtol=0, atol=slip * np.abs(expected).max(), err_msg=scheme)


def test_a_pull_mirrors_a_push_where_everything_sticks(solve: Solve) -> None:
    push, pull = solve("layers_push"), solve("layers_pull")
    for field in ("traction", "displacement"):
        expected = -getattr(push, field)
        np.testing.assert_allclose(getattr(pull, field), expected, rtol=0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("layers")])
def test_the_layers_are_symmetric(name: str, solve: Solve) -> None:
    results = solve(name)
    left, right = results.contact["seat_left"], results.contact["seat_right"]
    scale = max(np.abs(right.traction_n).max(), np.abs(right.traction_s).max())
    for field, sign in (("traction_n", 1), ("traction_s", -1)):
        mirrored = sign * getattr(left, field)[:, ::-1]
        np.testing.assert_allclose(mirrored, getattr(right, field), rtol=0, atol=1e-7 * scale, err_msg=field)
    assert (left.mode[:, ::-1] == right.mode).all()


def test_sliding_shear_is_friction_times_pressure(solve: Solve) -> None:
    for name, curve, friction in (("two_blocks_sliding", "top", 1.0), ("block_on_block", "top", 0.4)):
        shear, normal = solve(name).reactions[curve][-1]
        assert shear == pytest.approx(-friction * normal, rel=1e-5)


def test_proportional_load_needs_one_step(solve: Solve) -> None:
    one, five = solve("crack_field"), solve("crack_field_steps")
    assert (len(one.steps), len(five.steps)) == (1, 5)
    for name, crack in one.contact.items():
        assert (five.contact[name].mode[-1] == crack.mode[-1]).all(), name
    for field in ("displacement", "traction"):
        whole = getattr(one, field)[-1]
        for step in range(5):
            part = 5.0 / (step + 1) * getattr(five, field)[step]
            np.testing.assert_allclose(part, whole, rtol=0, atol=1e-9 * np.abs(whole).max(), err_msg=field)


def test_the_crack_field_is_what_its_script_writes(tmp_path: Path) -> None:
    script = FOLDER.parent / "scripts" / "make_crack_field.py"
    subprocess.run([sys.executable, script, "-o", tmp_path], check=True, timeout=60)
    for name in ("crack_field", "crack_field_steps"):
        assert (tmp_path / f"{name}.toml").read_text(encoding="utf-8") == CASES[name].read_text(encoding="utf-8")


def test_the_crack_field_has_cracks_of_all_kinds(solve: Solve) -> None:
    modes = [frozenset(crack.mode[-1].tolist()) for crack in solve("crack_field").contact.values()]
    assert len(modes) >= 60
    counts = {kind: modes.count(kind) for kind in set(modes)}
    assert all(counts[frozenset({mode})] >= 10 for mode in (0, 1, 2)), counts
    assert sum(len(kind) > 1 for kind in modes) >= 5, counts
