"""How Sphinx builds the site: ``make docs``. Warnings are errors, and nothing is fetched from a network."""

from __future__ import annotations

import os
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

import stepwell

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS))
import site_parts  # noqa: E402

# Notebooks choose the way that shows figures below their cells, unless this names another.
os.environ.pop("MPLBACKEND", None)

project = "stepwell"
author = "The stepwell developers"
copyright = "The stepwell developers"
release = version = stepwell.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "explorer_parts",
]
exclude_patterns = ["gallery/**.ipynb", "gallery/**.py"]
nitpicky = True
#: What annotations name outside of the package, or privately in it, has no page here.
nitpick_ignore_regex = [(r"py:.*", r"(?!stepwell\.[a-z]+$).*")]

# ---- pages

myst_enable_extensions = ["colon_fence", "dollarmath"]
# Browsers draw MathML by themselves, so that no script is loaded for formulas.
html_math_renderer = "mathml"
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_in_temp = True
nb_execution_timeout = 120
nb_merge_streams = True

#: Files beside docs/ that the site shows, and the page that includes each or is made from it.
INCLUDED = {
    "CHANGELOG.md": "developing/changelog.md",
    "CONTRIBUTING.md": "developing/contributing.md",
    "SECURITY.md": "developing/security.md",
    "benches/CONTROL.md": "benchmarks/control.md",
    "benches/RESULTS.md": "benchmarks/results.md",
    "examples/GALLERY_HEADER.rst": "gallery/index.rst",
}

# ---- the gallery: scripts of examples/, run and shown

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "subsection_order": [
        "../examples/motion",
        "../examples/methods",
        "../examples/sweeps",
        "../examples/equations",
    ],
    "within_subsection_order": "FileNameSortKey",
    "filename_pattern": r"\.py$",
    # The scripts right in examples/ print; those in its folders draw.
    "ignore_pattern": f"^({'|'.join(file.name for file in (DOCS.parent / 'examples').glob('*.py'))})$",
    "reset_argv": "site_parts.folder_for_pictures",
    "abort_on_example_error": True,
    "write_computation_times": False,
    "show_memory": False,
    "show_signature": False,
    "remove_config_comments": True,
    "thumbnail_size": (480, 320),
    "min_reported_time": 1e9,
    # What a last line returns, such as a title, is no result.
    "capture_repr": (),
}

# ---- reference

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autosummary_generate = False
maximum_signature_line_length = 88
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
python_use_unqualified_type_names = True
toc_object_entries_show_parents = "hide"

# ---- look

html_theme = "furo"
pygments_style = "default"
pygments_dark_style = "github-dark"
html_title = f"stepwell {release}"
html_favicon = "_static/favicon.svg"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["theme.js"]
#: Of the card that a link to a page becomes elsewhere, and of a search engine's entry.
ABOUT = "Fast, reproducible integration of motion, for games, simulators and courses"
#: Addresses of the project, from its package's record: one place to enter them.
ADDRESSES = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))[
    "project"
].get("urls", {})
html_baseurl = ADDRESSES.get("Documentation", "")
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    **(
        {
            "source_repository": f"{ADDRESSES['Repository']}/",
            "source_branch": "main",
            "source_directory": "docs/",
        }
        if "Repository" in ADDRESSES
        else {}
    ),
    "light_css_variables": {
        "color-brand-primary": "#175ca6",
        "color-brand-content": "#175ca6",
    },
    "dark_css_variables": {
        "color-brand-primary": "#6cb2f5",
        "color-brand-content": "#6cb2f5",
    },
}
copybutton_exclude = ".linenos, .gp, .go"

LINK = re.compile(r"(?<=\]\()([\w./-]+\.(?:md|rst))(?=[)#])")


def _to_pages(text: str, folder: Path) -> str:
    """Links between files, which are for readers of the repository, lead to the pages of the site."""

    def page(link: re.Match[str]) -> str:
        target = (folder / link[0]).resolve()
        if target.is_relative_to(DOCS):
            return f"/{target.relative_to(DOCS).as_posix()}"
        return f"/{INCLUDED[target.relative_to(DOCS.parent).as_posix()]}"

    return LINK.sub(page, text)


def _page_read(app: Any, name: str, source: list[str]) -> None:
    source[0] = _to_pages(source[0], (DOCS / name).parent)


def _file_included(app: Any, path: Path, name: str, source: list[str]) -> None:
    source[0] = _to_pages(source[0], (DOCS / path).parent)


def _with_card(
    app: Any, page: str, template: str, context: dict[str, Any], doctree: Any
) -> None:
    """A page's card: its title, what the project is for, and a picture."""
    picture = f"{html_baseurl}/_static/card.png" if html_baseurl else ""
    context["metatags"] = context.get("metatags", "") + site_parts.card(
        context.get("title", project), ABOUT, picture
    )


def setup(app: Any) -> None:
    """Called by Sphinx."""
    app.connect("html-page-context", _with_card)
    app.connect("doctree-read", site_parts.captions)
    app.add_html_math_renderer(
        "mathml",
        inline_renderers=(site_parts.formula, None),
        block_renderers=(site_parts.formula, None),
    )
    app.add_directive("public", site_parts.Public)
    app.connect(
        "autodoc-process-docstring", site_parts.as_text, priority=400
    )  # before Napoleon
    app.connect("autodoc-process-signature", site_parts.without_constructor)
    app.connect("source-read", _page_read)
    app.connect("include-read", _file_included)
