"""Names and pages use the field's words; those that only this project had do not come back."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from support.private_words import ALLOWED, NAMES, PHRASES

ROOT = Path(__file__).resolve().parent.parent
SOURCES = sorted(
    path
    for folder, endings in {"python": (".py", ".pyi"), "rust": (".rs",)}.items()
    for path in (ROOT / folder).rglob("*")
    if path.suffix in endings and "target" not in path.relative_to(ROOT).parts
)
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def found(expression: str, paths: list[Path]) -> list[str]:
    """Every line with a word, by file and number; the glossary itself names them."""
    word, lines = re.compile(rf"(?<!\w)(?:{expression})(?!\w)"), []
    for path in paths:
        name = path.relative_to(ROOT).as_posix()
        if (name, expression) in ALLOWED:
            continue
        text = path.read_text(encoding="utf-8")
        if name == "docs/developing/naming.md":
            text = text.partition("## Glossary")[0]
        lines += [f"{name}:{k}: {line.strip()}" for k, line in enumerate(text.splitlines(), 1) if word.search(line)]
    return lines


def test_there_is_something_to_look_through() -> None:
    assert len(SOURCES) > 150
    assert len(PAGES) > 10
    assert found("Oscillator", SOURCES)
    assert found("adaptive steps", PAGES)


@pytest.mark.parametrize("expression", PHRASES)
def test_a_phrase_of_our_own_does_not_come_back(expression: str) -> None:
    assert not found(expression, SOURCES + PAGES), f"write: {PHRASES[expression]}"


@pytest.mark.parametrize("expression", NAMES)
def test_a_name_of_our_own_does_not_come_back(expression: str) -> None:
    assert not found(expression, SOURCES), f"call it: {NAMES[expression]}"
