"""Spectra from a cube that `recording cube` wrote, by Spectral Python and NumPy alone, as JSON.

usage: spectrum.py CUBE.hdr X Y RADIUS DARK WHITE

X, Y and RADIUS are samples of the mosaic, of which a cell has 4x4; DARK and WHITE are counts.
"""

import json
import sys
import warnings

import numpy as np

warnings.simplefilter("ignore", ResourceWarning)
import spectral  # noqa: E402

image = spectral.open_image(sys.argv[1])
x, y, radius, dark, white = map(float, sys.argv[2:])
cube = np.asarray(image.load(), dtype=np.float64)

rows, columns = np.mgrid[: cube.shape[0], : cube.shape[1]]
near = np.hypot(4 * columns + 2 - x, 4 * rows + 2 - y) <= radius
chosen = cube[near]
reflectance = (chosen - dark) / (white - dark)
print(
    json.dumps(
        {
            "wavelengths": image.bands.centers,
            "cells": int(near.sum()),
            "counts": chosen.mean(axis=0).tolist(),
            "counts_spread": chosen.std(axis=0).tolist(),
            "reflectance": reflectance.mean(axis=0).tolist(),
            "reflectance_spread": reflectance.std(axis=0).tolist(),
        }
    )
)
