"""Which modules ask whether an element is straight or circular, or do the arithmetic of arcs."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from tests.structure.checks import Module

# The kinds themselves and what chooses among them, and the circles that users write down: their legs, their faults,
# their text.
MAY_ASK = {
    "pbem.geometry.elements.straight",
    "pbem.geometry.elements.arc",
    "pbem.geometry.elements.array",
    "pbem.geometry.elements.meeting",
    "pbem.geometry.shape",
    "pbem.model.shaping",
    "pbem.description.conflicts",
    "pbem.case.make",
}
# What only carries an array on.
CARRIERS = {"concatenate", "array", "asarray", "ascontiguousarray", "freeze", "stack", "join", "complete", "by_ends"}


def check_kinds(module: Module) -> list[str]:
    """Only the protocol of elements asks for their kind."""
    if module.name in MAY_ASK:
        return []
    return [
        f"{module.path}:{line}: asks for an element's kind, which only pbem.geometry.elements does"
        for line in sorted(set(find_questions(module)))
    ]


def find_questions(module: Module) -> Iterator[int]:
    """Lines that ask for an element's kind.

    That is: calculate with `sweep` (the angle that an arc turns through, 0 of straight elements), compare it, test it
    or hand it to a function, but for those that carry it on; or ask whether a `center` is there.
    """
    counters = {
        node.target.id for node in module.nodes
        if isinstance(node, ast.For | ast.comprehension) and isinstance(node.target, ast.Name)
        and isinstance(node.iter, ast.Call) and getattr(node.iter.func, "id", None) == "range"
    }

    def names(node: ast.AST, name: str) -> bool:
        if isinstance(node, ast.Subscript | ast.UnaryOp):
            return names(node.value if isinstance(node, ast.Subscript) else node.operand, name)
        if isinstance(node, ast.Attribute):
            return node.attr == name
        return isinstance(node, ast.Name) and node.id == name and name not in counters

    for node in module.nodes:
        if isinstance(node, ast.Call):
            function = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            owner = [node.func.value] if isinstance(node.func, ast.Attribute) else []
            asked = owner + (node.args if function not in CARRIERS and not function[:1].isupper() else [])
        elif isinstance(node, ast.Compare):
            asked = [node.left, *node.comparators]
        elif isinstance(node, ast.BinOp):
            asked = [node.left, node.right]
        elif isinstance(node, ast.BoolOp):
            asked = node.values
        elif isinstance(node, ast.UnaryOp):
            asked = [node.operand]
        elif isinstance(node, ast.If | ast.IfExp | ast.While):
            asked = [node.test]
        else:
            continue
        if any(names(each, "sweep") for each in asked):
            yield node.lineno
        tests = isinstance(node, ast.BoolOp) or (
            isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Is | ast.IsNot)
        )
        if tests and any(names(each, "center") for each in asked):
            yield node.lineno
