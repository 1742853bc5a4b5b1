"""Animations of a run: a page, or a file of frames."""

from __future__ import annotations

from pathlib import Path

from . import page_animation, runs_animation
from .runs import RunPicture


def animate(picture: RunPicture, path: str | Path, seconds: float, fps: float) -> None:
    """Write a page or frames, by the ending of the path."""
    seconds, fps = runs_animation.need(path, seconds, fps)
    write = page_animation.write if Path(path).suffix.lower() == ".html" else runs_animation.write
    write(picture, path, seconds, fps)
