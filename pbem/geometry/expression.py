"""Arithmetic that users write in case files, evaluated for whole arrays and without Python's own eval."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy import special

from pbem.arrays import Real

CONSTANTS: Mapping[str, float] = {"pi": math.pi, "e": math.e}
FUNCTIONS: Mapping[str, Callable[[Real], Real]] = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "asin": np.arcsin, "acos": np.arccos, "atan": np.arctan,
    "sinh": np.sinh, "cosh": np.cosh, "tanh": np.tanh, "exp": np.exp, "log": np.log, "sqrt": np.sqrt, "abs": np.abs,
    "erf": special.erf, "erfc": special.erfc,
}
FUNCTIONS_OF_TWO: Mapping[str, Callable[[Real, Real], Real]] = {
    "atan2": np.arctan2, "min": np.minimum, "max": np.maximum,
}
_OPERATORS: Mapping[type[ast.operator], Callable[[Real, Real], Real]] = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
}
# Characters that users may write; what the program composes from several texts may be longer.
LONGEST = 2000
# Expressions whose trees are kept: a run evaluates a few of them thousands of times, and reading costs more than that.
_KEPT = 256
_UNREADABLE = ("a text that cannot be read", 'an expression such as "0.1*sin(2*pi*t)"')


class ExpressionError(ValueError):
    """A text that is no expression. found: what is wrong and where in the text; expected: what may stand there."""

    def __init__(self, found: str, expected: str) -> None:
        self.found = found
        self.expected = expected
        super().__init__(f"found {found}; expected {expected}")


def evaluate_expression(text: str, **variables: ArrayLike) -> Real:
    """The values of an expression, in the common shape of the variables (arrays or numbers).

    Numbers, + - * / **, parentheses, pi, e, the variables and the functions above; an operation without a value in real
    numbers gives nan or inf. Raises ExpressionError where the text is anything else.
    """
    arrays = {name: np.asarray(value, dtype=float) for name, value in variables.items()}
    shape = np.broadcast_shapes(*(array.shape for array in arrays.values()))
    tree = _parse(text)
    try:
        with np.errstate(all="ignore"):
            value = _Evaluation(text, arrays).evaluate(tree)
    except RecursionError:
        raise ExpressionError(*_UNREADABLE) from None
    return np.array(np.broadcast_to(value, shape))


def read_expression(text: str, **variables: ArrayLike) -> Real:
    """The values of an expression as a user wrote it, which may have LONGEST characters; see `evaluate_expression`."""
    if len(text) > LONGEST:
        raise ExpressionError(f"a text of {len(text)} characters", f"at most {LONGEST}")
    return evaluate_expression(text, **variables)


@lru_cache(_KEPT)
def list_names(text: str) -> frozenset[str]:
    """The names that an expression has anywhere, those of functions included; none of a text that is no expression."""
    try:
        return frozenset(node.id for node in ast.walk(_parse(text)) if isinstance(node, ast.Name))
    except ExpressionError:
        return frozenset()


def list_switches(text: str) -> list[str]:
    """Expressions at whose changes of sign max, min and abs of an expression change their branch."""
    found = []
    for node in ast.walk(_parse(text)):
        match node:
            case ast.Call(func=ast.Name(id="abs"), args=[one]):
                found.append(ast.unparse(one))
            case ast.Call(func=ast.Name(id="min" | "max"), args=[one, other]):
                found.append(f"({ast.unparse(one)}) - ({ast.unparse(other)})")
    return found


def is_linear(text: str, names: tuple[str, ...]) -> bool:
    """Whether an expression is a polynomial of degree 1 at most in these names, by how it is written."""
    return _find_degree(_parse(text), names) <= 1


def _find_degree(node: ast.expr, names: tuple[str, ...]) -> float:
    """The degree in the names; infinite for what is no polynomial."""
    match node:
        case ast.Name(id=name):
            return 1 if name in names else 0
        case ast.UnaryOp(operand=operand):
            return _find_degree(operand, names)
        case ast.BinOp(left=left, op=operator, right=right):
            first, second = _find_degree(left, names), _find_degree(right, names)
            if isinstance(operator, ast.Add | ast.Sub):
                return max(first, second)
            if isinstance(operator, ast.Mult):
                return first + second
            return math.inf if second or (isinstance(operator, ast.Pow) and first) else first
        case ast.Call(args=arguments):
            return math.inf if any(_find_degree(each, names) for each in arguments) else 0
    return 0


@lru_cache(_KEPT)
def _parse(text: str) -> ast.expr:
    """The tree, which nobody changes. Raises ExpressionError."""
    if "\0" in text:  # Python 3.13 tells it otherwise than 3.11
        raise ExpressionError(*_UNREADABLE)
    try:
        return ast.parse(_straighten(text), mode="eval").body
    except SyntaxError as error:
        at = (error.offset or 1) - 1 + len(text) - len(text.lstrip())
        where = "at its end" if at >= len(text.rstrip()) else f"at character {at + 1} ('{text[at:at + 12]}')"
        raise ExpressionError(f'"{text}", which breaks off {where}', _UNREADABLE[1]) from None
    except (ValueError, RecursionError, MemoryError):
        raise ExpressionError(*_UNREADABLE) from None


def _straighten(text: str) -> str:
    """One line without spaces before it, as Python wants an expression."""
    return "".join(" " if character.isspace() else character for character in text).strip()


class _Evaluation:
    """Walks down the tree of an expression; whatever is not named here is refused."""

    def __init__(self, text: str, variables: Mapping[str, Real]) -> None:
        self.text = text
        self.variables = variables

    def evaluate(self, node: ast.expr) -> Real:
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                return self._number(node, value)
            case ast.Name(id=name):
                return self._look_up(node, name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self.evaluate(operand)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.evaluate(operand)
            case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
                return _OPERATORS[type(operator)](self.evaluate(left), self.evaluate(right))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self._call(node, name, arguments)
            case ast.BinOp(op=ast.BitXor()):
                raise self._refuse(node, "'^'", "'**' for a power")
        raise self._refuse(node, "a piece that is no arithmetic", "numbers, names, + - * / ** and functions")

    def _number(self, node: ast.expr, value: float) -> Real:
        try:
            return np.array(float(value))
        except OverflowError:
            raise self._refuse(node, "a number of too many digits", "a number to compute with") from None

    def _look_up(self, node: ast.expr, name: str) -> Real:
        if name in self.variables:
            return self.variables[name]
        if name in CONSTANTS:
            return np.array(CONSTANTS[name])
        known = ", ".join([*self.variables, *CONSTANTS])
        if name in FUNCTIONS or name in FUNCTIONS_OF_TWO:
            raise self._refuse(node, f"the function '{name}' without its argument", f"{name}(...)")
        raise self._refuse(node, f"the unknown name '{name}'", f"one of: {known}")

    def _call(self, node: ast.expr, name: str, arguments: list[ast.expr]) -> Real:
        wanted = 1 if name in FUNCTIONS else 2 if name in FUNCTIONS_OF_TWO else 0
        if not wanted:
            known = ", ".join([*FUNCTIONS, *FUNCTIONS_OF_TWO])
            raise self._refuse(node, f"the unknown function '{name}'", f"one of: {known}")
        if len(arguments) != wanted:
            found = f"{name} with {len(arguments)} argument{'s' if len(arguments) != 1 else ''}"
            raise self._refuse(node, found, f"{wanted} in its parentheses")
        values = [self.evaluate(argument) for argument in arguments]
        return FUNCTIONS[name](values[0]) if wanted == 1 else FUNCTIONS_OF_TWO[name](values[0], values[1])

    def _refuse(self, node: ast.expr, what: str, expected: str) -> ExpressionError:
        """Name the place by its character, counted from 1; the tree counts bytes."""
        before = _straighten(self.text).encode()[: node.col_offset].decode(errors="ignore")
        at = len(self.text) - len(self.text.lstrip()) + len(before)
        return ExpressionError(f'{what} at character {at + 1} of "{self.text}"', expected)
