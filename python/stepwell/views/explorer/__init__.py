"""The explorer: one page for a browser, in which scenes run by two methods side by side.

``page`` fills the files in ``web/`` with ``data``: scenes, their steps as ``stepwell.export`` writes them in JavaScript, and how
the page draws them, which is in ``systems`` for each system and in ``sliders`` for each built-in scene. The page needs no server
and no network.
"""

from __future__ import annotations

from .page import Explorer, explore

__all__ = ["Explorer", "explore"]
