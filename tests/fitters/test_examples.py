"""The examples of fitters/README.md run, one after the other, as a reader would type them."""

import re
from pathlib import Path

import fitters

PAGE = Path(fitters.__file__).parent / "README.md"


def blocks():
    """The code of the page, each with the number of the line before its first."""
    text = PAGE.read_text("utf-8")
    for match in re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        yield text[: match.start(1)].count("\n"), match[1]


def test_the_examples_run_in_their_order(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for line, code in blocks():
        exec(compile("\n" * line + code, str(PAGE), "exec"), names)
    assert (tmp_path / "metal.npz").exists()


def test_the_page_has_examples_of_every_name_that_the_package_exports_to_fit():
    text = "".join(code for _, code in blocks())
    for name in ("load_material", "Scene", "Problem", "fit", "parse", "load", "MODELS", "FittersError"):
        assert f"fitters.{name}" in text
