"""Expressions in one variable, as in formation files: ``"2*cos(s)"``, ``"5*d"``.

simpleeval evaluates them: it walks the syntax tree and cannot run code. Only arithmetic is allowed;
a comparison, a text or an attribute is rejected before evaluation.
"""

import ast
import math
import operator
from typing import Any

from simpleeval import InvalidExpression, SimpleEval

MAX_EXPRESSION_LENGTH = 300


def _power(base: float, exponent: float) -> float:
    """Return a power in floating point: powers of integers can fill memory."""
    return float(base) ** float(exponent)  # type: ignore[no-any-return]


OPERATORS: dict[type[ast.AST], Any] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: _power,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
NODES = (ast.BinOp, ast.UnaryOp, ast.Call, ast.Name, ast.Load, ast.Constant, *OPERATORS)
FUNCTIONS = {
    name: getattr(math, name)
    for name in (
        *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh"),
        *("sqrt", "exp", "log", "hypot", "floor", "ceil", "degrees", "radians"),
    )
} | {"abs": abs, "min": min, "max": max}
CONSTANTS = {"pi": math.pi, "e": math.e, "tau": math.tau}


class ExpressionError(ValueError):
    """A text that is no expression, or an expression without a finite value somewhere."""


class Expression:
    """A function of one variable. Raises ExpressionError if the text cannot be parsed."""

    def __init__(self, text: str, variable: str) -> None:
        self.text = text
        self.variable = variable
        self._evaluator = SimpleEval(
            operators=OPERATORS, functions=FUNCTIONS, names={**CONSTANTS, variable: 0.0}
        )
        if len(text) > MAX_EXPRESSION_LENGTH:
            raise ExpressionError(f"longer than {MAX_EXPRESSION_LENGTH} characters")
        try:
            self._tree = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
            raise ExpressionError(f"{text!r} is not an expression in {variable}") from error
        self._check_nodes()

    def __call__(self, value: float) -> float:
        """Return the expression's value; raise ExpressionError if it is not finite."""
        self._evaluator.names[self.variable] = value
        try:
            result = self._evaluator.eval(self.text, previously_parsed=self._tree)
            number = math.nan if isinstance(result, complex) else float(result)
        except OverflowError as error:
            raise ExpressionError(f"{self._at(value)}: the result is too large") from error
        except (ArithmeticError, ValueError, TypeError, RecursionError) as error:
            raise ExpressionError(f"{self._at(value)}: {error}") from error
        except InvalidExpression as error:
            raise ExpressionError(f"{self.text!r}: {error}") from error
        if isinstance(result, complex):
            raise ExpressionError(f"{self._at(value)} is not a real number")
        if not math.isfinite(number):
            raise ExpressionError(f"{self._at(value)} is not finite")
        return number

    def _at(self, value: float) -> str:
        return f"{self.text!r} at {self.variable} = {value:g}"

    def _check_nodes(self) -> None:
        known = {*CONSTANTS, *FUNCTIONS, self.variable}
        for node in ast.walk(self._tree):
            number = not isinstance(node, ast.Constant) or type(node.value) in {int, float}
            if not isinstance(node, NODES) or not number:
                raise ExpressionError(
                    f"{self.text!r}: allowed are numbers, {self.variable}, + - * / ** and functions"
                )
            if isinstance(node, ast.Name) and node.id not in known:
                raise ExpressionError(
                    f"{self.text!r}: {node.id!r} is unknown; allowed are {self.variable}, "
                    f"{', '.join(CONSTANTS)} and functions such as sin, sqrt, min"
                )
