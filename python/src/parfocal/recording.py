"""Hyperspectral recordings as lazy xarray Datasets."""

from __future__ import annotations

import contextlib
import importlib.util
import itertools
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from .errors import BadRecording

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_CELL = 4
_BANDS = _CELL * _CELL
_FORMAT = "parfocal-recording"
_NEWEST_VERSION = 1

# A pixel whose span from dark to white is below this share of its band's mean span gets the band's.
_LEAST_SPAN = 0.1

# Without dask a computation over all frames is done at once; more than this would fill the memory.
_MOST_BYTES = 2 << 30


class Recording(xr.Dataset):  # type: ignore[no-untyped-call]
    """A recording: an `xarray.Dataset` whose methods also give reflectances, colours and cubes.

    ``mosaic`` has the dimensions frame, y and x. Times, focal powers and frame numbers are coordinates
    of ``frame``; ``wavelength`` is one of the sixteen bands. Slices such as
    ``recording.isel(frame=slice(0, 100))`` are recordings, too.
    """

    __slots__ = ()

    def cube(self, frame: int) -> xr.DataArray:
        """Return the raw counts of one frame as a cube: cell_y, cell_x, wavelength."""
        with self._reading():
            cube = self._cube(self._frame(frame)).astype(np.uint16)
        return cube.rename("counts").assign_attrs(units="count")

    def reflectance(self, frame: int | None = None) -> xr.DataArray:
        """Return reflectances, 0 for dark and 1 for the white reference: of one frame, or of all.

        The calibration in the recording is used: dark, white, and the spectral correction. Without a white
        reference, counts say nothing about reflectance, and `BadRecording` is raised. With dask
        (``pip install parfocal[lazy]``) all frames are computed only as they are used.
        """
        if not self["white"].attrs["measured"]:
            raise BadRecording(
                "The recording has no white reference, so its counts say nothing about reflectance. Use cube() for "
                "counts, or record again with a calibration of 'parfocal calibrate'."
            )
        with self._reading():
            balanced = self._balanced(frame)
        correction = self._correction()
        if not np.array_equal(correction, np.eye(_BANDS)):
            rows = xr.DataArray(correction, dims=["wavelength", "from_wavelength"])
            parts = balanced.rename(wavelength="from_wavelength").drop_vars("from_wavelength")
            balanced = xr.dot(parts, rows, dim="from_wavelength").assign_coords(wavelength=self["wavelength"])
            balanced = balanced.astype(np.float32)
        return balanced.rename("reflectance").assign_attrs(long_name="reflectance", units="1")

    def rgb(self, frame: int) -> npt.NDArray[np.uint8]:
        """Return one frame's picture in sRGB, one pixel a mosaic cell: height, width, 3."""
        weights = np.stack([self[colour].to_numpy() for colour in ("red", "green", "blue")], axis=-1)
        with self._reading():
            balanced = self._balanced(frame).to_numpy()
        linear = np.clip(balanced @ weights.astype(np.float32), 0.0, 1.0)
        encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        picture: npt.NDArray[np.uint8] = np.rint(255.0 * encoded).astype(np.uint8)
        return picture

    @contextlib.contextmanager
    def _reading(self) -> Iterator[None]:
        """Turn the errors of damaged files into one that names the recording."""
        try:
            yield
        except (OSError, RuntimeError, ValueError) as error:
            folder = self.encoding.get("source", "The recording")
            raise BadRecording(
                f"{folder} cannot be read: {str(error).rstrip('.')}. 'parfocal recording info' says which frames are "
                "damaged; copy the recording again, or leave them out."
            ) from error

    def _frame(self, frame: int) -> xr.DataArray:
        count = self.sizes["frame"]
        if count == 0:
            raise IndexError("The recording holds no frame.")
        if not -count <= frame < count:
            raise IndexError(f"The recording has the frames 0 to {count - 1}, and not frame {frame}.")
        return self["mosaic"].isel(frame=frame)

    def _cube(self, samples: xr.DataArray) -> xr.DataArray:
        """Return samples (…, y, x) as (…, cell_y, cell_x, wavelength)."""
        places = zip(self["cell_row"].to_numpy(), self["cell_column"].to_numpy(), strict=True)
        bands = [
            samples.isel(y=slice(row, None, _CELL), x=slice(column, None, _CELL)) for row, column in places
        ]
        cube = xr.concat(bands, dim=self["wavelength"], coords="minimal", compat="override", join="override")
        return cube.rename(y="cell_y", x="cell_x").transpose(..., "cell_y", "cell_x", "wavelength")

    def _balanced(self, frame: int | None) -> xr.DataArray:
        if frame is None:
            frames = self["mosaic"]
            if frames.chunks is None and frames.size * 8 > _MOST_BYTES:
                raise BadRecording(
                    f"Reflectances of {self.sizes['frame']} frames do not fit into memory at once. Install dask "
                    "(pip install 'parfocal[lazy]') to compute them as they are used, or choose frames with isel."
                )
        else:
            frames = self._frame(frame)
        dark, white = (
            self._cube(self[name]) if self[name].ndim == 2 else self[name] for name in ("dark", "white")
        )
        # A dead pixel, or one outside the bright circle, sees almost no white. As in the program, it gets the
        # mean span of its band.
        span = white - dark
        if span.ndim == 3:
            of_band = span.mean(["cell_y", "cell_x"])
            span = span.where(span > _LEAST_SPAN * of_band, of_band)
        balanced = (self._cube(frames) - dark) / span
        return balanced.astype(np.float32)

    def _correction(self) -> npt.NDArray[np.float64]:
        return self["spectral_correction"].to_numpy().astype(np.float64)


def open_recording(path: str | os.PathLike[str]) -> Recording:
    """Open a recording: a folder that ``parfocal recording record`` or the server wrote.

    Frames are read when they are used. One that was cut short opens with what was stored.
    """
    folder = Path(path)
    if not (folder / "zarr.json").is_file():
        if (folder / "view.json").is_file():
            raise BadRecording(
                f"{folder} is a recording of the view, not of mosaics: its pictures are in view.mjpeg, "
                "their times in view.csv."
            )
        raise BadRecording(
            f"{folder} is not a recording: it has no zarr.json. Name the recording's own folder."
        )
    lazily: Any = {} if importlib.util.find_spec("dask") else None
    try:
        dataset = xr.open_zarr(folder, chunks=lazily, consolidated=True)
    except Exception as error:
        raise BadRecording(
            f"{folder} cannot be opened: {error}. The copy may not be complete; "
            f"'parfocal recording info {folder}' says what is damaged."
        ) from error

    attributes = dataset.attrs
    if attributes.get("format") != _FORMAT:
        raise BadRecording(f"{folder} is a Zarr group, but not a recording that parfocal made.")
    version = attributes.get("version")
    if not isinstance(version, int) or version > _NEWEST_VERSION:
        raise BadRecording(
            f"{folder} was made by {attributes.get('software', 'another version')} in version {version} of the "
            f"layout; this package reads up to {_NEWEST_VERSION}. Update it: pip install --upgrade parfocal."
        )
    missing = {"mosaic", "wavelength", "cell_row", "cell_column", "red", "green", "blue"} - set(
        dataset.variables
    )
    if missing:
        raise BadRecording(f"{folder} lacks its array '{min(missing)}'. Copy the recording again.")

    _check_files(folder)
    dataset = _with_values(folder, dataset)
    arrays = {str(name): dataset[name].variable for name in dataset.data_vars}
    coordinates = {str(name): dataset[name].variable for name in dataset.coords}
    recording = Recording({**arrays, **_references(folder, dataset)}, coords=coordinates, attrs=attributes)
    recording.encoding["source"] = str(folder)
    return recording


def _check_files(folder: Path) -> None:
    """Refuse a recording that lacks a file. Zarr would give zeros for what was in it, without a word."""
    described = json.loads((folder / "zarr.json").read_text(encoding="utf-8"))
    for name, array in described["consolidated_metadata"]["metadata"].items():
        chunk = array["chunk_grid"]["configuration"]["chunk_shape"]
        counts = [-(-length // size) for length, size in zip(array["shape"], chunk, strict=True)]
        for place in itertools.product(*map(range, counts)):
            file = Path(name, "c", *map(str, place))
            if not (folder / file).is_file():
                others = "; if there is no other copy, 'parfocal recording cube' reads the other frames"
                raise BadRecording(
                    f"{folder} lacks its file {file}. Copy the recording again{others if name == 'mosaic' else ''}."
                )


def _with_values(folder: Path, dataset: xr.Dataset) -> xr.Dataset:
    """Read all but the mosaics now, so that damage is noticed here."""
    try:
        values = dataset.drop_vars("mosaic").load()
    except (OSError, RuntimeError, ValueError) as error:
        raise BadRecording(
            f"{folder} cannot be read: {str(error).rstrip('.')}. Copy the recording again; "
            f"'parfocal recording info {folder}' says what is damaged."
        ) from error
    return values.assign(mosaic=dataset["mosaic"])


def _references(folder: Path, dataset: xr.Dataset) -> dict[str, xr.Variable]:
    """Read dark, white and the spectral correction from the recording's own calibration."""
    file = folder / "calibration" / "calibration.toml"
    try:
        text = file.read_text(encoding="utf-8")
        if not text.strip():
            raise BadRecording(f"{file} is empty. Copy the recording again.")
        calibration = tomllib.loads(text)
        return _calibrated(file, calibration, dataset)
    except FileNotFoundError:
        raise BadRecording(f"{folder} lacks its calibration ({file}). Copy the recording again.") from None
    except (OSError, ValueError, TypeError, IndexError) as error:
        raise BadRecording(f"{file} cannot be read: {error}. Copy the recording again.") from error


def _calibrated(file: Path, calibration: dict[str, Any], dataset: xr.Dataset) -> dict[str, xr.Variable]:
    """Return the arrays of the calibration that was read from ``file``."""
    # The file counts bands as they are in the cell; the recording has them by wavelength.
    order = _CELL * dataset["cell_row"].to_numpy() + dataset["cell_column"].to_numpy()
    full = float((1 << int(calibration.get("bit_depth", 10))) - 1)
    size = (dataset.sizes["y"], dataset.sizes["x"])

    def reference(key: str, default: float) -> xr.Variable:
        value = calibration.get(key, default)
        if isinstance(value, str):
            return xr.Variable(("y", "x"), _picture(file.parent / value, size))
        counts = np.broadcast_to(np.asarray(value, dtype=np.float64), (_BANDS,))
        return xr.Variable(("wavelength",), counts[order])

    white = reference("white", full)
    # As the program sees it: full scale in every band stands for a white that nobody has measured.
    white.attrs["measured"] = white.ndim == 2 or bool((white != full).any())
    correction = np.asarray(calibration.get("spectral_correction", np.eye(_BANDS)), dtype=np.float64)
    return {
        "dark": reference("dark", 0.0),
        "white": white,
        "spectral_correction": xr.Variable(
            ("wavelength", "from_wavelength"), correction[np.ix_(order, order)]
        ),
    }


def _picture(path: Path, size: tuple[int, int]) -> npt.NDArray[np.float64]:
    """Read a reference of one count a pixel: a gray TIFF of 16 bit."""
    try:
        from PIL import Image
    except ImportError:
        raise BadRecording(
            f"The calibration's reference {path.name} is a picture; to read it: pip install 'parfocal[pictures]'."
        ) from None
    try:
        with Image.open(path) as picture:
            counts = np.asarray(picture, dtype=np.float64)
    except OSError as error:
        raise BadRecording(
            f"The reference {path} cannot be read: {error}. Copy the recording again."
        ) from error
    if counts.shape != size:
        raise BadRecording(f"The reference {path} has {counts.shape} samples, the recording {size}.")
    return counts
