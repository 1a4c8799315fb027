"""Makes the pictures in tests/vectors/pictures: one scene in many kinds of TIFF, as laboratories' programs write them.

usage: pip install numpy pillow tifffile imagecodecs; python3 tests/vectors/pictures.py
"""

import os
import struct

import numpy as np
import tifffile
from PIL import Image

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "pictures")
HEIGHT, WIDTH = 53, 71


def path(name):
    return os.path.join(FOLDER, name)


def write(name, array, **options):
    tifffile.imwrite(path(name), array, metadata=None, software=False, **options)


def one_bit(name, order):
    """Black and white; in fill order 2 the first pixel is the lowest bit of its byte."""
    data = np.packbits(gray > 128, axis=1, bitorder="big" if order == 1 else "little").tobytes()
    # Width, height, bits, no compression, black is zero, fill order, place, samples, rows per strip, bytes.
    tags = [(256, 4, WIDTH), (257, 4, HEIGHT), (258, 3, 1), (259, 3, 1), (262, 3, 1), (266, 3, order), (273, 4, 8)]
    tags += [(277, 3, 1), (278, 4, HEIGHT), (279, 4, len(data))]
    entry = lambda tag, kind, value: struct.pack("<HHII" if kind == 4 else "<HHIHxx", tag, kind, 1, value)
    directory = struct.pack("<H", len(tags)) + b"".join(entry(*tag) for tag in tags) + struct.pack("<I", 0)
    with open(path(name), "wb") as file:
        file.write(b"II*\0" + struct.pack("<I", 8 + len(data)) + data + directory)


os.makedirs(FOLDER, exist_ok=True)
rng = np.random.default_rng(8)
# Blocks of 3x2 pixels, so that it compresses; no side is a multiple of a tile's.
gray = np.kron(rng.integers(0, 255, (27, 24)), np.ones((2, 3)))[:HEIGHT, :WIDTH].astype("u1")
planes = np.stack([gray, gray // 2, 255 - gray])
colour = np.moveaxis(planes, 0, 2)
Image.fromarray(gray).save(path("gray.png"))
Image.fromarray(colour).save(path("colour.png"))
Image.fromarray(((gray > 128) * 255).astype("u1")).save(path("one-bit.png"))

# Should read as gray.png.
write("gray.big.tif", gray, bigtiff=True)
write("gray.tiles-lzw.tif", gray, tile=(16, 32), compression="lzw")
write("gray.tiles-deflate-predictor.tif", gray, tile=(16, 16), compression="zlib", predictor=True, byteorder=">")
write("gray.packbits.tif", gray, compression="packbits", rowsperstrip=7)
write("gray.white-is-zero.tif", 255 - gray, photometric="miniswhite")
transparent = np.dstack([gray, gray // 3])
write("gray.transparent.tif", transparent, photometric="minisblack", planarconfig="contig", extrasamples=["unassalpha"])
write("gray.sixteen-bit.tif", gray.astype("u2") * 257, compression="lzw", byteorder=">")
grays = (np.arange(256) * 257).astype("u2")
write("gray.palette.tif", gray, photometric="palette", colormap=np.stack([grays] * 3))
# A smaller copy follows the picture; it is no page.
with tifffile.TiffWriter(path("gray.thumbnail.tif")) as file:
    file.write(gray, metadata=None, software=False)
    file.write(gray[::4, ::4], subfiletype=1, metadata=None, software=False)
# To be turned by 90 degrees clockwise, and from right to left.
write("gray.turned.tif", np.rot90(gray), extratags=[(274, 3, 1, 6, True)])
write("gray.mirrored.tif", gray[:, ::-1], extratags=[(274, 3, 1, 2, True)])

# Should read as colour.png.
separate = {"photometric": "rgb", "planarconfig": "separate"}
write("colour.tiles-planes.tif", planes, tile=(32, 16), compression="zlib", **separate)
write("colour.tiles-planes-lzw.tif", planes, tile=(16, 16), compression="lzw", **separate)
write("colour.planes.tif", planes, byteorder=">", **separate)
write("colour.strips-predictor.tif", colour, photometric="rgb", compression="lzw", predictor=True, rowsperstrip=5)

# Should read as one-bit.png.
one_bit("one-bit.fill-order-1.tif", 1)
one_bit("one-bit.fill-order-2.tif", 2)

# 12 bit, packed: the samples times 16 and a little.
write("twelve-bit.tif", gray.astype("u2") * 16 + 9, bitspersample=12, photometric="minisblack")

# Stored as JPEG, with the tables of all strips beside them.
write("jpeg.tif", gray, compression="jpeg", photometric="minisblack", rowsperstrip=16)

# Cannot be read.
write("zstd.tif", gray, compression="zstd")

# Of several pages.
write("pages.tif", np.stack([gray] * 5), photometric="minisblack")
stack = np.stack([gray // (1 + step) for step in range(6)])
z = {"axes": "ZYX", "PhysicalSizeZ": 2.5, "PhysicalSizeZUnit": "µm"}
tifffile.imwrite(path("stack.ome.tif"), stack, metadata=z, software=False, ome=True)
tifffile.imwrite(path("stack.imagej.tif"), stack, imagej=True, metadata={"axes": "ZYX", "spacing": 0.5, "unit": "um"})
