"""LaTeX: matplotlib accepts it, and a reader of its own finds the formula's values in it."""

import re

import numpy as np
import pytest
from matplotlib.mathtext import MathTextParser

from fitters.backends.latex import to_latex
from fitters.expressions import parse
from fitters.expressions.catalogue import CATALOGUE
from fitters.expressions.evaluation import evaluate_features
from tests.random_expressions import random_features, random_tree

TOKEN = re.compile(
    r"\s+|\\,|\\cos\\theta_(?P<angle>[ioh])|(?P<cosine>\\cos)\^|\\theta_(?P<after>[ioh])"
    r"|\\mathbf{(?P<one>\w)}\\cdot\\mathbf{(?P<other>\w)}|p_{(?P<parameter>\d+)}"
    r"|\\(?P<function>sin|cos|tan|exp|arcsin|arccos|arctan|max|min|ln)|(?P<number>\d+(\.\d+)?)"
    r"|(?P<sign>\\frac|\\sqrt|\\times|\\pi|\\left\(|\\right\)|[-+{}^,])"
)
FUNCTIONS = {name: getattr(np, name) for name in ("sin", "cos", "tan", "exp", "arcsin", "arccos", "arctan")}
FUNCTIONS |= {"max": np.maximum, "min": np.minimum}
PARAMETERS = {f"p{i}": value for i, value in enumerate((0.3, 1.7, 0.4, 0.2, 1.5, 0.1, 2.0, 1.2, 5.0, 1.1))}


class Reader:
    """Values of a formula in LaTeX, by the usual rules of mathematical writing."""

    def __init__(self, text, seen):
        self.seen, self.tokens, at = seen, [], 0
        while at < len(text):
            match = TOKEN.match(text, at)
            assert match, text[at:]
            at = match.end()
            if match.lastgroup:
                kind = next(name for name, value in match.groupdict().items() if value is not None)
                self.tokens.append((kind, match.groupdict()[kind], match))
        self.tokens.append(("end", "", None))

    def take(self, sign=None):
        kind, text, match = self.tokens.pop(0)
        assert sign is None or text == sign, f"{text} in place of {sign}"
        return kind, text, match

    def next(self, *signs):
        return self.tokens[0][1] in signs

    def sum(self):
        total = -self.product() if self.next("-") and self.take() else self.product()
        while self.next("+", "-"):
            total = total + self.product() if self.take()[1] == "+" else total - self.product()
        return total

    def product(self):
        value = self.power()
        while not self.next("+", "-", "}", ",", r"\right)", ""):
            if self.next(r"\times"):
                self.take()
            value = value * self.power()
        return value

    def power(self):
        value = self.atom()
        return np.power(value, self.group()) if self.next("^") and self.take() else value

    def group(self):
        self.take("{")
        value = self.sum()
        self.take("}")
        return value

    def atom(self):
        kind, text, match = self.take()
        if kind == "number":
            return np.float64(text)
        if kind == "parameter":
            return np.float64(PARAMETERS[f"p{text}"])
        if kind == "angle":
            return self.seen[f"w{text}.z"]
        if kind == "one":
            return self.seen[f"w{text}.w{match['other']}"]
        if kind == "cosine":
            exponent = self.group()
            return np.power(self.seen[f"w{self.take()[1]}.z"], exponent)
        if kind == "function":
            self.take(r"\left(")
            operands = [self.sum()]
            while self.next(","):
                self.take()
                operands.append(self.sum())
            self.take(r"\right)")
            return FUNCTIONS[text](*operands)
        if text == r"\left(":
            value = self.sum()
            self.take(r"\right)")
            return value
        return {
            r"\pi": lambda: np.float64(np.pi),
            r"\sqrt": lambda: np.sqrt(self.group()),
            r"\frac": self.fraction,
        }[text]()

    def fraction(self):
        return self.group() / self.group()


def read(text, seen):
    reader = Reader(text, seen)
    with np.errstate(all="ignore"):
        value = reader.sum()
    assert reader.next(""), reader.tokens
    return np.broadcast_to(value, np.shape(seen["wi.z"]))


@pytest.mark.parametrize("name", CATALOGUE)
def test_a_published_formula_is_read_by_matplotlib_and_has_its_values(name):
    text, seen = to_latex(CATALOGUE[name].expression), random_features(np.random.default_rng(2), 100)
    MathTextParser("path").parse(f"${text}$")
    expected = evaluate_features(CATALOGUE[name].expression, PARAMETERS, seen)
    np.testing.assert_allclose(read(text, seen), expected, rtol=1e-9)


def test_random_expressions_have_their_values():
    rng = np.random.default_rng(3)
    seen, finite = random_features(rng, 50), 0
    for _ in range(500):
        tree = random_tree(rng, 6)
        expected = evaluate_features(tree, PARAMETERS, seen)
        finite += np.isfinite(expected).sum()
        np.testing.assert_allclose(read(to_latex(tree), seen), expected, rtol=1e-6, atol=1e-300, err_msg=str(tree))
    assert finite > 10_000


@pytest.mark.parametrize(
    ("text", "latex"),
    [
        ("p0 / pi", r"\frac{p_{0}}{\pi}"),
        ("pow(wh.z, p1)", r"\cos^{p_{1}}\theta_h"),
        ("pow(wh.z, -1)", r"\left(\cos\theta_h\right)^{-1}"),
        ("pow(1 - dot(wo, wh), 5)", r"\left(1 - \left(\mathbf{i}\cdot\mathbf{h}\right)\right)^{5}"),
        ("max(dot(wo, wr), 0)", r"\max\left(\mathbf{o}\cdot\mathbf{r}, 0\right)"),
        ("p0 - -p1", r"p_{0} - \left(-p_{1}\right)"),
        ("p0 * (p1 + 2 * 4)", r"p_{0} \, \left(p_{1} + 2 \times 4\right)"),
        ("1e-05 * p0", r"1 \times 10^{-5} \, p_{0}"),
        (
            "exp(-acos(wh.z) / sqrt(p0))",
            r"\exp\left(\frac{-\arccos\left(\cos\theta_h\right)}{\sqrt{p_{0}}}\right)",
        ),
    ],
)
def test_formulas_read_as_they_are_written_in_papers(text, latex):
    assert to_latex(parse(text)) == latex
