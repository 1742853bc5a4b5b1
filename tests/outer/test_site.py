"""The site: it builds from a copy of the tree without a network or a warning, and its pages work in a browser, on a phone too."""

import html
import inspect
import json
import os
import re
import shutil
import subprocess
import sys
import zlib
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest
import stepwell as sw
from PIL import Image
from stepwell.analysis import stability
from stepwell.model import quaternion
from stepwell.views import charts
from support import ROOT
from support.browser import needs_browser

pytest.importorskip("sphinx_gallery", reason="the extra docs is not installed")
pytest.importorskip("myst_nb", reason="the extra docs is not installed")
pytest.importorskip("furo", reason="the extra docs is not installed")

#: What a fresh clone has of the site: what was built in docs/ before is left out.
NEEDED = ("docs", "examples", "benches", "pyproject.toml", "README.md", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md")
LEFT_OUT = shutil.ignore_patterns("gallery", "__pycache__", "control")
#: A proxy at which nobody listens: whatever asks for a page of the web fails.
NOWHERE = "http://127.0.0.1:9"
FEWEST_PICTURES = 24
TUTORIALS = ("first_run", "choose_a_step", "keep_energy", "your_equations", "game_loop", "sweep")
#: Attributes by which a page loads something, by element; a link that is only followed loads nothing.
LOADS = {"script": "src", "img": "src", "iframe": "src", "source": "srcset", "video": "src", "link": "href", "object": "data"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The built site; ``make docs`` runs the same command."""
    tree = tmp_path_factory.mktemp("site")
    for name in NEEDED:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, tree / name, **({"ignore": LEFT_OUT} if copy is shutil.copytree else {}))
    (recipe,) = re.findall(r"^\t\$\(BIN\)/sphinx-build (.*) docs \$\(OUT\)/docs$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert {"-n", "-W"} <= set(recipe.split()), "warnings are errors"
    proxies = {name: NOWHERE for each in ("http_proxy", "https_proxy", "all_proxy") for name in (each, each.upper())}
    # The package under test, whatever else is installed; an empty entry of the path would be the folder of the copy.
    pythonpath = os.pathsep.join([str(Path(sw.__file__).parents[1]), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", *recipe.split(), "docs", "built"],
        cwd=tree,
        env=os.environ | proxies | {"PYTHONPATH": pythonpath, "no_proxy": "127.0.0.1,localhost", "MPLBACKEND": "agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-6000:]
    assert (tree / "built" / "index.html").exists()
    return tree / "built"


class Page(HTMLParser):
    """What a page loads, where its links lead, and the names of its places."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.places: set[str] = set()
        self.frames: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        attributes = {name: value or "" for name, value in attrs}
        if "id" in attributes:
            self.places.add(attributes["id"])
        if tag == "a" and "href" in attributes:
            self.links.append(attributes["href"])
        if LOADS.get(tag) in attributes:
            self.loads.append(attributes[LOADS[tag]])
        self.frames += [attributes["srcdoc"]] if "srcdoc" in attributes else []


@cache
def read(path: Path) -> Page:
    return Page(path.read_text(encoding="utf-8"))


def from_the_web(site: Path) -> list[str]:
    """Everything that a page, a style or a frame within a page would load from the web."""
    addresses = []
    for path in site.rglob("*.html"):
        pages = [read(path), *map(Page, read(path).frames)]
        addresses += [f"{path.name}: {load[:80]}" for page in pages for load in page.loads if re.match(r"(https?:)?//", load)]
    for path in site.rglob("*.css"):
        style = path.read_text(encoding="utf-8")
        addresses += [f"{path.name}: {load}" for load in re.findall(r"(?:url\(|@import)\s*[\"']?((?:https?:)?//[^)\"']*)", style)]
    return addresses


def test_pages_load_nothing_from_the_web_and_lead_somewhere(site: Path) -> None:
    assert not from_the_web(site)
    # The button at the end of a page leads to its start, which has no name.
    assert not [each for each in lost(site) if not each.endswith(": #")]
    pages = list(site.rglob("*.html"))
    assert [path.name for path in pages if re.search(r"Text\(0?\.\d", path.read_text(encoding="utf-8"))] == []
    # What a search engine shows, and what a link becomes elsewhere.
    for path in (site / "index.html", site / "howto" / "runs.html", site / "gallery" / "motion" / "heavy_top.html"):
        text = path.read_text(encoding="utf-8")
        for needed in ('name="description" content="Fast, reproducible', 'property="og:title"', "favicon.svg"):
            assert needed in text, (path.name, needed)


def test_what_is_loaded_from_the_web_and_a_lost_link_are_found(tmp_path: Path) -> None:
    frame = html.escape('<img src="https://example.org/a.png">')
    (tmp_path / "a.html").write_text(f'<script src="//cdn.example.org/x.js"></script><iframe srcdoc="{frame}"></iframe>')
    (tmp_path / "a.css").write_text('@import "https://example.org/font.css"; p { background: url(data:x) }')
    assert len(from_the_web(tmp_path)) == 3
    links = "b.html", "#here", "#there", "http://example.org", "https://example", "a.html#here", "https://example.org/x"
    folder = tmp_path / "links"
    folder.mkdir()
    (folder / "a.html").write_text('<p id="here">' + "".join(f'<a href="{link}">' for link in links))
    assert [each.partition(": ")[2] for each in lost(folder)] == ["b.html", "#there", "http://example.org", "https://example"]


def lost(site: Path) -> list[str]:
    """Links and pictures that lead nowhere: to a file or a place in it that is not there, or to no proper address."""
    broken = []
    for path in site.rglob("*.html"):
        page = read(path)
        for link in page.links + page.loads:
            parts = urlsplit(link)
            if parts.scheme in ("data", "mailto"):
                continue
            if parts.scheme or parts.netloc:
                good = parts.scheme == "https" and re.fullmatch(r"[\w-]+(\.[\w-]+)+", parts.netloc)
            else:
                target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
                # What stands behind the # of the explorer is its state.
                place = unquote(parts.fragment) if target.suffix == ".html" and target != site / "explorer.html" else ""
                good = target.is_file() and (not place or place in read(target).places)
            if not good:
                broken.append(f"{path.relative_to(site)}: {link}")
    return broken


def thumbnails(site: Path) -> list[Path]:
    """The pages of the gallery's thumbnails."""
    text = (site / "gallery" / "index.html").read_text(encoding="utf-8")
    links = re.findall(r'<div class="sphx-glr-thumbcontainer".*?<a[^>]* href="([^"#]*)', text, re.DOTALL)
    return [site / "gallery" / link for link in links]


def test_every_picture_of_the_gallery_has_its_script_and_notebook(site: Path) -> None:
    pages = thumbnails(site)
    scripts = sorted(file.stem for file in (ROOT / "examples").glob("*/*.py"))
    assert sorted(page.stem for page in pages) == scripts
    assert len(pages) >= FEWEST_PICTURES
    for page in pages:
        files = {Path(link).suffix: page.parent / link for link in read(page).links if "_downloads/" in link}
        (script,) = (ROOT / "examples").glob(f"*/{page.stem}.py")
        assert files[".py"].read_bytes() == script.read_bytes()
        cells = json.loads(files[".ipynb"].read_text(encoding="utf-8"))["cells"]
        assert {cell["cell_type"] for cell in cells} == {"code", "markdown"}
        drawn = [load for load in read(page).loads if "/sphx_glr_" in load]
        assert len(drawn) == 1, page.stem
        with Image.open(page.parent / drawn[0]) as picture:
            assert len(picture.convert("RGB").resize((160, 120)).getcolors(1 << 24) or []) > 50, (
                f"{page.stem} draws next to nothing"
            )


def test_a_gallery_page_says_what_it_shows() -> None:
    """A title, and one to three sentences."""
    for script in (ROOT / "examples").glob("*/*.py"):
        title, line, _, *description = script.read_text(encoding="utf-8").partition('"""')[2].partition('"""')[0].splitlines()
        assert re.fullmatch("=+", line), script.name
        assert len(title) == len(line), script.name
        assert 40 < len(" ".join(description)) < 600, script.name


def documented(site: Path) -> set[str]:
    """The names of the reference."""
    inventory = (site / "objects.inv").read_bytes().split(b"\n", 4)[4]
    return {line.split()[0] for line in zlib.decompress(inventory).decode("utf-8").splitlines() if " py:" in line}


def test_every_public_name_is_in_the_reference_with_an_example(site: Path) -> None:
    known = documented(site)
    for module in (sw, charts, sw.errors, stability, quaternion, sw.orbits, sw.scenes):
        for name in getattr(module, "__all__", None) or dir(module):
            thing = getattr(module, name)
            own = getattr(thing, "__module__", "").startswith(module.__name__) and not name.startswith("_")
            if own and (inspect.isfunction(thing) or inspect.isclass(thing)):
                assert {f"{module.__name__}.{name}", f"stepwell.{name}"} & known, f"{module.__name__}.{name}"
    page = (site / "reference" / "runs.html").read_text(encoding="utf-8")
    assert "&gt;&gt;&gt; " in page


SEEN = (
    "index", "tutorials/first_run", "tutorials/sweep", "howto/runs", "gallery/index", "gallery/motion/heavy_top",
    "reference/index", "reference/systems", "theory/stability", "theory/paper", "benchmarks/work-precision", "developing/design",
)  # fmt: skip
PHONE, DESKTOP = {"width": 390, "height": 844}, {"width": 1280, "height": 900}


@needs_browser
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("window", [PHONE, DESKTOP], ids=["phone", "desktop"])
def test_pages_open_without_a_complaint(site: Path, browser: Any, window: Any, scheme: str, tmp_path: Path) -> None:
    context = browser.new_context(viewport=window, color_scheme=scheme)
    page = context.new_page()
    page.set_default_timeout(60_000)
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text) if message.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("requestfailed", lambda request: complaints.append(f"failed: {request.url}"))
    allowed = ("file:", "data:", "about:", "blob:")
    page.on("request", lambda request: None if request.url.startswith(allowed) else complaints.append(request.url))
    for name in SEEN:
        page.goto((site / f"{name}.html").as_uri())
        wide = page.evaluate("document.documentElement.scrollWidth")
        assert wide <= window["width"], f"{name} is {wide} pixels wide"
        shot = tmp_path / f"{name.replace('/', '-')}.png"
        page.screenshot(path=shot)
        with Image.open(shot) as seen:
            small = seen.convert("L")
            assert seen.width == window["width"]
            corner = small.getpixel((seen.width - 3, seen.height - 3))
            assert corner > 200 if scheme == "light" else corner < 60, f"{name} is not {scheme}"
            low, high = small.getextrema()
            assert high - low > 150, f"{name} shows next to nothing"
    context.close()
    assert not complaints


@needs_browser
@pytest.mark.parametrize(("name", "kind"), [("index", "explorer"), ("tutorials/first_run", "animation")])
def test_a_frame_has_the_theme_that_was_chosen_for_the_site(site: Path, browser: Any, name: str, kind: str) -> None:
    from playwright.sync_api import expect

    context = browser.new_context(viewport=DESKTOP, color_scheme="light")
    page = context.new_page()
    page.set_default_timeout(60_000)
    page.goto((site / f"{name}.html").as_uri())
    page.locator(f"iframe.{kind}").first.scroll_into_view_if_needed()
    shown = page.frame_locator(f"iframe.{kind}").first.locator("html")
    for theme, seen in (("auto", "light"), ("dark", "dark"), ("light", "light"), ("dark", "dark")):
        page.evaluate("theme => { document.body.dataset.theme = theme }", theme)
        expect(shown).to_have_attribute("data-theme", seen)
    context.close()


@needs_browser
def test_a_tutorial_animates_and_the_search_finds(site: Path, browser: Any) -> None:
    page = browser.new_page()
    page.set_default_timeout(60_000)
    page.goto((site / "tutorials" / "first_run.html").as_uri())
    frame = page.frame_locator("iframe.animation")
    before = frame.locator("output").inner_text()
    page.locator("iframe.animation").scroll_into_view_if_needed()
    page.wait_for_timeout(1500)
    assert frame.locator("output").inner_text() != before
    page.goto((site / "search.html").as_uri() + "?q=leapfrog")
    page.locator("#search-results li").first.wait_for()
    page.close()


def test_pages_have_formulas_pictures_and_captions(site: Path) -> None:
    text = re.sub(r"<[^>]*>", "", (site / "index.html").read_text(encoding="utf-8"))
    assert "def duffing(" in text
    assert "pip install" in text
    text = (site / "theory" / "stability.html").read_text(encoding="utf-8")
    assert text.count("<math ") > 4
    assert "\\begin{pmatrix}" not in text
    # Outside of the gallery, whose thumbnails have their names beside them, and of notebooks.
    for path in [site / "index.html", *site.glob("howto/*.html"), *site.glob("theory/*.html"), *site.glob("benchmarks/*.html")]:
        text = path.read_text(encoding="utf-8")
        images = re.findall(r"<img [^>]*src=\"[^\"]*_images/[^>]*>", text)
        assert all(re.search(r'alt="[^"]{8,}"', image) for image in images), path.name
        figures = re.findall(r"<figure.*?</figure>", text, re.DOTALL)
        assert all("<figcaption>" in figure for figure in figures), path.name
    assert "<figcaption>" in (site / "theory" / "stability.html").read_text(encoding="utf-8")
    for name in TUTORIALS:
        page = read(site / "tutorials" / f"{name}.html")
        drawn = [load for load in page.loads if "_images/" in load]
        assert drawn or page.frames, name
        text = (site / "tutorials" / f"{name}.html").read_text(encoding="utf-8")
        assert "output stderr" not in text, f"{name} shows a warning"
        assert f"tutorials/{name}.html" in "".join(read(site / "index.html").links), "it is in the navigation"


def states(site: Path) -> dict[str, list[str]]:
    """The states that links to the explorer restore, by page."""
    found = {path.relative_to(site).as_posix(): read(path).links for path in site.rglob("*.html")}
    return {
        page: ends
        for page, links in found.items()
        if (ends := [x.partition("#")[2] for x in links if "explorer.html#scene=" in x])
    }


def test_every_page_about_a_scene_opens_it_in_the_explorer(site: Path) -> None:
    """Found by another way than the site does: a page whose code makes a scene that the explorer has."""
    offered = {scene.name for scene in sw.explore().scenes}
    linked = states(site)
    about = 0
    for path in site.rglob("*.html"):
        page = path.relative_to(site).as_posix()
        if (
            re.match(r"index|developing/|reference/|genindex|search|py-modindex|explorer|_|howto/explorer", page)
            or "/index" in page
        ):
            continue
        text = re.sub(r"<[^>]+>", "", path.read_text(encoding="utf-8"))
        named = set(re.findall(r"scenes\.(\w+)\(", text)) & offered
        opened = {dict(pair.split("=") for pair in state.split("&"))["scene"] for state in linked.get(page, [])}
        assert named <= opened, page
        about += bool(opened)
    assert about > 30
    assert "scene=oscillator&a=false_euler&b=rk4&dt=0.5" in linked["gallery/methods/energies.html"]


@needs_browser
def test_links_to_the_explorer_open_their_state(site: Path, browser: Any) -> None:
    page = browser.new_page()
    page.set_default_timeout(60_000)
    for state in sorted({each for ends in states(site).values() for each in ends}):
        page.goto("about:blank")
        page.goto((site / "explorer.html").as_uri() + f"#{state}&play=0")
        page.evaluate("explorer.page.ready")
        words = dict(pair.split("=") for pair in state.split("&"))
        got = page.evaluate(
            "({ scene: explorer.page.scene.name, a: explorer.page.keys[0], b: explorer.page.keys[1], dt: explorer.page.dt })"
        )
        assert {name: str(got[name]).removesuffix(".0") for name in words} == {
            name: word.removesuffix(".0") for name, word in words.items()
        }
    page.close()


@needs_browser
@pytest.mark.parametrize("name", ["index", "howto/explorer"])
def test_the_explorer_is_live_on_pages_and_loaded_when_it_is_seen(site: Path, browser: Any, name: str) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    page.set_default_timeout(60_000)
    page.goto((site / f"{name}.html").as_uri())
    frame = page.locator("iframe.explorer")
    assert frame.get_attribute("loading") == "lazy"
    assert "srcdoc" not in (frame.evaluate("(node) => node.outerHTML")), "one file for all pages"
    frame.scroll_into_view_if_needed()
    inside = page.frame_locator("iframe.explorer")
    inside.locator("#play").wait_for()
    live = next(each for each in page.frames if "explorer.html#" in each.url)
    live.wait_for_function("window.explorer?.page.race?.k > 3")
    assert live.evaluate("explorer.page.playing")
    # The part that is played with is seen without scrolling in the frame.
    height = frame.bounding_box()["height"]
    for each in ("#motion-a", "#motion-b", "#error-a", "#energy", "#error"):
        box = live.evaluate("(name) => document.querySelector(name).getBoundingClientRect().bottom", each)
        assert box <= height, each
    page.close()


@needs_browser
def test_the_page_on_false_euler_is_one_sheet(site: Path, browser: Any, tmp_path: Path) -> None:
    """A4, as the browser prints it."""
    page = browser.new_page()
    page.goto((site / "theory" / "why_false_euler_works.html").as_uri())
    sheet = page.pdf(format="A4", margin=dict.fromkeys(("top", "bottom", "left", "right"), "12mm"))
    page.close()
    assert len(re.findall(rb"/Type\s*/Page\b", sheet)) == 1
