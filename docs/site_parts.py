"""What the site needs beside ``conf.py``: reference pages, docstrings as text, arguments of the gallery's scripts."""

from __future__ import annotations

import html
import importlib
import inspect
import re
import tempfile
from functools import cache
from typing import Any

import stepwell
from docutils import nodes
from docutils.statemachine import StringList
from sphinx.util.docutils import SphinxDirective

LITERAL = re.compile(r"(``.+?``|`.+?`)")


class Public(SphinxDirective):
    """The functions and classes that a module lists, as a table and then one by one.

    The argument is the module. Option ``from`` names the modules in which they are defined, if not all are meant: so a new
    system, which is listed in ``stepwell``, is on the page of the systems without being named there.
    """

    required_arguments = 1
    option_spec = {"from": str}  # noqa: RUF012

    def run(self) -> list[nodes.Node]:
        """The directive's nodes: what autodoc makes of the names."""
        module = importlib.import_module(self.arguments[0])
        wanted = tuple(self.options.get("from", "stepwell").split())
        names = []
        for name in getattr(module, "__all__", None) or dir(module):
            thing = getattr(module, name)
            if name.startswith("_") or not (
                inspect.isclass(thing) or inspect.isfunction(thing)
            ):
                continue
            # What stepwell itself lists is told of by the name that it has there; what a module only imports, elsewhere.
            here = _within(thing.__module__, (module.__name__,)) and (
                module is stepwell or thing is not getattr(stepwell, name, None)
            )
            if here and _within(thing.__module__, wanted):
                names.append((name, thing))
        if not names:
            raise self.error(f"{self.arguments[0]} lists nothing from {wanted}")
        lines = [
            "````{eval-rst}",
            f".. currentmodule:: {module.__name__}",
            "",
            ".. autosummary::",
            "   :nosignatures:",
            "",
        ]
        lines += [f"   {name}" for name, _ in names]
        for name, thing in names:
            kind = "autofunction" if inspect.isfunction(thing) else "autoclass"
            if kind == "autoclass" and issubclass(thing, BaseException):
                kind = "autoexception"
            lines += [
                "",
                f".. {kind}:: {name}",
                *(["   :members:"] if kind == "autoclass" else []),
            ]
        node = nodes.Element()
        self.state.nested_parse(
            StringList([*lines, "````"], self.get_source_info()[0]),
            self.content_offset,
            node,
        )
        return node.children


def _within(module: str, wanted: tuple[str, ...]) -> bool:
    return any(module == each or module.startswith(f"{each}.") for each in wanted)


def as_text(
    app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]
) -> None:
    """Stars and bars of a docstring mean themselves, as in a shape or a length; examples stay as they are."""
    example = False
    for i, line in enumerate(lines):
        example = line.lstrip().startswith(">>>") or (example and bool(line.strip()))
        if not example:
            parts = LITERAL.split(line)
            parts[::2] = [re.sub(r"([*|])", r"\\\1", part) for part in parts[::2]]
            lines[i] = "".join(parts)


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory()


def folder_for_pictures(
    gallery_conf: dict[str, Any], script: dict[str, Any]
) -> list[str]:
    """Arguments of an example: the folder for its picture, which the site does not need, since it takes the figure itself."""
    return [_folder().name]


def without_constructor(
    app: Any,
    what: str,
    name: str,
    thing: Any,
    options: Any,
    signature: str | None,
    returns: str | None,
) -> tuple[str, str | None] | None:
    """What is returned and not made by a user, and so has attributes and no arguments, is shown without its arguments."""
    told = inspect.getdoc(thing) or ""
    return (
        ("", returns)
        if what == "class" and "Attributes:" in told and "Args:" not in told
        else None
    )


def card(title: str, about: str, picture: str) -> str:
    """The lines of a page's head that say what it is, to search engines and where its link is shown."""
    title = html.escape(re.sub(r"<[^>]*>", "", title))
    lines = [
        f'<meta name="description" content="{html.escape(about)}">',
        f'<meta property="og:title" content="{title}">',
        f'<meta property="og:description" content="{html.escape(about)}">',
        '<meta property="og:type" content="website">',
    ]
    if picture:
        lines.append(f'<meta property="og:image" content="{html.escape(picture)}">')
    return "\n".join(lines) + "\n"


def captions(app: Any, doctree: nodes.document) -> None:
    """A picture that stands alone has its alternative text as a caption, too."""
    for number, paragraph in enumerate(list(doctree.findall(nodes.paragraph))):
        if len(paragraph) != 1 or not isinstance(image := paragraph[0], nodes.image):
            continue
        if not image.get("alt") or isinstance(paragraph.parent, nodes.figure):
            continue
        text = image["alt"]
        figure = nodes.figure(
            "", image, nodes.caption("", text), ids=[f"picture-{number}"]
        )
        paragraph.replace_self(figure)


def formula(writer: Any, node: nodes.Element) -> None:
    """A formula in LaTeX as MathML."""
    from latex2mathml.converter import convert

    block = isinstance(node, nodes.math_block)
    drawn = convert(node.astext(), display="block" if block else "inline")
    writer.body.append(f'<div class="formula">{drawn}</div>' if block else drawn)
    raise nodes.SkipNode
