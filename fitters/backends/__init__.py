"""The backends: what runs or prints the lowered form of an expression.

| backend | module | what it gives |
|---|---|---|
| NumPy | `fitters.expressions.evaluation` | values in float64: the meaning, which the others must reproduce |
| machine | `program`, `machine` | values in float32 over blocks of cells, at the speed that a search needs |
| double | `double` | a program's outputs in float64, for the last polish |
| scalar code | `scalar_code` | compiled code for one pair of directions, as in a renderer |
| SymPy | `sympy_form` | SymPy's objects, for proofs |
| LaTeX | `latex` | a formula to be read |

To add one, write a module with a `Walk` over the lowered form. It takes what an operator is called from the table
of operators, or from a table of its own that `operators.check_complete` checks. `fitters.testing.backends` has the
tests that it must pass.
"""
