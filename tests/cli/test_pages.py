"""The pages of documentation: printed by `pbem help`, installed with the package, and in step with the program."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import h5py
import pytest
from pydantic import BaseModel

import pbem
from pbem.cli import COMMANDS, main
from pbem.description.schema import CaseFile, LawTable, Table
from pbem.description.varying import ExpressionTable, VaryingTable
from pbem.pages import FOLDER, TOPICS, find_topic, lay_out, read_page
from pbem.pages.keys import write_key_page
from tests.cli.cli_sample import BLOCKS

Capture = pytest.CaptureFixture[str]
ROOT = Path(__file__).parents[2]
SOURCES = sorted((ROOT / "pbem").rglob("*.py"))


def test_each_topic_has_a_page_and_each_page_a_topic() -> None:
    assert {path.stem for path in FOLDER.glob("*.md")} == set(TOPICS)
    assert all(read_page(topic).startswith("# ") for topic in TOPICS)


@pytest.mark.parametrize("topic", TOPICS)
def test_pages_are_plain_text_for_any_terminal(topic: str) -> None:
    page = read_page(topic)
    assert page.isascii() and page.endswith("\n") and "\t" not in page
    lines = page.splitlines()
    # Commands and tables cannot be broken.
    assert [line for line in lines if len(line) > 120 and not line.startswith(("|", ".venv/bin/python -c "))] == []
    assert not re.search(r"\n\n\n", page), "empty lines"
    # Blocks of code are closed, and what is set apart within them is no heading.
    assert page.count("```") % 2 == 0


@pytest.mark.parametrize("topic", TOPICS)
def test_help_prints_a_page(topic: str, capsys: Capture) -> None:
    assert main(["help", *topic.split("-")]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    # All but the spaces of the columns of tables.
    assert re.findall(r"\w+", printed.out) == re.findall(r"\w+", read_page(topic))


def test_help_lists_the_topics(capsys: Capture) -> None:
    assert main(["help"]) == 0
    text = capsys.readouterr().out
    assert all(re.search(rf"^  {topic} +\w", text, re.MULTILINE) for topic in TOPICS)


@pytest.mark.parametrize(
    ("words", "near"), [("thoery", "theory"), ("large-modells", "large-models"), ("key", "keys"), ("result", "results")]
)
def test_an_unknown_topic_is_refused_with_the_nearest(words: str, near: str, capsys: Capture) -> None:
    assert main(["help", words]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert f"there is no topic '{words}'; did you mean '{near}'?" in printed.err
    assert all(topic in printed.err for topic in TOPICS)


def test_a_topic_that_is_like_nothing_is_not_guessed_at(capsys: Capture) -> None:
    assert main(["help", "x\x1b[2J"]) == 2
    text = capsys.readouterr().err
    assert text.startswith("pbem help: there is no topic 'x\\x1b[2J'. The topics are:") and "\x1b" not in text


def test_help_on_a_command_is_that_of_the_command(capsys: Capture) -> None:
    for command in COMMANDS:
        if find_topic(command):  # of `import` there is a page
            continue
        assert main(["help", command]) == 0
        assert capsys.readouterr().out.startswith(f"usage: pbem {command} ")


def test_topics_are_found_however_they_are_written() -> None:
    assert find_topic("Large  Models") == find_topic("large_models") == find_topic("large-models") == "large-models"
    assert find_topic("") is None and find_topic("../keys") is None


def test_tables_have_their_columns_below_each_other() -> None:
    page = "one\n| a | long name |\n| --- | --- |\n| 12345 | b |\ntwo"
    assert lay_out(page).splitlines() == ["one", "a      long name", "-----  ---------", "12345  b", "two"]


def test_help_loads_no_library_and_takes_a_closed_pipe() -> None:
    code = ("import sys; from pbem.cli import main; main(['help', 'theory']); "
            "heavy = {'numpy', 'scipy', 'h5py', 'mpi4py', 'petsc4py', 'pydantic', 'matplotlib'}; "
            "sys.exit(' '.join(heavy & set(sys.modules)) or 0)")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    reader, writer = os.pipe()
    os.close(reader)
    arguments = [sys.executable, "-m", "pbem", "help", "theory"]
    done = subprocess.run(arguments, stdout=writer, stderr=subprocess.PIPE, text=True, timeout=60)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")


def test_further_ranks_leave_help_to_the_first() -> None:
    environment = os.environ | {"OMPI_COMM_WORLD_RANK": "1", "OMPI_COMM_WORLD_SIZE": "2"}
    arguments = [sys.executable, "-m", "pbem", "help", "nothing of the kind"]
    done = subprocess.run(arguments, capture_output=True, text=True, env=environment, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_pages_are_installed_with_the_package(tmp_path: Path) -> None:
    installed = tmp_path / "installed"
    commands = ["egg_info", "--egg-base", str(tmp_path), "build_py", "--build-lib", str(installed)]
    done = subprocess.run([sys.executable, "setup.py", "-q", *commands], cwd=ROOT, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert {path.stem for path in (installed / "pbem" / "pages").glob("*.md")} == set(TOPICS)
    bundled = {path.stem for path in (installed / "pbem" / "cases" / "gallery").glob("*.toml")}
    assert bundled == {path.stem for path in (ROOT / "cases" / "gallery").glob("*.toml")} and len(bundled) > 20
    code = "import pbem, sys; from pbem.pages import read_page; print(pbem.__file__, read_page(sys.argv[1])[:7])"
    done = subprocess.run([sys.executable, "-c", code, "theory"], cwd=installed, capture_output=True, timeout=60)
    assert done.stdout.decode().split() == [str(installed / "pbem" / "__init__.py"), "#", "Theor"], done.stderr


def test_links_and_topics_that_are_named_exist() -> None:
    texts = {path: path.read_text(encoding="utf-8") for path in [ROOT / "README.md", *FOLDER.glob("*.md"), *SOURCES]}
    named = {(path, topic) for path, text in texts.items() for topic in re.findall(r"`pbem\s+help\s+([a-z-]+)`", text)}
    assert len(named) > 20 and {topic for _, topic in named} <= TOPICS.keys(), named
    for path, text in texts.items():
        if path.suffix == ".md":
            files = re.findall(r"`((?:scripts|pbem|cases|tests)/[\w/]+\.\w+)(?::\w+)?`", text)
            assert [file for file in files if not (ROOT / file).is_file()] == [], path
            links = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in link]
            assert [link for link in links if not (path.parent / link).exists()] == [], path


def test_the_page_of_keys_is_that_of_the_schema() -> None:
    assert read_page("keys") == write_key_page(), "python -m pbem.pages.keys > pbem/pages/keys.md"


def test_all_keys_are_on_their_page_with_a_meaning() -> None:
    page = read_page("keys")
    tables = [each for each in Table.__subclasses__() if issubclass(each, BaseModel)]
    assert len(tables) > 15
    for table in tables:
        for key, field in table.model_fields.items():
            if table in (CaseFile, VaryingTable, ExpressionTable):  # told in words
                continue
            assert re.search(rf"`(?:[\w.]+\.)?{key}(?:\.[\w.]+)?`", page), key
            if key not in ("sxx", "syy", "sxy", "gx", "gy", "exx", "eyy"):
                assert field.description, f"{table.__name__}.{key} has no meaning"
    assert all(re.search(rf"`\[+{name}[\].]", page) for name in CaseFile.model_fields if name != "title")
    assert page.count("`cohesion`") == 1 and "cohesion" in LawTable.model_fields


def list_reasons() -> Iterator[str]:
    """The short names with which the code ends or stops a run."""
    ends = {"ConvergenceError": 0, "StopError": 0, "_end": 1, "ask": 0, "fail": 0}  # the argument that names it
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Call):
                continue
            name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
            if name in ends and len(node.args) > 1 and isinstance(reason := node.args[ends[name]], ast.Constant):
                yield str(reason.value)


def test_all_reasons_with_which_a_run_may_end_are_explained() -> None:
    page = read_page("convergence")
    headings = set(re.findall(r"^### (.+)$", page, re.MULTILINE))
    reasons = set(list_reasons())
    assert {"free motion", "limit load", "mode cycle", "accuracy", "net force", "reader"} <= reasons
    stops = reasons - headings
    assert stops <= {"reader", "StorageError"} and all(f"`{stop}`" in page for stop in stops)
    assert headings <= reasons, "reasons that no run ends with"
    assert all(name in page for name in ("`SIGTERM`", "`interrupted`", "`MemoryError`", "`StorageError`", "`LawError`"))


def test_all_that_a_result_file_holds_is_explained(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "blocks.toml").write_text(BLOCKS + "[output]\npoints = [[0.5, 0.5]]\n", encoding="utf-8")
    pbem.run("blocks.toml")
    page = read_page("results")
    sections = dict(re.findall(r"^`/([\w/]+)`(.*?)(?=^`/|\Z)", page, re.MULTILINE | re.DOTALL))
    named = {"contact": "contact/NAME", "reactions": "reactions/CURVE", "tips": "tips/CRACK", "all": "all/contact"}
    found: list[str] = []
    with h5py.File("blocks.h5") as file:
        file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
        assert [name for name in file.attrs if f"`{name}`" not in page] == []
    assert len(found) > 50
    for name in found:
        group, _, _ = name.partition("/")
        dataset = name.rpartition("/")[2]
        text = sections[named.get(group, group)] + (sections["contact/NAME"] if group == "all" else "")
        assert group in ("reactions", "convergence", "notes") or dataset == "reactions" or f"`{dataset}`" in text, name
