"""Takes the pictures of docs/howto/explorer.md and of README.md in Chromium: ``.venv/bin/python docs/explorer_picture.py``."""

from __future__ import annotations

import shutil
import tempfile
from io import BytesIO
from pathlib import Path

import stepwell as sw
from PIL import Image
from playwright.sync_api import sync_playwright

IMAGES = Path(__file__).resolve().parent / "images"

#: Of the pictures: the link, the milliseconds that the page plays for a trail, the window in pixels, how many colours are kept.
LINK, PLAYED, WINDOW, COLOURS = (
    "#scene=clover&play=1",
    6500,
    (1180, 1060),
    96,
)
#: Of README.md: down to below the curves, so that the picture is on the first screen.
TOP = 718


def main() -> None:
    """Make the page, play it on a light page and on a dark one, take the pictures."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as started:
        page = sw.explore().save(Path(folder) / "explorer.html")
        browser = started.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        for scheme in ("light", "dark"):
            shown = browser.new_page(
                viewport={"width": WINDOW[0], "height": WINDOW[1]}, color_scheme=scheme
            )
            shown.goto(page.as_uri() + LINK)
            shown.wait_for_timeout(PLAYED)
            whole = Image.open(BytesIO(shown.screenshot())).convert("RGB")
            few = whole.quantize(COLOURS, dither=Image.Dither.NONE).convert("RGB")
            few.crop((0, 0, WINDOW[0], TOP)).save(
                IMAGES / f"explorer-{scheme}.png", optimize=True
            )
            if scheme == "light":
                # What a link to the site becomes elsewhere: 1200 × 630 is the usual size.
                card = Image.new("RGB", (1200, 630), "#f4f6f8")
                card.paste(few.crop((0, 0, WINDOW[0], 630)), (10, 0))
                card.save(IMAGES.parent / "_static" / "card.png", optimize=True)
                few.save(IMAGES / "explorer.png", optimize=True)
        browser.close()


if __name__ == "__main__":
    main()
