"""The page of theory and the code name the same formulas; each check is also seen to fail."""

from __future__ import annotations

from pathlib import Path

from pbem.pages import read_page
from tests.structure import formulas

ROOT = Path(__file__).parents[2]
PAGE = read_page("theory")


def test_formulas_are_found() -> None:
    # Else the tests below could pass because they look at nothing.
    assert len(formulas.read_numbers(PAGE)) > 70 and len(list(formulas.read_claims(PAGE))) > 90
    assert {"pbem/bem/straight.h", "pbem/contact/modes.py"} <= {file for _, file, _ in formulas.read_claims(PAGE)}


def test_formulas_are_numbered_in_order_and_say_where_they_are_implemented() -> None:
    assert formulas.check_numbers(PAGE) == []


def test_all_formulas_that_the_code_cites_are_on_the_page() -> None:
    assert formulas.check_citations(PAGE, ROOT) == []


def test_the_functions_that_the_page_names_cite_their_formulas() -> None:
    assert formulas.check_claims(PAGE, ROOT) == []


SMALL = """
    (1)  a = b,
         c = d
    (2)  e = f

- (1), (2): `pbem/one.py:add`,
  `pbem/two.h:scale`
"""


def test_breaches_are_found(tmp_path: Path) -> None:
    (tmp_path / "pbem").mkdir()
    one, two = tmp_path / "pbem" / "one.py", tmp_path / "pbem" / "two.h"
    one.write_text('def add():\n    """Adds (theory, 1 to 2)."""\n')
    two.write_text("static int other(void)\n{\n}\n\n/* Scales (theory, 1, 2). */\nstatic int scale(int a)\n{\n}\n")
    assert formulas.check_numbers(SMALL) == formulas.check_citations(SMALL, tmp_path) == []
    assert formulas.check_claims(SMALL, tmp_path) == []
    assert formulas.check_numbers(SMALL.replace("(2)  e", "(3)  e")) != []
    assert formulas.check_numbers(SMALL.replace("- (1), (2)", "- (1)")) == ["no function is named for formula 2"]
    one.write_text('def add():\n    """Adds (theory, 1, 7)."""\n')
    two.write_text("/* (theory, 1, 2) */\nstatic int other(void)\n{\n}\n\nstatic int scale(int a)\n{\n}\n")
    assert formulas.check_citations(SMALL, tmp_path) == [f"{one}: cites formula 7, which is not on the page"]
    assert formulas.check_claims(SMALL, tmp_path) == [
        "pbem/two.h: scale does not cite formula 1",
        "pbem/one.py: add does not cite formula 2",
        "pbem/two.h: scale does not cite formula 2",
    ]
    assert "pbem/one.py has no function put" in formulas.check_claims(SMALL.replace(":add", ":put"), tmp_path)
