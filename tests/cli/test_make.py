"""`pbem make` as a user meets it: files that are right, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbem.case import Case, read_case
from pbem.cli import main
from pbem.description.schema import CurveTable

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def make(kind: str, *options: str) -> Case:
    """The case that the command writes."""
    assert main(["make", kind, "-o", "made.toml", "--force", *options]) == 0
    return read_case("made.toml")


def list_shapes(case: Case) -> dict[str, tuple[object, ...]]:
    """What of the curves is written."""
    def tell(curve: CurveTable) -> tuple[object, ...]:
        return curve.points, curve.center, curve.radius, curve.elements

    return {name: tell(curve) for name, curve in case.curves.items()}


def test_what_is_made_can_be_checked_and_run(capsys: Capture) -> None:
    assert main(["make", "cracks", "-o", "few.toml", "--count", "3", "--elements", "3", "--sxx", "0.3"]) == 0
    assert capsys.readouterr().out == "case file: few.toml\n"
    assert main(["check", "few.toml"]) == 0
    assert main(["run", "few.toml", "--quiet"]) == 0
    capsys.readouterr()
    assert main(["info", "few.h5"]) == 0
    assert "crack_3" in capsys.readouterr().out


def test_inclusions_can_be_run(capsys: Capture) -> None:
    given = ["--count", "2", "--elements", "8", "--friction", "0.5", "--order", "1"]
    for place in ([], ["--plate", "6", "--plate-elements", "4"]):
        assert main(["make", "inclusions", "-o", "few.toml", "--force", *given, *place]) == 0
        assert main(["run", "few.toml", "--quiet", "--force"]) == 0
    capsys.readouterr()
    assert main(["info", "few.h5"]) == 0
    assert "inclusion_2" in capsys.readouterr().out


@pytest.mark.parametrize("options", [
    ("cracks", "--friction", "0.4", "--cohesion", "0.01"),
    ("cracks", "--distribution", "lognormal", "--length-spread", "0.4", "--orientation", "-30"),
    ("inclusions", "--distribution", "power", "--exponent", "2.5", "--largest", "3", "--shape", "disc"),
    ("inclusions", "--plate", "40", "--radius-spread", "0.2", "--friction", "0.3"),
])  # fmt: skip
def test_the_short_and_the_long_form_say_the_same(options: tuple[str, ...]) -> None:
    compact, explicit = (make(*options, "--count", "30", form) for form in ("--compact", "--explicit"))
    assert "[[generate]]" in compact.text and "[[generate]]" not in explicit.text
    assert list_shapes(compact) == list_shapes(explicit)
    for case in (compact, explicit):
        assert case.regions["host"] == compact.regions["host"]
        assert {name: law.model_dump() for name, law in case.interfaces.items()} == {
            name: law.model_dump() for name, law in compact.interfaces.items()
        }
    assert dict(compact.regions) == dict(explicit.regions)


def test_many_are_one_table() -> None:
    assert "[[generate]]" not in make("cracks", "--count", "50").text
    case = make("cracks", "--count", "51")
    assert "[[generate]]" in case.text and len(case.curves) == 51


def test_options_arrive_in_the_case() -> None:
    case = make("cracks", "--count", "60", "--half-length", "2", "--density", "0.01", "--distance", "0.7",
                "--seed", "5", "--elements", "6", "--order", "1", "--friction", "0.3", "--cohesion", "0.2",
                "--sxx", "0.5", "--syy", "-2", "--sxy", "0.25",
                "--young", "7", "--poisson", "0.1", "--plane", "stress", "--name", "joint")
    points = np.array([curve.points for curve in case.curves.values()])
    np.testing.assert_allclose(np.linalg.norm(points[:, 1] - points[:, 0], axis=1), 4, rtol=1e-7)
    host, table = case.materials["host"], case.generate[0]
    assert (host.young, host.poisson, host.plane) == (7, 0.1, "stress")
    assert (table.density, table.distance, table.seed, table.elements) == (0.01, 0.7, 5, 6)
    assert (table.friction, table.cohesion, case.analysis.order) == (0.3, 0.2, 1)
    assert case.remote is not None
    assert (case.remote.sxx, case.remote.syy, case.remote.sxy) == (0.5, -2, 0.25)
    assert "joint_60" in case.curves


def test_inclusions_are_bonded_unless_friction_is_given() -> None:
    assert {law.law for law in make("inclusions", "--count", "3").interfaces.values()} == {"bonded"}
    case = make("inclusions", "--count", "3", "--friction", "0.5", "--young", "3", "--inclusion-poisson", "0.4")
    assert {(law.law, law.friction) for law in case.interfaces.values()} == {("coulomb", 0.5)}
    assert (case.materials["filling"].young, case.materials["filling"].poisson) == (30, 0.4)
    areas = np.pi * sum(curve.radius**2 for curve in case.curves.values() if curve.radius)
    assert areas == pytest.approx(3 * np.pi)
    # A fifth of the area of the centres.
    centers = np.array([curve.center for curve in make("inclusions", "--count", "400").curves.values()])
    assert np.ptp(centers) == pytest.approx(np.sqrt(400 * np.pi / 0.2), rel=0.02)


REFUSED = {
    "no room": (["--count", "400", "--density", "9"], "found room for"),
    "count": (["--count", "0"], "generate[1].count"),
    "plate and density": (["--count", "4", "--plate", "20", "--density", "0.1"], "--density with --plate"),
    "plate and shear": (["--count", "4", "--plate", "20", "--sxy", "0.1"], "--sxy with --plate"),
    "orientation": (["--count", "4", "--orientation", "up"], "'up' is neither an angle nor uniform"),
    "no count": ([], "--count"),
    "folder": (["--count", "4", "-o", "none/made.toml"], "none/made.toml"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_made_is_refused(what: str, capsys: Capture, folder: Path) -> None:
    options, words = REFUSED[what]
    assert main(["make", "cracks", "-o", "made.toml", *options]) == 2
    assert words in capsys.readouterr().err
    assert list(folder.iterdir()) == []


def test_a_file_that_is_there_stays(folder: Path, capsys: Capture) -> None:
    (folder / "mine.toml").write_text("mine")
    assert main(["make", "cracks", "--count", "3", "-o", "mine.toml"]) == 2
    assert "mine.toml is there already; --force" in capsys.readouterr().err
    assert (folder / "mine.toml").read_text() == "mine"
