"""A policy in a process of its own, by what docs/policies.md says of the framing, with Python alone.

Its metric is the patch's mean, and its target a hundredth for each frame since it was told to forget. In the sixth frame
of the recording it does what its argument says.
"""

import mmap
import os
import socket
import struct
import sys
import time

ANSWER = "<4sHHQddII"

channel = socket.socket(fileno=int(os.environ["PARFOCAL_POLICY_SOCKET"]))
memory = mmap.mmap(int(os.environ["PARFOCAL_POLICY_MEMORY"]), 32768, mmap.MAP_SHARED, mmap.PROT_READ)
channel.send(struct.pack(ANSWER, b"PFPO", 1, 1, 0, 0.0, float("nan"), 1, 0))

# Two test pictures come before the recording.
asked = -2
since = 0
while question := channel.recv(64):
    _, _, kind, sequence = struct.unpack_from("<4sHHQ", question)
    if kind == 2:
        since = 0
        continue
    asked += 1
    since += 1
    target = 0.01 * since
    if asked == 6:
        deed = sys.argv[1]
        if deed == "end":
            sys.exit(3)
        if deed == "nonsense":
            channel.send(b"hello")
        if deed == "hang":
            time.sleep(1000)
        if deed == "nan":
            target = float("nan")
    mean = sum(struct.unpack_from("<1024f", memory)) / 1024
    channel.send(struct.pack(ANSWER, b"PFPO", 1, 2, sequence, target, mean, 0, 0))
