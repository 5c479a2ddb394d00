"""Films from pictures: GIF through Pillow, MP4 through ffmpeg."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lme.errors import InputError
from lme.requirements import install
from runners.records.atomic_write import replacing

if TYPE_CHECKING:
    from PIL import Image

Picture = NDArray[np.uint8]  # (height, width, 3)

GIF, MP4 = "gif", "mp4"
COLOURS = 200  # in the palette of a GIF, at most
APART = 12  # least difference between two of them in some channel, of 0 to 255
QUALITY = "23"  # of x264: the encoder's own default; lower is better and larger


def write_film(pictures: Iterable[Picture], path: Path, fps: float, sample: Sequence[Picture]) -> None:
    """Save pictures of one size as GIF or MP4, by the suffix of `path`. A failure leaves no partial file.

    fps: [1/s]. sample: pictures from which the colours of a GIF are chosen. Raises InputError if ffmpeg is missing or
    fails.
    """
    with replacing(path) as draft:
        if path.suffix == f".{GIF}":
            _write_gif(pictures, draft, fps, sample)
        else:
            _write_mp4(pictures, draft, fps)


def find_ffmpeg() -> str:
    """Return the path of ffmpeg: from PATH, else from imageio-ffmpeg. Raises InputError if there is neither."""
    executable = shutil.which("ffmpeg")
    if executable is not None:
        return executable
    try:
        from imageio_ffmpeg import get_ffmpeg_exe

        return str(get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        raise InputError(
            "figure.format is mp4: needs ffmpeg, which is not on the PATH: install it, or "
            f"{install('imageio-ffmpeg')}, or choose figure.format=gif"
        ) from None


def _write_gif(pictures: Iterable[Picture], path: Path, fps: float, sample: Sequence[Picture]) -> None:
    """Write a GIF with one palette for all frames, so that each stores only its differences from the previous one."""
    from PIL import Image

    palette = _palette(np.vstack(sample))

    def quantized() -> Iterator[Image.Image]:
        for picture in pictures:
            yield Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)

    frames = quantized()
    image = next(frames)
    hundredths = max(round(100.0 / fps), 2)  # [0.01 s], the unit of a GIF; browsers ignore less than 2
    image.save(path, save_all=True, append_images=frames, duration=10 * hundredths, loop=0, optimize=False)


def _palette(picture: Picture) -> Image.Image:
    """Return the most frequent clearly different colours: Pillow's fast quantizer confuses similar ones."""
    from PIL import Image

    colours, counts = np.unique(picture.reshape(-1, 3), axis=0, return_counts=True)
    # Take the most frequent colour that is left, and drop those near to it.
    remaining = colours[np.argsort(-counts, kind="stable")].astype(int)
    palette_colours: list[NDArray[np.int_]] = []
    while len(remaining) and len(palette_colours) < COLOURS:
        palette_colours.append(remaining[0])
        remaining = remaining[np.abs(remaining - remaining[0]).max(axis=1) >= APART]
    palette = Image.new("P", (1, 1))
    palette.putpalette(np.ravel(palette_colours).tolist())
    return palette


def _write_mp4(pictures: Iterable[Picture], path: Path, fps: float) -> None:
    """Pipe raw frames to ffmpeg, which pads the sides to even lengths, as yuv420p requires."""
    frames = iter(pictures)
    image = next(frames)
    height, width = image.shape[:2]
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps:g}", "-i", "-"]
    mp4 = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-c:v", "libx264", "-crf", QUALITY]
    mp4 += ["-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    command = [find_ffmpeg(), "-y", "-loglevel", "error", *raw, *mp4, str(path)]
    # Send one frame after the other; if ffmpeg fails, the last line of its output is the reason.
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as encoder:
        assert encoder.stdin is not None
        assert encoder.stderr is not None
        with contextlib.suppress(BrokenPipeError):  # ffmpeg gives the reason on standard error
            for picture in chain([image], frames):
                encoder.stdin.write(picture.tobytes())
        with contextlib.suppress(BrokenPipeError):
            encoder.stdin.close()
        error = encoder.stderr.read().decode(errors="replace").strip()
    if encoder.returncode != 0:
        reason = error.splitlines()[-1] if error else f"exit status {encoder.returncode}"
        raise InputError(f"figure.format is mp4: {command[0]} failed ({reason}); choose figure.format=gif")
