"""The numbered formulas of the page of theory, and where the code cites them: each check returns its faults."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

# A formula begins with its number, set apart like code; citations name one number, several, or a range.
FORMULA = re.compile(r"^ {4}\((\d+)\) ", re.MULTILINE)
CITATION = re.compile(r"\(theory, ((?:\d+(?: to \d+)?(?:, )?)+)\)")
CLAIM = re.compile(r"`(pbem/[\w/]+\.\w+):(\w+)`")


def read_numbers(page: str) -> list[int]:
    """The formulas' numbers in the order of the page."""
    return [int(number) for number in FORMULA.findall(page)]


def expand(cited: str) -> set[int]:
    """The numbers that a citation names: "3, 9 to 11" -> 3, 9, 10, 11."""
    numbers: set[int] = set()
    for part in cited.split(", "):
        first, _, last = part.partition(" to ")
        numbers |= set(range(int(first), int(last or first) + 1))
    return numbers


def list_citations(text: str) -> set[int]:
    """All numbers that a text cites."""
    return {number for cited in CITATION.findall(text) for number in expand(cited)}


def read_claims(page: str) -> Iterator[tuple[int, str, str]]:
    """Yield number, file and function for what the page says to implement a formula."""
    for line in re.sub(r"\n {2,}(?=\S)", " ", page).splitlines():
        if line.startswith("- ("):
            for number in re.findall(r"\((\d+)\)", line):
                for file, function in CLAIM.findall(line):
                    yield int(number), file, function


def check_numbers(page: str) -> list[str]:
    """Formulas are numbered from 1 on, without gaps, and each says where it is implemented."""
    numbers = read_numbers(page)
    faults = [] if numbers == list(range(1, len(numbers) + 1)) else [f"numbers out of order: {numbers}"]
    claimed = {number for number, _, _ in read_claims(page)}
    return faults + [f"no function is named for formula {number}" for number in numbers if number not in claimed]


def check_citations(page: str, root: Path) -> list[str]:
    """What the code cites is on the page."""
    known = set(read_numbers(page))
    return [
        f"{path}: cites formula {number}, which is not on the page"
        for path in list_sources(root)
        for number in sorted(list_citations(path.read_text(encoding="utf-8")) - known)
    ]


def check_claims(page: str, root: Path) -> list[str]:
    """The functions that the page names exist, and cite the formula: in Python in themselves, in C beside them."""
    known, faults = set(read_numbers(page)), []
    for number, file, function in read_claims(page):
        texts = find_function(root / file, function)
        if number not in known:
            faults.append(f"formula {number} of {file} is not on the page")
        if not texts:
            faults.append(f"{file} has no function {function}")
        elif not any(number in list_citations(text) for text in texts):
            faults.append(f"{file}: {function} does not cite formula {number}")
    return faults


def list_sources(root: Path) -> list[Path]:
    """Python and C files of the package."""
    return sorted(path for kind in ("*.py", "*.h", "*.c") for path in (root / "pbem").rglob(kind))


def find_function(path: Path, name: str) -> list[str]:
    """The texts of the functions of a name; in C the definition with the comment before it."""
    if not path.is_file():
        return []
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".py":
        return [
            ast.get_source_segment(text, node) or ""
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.FunctionDef) and node.name == name
        ]
    found = re.search(rf"^(?:INLINE|APART|static inline|static) [^;{{}}\n]*\b{name}\(", text, re.MULTILINE)
    return [] if not found else [text[max(0, text.rfind("\n}", 0, found.start())) : found.end()]]
