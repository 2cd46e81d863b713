"""Expressions of case files are computed as they are written, for whole arrays, and nothing else is run."""

from __future__ import annotations

import ast
import math

import numpy as np
import pytest

from pbem.geometry.expression import (
    CONSTANTS,
    FUNCTIONS,
    FUNCTIONS_OF_TWO,
    ExpressionError,
    evaluate_expression,
    list_names,
    read_expression,
)

VALUES = {
    "2*t": 1.4,
    "-t**2": -0.49,
    "(-t)**2": 0.49,
    "2**3**2": 512.0,
    "1 - 2 - 3": -4.0,
    "+1/4/2": 0.125,
    "1e-3 + .5": 0.501,
    "sin(2*pi*t)": math.sin(1.4 * math.pi),
    "cos(t)*tan(t)": math.sin(0.7),
    "asin(t) + acos(t)": math.pi / 2,
    "atan(t) - atan2(t, 1)": 0.0,
    "atan2(1, -1)": 0.75 * math.pi,
    "cosh(t)**2 - sinh(t)**2": 1.0,
    "tanh(t)": math.tanh(0.7),
    "log(exp(t))": 0.7,
    "log(e)": 1.0,
    "sqrt(t**2) - abs(-t)": 0.0,
    "max(t, min(2, 3))": 2.0,
    "erf(t)": math.erf(0.7),
    "erfc(t)": math.erfc(0.7),
    "  t\n + 1": 1.7,
}


@pytest.mark.parametrize("text", VALUES)
def test_values(text: str) -> None:
    assert evaluate_expression(text, t=0.7) == pytest.approx(VALUES[text], rel=1e-14, abs=1e-15)


def test_every_name_is_tried_above() -> None:
    used = " ".join(VALUES)
    assert all(name in used for name in [*CONSTANTS, *FUNCTIONS, *FUNCTIONS_OF_TWO])


def test_arrays_keep_their_shape() -> None:
    x, y = np.linspace(0, 1, 6).reshape(2, 3), np.ones(3)
    assert evaluate_expression("x + 2*y", x=x, y=y) == pytest.approx(x + 2)
    constant = evaluate_expression("3", x=x, y=y)
    assert constant.shape == (2, 3) and constant == pytest.approx(3.0)
    constant[0, 0] = 1.0  # the caller's own array
    assert evaluate_expression("3").shape == ()


def test_variable_wins_over_a_constant() -> None:
    assert evaluate_expression("e", e=2.0) == 2.0


def test_what_has_no_value_is_not_finite() -> None:
    values = evaluate_expression("sqrt(t) + log(t) + 1/t + 9.0**9**9", t=[-1.0, 0.0])
    assert not np.isfinite(values).any()


WRONG = {
    "": "breaks off at its end",
    "  ": "breaks off at its end",
    "  q": "at character 3",
    "2*(t": "breaks off",
    "2 t": "breaks off at character",
    "t +* 2": "breaks off at character 4 ('* 2')",
    "t)": "breaks off",
    "1) + (2": "breaks off at character 2",
    "t; 1": "breaks off",
    "2*q": "the unknown name 'q' at character 3 of \"2*q\"; expected one of: t, pi, e",
    "1 +\n2*q": "the unknown name 'q' at character 7",
    "sind(t)": "the unknown function 'sind' at character 1",
    "1 + sin": "the function 'sin' without its argument at character 5",
    "sin(t, 2)": "sin with 2 arguments at character 1",
    "1 + max(t)": "max with 1 argument at character 5",
    "sin()": "sin with 0 arguments",
    "t^2": "'^' at character 1 of \"t^2\"; expected '**' for a power",
    "t.real": "no arithmetic at character 1",
    "__import__('os')": "the unknown function '__import__'",
    "(lambda: 1)()": "no arithmetic",
    "[t]": "no arithmetic",
    "t, 1": "no arithmetic",
    "'a'": "no arithmetic",
    "1j": "no arithmetic",
    "True": "no arithmetic",
    "t < 1": "no arithmetic",
    "t if t else 1": "no arithmetic",
    "7 // 2": "no arithmetic",
    "7 % 2": "no arithmetic",
    "~1": "no arithmetic",
    "sin(x=t)": "no arithmetic",
    "sin(*t)": "no arithmetic at character 5",
    "t := 1": "breaks off at character 3",
    "f'{t}'": "no arithmetic",
    "1" + 400 * "0": "a number of too many digits",
    "1+" * 1500 + "1": "a text of 3001 characters",
    "ä + 1": "the unknown name 'ä' at character 1",
    "1 + \0": "cannot be read",
}


@pytest.mark.parametrize("text", WRONG, ids=range(len(WRONG)))
def test_what_is_no_expression_is_told_with_its_place(text: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        read_expression(text, t=0.5)
    assert WRONG[text] in str(caught.value)


def test_nesting_without_end_is_an_error() -> None:
    for text in (500 * "(" + "1" + 500 * ")", 1900 * "-" + "1", "1" + 990 * "+1"):
        with pytest.raises(ExpressionError, match=r"cannot be read|breaks off"):
            evaluate_expression(text)


def test_an_expression_is_read_once_however_often_it_is_evaluated(monkeypatch: pytest.MonkeyPatch) -> None:
    texts, parse = [], ast.parse
    with monkeypatch.context() as patch:
        patch.setattr(ast, "parse", lambda text, **named: texts.append(text) or parse(text, **named))
        found = [float(evaluate_expression("t + 0.1234567", t=time)) for time in (0.0, 1.0, 2.0)]
    assert found == [0.1234567, 1.1234567, 2.1234567] and list_names("t + 0.1234567") == {"t"}
    assert texts == ["t + 0.1234567"]
