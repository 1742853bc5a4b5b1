"""The explorer on the site: made once, live in a frame, and linked from each page about a scene that it has.

``setup`` connects it to Sphinx; ``conf.py`` names this module among the extensions.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import stepwell
from docutils import nodes
from sphinx.util.docutils import SphinxDirective

DOCS = Path(__file__).resolve().parent

#: The file of the explorer, in the first folder of the site.
FILE = "explorer.html"

#: Where a page names a scene: in code, and on the command line.
NAMED = re.compile(r"\bscenes\.(\w+)\(|\bstepwell (?:run|chart|explore|advise) (\w+)")

#: Pages that show a scene otherwise than the explorer begins with it, or without naming it: what their links restore.
STATES: dict[str, dict[str, dict[str, Any]]] = {
    "gallery/methods/dispersion": {"chain": {}},
    "gallery/methods/energies": {
        "oscillator": {"a": "false_euler", "b": "rk4", "dt": 0.5}
    },
    "gallery/methods/frame_rate": {
        "oscillator": {"a": "false_euler", "b": "rk4", "dt": 2.1}
    },
    "gallery/methods/frequencies": {
        "oscillator": {"a": "false_euler", "b": "rk4", "dt": 1.0}
    },
    "gallery/methods/orders": {"pendulum": {"a": "leapfrog", "b": "dop853"}},
    "gallery/methods/phase_portrait": {"oscillator": {}},
    "gallery/methods/resonance_curve": {"forced_oscillator": {}},
    "gallery/methods/root_loci": {"oscillator": {}},
    "gallery/motion/bouncing_balls": {"bouncing_ball": {}},
    "gallery/motion/rosette": {"conical_pendulum": {}},
    "gallery/motion/sticking_block": {"sticking_block": {}},
    "gallery/motion/tumbling": {"dzhanibekov": {}},
    "howto/springs": {"rope": {}},
    "howto/stiff": {"van_der_pol": {}, "rober": {}},
    "theory/stability": {"oscillator": {}, "chain": {}},
    "theory/where_methods_fail": {"van_der_pol": {}, "rober": {}},
    "theory/why_false_euler_works": {
        "oscillator": {"a": "false_euler", "b": "leapfrog", "dt": 0.5}
    },
}

#: Pages that name scenes in passing, and are about none of them.
ABOUT_NONE = re.compile(r"index$|developing/|reference/|howto/explorer$")


@cache
def _offered() -> dict[str, stepwell.Scene]:
    return {scene.name: scene for scene in _page().scenes}


@cache
def _page() -> stepwell.Explorer:
    return stepwell.explore()


def linked(page: str, text: str) -> dict[str, str]:
    """The scenes of a page that the explorer has, each with the state that its link restores."""
    if ABOUT_NONE.search(page):
        return {}
    states = {name: {} for match in NAMED.findall(text) for name in match if name}
    states |= STATES.get(page, {})
    return {
        name: "#" + urlencode({"scene": name} | state)
        for name, state in states.items()
        if name in _offered()
    }


def _source(app: Any, page: str) -> str:
    """The text that a page was written in; for one of the gallery, its script."""
    script = DOCS.parent / "examples" / f"{page.removeprefix('gallery/')}.py"
    path = script if script.exists() else Path(app.env.doc2path(page))
    return path.read_text(encoding="utf-8") if path.exists() else ""


def _links(app: Any, doctree: nodes.document, page: str) -> None:
    """Put the links below the title of a page."""
    links = linked(page, _source(app, page))
    title = next(iter(doctree.findall(nodes.title)), None)
    if not links or title is None:
        return
    line = nodes.paragraph("", "Open in the explorer: ", classes=["open-in-explorer"])
    for i, (name, state) in enumerate(links.items()):
        line += [nodes.Text(" · ")] if i else []
        line += nodes.reference(
            "",
            _offered()[name].title,
            refuri="../" * page.count("/") + FILE + state,
            internal=False,
        )
    title.parent.insert(title.parent.index(title) + 1, line)


class Live(SphinxDirective):
    """The explorer in a frame, loaded when it is about to be seen. The argument is its state, as its link holds it."""

    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The frame, and a link to the explorer in the whole window."""
        state = f"#{self.arguments[0]}" if self.arguments else ""
        place = "../" * self.env.docname.count("/") + FILE + state
        frame = f'<iframe class="explorer" loading="lazy" title="stepwell explorer" src="{place}"></iframe>'
        whole = nodes.paragraph(classes=["open-in-explorer"])
        whole += nodes.reference(
            "", "Open the explorer in the whole window", refuri=place
        )
        return [nodes.raw("", frame, format="html"), whole]


def _write(app: Any) -> None:
    """Write the explorer before the pages that link to it."""
    if app.builder.format == "html":
        _page().save(Path(app.outdir) / FILE)


def setup(app: Any) -> dict[str, bool]:
    """Called by Sphinx."""
    app.add_directive("explorer", Live)
    app.connect("builder-inited", _write)
    app.connect("doctree-resolved", _links)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
