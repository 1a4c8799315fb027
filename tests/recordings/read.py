"""Reads a recording as a laboratory would, with nothing of parfocal's, and prints what it finds as JSON.

usage: read.py RECORDING [CUBE.hdr FRAME]
"""

import json
import sys
import warnings

import numpy as np
import xarray as xr
import zarr

# What a library warns of today fails tomorrow.
warnings.simplefilter("error")

folder = sys.argv[1]
dataset = xr.open_zarr(folder)
mosaics = zarr.open_group(folder, mode="r")["mosaic"]
found = {
    "shape": mosaics.shape,
    "dimensions": list(dataset.mosaic.dims),
    "coordinates": sorted(dataset.coords),
    "wavelengths": dataset.wavelength.values.tolist(),
    "units": dataset.wavelength.attrs["units"],
    "lazily": dataset.mosaic.chunks is not None,
    "started": dataset.attrs["started"],
    "lost": dataset.attrs["frames_lost"],
}

if mosaics.shape[0] > 0:
    samples = mosaics[:]
    seconds = (dataset.time.values - dataset.time.values[0]) / np.timedelta64(1, "ns") / 1e9
    found |= {
        "first": samples[0, :2, :4].ravel().tolist(),
        "sums": samples.sum(axis=(1, 2), dtype="uint64").tolist(),
        "same": bool((dataset.mosaic.values == samples).all()),
        "numbers": dataset.frame_number.values.tolist(),
        "seconds": seconds.tolist(),
        "asked": dataset.focal_power_asked.values.tolist(),
        "patches": np.stack([dataset.patch_x, dataset.patch_y, dataset.patch_jumps], axis=-1).tolist(),
    }

if len(sys.argv) > 2:
    # Its own file handles are left to the garbage collector.
    warnings.simplefilter("ignore", ResourceWarning)
    import spectral

    image = spectral.open_image(sys.argv[2])
    mosaic = mosaics[int(sys.argv[3])]
    cells = zip(dataset.cell_row.values, dataset.cell_column.values)
    cube = np.stack([mosaic[row::4, column::4] for row, column in cells], axis=-1)
    found |= {
        "cube": image.shape,
        "centres": image.bands.centers,
        "widths": image.bands.bandwidths,
        "equal": bool((np.asarray(image.load()) == cube).all()),
    }

print(json.dumps(found))
