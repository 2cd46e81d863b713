"""Animations: a picture of each stored step, one after the other."""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pbem.errors import ResultFileError
from pbem.results.page import Page
from pbem.results.plot_style import style

FRAMES_PER_SECOND = 2.0
# So many rows of pictures are enough to choose colours by.
MOST_ROWS = 8000


class Picture(Protocol):
    """Pictures of several steps, with the same limits."""

    def draw(self, step: int) -> Figure:
        """Of one stored step (its place in the file)."""


def check_movie(path: str | os.PathLike[str]) -> None:
    """Raises ResultFileError where a format cannot be written here."""
    if Path(path).suffix.lower() == ".mp4" and find_ffmpeg() is None:
        raise ResultFileError(str(path), "needs the program ffmpeg, which is not installed (on Debian and Ubuntu: "
                                         "apt-get install ffmpeg; or pip install imageio-ffmpeg); an animation that "
                                         "ends with .gif needs nothing else")


def find_ffmpeg() -> str | None:
    """The program ffmpeg, or the one that the package imageio-ffmpeg brings along; None where neither is installed."""
    found = shutil.which("ffmpeg")
    if found is None:
        try:
            found = str(importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe())
        except (ImportError, RuntimeError, OSError):  # RuntimeError: it has none for this machine
            return None
    return found


def animate(
    picture: Picture, steps: Sequence[int], path: str | os.PathLike[str], page: Page, rate: float = FRAMES_PER_SECOND
) -> None:
    """Write an animation, .gif or .mp4, with a frame for each of the steps; rate: of them in a second.

    Raises ResultFileError where it cannot be written.
    """
    check_movie(path)
    frames = [_render(picture, step, page) for step in steps]
    if Path(path).suffix.lower() == ".gif":
        _write_gif(frames, path, rate)
    else:
        _write_mp4(frames, path, rate)


def _render(picture: Picture, step: int, page: Page) -> NDArray[np.uint8]:
    """A frame (height, width, 3), both even, as video formats ask for."""
    with style(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="constrained_layout not applied")
        figure = picture.draw(step)
        figure.set_dpi(page.dpi)
        figure.canvas.draw()
        frame = np.asarray(figure.canvas.buffer_rgba())[:, :, :3]  # type: ignore[attr-defined]
    height, width = frame.shape[:2]
    return np.ascontiguousarray(frame[: height - height % 2, : width - width % 2])


def _write_gif(frames: Sequence[NDArray[np.uint8]], path: str | os.PathLike[str], rate: float) -> None:
    from PIL import Image  # a part of matplotlib's own needs

    # One table of colours, made of all frames, else colours would change between them, or lack in some.
    images = [Image.fromarray(frame) for frame in frames]
    table = Image.fromarray(np.concatenate(choose_samples(frames))).quantize(255)
    images = [image.quantize(palette=table, dither=Image.Dither.NONE) for image in images]
    images[0].save(path, format="GIF", save_all=True, append_images=images[1:], duration=round(1000 / rate), loop=0,
                   optimize=False)


def choose_samples(frames: Sequence[NDArray[np.uint8]]) -> list[NDArray[np.uint8]]:
    """Rows of all frames that have their colours: of many frames every second, third, ... row."""
    rows = sum(len(frame) for frame in frames)
    every = -(-rows // MOST_ROWS)
    return [frame[number % every :: every] for number, frame in enumerate(frames)]


def _write_mp4(frames: Sequence[NDArray[np.uint8]], path: str | os.PathLike[str], rate: float) -> None:
    height, width = frames[0].shape[:2]
    command = [
        find_ffmpeg() or "ffmpeg", "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s",
        f"{width}x{height}", "-r", f"{rate:g}", "-i", "-", "-pix_fmt", "yuv420p", "-r", "25", os.fspath(path),
    ]  # fmt: skip
    done = subprocess.run(command, input=b"".join(frame.tobytes() for frame in frames), capture_output=True)
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip()
        raise ResultFileError(str(path), f"could not be written by ffmpeg: {said}")
