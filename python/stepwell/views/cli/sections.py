"""Sections of Hoffmann (2002) in tables."""

from __future__ import annotations

#: The name of a column of sections.
HOFFMANN = "Hoffmann (2002)"


def section(name: str) -> str:
    """A section as tables show it: a dash for what is not in Hoffmann (2002)."""
    return name.replace("Appendix", "App.") if name.startswith(("§", "Appendix")) else "–"
