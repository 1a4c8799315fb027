"""The films of still surfaces that a training may use."""

from __future__ import annotations

import resource
import subprocess
import sys
from pathlib import Path

import numpy as np

TOOL = Path(__file__).parents[1] / "tools/make_films.py"


def write(file: Path, picture: np.ndarray) -> None:
    """Write gray levels as a PNG."""
    height, width = picture.shape
    raw = ["-f", "rawvideo", "-pix_fmt", "gray", "-s", f"{width}x{height}", "-i", "-"]
    command = ["ffmpeg", "-v", "error", *raw, "-frames:v", "1", str(file)]
    subprocess.run(command, check=True, input=picture.astype(np.uint8).tobytes())


def frames(file: Path) -> np.ndarray:
    """Return the gray levels of all frames."""
    raw = ["-f", "rawvideo", "-pix_fmt", "gray", "-"]
    output = subprocess.run(["ffmpeg", "-v", "error", "-i", str(file), *raw], check=True, capture_output=True)
    return np.frombuffer(output.stdout, np.uint8).reshape(-1, 480, 640)


def make(out: Path, *arguments: str) -> None:
    """Run the tool."""
    subprocess.run(
        [sys.executable, "-s", str(TOOL), "--out", str(out), "--frames", "3", *arguments], check=True
    )


def test_a_stack_becomes_films_that_are_in_focus_everywhere(tmp_path: Path) -> None:
    """Left and right are sharp in another plane each; in the films both are as sharp as in the true picture."""
    random = np.random.default_rng(1)
    sharp = np.kron(random.integers(20, 236, (60, 80)), np.ones((4, 4)))
    soft = np.full_like(sharp, sharp.mean())
    left = np.arange(320) < 160
    stack = tmp_path / "scene"
    stack.mkdir()
    write(stack / "00.png", np.where(left, sharp, soft))
    write(stack / "01.png", np.where(left, soft, sharp))
    write(tmp_path / "true.png", sharp)

    make(tmp_path / "films", "--seed", "5", "--each", "1", str(stack))
    make(tmp_path / "again", "--seed", "5", "--each", "1", str(tmp_path / "true.png"))
    of_stack, of_truth = frames(tmp_path / "films/scene-0.mp4"), frames(tmp_path / "again/true-0.mp4")
    assert of_stack.shape == of_truth.shape == (3, 480, 640)
    spread = of_truth.std()
    assert spread > 20
    # They differ only where the planes meet.
    differs = np.abs(of_stack.astype(float) - of_truth) > spread
    assert differs.mean() < 0.1


def test_a_seed_gives_the_same_film_again_and_another_one_does_not(tmp_path: Path) -> None:
    """Films can be made again."""
    write(tmp_path / "surface.png", np.random.default_rng(2).integers(0, 256, (200, 300)))
    for folder, seed in [("one", "1"), ("two", "1"), ("three", "2")]:
        make(tmp_path / folder, "--seed", seed, str(tmp_path / "surface.png"))
    first = (tmp_path / "one/surface-0.mp4").read_bytes()
    assert first == (tmp_path / "two/surface-0.mp4").read_bytes()
    assert first != (tmp_path / "three/surface-0.mp4").read_bytes()
    assert first != (tmp_path / "one/surface-1.mp4").read_bytes()


def test_what_cannot_be_read_is_named(tmp_path: Path) -> None:
    """A wrong name gets a sentence, not a traceback."""
    (tmp_path / "empty").mkdir()
    (tmp_path / "note.png").write_text("no picture")
    for wrong, said in [
        ("gone.jpg", "cannot read "),
        ("note.png", "cannot read "),
        ("empty", "holds no pictures"),
    ]:
        command = [sys.executable, "-s", str(TOOL), "--out", str(tmp_path / "films"), str(tmp_path / wrong)]
        run = subprocess.run(command, capture_output=True, text=True)
        assert run.returncode == 1
        assert wrong in run.stderr
        assert said in run.stderr
        assert "Traceback" not in run.stderr


def test_a_film_that_does_not_fit_onto_the_disk_is_named_and_not_left(tmp_path: Path) -> None:
    """A part of a film would be taken for one."""
    write(tmp_path / "surface.png", np.random.default_rng(2).integers(0, 256, (200, 300)))
    command = [sys.executable, "-s", str(TOOL), "--out", str(tmp_path / "films"), "--each", "1"]
    run = subprocess.run(
        [*command, str(tmp_path / "surface.png")],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)),
    )
    assert run.returncode == 1
    assert f"ffmpeg could not write {tmp_path / 'films/surface-0.mp4'}" in run.stderr
    assert "Traceback" not in run.stderr
    assert list((tmp_path / "films").iterdir()) == []


def test_files_of_an_operating_system_are_no_planes(tmp_path: Path) -> None:
    """Such as those that macOS puts beside pictures."""
    stack = tmp_path / "scene"
    stack.mkdir()
    write(stack / "00.png", np.random.default_rng(2).integers(0, 256, (200, 300)))
    (stack / "._00.png").write_text("no picture")
    make(tmp_path / "films", "--each", "1", str(stack))
    assert (tmp_path / "films/scene-0.mp4").is_file()


def test_two_surfaces_of_one_name_are_refused(tmp_path: Path) -> None:
    """Their films would be the same files."""
    command = [
        sys.executable,
        "-s",
        str(TOOL),
        "--out",
        str(tmp_path / "films"),
        "one/scene.png",
        "two/scene.jpg",
    ]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 1
    assert "two surfaces are named scene" in run.stderr
