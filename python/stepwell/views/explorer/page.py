"""The page: the files in ``web/`` and the data of scenes, in one text."""

from __future__ import annotations

import html
import json
import re
import sys
import tempfile
import webbrowser
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any

from ... import _core
from ...base import checks, files, paths
from ...base.immutable import ValueEquality
from ...errors import ArgumentError
from ...model.methods import Method
from ...model.methods import choice as chosen_methods
from ...scenes import Scene, scenes
from ...scenes import scene as find_scene
from . import sliders
from .data import of_method, of_scene

WEB = Path(__file__).resolve().parent / "web"

#: The modules of the page, each after those that it imports.
MODULES = (
    *("roots", "energies", "truths", "trajectory", "conserved", "state", "palette", "texts", "limits", "slider"),
    *("motion", "plots", "race", "pictures", "app"),
)

#: Height of the page in a notebook, in pixels.
NOTEBOOK_HEIGHT = 900

#: Methods that a page has only if they are named. They are made to choose their steps; by steps of one length, as a page makes
#: them, fehlberg_5 and dop853 show the same, and these would be a third of the page of all scenes.
IF_NAMED = ("dopri5", "tsit5", "vern7", "vern9")

IMPORT = re.compile(r"^import .*?;\n", re.MULTILINE | re.DOTALL)


def explore(scenes: Any = None, *, methods: Any = None) -> Explorer:
    """A page for a browser in which scenes run by two methods side by side.

    It shows the motion, the phase plane, the roots of a step in the z-plane, energy and error, with sliders for the step and the
    scene's parameters. It is one file that needs no server and no network; its steps are those that ``stepwell.export`` writes in
    JavaScript, and so have the numbers of ``integrate``, to the last bit.

    Args:
        scenes: a scene or a name of one, or a list of these; all built-in scenes that are short enough for a page if None.
        methods: names of the methods to choose from, or what ``stepwell.methods`` returns. If None, all but
            "dopri5", "tsit5", "vern7" and "vern9", whose steps are long.

    Returns:
        An ``Explorer``: ``.save(path)`` writes the page, ``.open()`` shows it in the browser; a notebook shows it by itself.

    Raises:
        UnsupportedError: if no method steps one of the scenes, or its steps are too long for a page.

    Example:
        >>> page = sw.explore("kepler", methods=["leapfrog", "rk4"])
        >>> page.save("kepler.html").name
        'kepler.html'
    """
    chosen = tuple(each for each in chosen_methods(methods) if methods is not None or each.name not in IF_NAMED)
    page = Explorer(tuple(_scenes(scenes)), chosen)
    _ = page.data  # raises here for a scene that cannot be shown
    return page


def offered() -> list[Scene]:
    """The scenes of a page by default."""
    known = {each.name: each for each in (*scenes(), sliders.rope())}
    return [known[name] for name in sliders.OFFERS]


def _scenes(scenes: Any) -> list[Scene]:
    if scenes is None:
        return offered()
    several = [scenes] if isinstance(scenes, (str, Scene)) else checks.several("scenes", scenes, "scenes or their names")
    if not several:
        raise ArgumentError("scenes: expected at least one, got none")
    chosen = [sliders.rope() if isinstance(each, str) and each == "rope" else find_scene(each) for each in several]
    names = [each.name for each in chosen]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ArgumentError(f"scenes: expected scenes of different names, got {twice!r} twice; give one another name=")
    return chosen


@dataclass(frozen=True, eq=False)
class Explorer(ValueEquality):
    """A page with scenes and methods. ``save`` it, ``open`` it, or let a notebook show it.

    Attributes:
        scenes: the scenes that it offers; it begins with the first.
        methods: the methods that it offers.

    Example:
        >>> page = sw.explore(["clover", "oscillator"], methods=["false_euler", "rk4"])
        >>> [scene.name for scene in page.scenes]
        ['clover', 'oscillator']
    """

    scenes: tuple[Scene, ...]
    methods: tuple[Method, ...]

    @cached_property
    def data(self) -> dict[str, Any]:
        """The data of the page: its methods, and its scenes with their steps, as numbers and texts.

        Raises:
            UnsupportedError: if no method steps one of the scenes, or its steps are too long for a page.
        """
        return {
            "version": _core.__version__,
            "methods": [of_method(each) for each in self.methods],
            "scenes": [of_scene(each, self.methods) for each in self.scenes],
        }

    @cached_property
    def html(self) -> str:
        """The page: HTML with all that it needs."""
        data = json.dumps(self.data, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")
        text = (WEB / "page.html").read_text(encoding="utf-8")
        style = (WEB / "page.css").read_text(encoding="utf-8")
        parts = {"STYLE": style, "DATA": data, "SCRIPT": script(), "VERSION": _core.__version__}
        return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], text)

    def save(self, path: str | PathLike[str]) -> Path:
        """Write the page.

        Args:
            path: the file, ending in ``.html`` or ``.htm``.

        Raises:
            ArgumentError: if it has another ending or cannot be written.
        """
        place = paths.file("path", path, (".html", ".htm"))
        files.write_text(place, self.html)
        return place

    def open(self) -> Path:
        """Write the page to a temporary file, and show that in the browser.

        Returns:
            The path of the file, which stays there.
        """
        with tempfile.NamedTemporaryFile("w", prefix="stepwell-", suffix=".html", delete=False, encoding="utf-8") as file:
            file.write(self.html)
        webbrowser.open(Path(file.name).as_uri())
        return Path(file.name)

    def _repr_html_(self) -> str:
        inside = html.escape(self.html, quote=True)
        style = f"width:100%;height:{NOTEBOOK_HEIGHT}px;border:1px solid #8888"
        return f'<iframe title="stepwell explorer" style="{style}" srcdoc="{inside}"></iframe>'

    def __repr__(self) -> str:
        names = ", ".join(each.name for each in self.scenes)
        return f"<explorer of {names}; {len(self.methods)} methods>"


def script() -> str:
    """The modules of the page in one text, without what they import from each other."""
    texts = ((WEB / f"{name}.js").read_text(encoding="utf-8") for name in MODULES)
    return "\n".join(re.sub(r"^export ", "", IMPORT.sub("", text), flags=re.MULTILINE) for text in texts)


def in_notebook() -> bool:
    """True if a notebook shows the value of a cell's last expression."""
    shell = sys.modules.get("IPython")
    running = shell.get_ipython() if shell is not None else None
    return running is not None and hasattr(running, "kernel")
