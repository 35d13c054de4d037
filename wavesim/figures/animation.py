"""The pulse on its way: one field in the bar, frame by frame, as a GIF or an MP4."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from wavesim.figures.style import FOUND, GAP, STYLE, as_written, symbol
from wavesim.material.family import is_macro
from wavesim.simulation.field import Field

_SIZE, _DPI = (8.0, 3.2), 100  # whole, even numbers of pixels, which encoders need
_COLOURS = 48


class AnimationError(RuntimeError):
    """An animation can't be made; the message says why and what to do."""


def field_of(field: Field, name: str | None) -> str:
    """The field to show: the one asked for, else the first macro-field there is.

    Raises:
        AnimationError: it is none of this run.
    """
    if name is None:
        return next((n for n in field.names if is_macro(n)), field.names[0])
    if name not in field.names:
        raise AnimationError(f"--field {name}: must be one of {', '.join(field.names)}")
    return name


def animate(
    path: Path,
    field: Field,
    name: str,
    frames: int,
    rate: int,
    tell: Callable[[int, int], None] = lambda done, of: None,
) -> None:
    """Write an animation of a field.

    Args:
        path: of the file, .gif or .mp4.
        field: of a run.
        name: of the field shown.
        frames: how many, spread over the run.
        rate: frames a second.
        tell: called with the frames done, and all there are.

    Raises:
        AnimationError: MP4 is asked for and there is no ffmpeg, or it fails.
    """
    write = _write_mp4 if path.suffix.lower() == ".mp4" else _write_gif
    with matplotlib.rc_context(STYLE):
        write(path, _images(field, name, frames, tell), rate)


def _images(
    field: Field, name: str, frames: int, tell: Callable[[int, int], None]
) -> Iterator[np.ndarray]:
    """Pictures (height, width, 3); what does not move is drawn once."""
    chosen = np.unique(np.linspace(0, len(field.t) - 1, min(frames, len(field.t))).round())
    x = field.positions(name) * 1e3
    top = max(float(np.abs(field.part(name, slice(int(n), int(n) + 1))).max()) for n in chosen)
    figure = Figure(figsize=_SIZE, dpi=_DPI)
    axes = figure.subplots()
    bar = field.bar
    for low, high in ((0.0, bar.clear[0]), (bar.clear[1], bar.length)):
        if high > low:
            axes.axvspan(low * 1e3, high * 1e3, **GAP)
    for edge in field.layers.interfaces:
        axes.axvline(edge * 1e3, color="#55606b", lw=0.6, ls="--")
    for label, position in list(field.receivers.items())[:24]:
        axes.axvline(position * 1e3, color="#2f6f9f", lw=0.7, ls=":")
        axes.text(position * 1e3, 1.01, as_written(label), fontsize=7, ha="center", va="bottom",
                  color="#2f6f9f", transform=axes.get_xaxis_transform())  # fmt: skip
    reach = 1.08 * (top or 1.0)
    axes.set(
        xlim=(0, bar.length * 1e3), ylim=(-reach, reach), xlabel="x (mm)",
        ylabel=f"{symbol(name)} ({field.unit(name)})",
    )  # fmt: skip
    axes.yaxis.get_offset_text().set_x(-0.09)  # clear of the first receiver's name
    (line,) = axes.plot(x, np.zeros(len(x)), color=FOUND, lw=1.1)
    clock = axes.text(0.99, 0.96, "", ha="right", va="top", transform=axes.transAxes)
    canvas = FigureCanvasAgg(figure)
    for moving in (line, clock):
        moving.set_animated(True)
    canvas.draw()
    still = canvas.copy_from_bbox(figure.bbox)
    for count, number in enumerate(chosen, start=1):
        canvas.restore_region(still)
        line.set_ydata(field.part(name, slice(int(number), int(number) + 1))[0])
        clock.set_text(f"t = {field.t[int(number)] * 1e6:.4g} µs")
        for moving in (line, clock):
            axes.draw_artist(moving)
        yield np.asarray(canvas.buffer_rgba())[..., :3].copy()
        tell(count, len(chosen))


def _write_gif(path: Path, images: Iterator[np.ndarray], rate: int) -> None:
    palette: Image.Image | None = None
    pictures = []
    for image in images:
        picture = Image.fromarray(image)
        if palette is None:
            palette = picture.quantize(_COLOURS)
        pictures.append(picture.quantize(palette=palette, dither=Image.Dither.NONE))
    first, *rest = pictures
    first.save(path, save_all=True, append_images=rest, duration=1000 / rate, loop=0)


def _ffmpeg() -> str:
    """The encoder: that of this machine, else the one that comes with imageio-ffmpeg."""
    program = shutil.which("ffmpeg")
    if program is not None:
        return program
    try:
        import imageio_ffmpeg

        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise AnimationError(
            "--format mp4: needs ffmpeg, which is not here; pip install 'wavesim[movies]' brings "
            "it, or take gif"
        ) from None


def _write_mp4(path: Path, images: Iterator[np.ndarray], rate: int) -> None:
    program = _ffmpeg()
    width, height = (round(side * _DPI) for side in _SIZE)
    asked = [
        program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s",
        f"{width}x{height}", "-r", str(rate), "-i", "-", "-pix_fmt", "yuv420p", str(path),
    ]  # fmt: skip
    with subprocess.Popen(asked, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            for image in images:
                process.stdin.write(image.tobytes())
            process.stdin.close()
        except BrokenPipeError:
            pass
        told = process.stderr.read().decode(errors="replace").strip()
    if process.returncode:
        raise AnimationError(f"{path}: ffmpeg failed: {told.splitlines()[-1] if told else ''}")
