"""`pbem check`: laws, contacts, loads and the forecast, for people and for programs; refusals and doubts."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from pbem.cli import main

CASE = """
title = "Everything that has a law"
[materials.rock]
young = 1000.0
poisson = 0.25
[curves]
bottom = { points = [[0, 0], [4, 0]], elements = 8 }
right = { points = [[4, 0], [4, 2]], elements = 8 }
top = { points = [[4, 2], [0, 2]], elements = 16 }
left = { points = [[0, 2], [0, 0]], elements = 8 }
"t1.1" = { points = [[1, 0.5], [1.5, 0.6]], elements = 3 }
"t1.2" = { points = [[1.5, 0.6], [1.8, 0.9]], elements = 8 }
t2 = { points = [[2.5, 1.5], [3.0, 1.6]], elements = 8 }
t3 = { points = [[3.2, 0.5], [3.4, 0.8]], elements = 3 }
punch_bottom = { points = [[1.5, 2], [2.5, 2]], elements = 8 }
punch_right = { points = [[2.5, 2], [2.5, 3]], elements = 4 }
punch_top = { points = [[2.5, 3], [1.5, 3]], elements = 4 }
punch_left = { points = [[1.5, 3], [1.5, 2]], elements = 4 }
[regions.base]
material = "rock"
boundary = ["bottom", "right", "top", "left"]
cracks = ["t1.1", "t1.2", "t2", "t3"]
[regions.punch]
material = "rock"
boundary = ["punch_bottom", "punch_right", "punch_top", "punch_left"]
[contacts.seat]
between = ["punch_bottom", "top"]
friction = 0.3
[interfaces.t2]
law = "coulomb"
friction = 0.6
cohesion = 1.0
tensile_strength = 0.5
friction_dynamic = 0.4
slip_distance = 0.01
cohesion_lost = true
normal_stiffness = 1e5
tangential_stiffness = 2e5
gap = 0.001
pressure = 0.25
[interfaces.t3]
law = "frictionless"
[boundary.bottom]
ux = 0.0
uy = 0.0
[boundary.punch_top]
ux = 0.0
uy = 0.0
[[stages]]
name = "press"
steps = 2
[stages.boundary.punch_top]
ux = 0.0
uy = -0.001
[[stages]]
name = "inject"
steps = 1
[stages.interfaces.t2]
pressure = 0.5
"""
# A case without any load, by taking all loads out of the one above.
UNLOADED = CASE.split("[[stages]]")[0].replace("pressure = 0.25", "pressure = 0.0") + "[analysis]\nsteps = 1\n"


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("SLURM_MEM_PER_NODE", "SLURM_MEM_PER_CPU", "PBS_RESC_MEM", "PBEM_ALLOW_MEMORY"):
        monkeypatch.delenv(name, raising=False)
    path = tmp_path / "case.toml"
    path.write_text(CASE)
    return path


def read_section(text: str, title: str) -> list[str]:
    """Lines below a title, single-spaced."""
    body = text.split(f"\n{title}\n", 1)[1].split("\n\n")[0]
    return [" ".join(line.split()) for line in body.splitlines()]


def read_json(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    assert main(["check", *arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_every_law_is_shown_with_all_its_numbers(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(case)]) == 0
    text = capsys.readouterr().out
    titles, *rows = read_section(text, "laws")
    for title in ("friction", "cohesion", "tensile strength", "weakening", "stiffness", "gap", "pressure"):
        assert title in titles
    assert rows == [
        "t1 (1 crack in 2 pieces) coulomb 0 0 0 - rigid 0 0",
        "t2 coulomb 0.6 1 0.5 friction to 0.4 over slip 0.01, strength lost at first failure 100000, 200000 0.001 "
        "0.25, 0.5",
        "t3 frictionless 0 0 0 - rigid 0 0",
        "seat coulomb 0.3 0 0 - rigid 0 0",
    ]
    assert read_section(text, "contacts")[1].startswith("seat punch_bottom top ")
    assert read_section(text, "load") == [
        "press: 2 steps, fluid pressure 0.25 in t2", "punch_top: uy = -0.001",
        "inject: 1 step, fluid pressure 0.5 in t2", "punch_top: uy = -0.001",
    ]  # fmt: skip


def test_programs_read_the_same(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = read_json(capsys, str(case))
    laws = {name: law for law in told["laws"] for name in law["of"]}
    assert laws["t2"]["friction_dynamic"] == 0.4 and laws["t2"]["pressure"] == [0.25, 0.5]
    assert laws["t1.1"] is laws["t1.2"] and laws["seat"]["on"] == "contact" and laws["t2"]["on"] == "crack"
    assert told["contacts"]["seat"]["between"] == ["punch_bottom", "top"]
    assert told["contacts"]["seat"]["least_distance"] == pytest.approx(0.0, abs=1e-9)
    assert told["interfaces"]["t2"] == {"kind": "crack", "first": "base", "second": None, "pairs": 24}
    assert told["conditions"]["punch_top"]["y"] == {"known": "displacement", "stiffness": 0.0,
                                                    "values": [-0.001, -0.001]}
    assert [(stage["name"], stage["steps"], stage["pressure"]) for stage in told["stages"]] == [
        ("press", 2, {"t2": 0.25}), ("inject", 1, {"t2": 0.5})]
    assert told["size"]["unknowns"] == told["forecast"]["unknowns"] == 2 * told["size"]["nodes"]
    forecast = told["forecast"]
    assert forecast["memory"] == pytest.approx(sum(forecast["memory_by_use"].values())) and forecast["disk"] > 0
    assert forecast["seconds"] == pytest.approx(sum(forecast["seconds_by_piece"].values())) and forecast["seconds"] > 0


def test_what_is_probably_not_meant_is_said(case: Path, capsys: pytest.CaptureFixture[str]) -> None:
    smooth, sparse = read_json(capsys, str(case))["doubts"]
    assert smooth.startswith("t1 (1 curve in 2 pieces): Coulomb's law without friction")
    assert sparse.startswith("t3: contact on 3 elements")  # the pieces of t1 have 11
    case.write_text(UNLOADED)
    told = read_json(capsys, str(case))
    assert sum("load" in text.lower() for text in (*told["doubts"], *told["notes"])) == 1
    assert sum("friction" in text for text in (*told["doubts"], *told["notes"])) == 1
    assert any(text.startswith("No load: ") for text in told["notes"])
    case.write_text(UNLOADED.replace("gap = 0.001\n", "gap = 0.001\nfriction_angle = 0.0\n").replace(
        "friction = 0.6\n", "").replace("friction_dynamic = 0.4\nslip_distance = 0.01\n", "").replace(
        "tensile_strength = 0.5\n", "").replace("cohesion = 1.0\n", "").replace("cohesion_lost = true\n", ""))
    assert not any("t2" in text for text in read_json(capsys, str(case))["doubts"])  # friction 0 was asked for


def test_thousands_of_traces_are_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = ["[materials.rock]", "young = 1000.0", "poisson = 0.25", "[curves]"]
    for number in range(1, 301):
        x, y = 3.0 * (number % 20), 3.0 * (number // 20)
        lines.append(f'"t{number}.1" = {{ points = [[{x}, {y}], [{x + 1}, {y}]], elements = 3 }}')
        lines.append(f'"t{number}.2" = {{ points = [[{x + 1}, {y}], [{x + 2}, {y + 0.5}]], elements = 3 }}')
    names = ", ".join(f'"t{number}.{piece}"' for number in range(1, 301) for piece in (1, 2))
    lines += ["[regions.plane]", 'material = "rock"', "infinite = true", f"cracks = [{names}]"]
    lines += ["[remote]", "syy = -1.0"]
    lines += ['[interfaces."t7.1"]', "friction = 0.5", '[interfaces."t7.2"]', "friction = 0.5"]
    path = tmp_path / "traces.toml"
    path.write_text("\n".join(lines))
    assert main(["check", str(path)]) == 0
    _, *rows = read_section(capsys.readouterr().out, "laws")
    assert [row.split(" coulomb ")[0] for row in rows] == [
        "t1 to t6, t8 to t300 (299 cracks in 598 pieces)", "t7 (1 crack in 2 pieces)"]


def test_too_little_memory_is_refused_with_numbers(
    case: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SLURM_MEM_PER_NODE", "300")
    assert main(["check", str(case)]) == 0
    capsys.readouterr()
    assert main(["check", str(case), "--ranks", "4"]) == 2
    said = capsys.readouterr()
    assert "on 4 ranks, but SLURM_MEM_PER_NODE grants 0.315 GB" in said.err and said.out == ""
    monkeypatch.setenv("PBEM_ALLOW_MEMORY", "1")
    assert main(["check", str(case), "--ranks", "4"]) == 0


def test_runs_are_refused_likewise(
    case: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(case.parent)
    monkeypatch.setenv("SLURM_MEM_PER_NODE", "100")
    assert main(["run", str(case)]) == 2
    assert "not enough memory" in capsys.readouterr().err and not Path("case.h5").exists()


@pytest.mark.parametrize("ranks", ["0", "-1", "two", "1.5"])
def test_a_number_of_ranks_is_a_whole_one(case: Path, capsys: pytest.CaptureFixture[str], ranks: str) -> None:
    assert main(["check", str(case), "--ranks", ranks]) == 2
    assert "--ranks" in capsys.readouterr().err
