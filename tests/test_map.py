"""The map of the repository, gpsearch/README.md, against the code."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
PACKAGES = ("fitters", "workers", "gpsearch")
PAGE = ROOT / "gpsearch" / "README.md"


def named_paths() -> set[str]:
    """What the page names as a path: in code marks, with a slash or with the suffix of a file."""
    words = re.findall(r"`([^`\s]+)`", PAGE.read_text(encoding="utf-8"))
    return {
        word for word in words if re.fullmatch(r"[\w./-]+(/|\.(py|md|yaml|json))", word) and word != "front.json"
    }


def exists(path: str) -> bool:
    """Paths count from the repository, or from gpsearch, which the page is about."""
    return any((folder / path).exists() for folder in (ROOT, PAGE.parent))


def test_every_path_that_the_map_names_exists():
    assert [path for path in sorted(named_paths()) if not exists(path)] == []


def test_every_folder_of_the_packages_is_on_the_map():
    files = (file for package in PACKAGES for file in (ROOT / package).rglob("*.py"))
    folders = {f"{file.parent.relative_to(ROOT).as_posix()}/" for file in files}
    assert sorted(folders - named_paths()) == []


def test_every_module_that_the_map_names_by_a_link_exists():
    links = re.findall(r"\]\(([^)#\s]+)\)", PAGE.read_text(encoding="utf-8"))
    assert [link for link in links if not link.startswith("http") and not (PAGE.parent / link).exists()] == []


def test_names_in_the_table_of_additions_are_in_the_files_beside_them():
    """Of a row `NAME` in `path/file.py`, the file has the name."""
    rows = re.findall(r"`(\w+)` in `([\w./-]+\.py)`", PAGE.read_text(encoding="utf-8"))
    assert rows
    for name, path in rows:
        file = next(folder / path for folder in (ROOT, PAGE.parent) if (folder / path).exists())
        assert re.search(rf"\b{name}\b", file.read_text(encoding="utf-8")), f"{path} has no {name}"
