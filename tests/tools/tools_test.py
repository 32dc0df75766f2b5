#!/usr/bin/env python3
"""Tests of the scripts beside this one, run as a user runs them."""
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest
import zipfile
import zlib

TOOLS = pathlib.Path(__file__).resolve().parent


def run(tool, *arguments):
    return subprocess.run([sys.executable, TOOLS / tool, *map(str, arguments)], capture_output=True, text=True,
                          check=False)


def npy(values, shape, kind="<f4"):
    header = f"{{'descr': '{kind}', 'fortran_order': False, 'shape': {shape}, }}".encode()
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header + struct.pack(f"<{len(values)}f", *values)


class Npz(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.npz = pathlib.Path(self.folder.name) / "truth.npz"
        self.png = pathlib.Path(self.folder.name) / "disp.png"

    def write(self, data):
        with zipfile.ZipFile(self.npz, "w") as archive:
            archive.writestr("arr_0.npy", data)

    def test_values(self):
        nan, inf = float("nan"), float("inf")
        self.write(npy([0.5, inf, nan, -1.0, 0.0, 300.0, 1 / 1024, 2.001953125], (2, 4)))
        self.assertEqual(run("npz_to_disparity_png.py", self.npz, self.png).returncode, 0)
        data = self.png.read_bytes()
        self.assertEqual(struct.unpack(">IIBB", data[16:26]), (4, 2, 16, 0))
        at = data.index(b"IDAT")
        length = struct.unpack(">I", data[at - 4:at])[0]
        rows = zlib.decompress(data[at + 4:at + 4 + length])
        self.assertEqual(struct.unpack(">x4Hx4H", rows), (128, 0, 0, 0, 0, 65535, 1, 513))

    def test_refusals(self):
        for data in (b"", b"\x93NUMPY\x01\x00", npy([1.0], (1, 1), "<f8"), npy([1.0], (1,)), npy([1.0], (2, 2))):
            self.write(data)
            done = run("npz_to_disparity_png.py", self.npz, self.png)
            self.assertEqual(done.returncode, 66, done.stderr)
            self.assertIn("truth.npz: ", done.stderr)
            self.assertNotIn("Traceback", done.stderr)
            self.assertFalse(self.png.exists())


class Summary(unittest.TestCase):
    def test_skips_are_grouped_by_reason(self):
        block = "{0}/3 Testing: t{0}\nOutput:\n{1}<end of output>\n{2}\n"
        skipped = "/x.cpp:3: Skipped\n{0}\n[  SKIPPED ] A\n"
        note = "Test Pass Reason:\nSkip regular expression found in output."
        with tempfile.NamedTemporaryFile("w", suffix=".log") as log:
            log.write(block.format(1, "fine\n", "Test Passed.") + block.format(2, skipped.format("no data"), note)
                      + block.format(3, skipped.format("no data"), note))
            log.flush()
            said = run("test_summary.py", log.name).stdout
        self.assertEqual(said, "3 tests, 2 of them skipped:\n     2 no data\n")


if __name__ == "__main__":
    unittest.main()
