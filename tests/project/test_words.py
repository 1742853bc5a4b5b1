"""Sources and pages use the field's words; phrases that only this project had do not come back."""

from __future__ import annotations

import re

from support import ROOT

#: The expression, and what to write instead. docs/developing/naming.md has the glossary.
PHRASES = {
    r"(steps?|none) of chosen length": "adaptive steps",
    r"chosen steps?": "adaptive steps",
    r"kept states?": "saved states",
    r"films?": "animation",
    r"dear(er|est)?": "expensive",
    r"(step|one|those) beside the path": "extra step",
    r"abreast": "interleaved, vectors of a block",
    r"a lone \w+": "a single member",
    r"nobody|somebody|anybody|everybody|whoever": "the member, the caller, the thread, the value",
    r"who (diverged|tells|asks|is not finite)": "which members diverged",
    r"look(s|ing)? at": "check, read, evaluate",
    r"(two|one|last|next|first|more) looks?|looks (between|in between)": "check",
    r"held against": "compared with",
    r"(what|that) comes of": "result",
    r"is its own affair": "is computed by",
    r"in the place of": "in place of",
    r"unless told otherwise": "by default",
    r"pumps energy": "adds energy",
}


def texts() -> dict[str, str]:
    """Every source and page by its name, without the glossary, which has the phrases."""
    kinds = (("python", "*.py*"), ("rust", "*.rs"), ("docs", "*.md"))
    paths = [*(path for folder, kind in kinds for path in (ROOT / folder).rglob(kind)), ROOT / "README.md"]
    named = {path.relative_to(ROOT).as_posix(): path for path in paths if path.suffix in (".py", ".pyi", ".rs", ".md")}
    return {name: path.read_text(encoding="utf-8").partition("## Glossary")[0] for name, path in named.items()}


def test_phrases_of_our_own_do_not_come_back() -> None:
    read = texts()
    assert len(read) > 160
    assert any("Oscillator" in text for text in read.values())
    for phrase, better in PHRASES.items():
        expression = re.compile(rf"(?<!\w)(?:{phrase})(?!\w)")
        lines = [f"{name}: {each[0]}" for name, text in read.items() for each in expression.finditer(text)]
        assert not lines, f"write: {better}"


def test_docstrings_say_first_what_a_thing_is() -> None:
    docstring = re.compile(r'"""(?:Those|That|These|The same|What|Whether)\b.*')
    comment = re.compile(r"(?:\A|\n(?! *//[/!]).*\n) *(//[/!] (?:Those|That|These|The same|What|So (?:many|much))\b.*)")
    begun = [(name, line) for name, text in texts().items() for line in (comment if ".rs" in name else docstring).findall(text)]
    assert not begun, "begin with a noun or a verb:\n" + "\n".join(f"{name}: {line}" for name, line in begun)


def test_comments_of_the_core_fit_a_line() -> None:
    """As rustfmt breaks code, and not comments, at its ``max_width``."""
    sources = {name: text for name, text in texts().items() if name.endswith(".rs")}
    long = [(name, line) for name, text in sources.items() for line in text.split("\n") if len(line) > 130]
    lines = [f"{name}: {line}" for name, line in long if line.lstrip().startswith("//")]
    assert not lines, "\n".join(lines)
