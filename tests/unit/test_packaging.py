"""The recipes of packages agree with the project: versions, requirements, and the files that they take."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path

from pbem.version import __version__

ROOT = Path(__file__).resolve().parents[2]
PACKAGING = ROOT / "scripts" / "packaging"
# What conda-forge calls otherwise.
NAMES = {"matplotlib-base": "matplotlib"}


def test_the_recipe_is_of_this_version_and_asks_for_the_same_libraries() -> None:
    recipe = (PACKAGING / "recipe.yaml").read_text()
    assert f'version: "{__version__}"' in recipe
    run = recipe.split("\n  run:\n")[1].split("\n\n")[0]
    found = dict(re.findall(r"^ +- (\S+) >=([\d.]+)", run, re.MULTILINE))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    asked = dict(re.split(r">=", each) for each in project["dependencies"])
    assert {NAMES.get(name, name): version for name, version in found.items() if name != "python"} == asked
    assert f">={found['python']}" == project["requires-python"]
    (host,) = re.findall(r"- setuptools >=(\d+)", recipe)
    assert tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"] == [f"setuptools>={host}"]


def test_the_container_takes_files_that_are_there() -> None:
    definition = (PACKAGING / "pbem.def").read_text()
    sections = re.findall(r"^%(\w+)$", definition, re.MULTILINE)
    assert sections == ["files", "post", "environment", "runscript", "test", "labels", "help"]
    files = definition.split("%files\n")[1].split("\n\n")[0].split()
    assert all((ROOT / source).exists() for source in files[::2])
    assert files[1::2] == [f"/opt/pbem/{source}" for source in files[::2]]
    for name in ("post", "test"):
        steps = definition.split(f"%{name}\n")[1].split("\n%")[0]
        subprocess.run(["sh", "-n"], input=steps, text=True, check=True, timeout=20)


def test_scripts_of_packages_are_in_order() -> None:
    for script in PACKAGING.glob("*.sh"):
        subprocess.run(["bash", "-n", str(script)], check=True, timeout=20)


def set_up(stubs: str) -> subprocess.CompletedProcess[str]:
    """What setup does about packages of the system, with other commands in place of the system's."""
    script = (ROOT / "scripts" / "setup.sh").read_text()
    assert script.endswith("\nmain\n")
    text = script.removesuffix("main\n").replace('$(dirname "${BASH_SOURCE[0]}")/..', str(ROOT))
    return subprocess.run(["bash", "-c", f"{text}{stubs}\ninstall_system_packages"], capture_output=True, text=True,
                          timeout=20)


OFFERS = {"nothing": "apt-cache() { :; }", "all": "apt-cache() { echo Package: $3; }"}
INSTALLED = 'dpkg-query() { case ${!#} in *ezdxf) echo not-installed;; *) echo installed;; esac; }\n'
STUBS = 'id() { echo 0; }\napt-get() { echo "apt-get $*"; }\nenv() { shift; "$@"; }\n' + INSTALLED


def test_libraries_that_a_distribution_lacks_are_no_reason_to_fail() -> None:
    done = set_up(STUBS + OFFERS["nothing"])
    assert done.returncode == 0 and "apt-get" not in done.stdout
    assert "python3-ezdxf is left out, this distribution has none; needed for pbem import of" in done.stderr
    assert ".venv/bin/pip install ezdxf" in done.stderr and "pandas" not in done.stderr
    done = set_up(STUBS + OFFERS["all"])
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.count("apt-get install") == 1
    done = set_up(STUBS + OFFERS["all"] + '\napt-get() { return 100; }')
    assert done.returncode == 0 and "apt-get could not install it" in done.stderr


def test_what_runs_need_is_a_reason_to_fail() -> None:
    stubs = STUBS + OFFERS["all"] + '\ndpkg-query() { return 1; }\nsudo() { :; }\napt-get() { [ $1 = update ]; }'
    assert set_up(stubs).returncode != 0
