"""A process builds its heavy data once and keeps the last few."""

import pytest

from workers.context import KEPT, Recipe, context_of

built: list[str] = []


def build(argument: str) -> object:
    built.append(argument)
    if argument == "broken":
        raise OSError("cannot be read")
    return object()


def test_equal_recipes_share_one_context() -> None:
    assert context_of(Recipe(build, "shared")) is context_of(Recipe(build, "shared"))
    assert built.count("shared") == 1


def test_only_the_last_ones_are_kept() -> None:
    for number in range(KEPT + 1):
        context_of(Recipe(build, f"many {number}"))
    context_of(Recipe(build, f"many {KEPT}"))
    context_of(Recipe(build, "many 0"))
    assert built.count(f"many {KEPT}") == 1
    assert built.count("many 0") == 2


def test_a_build_that_failed_is_tried_again() -> None:
    for _ in range(2):
        with pytest.raises(OSError, match="cannot be read"):
            context_of(Recipe(build, "broken"))
    assert built.count("broken") == 2
