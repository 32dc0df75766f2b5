#!/usr/bin/env python3
"""controller.py [PORT]: go, slow or stop, at every sectors_t and at least ten times a second.

Needs no LCM library, only the message types: lcm-gen -p --ppath . /usr/share/groundline/lcmtypes/*.lcm
"""
import math
import socket
import sys
import time

from groundline import mask_t, sectors_t

OLDEST_S, STOPPING_M, AHEAD_RAD = 0.3, 1.0, 0.35
CHANNEL = b"GROUNDLINE_SECTORS\0"


def decide(newest):
    if newest is None or not abs(time.time() - 1e-6 * newest.utime) < OLDEST_S:
        return "stop: nothing new"
    if newest.verdict == mask_t.VERDICT_BLIND:
        return "stop: blind"
    ahead = [sector.free_range_m for sector in newest.sectors if abs(sector.bearing_rad) < AHEAD_RAD]
    if not min(ahead, default=math.nan) >= STOPPING_M:
        return "stop: no free ground"
    return "go" if newest.verdict == mask_t.VERDICT_TRUSTED else "slow"


link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
link.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
link.bind(("239.255.76.67", int(sys.argv[1]) if len(sys.argv) > 1 else 7667))
link.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton("239.255.76.67") + bytes(4))
link.settimeout(0.1)
newest = None
while True:
    try:
        datagram = link.recv(65536)  # LC02, a number of 4 bytes, the channel and a NUL, the message
        if datagram.startswith(b"LC02") and datagram.startswith(CHANNEL, 8):
            newest = sectors_t.decode(datagram[8 + len(CHANNEL):])
    except TimeoutError:
        pass
    print(decide(newest), flush=True)
