r"""The LaTeX backend: a formula to be read, without a line break.

Written in what matplotlib's mathtext reads, too: `\cos\theta_h` for `wh.z`, `\mathbf{i}\cdot\mathbf{h}` for the
dot product of w_i and w_h, `p_{0}` for parameters.
"""

from fitters.expressions import grammar
from fitters.expressions.expression import Expression
from fitters.expressions.lowered import Walk, lowered
from fitters.expressions.operators import CALL, OPERATORS, PRODUCT, SUM, spelling

_ATOM = CALL + 1
"""How tightly a symbol or a number holds together: it may be raised to a power as it stands."""

_Printed = tuple[str, int]
"""Text, and the precedence of its outermost operator."""


def to_latex(expression: Expression) -> str:
    """The formula in LaTeX's mathematics, without dollar signs.

    Dot products appear as in the lowered form: what is a cosine to the normal is written as one. Raises
    `FittersError` for an operator that has no LaTeX.
    """
    form, root = lowered(expression)
    ((text, _),) = Walk[_Printed](form, [root]).run(_leaf, _operation)
    return text


def _leaf(kind: str, label: float | str) -> _Printed:
    if kind == "param":
        return f"p_{{{grammar.number(str(label))}}}", _ATOM
    if kind == "feature":
        first, second = (part.removeprefix("w") for part in str(label).split("."))
        if second == "z":
            return rf"\cos\theta_{first}", CALL
        return rf"\mathbf{{{first}}}\cdot\mathbf{{{second}}}", SUM
    symbol = grammar.constant(float(label))
    if symbol == "pi":
        return r"\pi", _ATOM
    mantissa, _, exponent = symbol.partition("e")
    return (rf"{mantissa} \times 10^{{{int(exponent)}}}", PRODUCT) if exponent else (symbol, _ATOM)


def _operation(name: str, *operands: _Printed) -> _Printed:
    operator, template = OPERATORS[name], spelling(name, "latex")
    if name == "pow" and _is_cosine(operands[0]) and operands[1][1] == _ATOM:
        return rf"\cos^{{{operands[1][0]}}}{operands[0][0].removeprefix(_COSINE)}", CALL
    texts, enclosed = [], True
    for place, (text, level) in enumerate(operands):
        bare = True
        if template.startswith(f"{{{place}}}"):
            enclosed, bare = False, level >= (_ATOM if operator.precedence == CALL else operator.precedence)
        elif template.endswith(f"{{{place}}}"):
            # Two signs in a row are hard to read: a - (-b).
            least = operator.precedence + 1 if operator.arity == 2 else PRODUCT
            enclosed, bare = False, level >= least and not text.startswith("-")
        texts.append(text if bare else rf"\left({text}\right)")
    if name == "mul" and texts[1][:1].isdigit():
        # 2 4 would be read as 24.
        template = r"{0} \times {1}"
    return template.format(*texts), CALL if enclosed else operator.precedence


_COSINE = r"\cos"


def _is_cosine(printed: _Printed) -> bool:
    return printed[0].startswith(rf"{_COSINE}\theta_") and printed[1] == CALL
