"""A policy that believes what a file says: a focal power from 0 to 1, or nothing. It leaves the lens where it is."""

import mmap
import os
import socket
import struct
import sys

ANSWER = "<4sHHQddII"
VALUES = 41

channel = socket.socket(fileno=int(os.environ["PARFOCAL_POLICY_SOCKET"]))
memory = mmap.mmap(int(os.environ["PARFOCAL_POLICY_MEMORY"]), 32768, mmap.MAP_SHARED)
channel.send(struct.pack(ANSWER, b"PFPO", 1, 1, 0, 0.0, float("nan"), 1, 0))
while question := channel.recv(64):
    _, _, kind, sequence = struct.unpack_from("<4sHHQ", question)
    if kind == 2:
        continue
    with open(sys.argv[1]) as file:
        place = file.read().strip()
    belief = [1 / VALUES] * VALUES
    if place:
        belief = [0.0] * VALUES
        belief[round(float(place) * (VALUES - 1))] = 1.0
    memory[16384 : 16384 + 4 * VALUES] = struct.pack(f"<{VALUES}f", *belief)
    channel.send(struct.pack(ANSWER, b"PFPO", 1, 3, sequence, 0.0, float("nan"), VALUES, 0))
