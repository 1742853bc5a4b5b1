"""Takes the picture of docs/howto/explorer.md in Chromium: ``.venv/bin/python docs/explorer_picture.py``."""

from __future__ import annotations

import shutil
import tempfile
from io import BytesIO
from pathlib import Path

import stepwell as sw
from PIL import Image
from playwright.sync_api import sync_playwright

PICTURE = Path(__file__).resolve().parent / "images" / "explorer.png"

#: Of the picture: the link, the milliseconds that the page plays for a trail, the window in pixels, how many colours are kept.
LINK, PLAYED, WINDOW, COLOURS = (
    "#scene=clover&play=1",
    6500,
    (1180, 1060),
    96,
)


def main() -> None:
    """Make the page, play it, take the picture."""
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as started:
        page = sw.explore().save(Path(folder) / "explorer.html")
        browser = started.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox"]
        )
        shown = browser.new_page(
            viewport={"width": WINDOW[0], "height": WINDOW[1]}, color_scheme="light"
        )
        shown.goto(page.as_uri() + LINK)
        shown.wait_for_timeout(PLAYED)
        whole = Image.open(BytesIO(shown.screenshot())).convert("RGB")
        whole.quantize(COLOURS, dither=Image.Dither.NONE).convert("RGB").save(
            PICTURE, optimize=True
        )
        browser.close()


if __name__ == "__main__":
    main()
