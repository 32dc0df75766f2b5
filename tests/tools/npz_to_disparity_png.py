#!/usr/bin/env python3
"""Turn a disparity array in an .npz file into the project's truth format, with the standard library alone.

npz_to_disparity_png.py TRUTH.npz DISP.png

The array must hold float32 in C order, two-dimensional. The picture has 16 bits: disparity x 256, 0 = no truth
(NaN, infinite, not positive). Valid values are held within 1..65535.
"""
import array
import ast
import math
import os
import struct
import sys
import zipfile
import zlib


def read_npy(data):
    """Returns (width, height, float32 array) of a .npy file (numpy's format 1.0 to 3.0)."""
    if data[:6] != b"\x93NUMPY":
        raise ValueError("not a .npy file")
    length_bytes = 2 if data[6] == 1 else 4
    header_end = 8 + length_bytes + int.from_bytes(data[8:8 + length_bytes], "little")
    header = ast.literal_eval(data[8 + length_bytes:header_end].decode("latin-1"))
    if header["descr"] != "<f4" or header["fortran_order"] or len(header["shape"]) != 2:
        raise ValueError(f"expected a two-dimensional float32 array in C order, found {header}")
    height, width = header["shape"]
    values = array.array("f")
    values.frombytes(data[header_end:])
    if sys.byteorder == "big":
        values.byteswap()
    if len(values) != width * height:
        raise ValueError(f"expected {width * height} values, found {len(values)}")
    return width, height, values


def stored(disparity):
    if not math.isfinite(disparity) or disparity <= 0.0:
        return 0
    return min(65535, max(1, math.floor(disparity * 256.0 + 0.5)))


def png16(width, height, values):
    """A 16-bit grey PNG of `values`, row by row."""
    pixels = array.array("H", values)
    if sys.byteorder == "little":
        pixels.byteswap()
    raw = pixels.tobytes()
    rows = b"".join(b"\0" + raw[2 * width * y:2 * width * (y + 1)] for y in range(height))

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, 0, 0, 0, 0))
            + chunk(b"IDAT", zlib.compress(rows, 6)) + chunk(b"IEND", b""))


def main():
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        with zipfile.ZipFile(sys.argv[1]) as archive:
            width, height, values = read_npy(archive.read(archive.namelist()[0]))
    except (OSError, ValueError, SyntaxError, KeyError, IndexError, zipfile.BadZipFile) as problem:
        print(f"{sys.argv[1]}: {problem}", file=sys.stderr)
        return 66
    temporary = sys.argv[2] + ".part"
    with open(temporary, "wb") as file:
        file.write(png16(width, height, [stored(value) for value in values]))
    os.replace(temporary, sys.argv[2])
    return 0


if __name__ == "__main__":
    sys.exit(main())
