"""The documents: what they name exists, and every departure from the paper is quoted and tested."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import tomllib

ROOT = Path(__file__).parents[2]
DEVIATIONS = (ROOT / "DEVIATIONS.md").read_text(encoding="utf-8")
# Unit tests stand below this line of a source file.
TESTS_BEGIN = "#[cfg(test)]"


def read(*patterns: str) -> list[str]:
    """The texts of all files that match."""
    return [path.read_text(encoding="utf-8") for pattern in patterns for path in sorted(ROOT.glob(pattern))]


def sources_and_tests() -> tuple[str, str]:
    """All code without its tests, and all tests."""
    parts = [text.partition(TESTS_BEGIN) for text in read("crates/*/src/**/*.rs")]
    code = "\n".join([*(part[0] for part in parts), *read("scenes/*.py")])
    tests = "\n".join([*(part[2] for part in parts), *read("crates/*/tests/**/*.rs", "tests/python/*.py")])
    return code, tests


def test_departures_are_quoted_and_tested():
    """Catches a departure whose number stands in no code or in no test, and a number without a departure."""
    numbers = set(re.findall(r"^\*\*(D\d+)\. ", DEVIATIONS, re.MULTILINE))
    assert len(numbers) > 20
    for where, text in zip(("code", "tests"), sources_and_tests(), strict=True):
        # D65, the illuminant, is no departure.
        quoted = set(re.findall(r"\bD\d+\b", text)) - {"D65"}
        assert quoted == numbers, f"{where}: {sorted(quoted ^ numbers)}"


def test_functions_named_in_documents_exist():
    """Catches a test that was renamed or removed while a document goes on to rely on it."""
    functions = set(re.findall(r"\b(?:fn|def) (\w+)[<(]", "\n".join(sources_and_tests())))
    for path in [ROOT / "DEVIATIONS.md", *sorted((ROOT / "docs").glob("**/*.md"))]:
        named = re.findall(r"`([a-z]\w*_\w+_\w+_\w+)`", path.read_text(encoding="utf-8"))
        missing = [name for name in named if name not in functions]
        assert not missing, f"{path.name}: {missing}"


def test_paths_named_in_documents_exist():
    """Catches a file that was moved or removed while a document goes on to name it."""
    pages = [*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), ROOT / "scenes/README.md"]
    for path in sorted(pages):
        text = path.read_text(encoding="utf-8")
        named = re.findall(r"`((?:crates|python|docs|scenes|tests|benches)/[\w./-]+)`", text)
        missing = [name for name in named if not (ROOT / name).exists()]
        assert not missing, f"{path.name}: {missing}"
        linked = re.findall(r"\]\(([\w./-]+)(?:#[\w-]+)?\)", text)
        missing = [name for name in linked if "." in name and not (path.parent / name).exists()]
        assert not missing, f"{path.name}: {missing}"


def figures(table: dict[str, Any], prefix: str = "") -> dict[str, str]:
    """The figures of a spec file, by key with its table."""
    flat: dict[str, str] = {}
    for key, value in table.items():
        flat |= figures(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key: str(value)}
    return flat


@pytest.mark.parametrize(
    ("page", "file"),
    [
        ("ideal", "crates/simulator/src/ideal/spec.toml"),
        ("sb-pram", "crates/simulator/src/sb_pram/spec.toml"),
        ("dash", "crates/memory/specs/dash.toml"),
        ("two-socket", "crates/memory/specs/two-socket.toml"),
    ],
)
def test_pages_of_machines_have_all_their_figures(page, file):
    """Catches a figure that was changed, added or removed in a file and not on the machine's page."""
    text = (ROOT / f"docs/machines/{page}.md").read_text(encoding="utf-8")
    shown = dict(re.findall(r"^\| `([a-z_.]+)` \| (\S+) \|", text, re.MULTILINE))
    assert shown == figures(tomllib.loads((ROOT / file).read_text(encoding="utf-8")))
