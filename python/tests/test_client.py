"""The clients, on a real server: requests, live pictures, and what goes wrong."""

from __future__ import annotations

import asyncio
import contextlib
import http.server
import json
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

import parfocal
from parfocal import AsyncClient, Client, Server, interface

from .conftest import ROOT, Course


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with Server(fps=20) as server:
        yield server


def test_every_request_of_the_interface_has_a_method_in_both_clients() -> None:
    api = json.loads((ROOT / "web" / "types" / "openapi.json").read_text())
    # Pages and their files, and /live, which is frames().
    browsers = {
        "roles_enter",
        "roles_start",
        "assets_asset",
        "surgeon_worker",
        "trust_profile",
        "trust_check",
    }
    browsers |= {"stream_live", "stream_mjpeg"}
    clients = (Client("http://127.0.0.1:1"), AsyncClient("http://127.0.0.1:1"))
    for methods in api["paths"].values():
        for operation in methods.values():
            page = any(
                "text/html" in answer.get("content", {})
                for status, answer in operation["responses"].items()
                if status == "200"
            )
            if page or operation["operationId"] in browsers:
                continue
            tag = operation["tags"][0]
            name = operation["operationId"].removeprefix(f"{tag}_")
            for client in clients:
                assert callable(getattr(getattr(client, tag), name)), operation["operationId"]


def test_requests_answer_with_what_the_interface_promises(server: Server) -> None:
    with server.client("operator") as client:
        health = client.service.healthz()
        assert health["version"] == interface.VERSION == parfocal.__version__
        # The wheel is named by it.
        assert f'\nversion = "{health["version"]}"\n' in (ROOT / "python" / "pyproject.toml").read_text()
        assert health["simulated"]
        assert "practice" in [protocol["name"] for protocol in client.operator.choices()["protocols"]]
        assert client.operator.session() is None
        client.operator.focus(focal_power=0.25)
        assert "parfocal_viewers" in client.service.metrics()


def test_the_link_of_a_role_is_enough(server: Server) -> None:
    with Client(server.links["researcher"]) as client:
        assert client.researcher.list() == []


def test_frames_come_with_what_the_server_says_of_them(server: Server) -> None:
    with server.client("operator") as client:
        client.operator.focus(focal_power=0.25)
        frames = client.frames()
        seen = [next(frames) for _ in range(3)]
    assert [frame.jpeg[:2] for frame in seen] == [b"\xff\xd8"] * 3
    assert seen[0].number < seen[1].number < seen[2].number
    assert seen[2].picture().shape == (seen[2].header["height"], seen[2].header["width"], 3)
    assert seen[2].status is not None
    assert seen[2].status["steps"] > 0
    assert seen[2].focal_power is not None


def test_a_surgeon_gets_no_focal_power(server: Server) -> None:
    with server.client("surgeon") as client:
        frame = next(client.frames())
    assert frame.focal_power is None
    assert "asked" not in frame.header


def test_a_slow_viewer_gets_the_latest_frame_and_not_the_next(server: Server) -> None:
    with server.client() as client:
        frames = client.frames()
        first = next(frames)
        time.sleep(1.0)
        next(frames)
        later = next(frames)
    assert later.number - first.number > 10


def test_a_wider_screen_gets_wider_pictures(server: Server) -> None:
    with server.client() as client:
        frames = client.frames(screen=1024)
        # They grow once the server knows that the way and the machine are fast enough.
        deadline = time.monotonic() + 60.0
        while next(frames).header["width"] != 1024:
            assert time.monotonic() < deadline, "the pictures stay small"


def test_asyncio_gets_the_same(server: Server) -> None:
    async def watch() -> tuple[int, str]:
        async with server.async_client() as client:
            choices = await client.operator.choices()
            frames = client.frames()
            number = (await anext(frames)).number
            await frames.aclose()  # type: ignore[attr-defined]
            return number, choices["protocols"][0]["name"]

    number, protocol = asyncio.run(watch())
    assert number > 0
    assert protocol


def test_errors_are_the_servers_own_sentences(server: Server) -> None:
    with server.client("operator") as client:
        with pytest.raises(parfocal.ServerError, match=r"participant") as refused:
            client.operator.add_participant(code="no capital letters")
        assert refused.value.status == 422
    with Client(server.url, "a wrong key") as client:
        with pytest.raises(parfocal.ServerError) as refused:
            client.operator.choices()
        assert refused.value.status == 403
        assert len(str(refused.value).split()) > 4
        with pytest.raises(parfocal.ServerError) as live:
            next(client.frames())
        assert live.value.status == 403
        assert "link" in str(live.value)


def test_a_key_of_another_role_is_refused(server: Server) -> None:
    with server.client("surgeon") as client, pytest.raises(parfocal.ServerError, match=r"operator"):
        client.operator.choices()


def test_a_refusal_that_signing_in_would_help_says_so(server: Server) -> None:
    with server.client("researcher") as client:
        with pytest.raises(parfocal.ServerError) as refused:
            client.accounts.list()
        assert refused.value.sign_in


def test_signing_in_opens_what_belongs_to_people(server: Server) -> None:
    import subprocess

    from parfocal.program import find_program

    command = [find_program(), "account", "add", "ada", "--role", "lead", "--display", "Dr Ada"]
    passphrase = "correct horse battery staple"
    subprocess.run(
        [*command, "--data-dir", str(server.data)],
        input=f"{passphrase}\n",
        text=True,
        check=True,
        capture_output=True,
    )
    with Client(server.url) as client:
        with pytest.raises(parfocal.ServerError):
            client.accounts.list()
        with pytest.raises(parfocal.ServerError, match=r"passphrase"):
            client.sign_in("ada", "something else")
        client.sign_in("ada", passphrase)
        assert [line["display"] for line in client.accounts.list()] == ["Dr Ada"]


@pytest.mark.parametrize("how", ["kill", "close"])
def test_a_server_that_goes_away_ends_frames_with_a_sentence(how: str) -> None:
    with Server(fps=10) as server, server.client() as client:
        frames = client.frames()
        next(frames)
        getattr(server, how)()
        with pytest.raises(parfocal.ServerGone, match=r"went away while frames were coming.*once it is back"):
            for _ in frames:
                pass
        with pytest.raises(parfocal.ServerGone, match=r"does not answer"):
            client.operator.choices()


def test_asyncio_hears_of_it_too() -> None:
    async def watch(server: Server) -> None:
        async with server.async_client() as client:
            async for _ in client.frames():
                if server.running:
                    server.kill()

    with Server(fps=10) as server, pytest.raises(parfocal.ServerGone, match=r"went away"):
        asyncio.run(watch(server))


class Fake(http.server.BaseHTTPRequestHandler):
    """Something else than the server that was expected."""

    answer = b""

    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        self.wfile.write(self.answer)

    def log_message(self, format: str, *arguments: object) -> None:
        pass


@contextlib.contextmanager
def fake(answer: bytes) -> Iterator[str]:
    handler = type("Answering", (Fake,), {"answer": answer})
    with http.server.HTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


@pytest.mark.parametrize(
    ("answer", "sentence"),
    [
        (
            b'{"status": "ok", "version": "0.9.2"}',
            r"is parfocal 0.9.2; this package speaks with 0.1.*parfocal==0.9",
        ),
        (b'{"status": "green"}', "is not a parfocal server"),
        (b"<html>hello</html>", "did not answer with JSON"),
    ],
)
def test_another_server_is_named(answer: bytes, sentence: str) -> None:
    with fake(answer) as url, Client(url, "key") as client:
        with pytest.raises(parfocal.IncompatibleServer, match=sentence):
            client.operator.choices()
        with pytest.raises(parfocal.IncompatibleServer, match=sentence):
            next(client.frames())


@pytest.mark.parametrize("url", ["ftp://bench", "http://", "bench:many", "bench:80800", "http://[::1"])
def test_an_address_that_is_none_is_refused(url: str) -> None:
    with pytest.raises(parfocal.ParfocalError, match=r"is not a server's address"):
        Client(url)


def test_a_download_that_fails_leaves_no_file(course: Course, tmp_path: Path) -> None:
    with pytest.raises(parfocal.ServerError):
        course.researcher.download("/api/researcher/sessions/nothing/export.zip", tmp_path / "export.zip")
    assert list(tmp_path.iterdir()) == []


def test_a_download_that_cannot_be_saved_is_told_with_a_sentence(course: Course, tmp_path: Path) -> None:
    path = f"/api/researcher/sessions/{course.session}/export.zip"
    folder = tmp_path / "export.zip"
    folder.mkdir()
    for file in (tmp_path / "nowhere" / "export.zip", folder):
        with pytest.raises(
            parfocal.ParfocalError, match=r"export.zip cannot be written .*Make room on the disk"
        ):
            course.researcher.download(path, file)
    assert list(tmp_path.rglob("*")) == [folder]


def test_an_encrypted_server_is_trusted_by_its_authority() -> None:
    with Server(arguments=["--tls"]) as server:
        assert server.url.startswith("https://")
        with server.client() as client:
            assert client.service.healthz()["simulated"]
            assert next(client.frames()).jpeg
        unencrypted = Client(server.url.replace("https", "http"), server.keys["operator"])
        with unencrypted, pytest.raises(parfocal.IncompatibleServer, match=r"leads to https://.*use that"):
            unencrypted.operator.choices()
        stranger = Client(server.url, server.keys["operator"])
        with stranger, pytest.raises(parfocal.ServerGone, match=r"not trusted: give the authority"):
            stranger.operator.choices()
