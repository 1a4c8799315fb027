"""Makes films of still surfaces, to train on with `parfocal train --footage`: docs/notebook.md.

python3 tools/make_films.py --out DIR PHOTOGRAPH_OR_FOCAL_STACK...

Each film shows one surface, in focus everywhere, under a camera in a hand: it pans, turns, comes nearer, and the surface
is strained as tissue is. Light, softness, noise, glints and compression differ from film to film. Blur is left to the
training. A focal stack (a folder of pictures) first becomes one picture, each place from the plane where it is sharpest.
Every core makes films of another surface. Needs ffmpeg and numpy.
"""

from __future__ import annotations

import argparse
import contextlib
import shutil
import subprocess
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.floating]

WIDTH, HEIGHT, RATE = 640, 480, 25
#: Surfaces are reduced to this width.
WIDEST = 1000
SUFFIXES = {".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp"}


def read(file: Path) -> Picture:
    """Return a picture as gray levels, at most WIDEST pixels wide."""
    scale = f"scale='min({WIDEST},iw)':-2:flags=area,format=gray"
    command = ["ffmpeg", "-v", "error", "-i", f"file:{file}", "-frames:v", "1", "-vf", scale]
    command += ["-f", "image2pipe", "-c:v", "pgm", "-"]
    run = subprocess.run(command, capture_output=True)
    pgm = run.stdout
    if run.returncode != 0 or not pgm:
        complaint = run.stderr.decode(errors="replace").strip().splitlines() or ["it holds no picture"]
        raise SystemExit(f"cannot read {file}: {complaint[-1]}")
    width, height = (int(number) for number in pgm.split(maxsplit=3)[1:3])
    return np.frombuffer(pgm[-width * height :], np.uint8).reshape(height, width).astype(np.float32)


def blurred(picture: Picture, sigma: float) -> Picture:
    """Return a picture under a Gaussian, mirrored at its edges."""
    margin = int(4 * sigma) + 1
    wide = np.pad(picture, margin, mode="symmetric")
    down, along = np.fft.fftfreq(wide.shape[0])[:, None], np.fft.rfftfreq(wide.shape[1])[None, :]
    transfer = np.exp(-2 * (np.pi * sigma) ** 2 * (down**2 + along**2))
    soft = np.fft.irfft2(np.fft.rfft2(wide) * transfer, wide.shape)
    return soft[margin:-margin, margin:-margin].astype(np.float32)


def all_in_focus(folder: Path) -> Picture:
    """Return one picture of a focal stack: each place from the plane where it is sharpest."""
    # Hidden files are an operating system's, such as `._picture.jpg`.
    named = (file for file in folder.iterdir() if not file.name.startswith("."))
    files = sorted(file for file in named if file.suffix.lower() in SUFFIXES)
    if not files:
        raise SystemExit(f"{folder} holds no pictures")
    best = np.zeros(0, np.float32)
    sharpest = np.zeros(0, np.float32)
    for file in files:
        plane = read(file)
        smooth = np.pad(blurred(plane, 1.0), 1, mode="edge")
        middle = smooth[1:-1, 1:-1]
        laplacian = smooth[:-2, 1:-1] + smooth[2:, 1:-1] + smooth[1:-1, :-2] + smooth[1:-1, 2:] - 4 * middle
        energy = blurred(laplacian**2, 6.0)
        if not best.size:
            best, sharpest = plane, energy
            continue
        if plane.shape != best.shape:
            raise SystemExit(f"{file} differs in size from the other pictures of its stack")
        sharper = energy > sharpest
        best, sharpest = np.where(sharper, plane, best), np.maximum(energy, sharpest)
    return best


def looked_at(picture: Picture, x: Picture, y: Picture) -> Picture:
    """Return the levels at places between pixels, by linear interpolation; beyond its edges a picture is mirrored."""
    height, width = picture.shape

    def mirrored(place: Picture, size: int) -> Picture:
        period = np.float32(2 * (size - 1))
        turned: Picture = place - period * np.floor(place / period)
        return size - 1 - np.abs(turned - (size - 1))

    x, y = mirrored(x, width), mirrored(y, height)
    left, top = np.minimum(x.astype(np.int32), width - 2), np.minimum(y.astype(np.int32), height - 2)
    across, down = x - left.astype(np.float32), y - top.astype(np.float32)
    levels, first = picture.ravel(), top * width + left
    above = levels[first] * (1 - across) + levels[first + 1] * across
    below = levels[first + width] * (1 - across) + levels[first + width + 1] * across
    mixed: Picture = above * (1 - down) + below * down
    return mixed


def film(surface: Picture, file: Path, frames: int, seed: int) -> None:
    """Write a film of a surface; its camera and light are drawn from the seed."""
    random = np.random.default_rng(seed)
    height, width = surface.shape
    zoom = np.exp(random.uniform(np.log(0.6), np.log(1.8))) * max(1.0, 300 / min(height, width))
    speed = random.choice([0.3, 1.0, 2.5, 5.0])
    strain = random.choice([0.0, 0.0, 0.02, 0.05])
    phase, pace = random.uniform(0, 6.28, 4), random.uniform(0.02, 0.15, 4)
    wave = random.uniform(0.004, 0.02, 4)
    gamma, gain, fall = random.uniform(0.7, 1.4), random.uniform(0.6, 1.2), random.uniform(0.0, 0.5)
    softness, noise = random.choice([0.0, 0.0, 0.6, 1.0]), random.choice([0.0, 1.0, 2.5])
    glints = random.uniform([0, 0, 1], [WIDTH, HEIGHT, 4], (random.choice([0, 0, 10, 25]), 3))
    quality = int(random.integers(18, 32))

    light = (255 * gain * (np.clip(surface, 0, 255) / 255) ** gamma).astype(np.float32)
    light = np.clip(blurred(light, softness / zoom) if softness else light, 0, 255)
    x = np.arange(WIDTH, dtype=np.float32)[None, :] - WIDTH / 2
    y = np.arange(HEIGHT, dtype=np.float32)[:, None] - HEIGHT / 2
    shade = 1 - fall * (x**2 + y**2) / (WIDTH**2 / 4 + HEIGHT**2 / 4)
    is_glint = np.zeros((HEIGHT, WIDTH), bool)
    for left, top, radius in glints:
        is_glint |= (x + WIDTH / 2 - left) ** 2 + (y + HEIGHT / 2 - top) ** 2 < radius**2
    place, velocity = np.array([width, height]) * random.uniform(0.3, 0.7, 2), np.zeros(2)
    angle, turning, depth, nearing = random.uniform(0, 6.28), 0.0, 0.0, 0.0

    raw = ["-f", "rawvideo", "-pix_fmt", "gray", "-s", f"{WIDTH}x{HEIGHT}", "-r", str(RATE), "-i", "-"]
    # One thread, so that the same seed gives the same film on every machine.
    video = ["-c:v", "libx264", "-preset", "veryfast", "-threads", "1"]
    video += ["-crf", str(quality), "-pix_fmt", "yuv420p"]
    unfinished = file.with_name(f".{file.name}.partial")
    command = ["ffmpeg", "-y", "-v", "error", *raw, *video, "-f", "mp4", f"file:{unfinished}"]
    encoder = subprocess.Popen(command, stdin=subprocess.PIPE)
    assert encoder.stdin is not None
    for frame in range(frames):
        velocity = 0.94 * velocity + 0.06 * random.normal(0, 3 * speed, 2)
        if random.random() < 0.01:
            velocity = velocity + random.normal(0, 4 * speed, 2)
        turning = 0.95 * turning + 0.05 * random.normal(0, 0.012)
        nearing = 0.95 * nearing + 0.05 * random.normal(0, 0.01)
        place, angle = place + 0.7 * velocity, angle + turning
        depth = float(np.clip(depth + nearing, -0.25, 0.25))

        # How far the strain moves what is in a column, and what is in a row, to the right and down.
        swing = 0.3 * strain / wave
        right = swing[1] * np.sin(x * wave[1] + pace[1] * frame + phase[1])
        right_in_row = swing[0] * np.sin(y * wave[0] + pace[0] * frame + phase[0])
        down = swing[2] * np.sin(x * wave[2] + pace[2] * frame + phase[2])
        down_in_row = swing[3] * np.sin(y * wave[3] + pace[3] * frame + phase[3])

        # Each coordinate is a sum of what depends on the column and what depends on the row.
        scale = np.exp(depth) / zoom
        cosine, sine = scale * np.cos(angle), scale * np.sin(angle)
        across = (cosine * (x + right) - sine * down + place[0]).astype(np.float32)
        across_in_row = (cosine * right_in_row - sine * (y + down_in_row)).astype(np.float32)
        below = (sine * (x + right) + cosine * down + place[1]).astype(np.float32)
        below_in_row = (sine * right_in_row + cosine * (y + down_in_row)).astype(np.float32)

        picture = looked_at(light, across + across_in_row, below + below_in_row) * shade
        picture[is_glint] = 255
        if noise:
            picture += np.float32(noise) * random.standard_normal(picture.shape, np.float32)
        try:
            encoder.stdin.write(np.clip(np.rint(picture), 0, 255).astype(np.uint8).tobytes())
        except BrokenPipeError:
            # ffmpeg has ended early, and has said why.
            break

    with contextlib.suppress(BrokenPipeError):
        encoder.stdin.close()
    if encoder.wait() != 0:
        unfinished.unlink(missing_ok=True)
        raise SystemExit(f"ffmpeg could not write {file}")
    unfinished.replace(file)


def films(path: Path, first_seed: int, given: argparse.Namespace) -> None:
    """Write the films of one surface, a photograph or a focal stack."""
    surface = all_in_focus(path) if path.is_dir() else read(path)
    for number in range(given.each):
        film(surface, given.out / f"{path.stem}-{number}.mp4", given.frames, first_seed + number)


def whole(least: int) -> Callable[[str], int]:
    """Read a whole number of at least so much."""

    def read_number(text: str) -> int:
        if not text.isdecimal() or int(text) < least:
            raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of {least} or more")
        return int(text)

    return read_number


def main() -> None:
    """Make the films that the command line names."""
    parser = argparse.ArgumentParser(description="Make films of still surfaces, to train on.")
    parser.add_argument("--out", type=Path, required=True, help="folder of the films")
    parser.add_argument("--seed", type=whole(0), default=1, help="seed of the first film; the others follow")
    parser.add_argument("--frames", type=whole(1), default=160, help="frames of each film")
    parser.add_argument("--each", type=whole(1), default=2, help="films of each surface")
    parser.add_argument("surface", type=Path, nargs="+", help="photograph, or folder of a focal stack")
    given = parser.parse_args()
    if not shutil.which("ffmpeg"):
        raise SystemExit("films are made by ffmpeg, which is not installed: install Debian's package ffmpeg")

    stems = [path.stem for path in given.surface]
    for stem in stems:
        if stems.count(stem) > 1:
            raise SystemExit(f"two surfaces are named {stem}, and so would be their films: rename one")

    try:
        given.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SystemExit(f"cannot make the folder {given.out}: {error.strerror}") from error
    first_seeds = [given.seed + given.each * index for index in range(len(given.surface))]
    with ProcessPoolExecutor() as cores:
        # The list waits for the films, and raises what went wrong with one.
        list(cores.map(partial(films, given=given), given.surface, first_seeds))


if __name__ == "__main__":
    main()
