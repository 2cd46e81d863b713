#!/usr/bin/env python3
"""Runs the cases of the gallery, checks their numbers, and writes their pages, pictures and lists.

    .venv/bin/python -m scripts.make_gallery [NAME ...] [--check]

A case is cases/gallery/NAME.toml with NAME.py beside it: constants TITLE, SUBJECT (one of SUBJECTS), PROBLEM, SOURCE,
EXPECTED = {quantity: (value of the source, relative tolerance)}, PICTURES = [(what it shows, arguments of `pbem plot`
after the file's name)], and `compute(results)`, which gives the quantities of EXPECTED by name.

Written are cases/gallery/NAME.md and NAME_1.png, ..., the list in cases/README.md and pbem/pages/gallery.md. With names
only their pages are written. --check writes nothing. Exit code 1 if a number is not as expected.
"""

from __future__ import annotations

import argparse
import ast
import importlib.util
import math
import re
import sys
import tempfile
import textwrap
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import pbem  # noqa: E402
from pbem.results.reader import Results  # noqa: E402

FOLDER = ROOT / "cases" / "gallery"
LIST, PAGE = ROOT / "cases" / "README.md", ROOT / "pbem" / "pages" / "gallery.md"
MARKERS = ("<!-- gallery -->\n", "<!-- end of gallery -->\n")
SUBJECTS = ("fracture", "contact", "composites", "masonry", "rock joints", "tunnels and ground", "faults", "injection")
OTHERS = "more"
CONSTANTS = ("TITLE", "SUBJECT", "PROBLEM", "SOURCE", "EXPECTED", "PICTURES")
# Of a picture (bytes), and of all pictures together.
LARGEST, LARGEST_SUM = 60_000, 2_000_000
COLOURS, DPI, WIDTH = (128, 64, 32, 16), 100, 17.8  # of a picture: as many as fit; dots per inch, cm
DIGITS = 6
# Of those that are known to all of them.
MORE_DIGITS = 9


@dataclass(frozen=True)
class GalleryCase:
    """One case of the gallery, by its name."""

    name: str

    @property
    def case(self) -> Path:
        """The case file."""
        return FOLDER / f"{self.name}.toml"

    @property
    def page(self) -> Path:
        """The page that is made."""
        return FOLDER / f"{self.name}.md"

    @cached_property
    def source(self) -> str:
        """The text of the Python file beside the case."""
        return (FOLDER / f"{self.name}.py").read_text(encoding="utf-8")

    @cached_property
    def module(self) -> ModuleType:
        """The Python file, loaded."""
        spec = importlib.util.spec_from_file_location(f"gallery_{self.name}", FOLDER / f"{self.name}.py")
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    @property
    def subject(self) -> str:
        """Under which heading it is listed."""
        return getattr(self.module, "SUBJECT", OTHERS)

    @property
    def expected(self) -> dict[str, tuple[float, float]]:
        """By quantity the value of the source and a relative tolerance."""
        return self.module.EXPECTED

    @property
    def compute(self) -> Callable[[Results], dict[str, float]]:
        """The function that takes the quantities from results."""
        return self.module.compute

    def list_pictures(self) -> list[Path]:
        """The files of its pictures."""
        return [FOLDER / f"{self.name}_{number + 1}.png" for number in range(len(self.module.PICTURES))]


@dataclass(frozen=True)
class Measured:
    """What a run gave, as its page shows it: quantities (texts), unknowns, seconds of the processor (text)."""

    values: dict[str, str]
    unknowns: int
    seconds: str


def list_gallery() -> list[GalleryCase]:
    """All cases, by subject and name."""
    cases = [GalleryCase(path.stem) for path in sorted(FOLDER.glob("*.toml"))]
    order = [*SUBJECTS, OTHERS]
    return sorted(cases, key=lambda case: (order.index(case.subject), case.name))


def find_difference(found: float, value: float) -> float:
    """Relative difference; absolute where the value is zero."""
    return abs(found - value) / (abs(value) or 1.0)


def find_wrong(case: GalleryCase, found: dict[str, float]) -> list[str]:
    """The quantities that are not as expected, a line each."""
    if found.keys() != case.expected.keys():
        return [f"{case.name}: compute() gives {sorted(found)}, EXPECTED has {sorted(case.expected)}"]
    return [
        f"{case.name}: {name}: {found[name]:.7g}, expected {value:.7g} within {tolerance:g}"
        for name, (value, tolerance) in case.expected.items()
        if not find_difference(found[name], value) <= tolerance
    ]


def write_snippet(case: GalleryCase) -> str:
    """The Python of a page: what the file beside the case imports and does, without its constants."""
    tree, lines = ast.parse(case.source), case.source.splitlines()

    def cut(first: ast.stmt, last: ast.stmt) -> str:
        return "\n".join(lines[first.lineno - 1 : last.end_lineno])

    imports, others, compute = ["import pbem"], [], None
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            if getattr(node, "module", "") not in ("__future__", "pbem.results.reader"):
                imports.append(cut(node, node))
        elif isinstance(node, ast.FunctionDef) and node.name == "compute":
            compute = node
        elif not (isinstance(node, ast.Expr) or _find_target(node) in CONSTANTS):
            others.append(cut(node, node))
    assert compute is not None, f"{case.name}.py has no function compute"
    body = [node for node in compute.body if not (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))]
    assert isinstance(body[-1], ast.Return), f"{case.name}.py: compute ends with `return`"
    steps = textwrap.dedent(cut(body[0], body[-1]))
    steps = re.sub(r"^return ", "numbers = ", steps, flags=re.MULTILINE)
    sorted_imports = sorted(set(imports), key=lambda line: (line.split()[1].startswith("pbem"), line.split()[1]))
    run = f'results = pbem.run("{case.name}")'
    return "\n".join([*sorted_imports, "", *others, *([""] if others else []), run, steps, "print(numbers)"]) + "\n"


def _find_target(node: ast.stmt) -> str:
    """The name to which a statement gives a value."""
    target = node.targets[0] if isinstance(node, ast.Assign) else getattr(node, "target", None)
    return target.id if isinstance(target, ast.Name) else ""


def write_page(case: GalleryCase, measured: Measured) -> str:
    """The page of a case."""
    module = case.module
    pictures = [f"![{words}]({path.name})\n\n{words[0].upper()}{words[1:]}: `pbem plot {case.name}.h5 "
                f"{' '.join(arguments[1:])}".rstrip() + "`.\n"
                for (words, arguments), path in zip(module.PICTURES, case.list_pictures(), strict=True)]
    rows = []
    for name, (value, tolerance) in case.expected.items():
        found = measured.values[name]
        digits = DIGITS if tolerance > 10.0 ** (1 - DIGITS) else MORE_DIGITS
        rows.append(f"| {name} | {value:.{digits}g} | {found} | {_describe_difference(float(found), value)} | "
                    f"{tolerance:g} |")
    return "\n".join([
        f"# {module.TITLE}\n",
        textwrap.fill(" ".join(module.PROBLEM.split()), 110) + "\n",
        textwrap.fill("Source: " + " ".join(module.SOURCE.split()), 110) + "\n",
        *pictures,
        "## Numbers to expect\n",
        "| quantity | expected | computed | difference | tolerance |",
        "| --- | --- | --- | --- | --- |",
        *rows,
        f"\n{measured.unknowns} unknowns, about {measured.seconds} s on one core, `pbem run {case.name}`. Differences "
        "are relative.\n",
        "## The case\n",
        f"```toml\n{case.case.read_text(encoding='utf-8').strip()}\n```\n",
        "## The same in Python\n",
        f"```python\n{write_snippet(case).strip()}\n```\n",
        "This page is made by `python -m scripts.make_gallery`.",
    ]) + "\n"  # fmt: skip


def _describe_difference(found: float, value: float) -> str:
    difference = find_difference(found, value)
    return "< 1e-6" if difference < 1e-6 else f"{difference:.0e}".replace("e-0", "e-")


def read_measured(page: str) -> Measured | None:
    """What a page shows of a run; None of a page of another form."""
    values = dict(re.findall(r"^\| ([^|]+) \| [^|]+ \| ([^|]+) \| [^|]+ \| [^|]+ \|$", page, re.MULTILINE))
    run = re.search(r"^(\d+) unknowns, about ([\d.]+) s", page, re.MULTILINE)
    values = {name: text for name, text in values.items() if name not in ("quantity", "---")}
    return Measured(values, int(run[1]), run[2]) if run else None


def settle(now: Measured, before: Measured | None) -> Measured:
    """What the page shows: as before where only rounding, or the time by about a factor of 2, has changed."""
    if before is None:
        return now
    values = {}
    for name, text in now.values.items():
        old = before.values.get(name, text)
        values[name] = old if find_difference(float(text), float(old)) < 10.0 ** (1 - DIGITS) else text
    keeps = 1 / 3 < float(now.seconds) / float(before.seconds) < 3  # one step of 1, 2, 5, 10
    return Measured(values, now.unknowns, before.seconds if keeps else now.seconds)


def run_case(case: GalleryCase, folder: Path) -> tuple[Results, float]:
    """The results, and the seconds that the processor worked for them."""
    begin = time.process_time()
    results = pbem.run(case.case, folder / f"{case.name}.h5", force=True)
    return results, time.process_time() - begin


def measure(found: dict[str, float], results: Results, seconds: float) -> Measured:
    """What the page shows of a run."""
    # One digit of 1, 2 or 5.
    power = 10.0 ** math.floor(math.log10(max(seconds, 0.05)))
    rounded = power * min((1, 2, 5, 10), key=lambda digit: abs(math.log(seconds / power / digit)))
    values = {name: f"{value:.{DIGITS}g}" for name, value in found.items()}
    return Measured(values, 2 * len(results.nodes.position), f"{rounded:g}")


def draw(case: GalleryCase, results: Results) -> list[str]:
    """Write the pictures of a case, with few colours so that the files are small; what was wrong, a line each."""
    from PIL import Image

    from pbem.cli import main

    for (_, arguments), path in zip(case.module.PICTURES, case.list_pictures(), strict=True):
        command, *options = arguments
        sizes = [] if {"--width", "--size"} & set(options) else ["--width", str(WIDTH)]
        if main([command, str(results.path), *options, *sizes, "--dpi", str(DPI), "-o", str(path)]) != 0:
            return [f"{case.name}: pbem {' '.join(arguments)}"]
        with Image.open(path) as picture:
            full = picture.convert("RGB")
        for colours in COLOURS:
            full.quantize(colours, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(path, optimize=True)
            if path.stat().st_size <= LARGEST:
                break
        else:
            return [f"{path} has {path.stat().st_size} bytes, more than {LARGEST}"]
    return []


def write_list(cases: list[GalleryCase], link: str) -> str:
    """The table of all cases; link: from its place to their pages."""
    rows = [f"| {case.subject} | [{case.name}]({link}{case.name}.md) | {case.module.TITLE} |" for case in cases]
    return "\n".join(["| subject | case | what it shows |", "| --- | --- | --- |", *rows]) + "\n"


def write_readme(cases: list[GalleryCase]) -> str:
    """cases/README.md with the list between its markers."""
    before, _, rest = LIST.read_text(encoding="utf-8").partition(MARKERS[0])
    after = rest.partition(MARKERS[1])[2]
    return before + MARKERS[0] + write_list(cases, "gallery/") + MARKERS[1] + after


def write_topic(cases: list[GalleryCase]) -> str:
    """The page of `pbem help gallery`."""
    width = max(len(case.name) for case in cases)
    parts = []
    for subject in (*SUBJECTS, OTHERS):
        own = [f"    {case.name:{width}}  {case.module.TITLE}" for case in cases if case.subject == subject]
        if own:
            parts.append(f"## {subject.capitalize()}\n\n" + "\n".join(own))
    return f"""# Gallery

{len(cases)} cases to start from, each with a known answer and a run time of a few seconds at most. They
come with the program and can be run by name in any folder:

    pbem check {cases[0].name}             # the model, and the automatic choices
    pbem run {cases[0].name}               # also: pbem run gallery/{cases[0].name}
    pbem plot {cases[0].name}.h5

In Python, `pbem.run("{cases[0].name}")` runs it, and `pbem.Case.read("{cases[0].name}")` is the case to go on from.

The folder `cases/gallery` of the sources has a page for each, NAME.md: problem, source, case, the same in
Python, pictures, and the numbers to expect. To start your own case, copy NAME.toml.

""" + "\n\n".join(parts) + "\n"


def main() -> int:
    """Make the gallery."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help="only these cases")
    parser.add_argument("--check", action="store_true", help="write nothing")
    options = parser.parse_args()
    cases = list_gallery()
    if unknown := set(options.names) - {case.name for case in cases}:
        parser.error(f"no such case: {', '.join(sorted(unknown))}")
    wrong = []
    with tempfile.TemporaryDirectory() as folder:
        for case in [case for case in cases if not options.names or case.name in options.names]:
            try:
                results, seconds = run_case(case, Path(folder))
            except pbem.PbemError as error:
                wrong.append(f"{case.name}: {error}")
                continue
            found = case.compute(results)
            wrong += find_wrong(case, found)
            differences = ", ".join(f"{find_difference(found[name], value):.1e} of {tolerance:g}"
                                    for name, (value, tolerance) in case.expected.items() if name in found)
            print(f"{case.name:24s} {2 * len(results.nodes.position):5d} unknowns {seconds:6.2f} s  {differences}")
            if not options.check and not find_wrong(case, found):
                before = read_measured(case.page.read_text(encoding="utf-8")) if case.page.exists() else None
                page = write_page(case, settle(measure(found, results, seconds), before))
                case.page.write_text(page, encoding="utf-8")
                wrong += draw(case, results)
    if not options.check and not options.names:
        LIST.write_text(write_readme(cases), encoding="utf-8")
        PAGE.write_text(write_topic(cases), encoding="utf-8")
    print("\n".join(wrong) if wrong else "all numbers are as expected", file=sys.stderr if wrong else sys.stdout)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
