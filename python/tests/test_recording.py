"""Recordings as lazy Datasets, against what the program itself makes of them."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import parfocal
from parfocal.program import find_program


def run(*arguments: str) -> None:
    subprocess.run([find_program(), *arguments], check=True, capture_output=True, stdin=subprocess.DEVNULL)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recordings")
    run("calibrate", "dark", "--camera", "phantom:dark", "--out", str(folder / "unit"))
    run("calibrate", "white", "--camera", "phantom:white", "--out", str(folder / "unit"))
    arguments = ["--seconds", "1", "--fps", "5", "--calibration", str(folder / "unit")]
    run("recording", "record", "--out", str(folder / "recording"), *arguments)
    return folder / "recording"


def test_wavelengths_times_and_focal_powers_are_coordinates(made: Path) -> None:
    recording = parfocal.open_recording(made)
    for name in ("time", "focal_power_asked", "focal_power_measured", "frame_number", "wavelength"):
        assert name in recording.coords
    assert recording["wavelength"].to_numpy()[0] == 460.1
    assert np.issubdtype(recording["time"].dtype, np.datetime64)
    part = recording.isel(frame=slice(0, 2))
    assert isinstance(part, parfocal.Recording)
    assert part.cube(1).shape == (272, 512, 16)


def test_a_cube_is_the_one_that_the_program_writes(made: Path, tmp_path: Path) -> None:
    run("recording", "cube", str(made), "--frame", "1", "--out", str(tmp_path / "cube.hdr"))
    data = next(path for path in tmp_path.iterdir() if path.suffix != ".hdr")
    # Band interleaved by line: row, band, column.
    expected = np.fromfile(data, "<u2").reshape(272, 16, 512).transpose(0, 2, 1)
    cube = parfocal.open_recording(made).cube(1)
    assert cube.dims == ("cell_y", "cell_x", "wavelength")
    assert (cube.to_numpy() == expected).all()


def test_reflectances_are_between_dark_and_white(made: Path) -> None:
    recording = parfocal.open_recording(made)
    reflectance = recording.reflectance(0)
    # By hand, for one sample.
    band = 5
    row, column = int(recording["cell_row"][band]), int(recording["cell_column"][band])
    y, x = 4 * 100 + row, 4 * 200 + column
    dark, white = float(recording["dark"][y, x]), float(recording["white"][y, x])
    expected = (float(recording["mosaic"][0, y, x]) - dark) / (white - dark)
    assert float(reflectance[100, 200, band]) == pytest.approx(expected, abs=1e-6)
    assert reflectance.sel(wavelength=550, method="nearest").shape == (272, 512)
    assert recording.reflectance().shape == (recording.sizes["frame"], 272, 512, 16)


def test_colours_are_those_of_the_program(made: Path, tmp_path: Path) -> None:
    run("recording", "video", str(made), "--out", str(tmp_path / "pictures"))
    first = min((tmp_path / "pictures").glob("*.png"))
    with Image.open(first) as picture:
        expected = np.asarray(picture.convert("RGB")).astype(int)
    recording = parfocal.open_recording(made)
    apart = np.abs(recording.rgb(0).astype(int) - expected)
    # The program computes in whole numbers, and cuts what is several times as bright as white.
    below_white = (recording.reflectance(0) <= 1).all("wavelength").to_numpy()
    assert below_white.mean() > 0.5
    assert apart[below_white].max() <= 3
    assert apart.mean() < 0.6


def test_without_a_white_reference_there_are_counts_and_colours_but_no_reflectances(
    made: Path, tmp_path: Path
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(made, copy)
    toml = copy / "calibration" / "calibration.toml"
    lines = [line for line in toml.read_text().splitlines() if not line.startswith("white = ")]
    toml.write_text("\n".join(lines))
    recording = parfocal.open_recording(copy)
    assert recording.cube(0).shape == (272, 512, 16)
    assert recording.rgb(0).shape == (272, 512, 3)
    for frame in (0, None):
        with pytest.raises(parfocal.BadRecording, match=r"no white reference.*Use cube"):
            recording.isel(frame=slice(0, 1)).reflectance(frame)


def test_a_frame_that_is_not_there_is_named(made: Path) -> None:
    recording = parfocal.open_recording(made)
    with pytest.raises(IndexError, match=r"has the frames 0 to \d+, and not frame 900"):
        recording.cube(900)
    with pytest.raises(IndexError, match=r"holds no frame"):
        recording.isel(frame=slice(0, 0)).cube(0)


def change(folder: Path, **attributes: object) -> None:
    described = json.loads((folder / "zarr.json").read_text())
    described["attributes"] |= attributes
    (folder / "zarr.json").write_text(json.dumps(described))


def test_what_cannot_be_opened_is_refused_with_a_sentence(made: Path, tmp_path: Path) -> None:
    with pytest.raises(parfocal.BadRecording, match=r"it has no zarr.json"):
        parfocal.open_recording(tmp_path)
    copy = tmp_path / "copy"
    shutil.copytree(made, copy)

    change(copy, version=7, software="parfocal 4.0.0")
    with pytest.raises(
        parfocal.BadRecording, match=r"made by parfocal 4.0.0 in version 7.*pip install --upgrade"
    ):
        parfocal.open_recording(copy)
    change(copy, version=1, format="something")
    with pytest.raises(parfocal.BadRecording, match=r"not a recording that parfocal made"):
        parfocal.open_recording(copy)
    change(copy, format="parfocal-recording")
    for damaged in (b"\xff\xfe", b"dark = [1, 2]", b"bit_depth = 'ten'", b"spectral_correction = [[1]]"):
        (copy / "calibration" / "calibration.toml").write_bytes(damaged)
        with pytest.raises(parfocal.BadRecording, match=r"calibration.toml cannot be read"):
            parfocal.open_recording(copy)
    shutil.rmtree(copy / "calibration")
    with pytest.raises(parfocal.BadRecording, match=r"lacks its calibration"):
        parfocal.open_recording(copy)
    (copy / "zarr.json").write_text("{")
    with pytest.raises(parfocal.BadRecording, match=r"cannot be opened.*recording info"):
        parfocal.open_recording(copy)


def flip(file: Path, at: int) -> None:
    content = bytearray(file.read_bytes())
    content[at] ^= 0x10
    file.write_bytes(content)


@pytest.mark.parametrize("name", ["mosaic/c/0/0/0", "cell_row/c/0", "focal_power_asked/c/0"])
def test_a_file_that_was_not_copied_is_named_and_not_read_as_zeros(
    made: Path, tmp_path: Path, name: str
) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(made, copy)
    (copy / name).unlink()
    with pytest.raises(parfocal.BadRecording, match=f"copy lacks its file {name}"):
        parfocal.open_recording(copy)


def test_damage_is_told_with_the_recordings_folder(made: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(made, copy)
    flip(copy / "mosaic" / "c" / "0" / "0" / "0", -1)  # The checksum of the places of all frames.
    recording = parfocal.open_recording(copy)
    with pytest.raises(parfocal.BadRecording, match=r"copy cannot be read.*recording info"):
        recording.isel(frame=slice(0, 2)).rgb(1)

    flip(copy / "red" / "c" / "0", 3)
    with pytest.raises(parfocal.BadRecording, match=r"copy cannot be read.*recording info"):
        parfocal.open_recording(copy)
    flip(copy / "red" / "c" / "0", 3)

    (copy / "calibration" / "calibration.toml").write_text("")
    with pytest.raises(parfocal.BadRecording, match=r"calibration.toml is empty"):
        parfocal.open_recording(copy)
