"""What the sources of a package have to obey, as functions of its folder: each returns its faults, with their place."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

# The path of the data: a part imports those before it, never those after it.
# The package itself comes last: it offers what they define.
ORDER = (
    "geometry", "description", "model", "mesh", "bem", "contact", "forecast", "bundled", "case", "importing", "solve",
    "results", "progress", "passes", "pass_file", "storing", "driver", "sweeps", "terminal", "make_command",
    "import_command", "check_command", "run_command", "sweep_command", "export_command", "info_command", "plot_command",
    "pages", "cli", "__main__", "__init__",
)
# Beside the path: they import no part of it, so that every part may import them ...
BASE = ("version", "arrays", "errors", "wording", "blas_kernels", "environment", "parallel", "exact", "clock",
        "heap", "loading", "uniform", "formed", "linear_programme")
# ... but mechanics knows nothing of processes, and results are read without them.
MAY_BE_PARALLEL = (
    "solve", "pass_file", "storing", "driver", "sweeps", "run_command", "sweep_command", "cli", "__main__", "parallel",
)

# Each of these comes in by one door only.
DOORS = {
    "petsc4py": ("solve",),
    "mpi4py": ("parallel", "solve"),
    "h5py": ("results",),
    "tomllib": ("case",),
    "matplotlib": ("results",),
    "ezdxf": ("importing",),
}

# The systems of equations and what they are made of: asking an object which of them it is belongs to none ...
KINDS = (
    "RowOperator", "HierarchicalOperator", "DenseSystem", "HierarchicalSystem", "DenseChoice", "HierarchicalChoice",
    "CondensedTangent", "FactoredTangent", "ReleasedTangent", "KrylovTangent",
)
# ... and their classes are known to those alone that make them, beside the modules that define them.
MAKERS = {
    "DenseSystem": ("pbem.solve.system.choice",),
    "HierarchicalSystem": ("pbem.solve.system.choice",),
    "DenseChoice": (),
    "HierarchicalChoice": (),
    "CondensedTangent": ("pbem.solve.system.dense",),
    "FactoredTangent": ("pbem.solve.system.dense",),
    "ReleasedTangent": ("pbem.solve.system.dense",),
    "KrylovTangent": ("pbem.solve.system.hierarchical",),
}

# What objects of these kinds are called.
HELD = ("system", "tangent", "operator", "problem")

FORBIDDEN_NAME = "mu"  # friction coefficient, shear modulus or measure? friction_coefficient, shear_modulus
VAGUE_WORDS = {"util", "utils", "helper", "helpers", "manager", "managers"}
MOST_LINES = 400


@dataclass(frozen=True)
class Module:
    """A source file. name: dotted, e.g. "pbem.mesh.mesh"; is_package: it is an __init__.py; nodes: of its tree."""

    name: str
    path: Path
    is_package: bool
    text: str = field(repr=False)
    tree: ast.Module = field(repr=False)
    nodes: tuple[ast.AST, ...] = field(repr=False)

    @property
    def part(self) -> str:
        """The folder or file directly below the package, e.g. "mesh"; "__init__" for the package itself."""
        return [*self.name.split("."), "__init__"][1]


def read_modules(package: Path) -> dict[str, Module]:
    """Read all sources below the folder of a package, by dotted name."""
    modules = {}
    for path in sorted(package.rglob("*.py")):
        parts = [package.name, *path.relative_to(package).with_suffix("").parts]
        is_package = parts[-1] == "__init__"
        name = ".".join(parts[:-1] if is_package else parts)
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text, str(path))
        modules[name] = Module(name, path, is_package, text, tree, tuple(ast.walk(tree)))
    return modules


def list_imports(module: Module) -> Iterator[tuple[int, str]]:
    """Yield line and absolute dotted name of all that is imported, also inside functions and for types only."""
    for node in module.nodes:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name
        elif isinstance(node, ast.ImportFrom):
            # level 1 is the module's own folder, each further one the folder above
            folder = module.name.split(".") if module.is_package else module.name.split(".")[:-1]
            above = folder[: len(folder) - node.level + 1] if node.level else []
            origin = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                yield node.lineno, f"{origin}.{alias.name}"


def find_imported_modules(module: Module, modules: dict[str, Module]) -> Iterator[tuple[int, Module]]:
    """Yield line and module for each import from the package itself."""
    for line, name in list_imports(module):
        while name and name not in modules:
            name = name.rpartition(".")[0]
        if name:
            yield line, modules[name]


def check_order(module: Module, modules: dict[str, Module]) -> list[str]:
    """Imports go along the order of the parts."""
    if module.part not in ORDER + BASE:
        return [f"{module.path}: part {module.part!r} has no place in the order {', '.join(ORDER)}"]
    faults = []
    for line, imported in find_imported_modules(module, modules):
        if imported.part == "parallel":
            allowed = module.part in MAY_BE_PARALLEL
        elif imported.part in BASE:
            allowed = True
        elif module.part in BASE:
            allowed = False
        else:
            allowed = imported.part in ORDER and ORDER.index(imported.part) <= ORDER.index(module.part)
        if not allowed:
            faults.append(f"{module.path}:{line}: {module.part} may not import {imported.name}")
    return faults


def check_cycles(modules: dict[str, Module]) -> list[str]:
    """No module imports itself by way of others."""
    graph = {
        name: {imported.name for _, imported in find_imported_modules(module, modules)}
        for name, module in modules.items()
    }
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return [f"cycle of imports: {' <- '.join(error.args[1])}"]
    return []


def check_doors(module: Module) -> list[str]:
    """PETSc, MPI, HDF5, TOML and plotting come in by their own parts only."""
    return [
        f"{module.path}:{line}: {name} may be imported in {' and '.join(DOORS[library])} only"
        for line, name in list_imports(module)
        if (library := name.split(".")[0]) in DOORS and module.part not in DOORS[library]
    ]


def check_questions(module: Module) -> list[str]:
    """No module asks which system of equations or tangent operator it has before it, and only makers know them."""
    faults = []
    for node in module.nodes:
        match node:
            case ast.Call(func=ast.Name(id="isinstance" | "issubclass"), args=[_, kind]):
                asked = {name.id for name in ast.walk(kind) if isinstance(name, ast.Name)}
                asked |= {name.attr for name in ast.walk(kind) if isinstance(name, ast.Attribute)}
                faults += [f"{module.path}:{node.lineno}: asks for {name}" for name in sorted(asked & {*KINDS})]
            case ast.Call(func=ast.Name(id="getattr" | "hasattr"), args=[held, *_]) if _ends_in(held, HELD):
                faults.append(f"{module.path}:{node.lineno}: asks what {ast.unparse(held)} has")
            case ast.Compare(left=left, comparators=[right]) if _ends_in(left, KINDS) or _ends_in(right, KINDS):
                faults.append(f"{module.path}:{node.lineno}: compares types")
    faults += [
        f"{module.path}:{line}: {name} is made in {' and '.join(MAKERS[kind]) or 'its own module'} only"
        for line, name in list_imports(module)
        if (kind := name.rpartition(".")[2]) in MAKERS and module.name not in MAKERS[kind]
    ]
    return faults


def _ends_in(node: ast.expr, names: tuple[str, ...]) -> bool:
    """Whether an expression is a name, or an attribute, of these."""
    return (isinstance(node, ast.Name) and node.id in names) or (isinstance(node, ast.Attribute) and node.attr in names)


def check_names(module: Module) -> list[str]:
    """No name that means several things, no module, class or function whose name says nothing."""
    faults = [
        f"{module.path}:{line}: the name {FORBIDDEN_NAME!r} means several things"
        for line, name in list_names(module.nodes)
        if name == FORBIDDEN_NAME
    ]
    definitions = [(1, module.name)] + [
        (node.lineno, node.name)
        for node in module.nodes
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
    ]
    faults += [
        f"{module.path}:{line}: {name} does not say what it is"
        for line, name in definitions
        if VAGUE_WORDS.intersection(split_words(name))
    ]
    return faults


def list_names(nodes: Iterable[ast.AST]) -> Iterator[tuple[int, str]]:
    """Yield line and name wherever a source gives or uses one."""
    for node in nodes:
        match node:
            case ast.Name(id=name) | ast.arg(arg=name) | ast.Attribute(attr=name) | ast.keyword(arg=str(name)):
                yield node.lineno, name
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield node.lineno, name
            case ast.alias(name=name, asname=asname):
                yield node.lineno, asname or name


def split_words(name: str) -> list[str]:
    """Split snake_case, CamelCase and dots: "pbem.MeshUtils" -> pbem, mesh, utils."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+", name)]


def check_docstrings(module: Module) -> list[str]:
    """The module, and its public functions and classes, say what they are."""
    faults = [] if ast.get_docstring(module.tree) else [f"{module.path}:1: the module has no docstring"]
    for node in module.tree.body:
        defines = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
        if defines and not node.name.startswith("_") and not ast.get_docstring(node):
            faults.append(f"{module.path}:{node.lineno}: {node.name} has no docstring")
    return faults


def check_length(module: Module) -> list[str]:
    """A module can be read at one go."""
    lines = len(module.text.splitlines())
    return [f"{module.path}: {lines} lines, more than {MOST_LINES}"] if lines > MOST_LINES else []
