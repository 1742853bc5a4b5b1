"""The frames of an animation as a file: what stands still is drawn once, and a .gif has one palette of few colours."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, cast

import numpy as np

from ...base.streams import reader_is_gone
from ...errors import UnsupportedError
from .style import Figure

Pixels = np.ndarray[Any, np.dtype[np.uint8]]

#: The colours of a .gif, without that of pixels that stay as they are; fewer where it would be too large with these. Lines have
#: some shades at their edges.
COLOURS = (63, 15, 7)

#: So many frames, evenly spread, decide on the colours.
SAMPLES = 8

#: The most bytes of a .gif, and the least share of its frames that it then has.
MOST_BYTES, LEAST_SHARE = 1_400_000, 0.25

#: Bits of a red, green or blue by which colours are told apart.
BITS = 5


class Frames:
    """The frames of a figure, one for each saved state, of which only the ``animated`` artists are drawn anew.

    ``show`` shows a state on the figure; ``progress`` is called with the share that is done.
    """

    def __init__(
        self,
        figure: Figure,
        show: Callable[[int], None],
        states: Sequence[int],
        progress: Callable[[float], object] | None = None,
    ) -> None:
        self.figure, self.show, self.states, self.progress = figure, show, states, progress
        self.canvas = cast(Any, figure.canvas)
        self.artists = [each for each in figure.findobj() if each.get_animated()]
        self.canvas.draw()
        self.background = self.canvas.copy_from_bbox(figure.bbox)

    def frame(self, state: int) -> Pixels:
        """The pixels of a state, shape (height, width, 3)."""
        self.show(state)
        self.canvas.restore_region(self.background)
        for artist in sorted(self.artists, key=lambda each: each.get_zorder()):
            self.figure.draw_artist(artist)
        return np.array(self.canvas.buffer_rgba())[..., :3]

    def __iter__(self) -> Iterator[Pixels]:
        for i, state in enumerate(self.states):
            yield self.frame(state)
            if self.progress is not None:
                self.progress((i + 1) / len(self.states))


def write_gif(frames: Frames, path: Path, rate: float) -> None:
    """Write a .gif that repeats itself, of fewer frames where all would be more than ``MOST_BYTES``."""
    count = len(frames.states)
    some = np.linspace(0, count - 1, min(SAMPLES, count)).astype(int).tolist()
    samples = [frames.frame(frames.states[i]) for i in some]
    following = [frames.frame(frames.states[min(i + 1, count - 1)]) for i in some]
    for number in COLOURS:
        colours, place = _palette(samples, number)
        codes = [(place[_coarse(one)], place[_coarse(other)]) for one, other in zip(samples, following, strict=True)]
        size = count * float(np.mean([len(_gif([_image(after, colours, before)], number)) for before, after in codes]))
        if size <= MOST_BYTES:
            break
    else:
        # The fewer there are, the more changes from one to the next.
        fewer = max(2, round(max(0.75 * MOST_BYTES / size, LEAST_SHARE) * count))
        frames.states = [frames.states[i] for i in np.linspace(0, count - 1, fewer).round().astype(int).tolist()]
        rate *= fewer / count

    def images() -> Iterator[Any]:
        before = None
        for pixels in frames:
            codes = place[_coarse(pixels)]
            yield _image(codes, colours, before)
            before = codes

    path.write_bytes(_gif(images(), number, rate))


def _image(codes: Pixels, colours: Pixels, before: Pixels | None) -> Any:
    """A frame, in which pixels that are as before are transparent."""
    from PIL import Image

    image = Image.fromarray(codes if before is None else np.where(codes == before, np.uint8(len(colours)), codes), "P")
    image.putpalette(colours.tobytes() + bytes(3))
    return image


def _gif(images: Iterable[Any], colours: int, rate: float = 1.0) -> bytes:
    rest, written = iter(images), BytesIO()
    first = next(rest)
    options: dict[str, Any] = {"duration": round(1000.0 / rate), "loop": 0, "transparency": colours, "disposal": 1}
    first.save(written, format="gif", save_all=True, append_images=rest, optimize=False, **options)
    return written.getvalue()


def _coarse(pixels: Pixels) -> Any:
    """The colours as whole numbers of 3 × BITS bits."""
    red, green, blue = (pixels[..., i].astype(np.int32) >> (8 - BITS) for i in range(3))
    return (red << 2 * BITS) | (green << BITS) | blue


def _palette(samples: Sequence[Pixels], number: int) -> tuple[Pixels, Pixels]:
    """The colours of a palette of this size, and the place in it of each coarse colour."""
    from PIL import Image

    counts = np.bincount(np.concatenate([_coarse(each).ravel() for each in samples]), minlength=1 << 3 * BITS)
    every = np.arange(len(counts))
    parts = np.stack([(every >> shift) & ((1 << BITS) - 1) for shift in (2 * BITS, BITS, 0)], axis=-1)
    shades = (parts * 255 // ((1 << BITS) - 1)).astype(np.uint8)
    # By the root of how often they occur: a small dot keeps its colour beside a large ground.
    weighted = np.repeat(shades, np.ceil(np.sqrt(counts)).astype(int), axis=0)
    chosen = Image.fromarray(weighted[np.newaxis]).quantize(number, Image.Quantize.MEDIANCUT, kmeans=2)
    colours = np.zeros((number, 3), dtype=np.uint8)
    own = np.array(chosen.getpalette(), dtype=np.uint8).reshape(-1, 3)[:number]
    colours[: len(own)] = own
    colours[np.argmax(own.astype(int).sum(axis=1))] = 255  # the ground is white
    distance = ((shades[:, np.newaxis].astype(np.int32) - colours[np.newaxis, : len(own)]) ** 2).sum(axis=-1)
    return colours, distance.argmin(axis=1).astype(np.uint8)


def write_mp4(frames: Frames, path: Path, rate: float) -> None:
    """Write an .mp4 by the program ffmpeg."""
    from matplotlib.animation import FFMpegWriter

    height, width = frames.frame(frames.states[0]).shape[:2]
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{rate:.6g}", "-i", "-"]
    # The format has even sides only.
    target = ["-vf", "crop=trunc(iw/2)*2:trunc(ih/2)*2", "-vcodec", "h264", "-pix_fmt", "yuv420p", str(path)]
    program = [FFMpegWriter.bin_path(), "-y", "-loglevel", "error", *source, *target]
    with subprocess.Popen(program, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            for pixels in frames:
                process.stdin.write(np.ascontiguousarray(pixels).data)
            process.stdin.close()
        except BaseException as error:
            if not (isinstance(error, OSError) and reader_is_gone(error)):  # then ffmpeg says why
                process.kill()
                raise
        message = process.stderr.read().decode(errors="replace").strip()
    if process.returncode != 0:
        raise UnsupportedError(f"animate: ffmpeg wrote no {path}: {message}")
