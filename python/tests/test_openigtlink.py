"""The live picture by OpenIGTLink, as a client of another maker sees it."""

from __future__ import annotations

import re
import socket
import struct
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyigtl
import pytest
from PIL import Image

from parfocal import Server
from parfocal.program import find_program

from .test_server import wait_until


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recordings") / "recording"
    words = [find_program(), "recording", "record", "--out", str(folder), "--seconds", "1", "--fps", "5"]
    subprocess.run(words, check=True, capture_output=True, stdin=subprocess.DEVNULL)
    return folder


@pytest.fixture(scope="module")
def pictures(recording: Path) -> list[Any]:
    """Its frames, as the program writes them into files."""
    out = recording.parent / "pictures"
    words = [find_program(), "recording", "video", str(recording), "--out", str(out)]
    subprocess.run(words, check=True, capture_output=True, stdin=subprocess.DEVNULL)
    return [np.asarray(Image.open(file).convert("RGB")) for file in sorted(out.glob("*.png"))]


def port(server: Server) -> int:
    return next(
        int(match[1]) for line in server._said if (match := re.match(r"OpenIGTLink: \S+:(\d+)\.", line))
    )


@pytest.fixture(scope="module")
def server(recording: Path) -> Iterator[Server]:
    arguments = ["--openigtlink", "0", "--openigtlink-rate", "20"]
    with Server(camera=f"recording:{recording}", fps=10, arguments=arguments) as server:
        yield server


def message(client: Any, device: str) -> Any:
    """The next message of a device."""
    got = client.wait_for_message(device, timeout=30)
    assert got is not None, f"nothing of {device} came"
    return got


def raw(connection: socket.socket) -> tuple[int, str, str, bytes]:
    """A message's version, kind, device and body, after its checksum was compared."""

    def exactly(count: int) -> bytes:
        data = b""
        while len(data) < count:
            piece = connection.recv(count - len(data))
            assert piece, "the server closed the connection"
            data += piece
        return data

    version, kind, device, _, size, checksum = struct.unpack(">H12s20sQQQ", exactly(58))
    body = exactly(size)
    assert pyigtl.messages.CRC64(body) == checksum
    return version, kind.rstrip(b"\0").decode(), device.rstrip(b"\0").decode(), body


def connect(server: Server) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port(server)), timeout=30)


def test_every_pixel_is_that_of_the_recording(server: Server, pictures: list[Any]) -> None:
    client = pyigtl.OpenIGTLinkClient("127.0.0.1", port(server))
    try:
        for _ in range(3):
            image = message(client, "Exoscope")
            assert image.image.shape == (1, *pictures[0].shape)
            assert any((image.image[0] == picture).all() for picture in pictures)
            assert abs(time.time() - image.timestamp) < 60
    finally:
        client.stop()


def test_a_client_that_speaks_version_3_gets_the_focal_power_with_the_picture(server: Server) -> None:
    client = pyigtl.OpenIGTLinkClient("127.0.0.1", port(server))
    try:
        assert message(client, "Exoscope").header_version == 1
        hello = pyigtl.StringMessage("hello", device_name="test")
        hello.header_version = 2
        client.send_message(hello)
        wait_until(lambda: message(client, "Exoscope").header_version == 2)
        assert 0 <= float(message(client, "Exoscope").metadata["FocalPower"]) <= 1
    finally:
        client.stop()


def test_status_and_focal_power_are_messages_of_their_own(server: Server) -> None:
    with connect(server) as connection:
        seen: dict[str, bytes] = {}
        while len(seen) < 3:
            version, kind, _, body = raw(connection)
            assert version == 1
            seen[kind] = body
        assert seen["STATUS"][:2] == b"\0\x01"
        assert b"The camera delivers pictures." in seen["STATUS"]
        # One number of 64 bits.
        assert seen["NDARRAY"][:4] == b"\x0b\x01\0\x01"
        assert 0 <= struct.unpack(">d", seen["NDARRAY"][4:])[0] <= 1

        # It is told again on request.
        body = b""
        header = struct.pack(">H12s20sQQQ", 1, b"GET_STATUS", b"test", 0, 0, pyigtl.messages.CRC64(body))
        connection.sendall(header)
        while raw(connection)[1] != "STATUS":
            pass


def test_a_slow_client_delays_no_other(server: Server) -> None:
    with connect(server), connect(server) as quick:
        # The first takes nothing at all.
        images = sum(raw(quick)[1] == "IMAGE" for _ in range(60))
        assert images > 20


def test_a_port_scanner_is_shrugged_off_with_one_line_for_each_reason(server: Server) -> None:
    said = "OpenIGTLink: a client was disconnected: "
    for bytes_ in [b"GET / HTTP/1.1\r\nHost: x\r\n\r\n" + b" " * 64, b"\x16\x03\x01" + b"\0" * 80] * 2:
        with connect(server) as stranger:
            stranger.sendall(bytes_)
            try:
                while stranger.recv(65536):
                    pass
            except ConnectionResetError:
                pass
    wait_until(lambda: said in server.log)
    with connect(server) as connection:
        raw(connection)

    reasons = [line.partition(said)[2] for line in server.log.splitlines() if said in line]
    assert len(reasons) == len(set(reasons))
    assert not any("127.0.0.1" in reason for reason in reasons)


def test_a_damaged_message_is_noticed(server: Server) -> None:
    with connect(server) as stranger:
        stranger.sendall(struct.pack(">H12s20sQQQ", 1, b"GET_STATUS", b"test", 0, 0, 77))
        wait_until(lambda: "a message's checksum is wrong" in server.log)


def test_half_size_has_four_times_the_pixels(recording: Path) -> None:
    arguments = ["--openigtlink", "127.0.0.1:0", "--openigtlink-size", "half"]
    with Server(camera=f"recording:{recording}", fps=5, arguments=arguments) as server:
        client = pyigtl.OpenIGTLinkClient("127.0.0.1", port(server))
        try:
            image = message(client, "Exoscope")
            assert image.image.shape == (1, 544, 1024, 3)
            # Both sizes cover the same area.
            assert image.ijk_to_world_matrix[0, 0] == 0.5
        finally:
            client.stop()


def test_a_blinded_session_shows_pictures_and_status_alone() -> None:
    with Server(fps=10, seed=1, arguments=["--openigtlink", "0"]) as server, connect(server) as connection:
        while raw(connection)[1] != "NDARRAY":
            pass
        with server.client() as operator:
            operator.operator.add_participant(code="S-01")
            made = operator.operator.create(participant="S-01", protocol="paper")
            assert made is not None
            operator.operator.act(session=made["session"], action="start")
            # What was under way when the session began has passed after some frames.
            kinds = [raw(connection)[1] for _ in range(40)]
            assert set(kinds[-20:]) == {"IMAGE"}
