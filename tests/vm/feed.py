#!/usr/bin/env python3
"""Plays pictures into v4l2loopback devices as cameras would: one stamp for all of them, taken at one instant.

feed.py --size 320x240 --format GREY --rate 4 /dev/video10=FOLDER /dev/video11=FOLDER
FOLDER holds PGM files for GREY and YUYV, JPEG files for MJPG; FOLDER+FOLDER puts two side by side. Prints a line once
the devices are set up.
"""
import argparse
import errno
import fcntl
import itertools
import mmap
import os
import pathlib
import struct
import time

S_FMT, REQBUFS, QUERYBUF, QBUF, STREAMON = 0xC0D05605, 0xC0145608, 0xC0585609, 0xC058560F, 0x40045612
OUTPUT, MMAP, NO_FIELDS = 2, 1, 1
BUFFER = "<5I4xqq16sIIQII4x"  # struct v4l2_buffer of 64-bit Linux
# As many as the driver was loaded with: the reader and we must agree, or the driver mixes them up.
BUFFERS = 4
REFUSED_AT_MOST_S = 10


def set_format(file, request):
    """Repeated while it is refused: a reader that just looks at the device, or lets go of it, holds its format."""
    end = time.monotonic() + REFUSED_AT_MOST_S
    while True:
        try:
            return fcntl.ioctl(file, S_FMT, bytearray(request))
        except OSError as refused:
            if refused.errno not in (errno.EINVAL, errno.EBUSY) or time.monotonic() > end:
                raise
        time.sleep(0.05)


class Device:
    def __init__(self, path, width, height, code, bytes_a_line, largest):
        self.file = os.open(path, os.O_RDWR)
        picture = struct.pack("<8I", width, height, struct.unpack("<I", code)[0], NO_FIELDS, bytes_a_line, largest, 8, 0)
        set_format(self.file, struct.pack("<I4x", OUTPUT) + picture.ljust(200, b"\0"))
        asked = bytearray(struct.pack("<5I", BUFFERS, OUTPUT, MMAP, 0, 0))
        fcntl.ioctl(self.file, REQBUFS, asked)
        self.maps = []
        for index in range(struct.unpack_from("<I", asked)[0]):
            buffer = bytearray(struct.pack(BUFFER, index, OUTPUT, 0, 0, 0, 0, 0, b"", 0, MMAP, 0, 0, 0))
            fcntl.ioctl(self.file, QUERYBUF, buffer)
            *_, offset, length, _ = struct.unpack(BUFFER, buffer)
            self.maps.append(mmap.mmap(self.file, length, offset=offset))
        fcntl.ioctl(self.file, STREAMON, struct.pack("<I", OUTPUT))
        self.turn = 0

    def give(self, payload, stamp_us):
        index = self.turn % len(self.maps)
        self.turn += 1
        self.maps[index][:len(payload)] = payload
        seconds, micros = divmod(stamp_us, 1_000_000)
        fcntl.ioctl(self.file, QBUF, bytearray(struct.pack(BUFFER, index, OUTPUT, len(payload), 0, NO_FIELDS, seconds,
                                                           micros, b"", 0, MMAP, 0, 0, 0)))


def pixels(file, width):
    """Rows of a PGM as frames.cpp writes it."""
    data = file.read_bytes()
    start = data.index(b"255\n") + 4
    return [data[at:at + width] for at in range(start, len(data), width)]


def payloads(folders, code, width):
    for files in zip(*(sorted(pathlib.Path(folder).iterdir()) for folder in folders)):
        if code == b"MJPG":
            yield files[0].read_bytes()
            continue
        rows = b"".join(itertools.chain(*zip(*(pixels(file, width) for file in files))))
        if code == b"YUYV":
            both = bytearray(b"\x80") * (2 * len(rows))
            both[0::2] = rows
            rows = bytes(both)
        yield rows


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--size", required=True)
    parser.add_argument("--format", required=True)
    parser.add_argument("--rate", type=float, required=True)
    parser.add_argument("--loop", action="store_true")
    parser.add_argument("--every", type=int, default=1, help="the last device gets one picture in so many")
    parser.add_argument("--late-ms", type=float, default=0, help="stamps of the last device are later by so much")
    parser.add_argument("feeds", nargs="+")
    wanted = parser.parse_args()
    width, height = map(int, wanted.size.split("x"))
    code = wanted.format.encode()
    feeds = []
    for feed in wanted.feeds:
        path, _, folders = feed.partition("=")
        frames = list(payloads(folders.split("+"), code, width))
        whole = width * len(folders.split("+"))
        line = {b"GREY": whole, b"YUYV": 2 * whole, b"MJPG": 0}[code]
        feeds.append((Device(path, whole, height, code, line, max(map(len, frames))), frames))
    print("feeding", flush=True)
    due = time.monotonic()
    count = len(feeds[0][1])
    for number in itertools.count() if wanted.loop else range(count):
        due += 1 / wanted.rate
        time.sleep(max(0.0, due - time.monotonic()))
        stamp_us = time.monotonic_ns() // 1000
        for device, frames in feeds:
            last = device is feeds[-1][0]
            if last and number % wanted.every:
                continue
            device.give(frames[number % count], stamp_us + (int(1000 * wanted.late_ms) if last else 0))
    time.sleep(3)  # a loopback device without a writer is none: let the reader take the last picture


main()
