"""Expressions: the grammar, immutable trees, their text form, their meaning, and the published formulas."""

from fitters.expressions.evaluation import evaluate
from fitters.expressions.expression import Expression
from fitters.expressions.text import parse, to_text

__all__ = ["Expression", "evaluate", "parse", "to_text"]
