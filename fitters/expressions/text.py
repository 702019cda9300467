"""The text form of expressions: `p0 / pi + p1 * pow(dot(wh, wn), p2)`.

`+ - * /` are infix and associate to the left, a leading `-` binds tighter than they do, everything else is a
call. Printing uses as few parentheses as parse back to the same tree.
"""

import re

from fitters.errors import FittersError
from fitters.expressions import grammar
from fitters.expressions.expression import MAX_DEPTH, Expression
from fitters.expressions.operators import CALL, OPERATORS, SUM

MAX_LENGTH = 50_000
"""Characters: some hundred times the longest published formula."""

_INFIX = {operator.sign: operator for operator in OPERATORS.values() if operator.sign and operator.arity == 2}
_PREFIX = {operator.sign: operator for operator in OPERATORS.values() if operator.sign and operator.arity == 1}
_TOKEN = re.compile(
    r"\s*(?:(?P<number>\d+\.?\d*(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*(?:\.[A-Za-z]\w*)?)|(?P<sign>[-+*/(),]))",
    re.ASCII,
)


def to_text(expression: Expression) -> str:
    """The text form; `parse` turns it back into the same tree."""
    return _print(expression)[0]


def _print(node: Expression) -> tuple[str, int]:
    """Text of a node and the precedence of its outermost operator (`CALL` for what never needs parentheses)."""
    operator = OPERATORS.get(node.symbol)
    if operator is not None and operator.sign:
        *before, last = node.children
        right = _enclose(last, operator.precedence + len(before))
        left = "".join(f"{_enclose(child, operator.precedence)} " for child in before)
        return f"{left}{operator.sign}{' ' if before else ''}{right}", operator.precedence
    if node.children:
        return f"{node.symbol}({', '.join(_print(child)[0] for child in node.children)})", CALL
    return node.symbol, CALL


def _enclose(node: Expression, least: int) -> str:
    text, precedence = _print(node)
    return text if precedence >= least else f"({text})"


def parse(text: str) -> Expression:
    """The expression that a text stands for.

    Raises `FittersError` with the place and what was expected there; no input, however long or deep, does worse.
    """
    if len(text) > MAX_LENGTH:
        raise FittersError(f"an expression of {len(text)} characters: at most {MAX_LENGTH} are read")
    return _Parser(text).whole()


class _Parser:
    """Precedence climbing over the tokens of one text."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.tokens = _tokens(text)
        self.at = 0
        self.depth = 0

    def whole(self) -> Expression:
        node = self.expression(SUM)
        if self.peek() is not None:
            raise self.error("an operator or the end")
        if node.is_vector:
            raise FittersError(f"the whole expression is the vector {node.symbol}: a BRDF is a number")
        return node

    def expression(self, least: int, steps: int = 1) -> Expression:
        """What stands here, up to an operator that binds less than `least`.

        A level of a tree takes two steps at most (a right operand and its parentheses), a step one stack frame.
        """
        self.depth += steps
        if self.depth > 2 * MAX_DEPTH:
            raise FittersError(
                f"an expression may be nested at most {MAX_DEPTH} levels deep (character {self.position()})"
            )
        token = self.peek()
        if token is not None and token in _PREFIX:
            self.at += 1
            prefix = _PREFIX[token]
            node = self.node(prefix.name, (self.expression(prefix.precedence, steps=2),))
        elif token == "(":
            self.at += 1
            node = self.expression(SUM)
            self.expect(")")
        else:
            node = self.operand(token)
        while (operator := _INFIX.get(self.peek() or "")) is not None and operator.precedence >= least:
            self.at += 1
            node = self.node(operator.name, (node, self.expression(operator.precedence + 1)))
        self.depth -= steps
        return node

    def operand(self, token: str | None) -> Expression:
        if token is None or not (token[0].isalnum() or token[0] == "_"):
            raise self.error("a number, a name, '-' or '('")
        if token[0].isdigit():
            self.at += 1
            return self.number(token)
        return self.named(token)

    def number(self, token: str) -> Expression:
        try:
            return Expression(grammar.constant(float(token)))
        except ValueError:
            raise self.error("a finite number", back=1) from None

    def named(self, name: str) -> Expression:
        kind = grammar.kind(name)
        if not kind or (name in OPERATORS and OPERATORS[name].sign):
            raise self.error("a function, vector, component, parameter or constant of the grammar")
        self.at += 1
        if not grammar.arity(name):
            return Expression(name)
        self.expect("(")
        children = [self.expression(SUM, steps=2)]
        while len(children) < grammar.arity(name):
            self.expect(",")
            children.append(self.expression(SUM, steps=2))
        self.expect(")")
        return self.node(name, tuple(children))

    def node(self, symbol: str, children: tuple[Expression, ...]) -> Expression:
        try:
            return Expression(symbol, children)
        except FittersError as error:
            raise FittersError(f"{error} (before character {self.position()} of {_excerpt(self.text)})") from None

    def peek(self) -> str | None:
        return self.tokens[self.at][0] if self.at < len(self.tokens) else None

    def expect(self, token: str) -> None:
        if self.peek() != token:
            raise self.error(repr(token))
        self.at += 1

    def position(self, back: int = 0) -> int:
        at = self.at - back
        return self.tokens[at][1] + 1 if at < len(self.tokens) else len(self.text) + 1

    def error(self, wanted: str, back: int = 0) -> FittersError:
        at = self.at - back
        there = f"'{self.tokens[at][0][:40]}'" if at < len(self.tokens) else "the end"
        return FittersError(
            f"expected {wanted} at character {self.position(back)} of {_excerpt(self.text)}, found {there}"
        )


def _tokens(text: str) -> list[tuple[str, int]]:
    tokens, at, end = [], 0, len(text.rstrip())
    while at < end:
        match = _TOKEN.match(text, at)
        if not match:
            at += len(text[at:]) - len(text[at:].lstrip())
            raise FittersError(f"{text[at]!r} at character {at + 1} of {_excerpt(text)} means nothing here")
        tokens.append((match.group(match.lastgroup or 0), match.start(match.lastgroup or 0)))
        at = match.end()
    return tokens


def _excerpt(text: str) -> str:
    return repr(text if len(text) <= 80 else text[:77] + "...")
