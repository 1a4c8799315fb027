"""Clients of a running server: one that waits, and one for asyncio."""

from __future__ import annotations

import contextlib
import os
from collections.abc import AsyncIterator, Iterator, Mapping
from pathlib import Path
from typing import Any

import httpx
from websockets.exceptions import ConnectionClosed, InvalidHandshake

from .connection import Address, Answer, check_version, read, refusal, request
from .errors import ParfocalError
from .interface import AsyncGroups, Groups
from .live import Frame, Viewer, connect, connect_async

_HEALTH = "/healthz"


class Client(Groups):
    """A client of a running server.

    ``Client("http://127.0.0.1:8080", key)``, or ``Client(link)`` with a role's link as the server prints it.
    Requests are in the groups of ``/api/openapi.json``: ``client.operator.focus(policy="parfocal")``. A
    server that encrypts with its own authority needs ``ca="data/tls/authority.crt"``.
    """

    def __init__(self, url: str, key: str | None = None, *, ca: str | Path | None = None) -> None:
        self.address = Address(url, key, ca)
        self._http = httpx.Client(**self.address.options())
        self._known = False
        self._make_groups(self._call)

    def sign_in(self, name: str, passphrase: str) -> None:
        """Sign in under a personal account, as everything that belongs to a study needs it."""
        token = self.accounts.sign_in(name=name, passphrase=passphrase, as_bearer=True).get("token")
        self.address.key = token

    def frames(self, *, role: str | None = None, screen: int | None = None) -> Iterator[Frame]:
        """Yield live pictures, each the latest there is when the next is asked for.

        So a program that is slow gets fewer, and none is old. ``screen`` says that the whole picture
        covers so many pixels: pictures grow with it as far as the connection carries them. Ends only by
        an error, or when the caller stops.
        """
        self._look_at_version()
        viewer = Viewer(self.address, role, screen)
        try:
            connection = connect(viewer.url, **viewer.options())
        except (OSError, InvalidHandshake) as error:
            raise viewer.refused(error) from error
        with connection:
            try:
                for message in viewer.greeting():
                    connection.send(message)
                while True:
                    frame = viewer.take(connection.recv())
                    if frame is not None:
                        yield frame
                        connection.send(viewer.drawn(frame))
            except ConnectionClosed as error:
                raise viewer.ended(error) from error

    def download(self, path: str, to: str | os.PathLike[str]) -> Path:
        """Save what ``path`` of the interface gives as file ``to``, as it comes; an export may be large.

        ``client.download(f"/api/researcher/sessions/{session}/export.zip", "session.zip")``
        """
        self._look_at_version()
        file = Path(to)
        part = file.with_name(file.name + ".part")
        try:
            with self._http.stream(**request(self.address, "GET", path, None, None, None, None)) as response:
                if not response.is_success:
                    raise refusal(response.status_code, response.read())
                with part.open("wb") as out:
                    for block in response.iter_bytes():
                        out.write(block)
            part.replace(file)
        except httpx.TransportError as error:
            raise self.address.unreachable(error) from error
        except OSError as error:
            raise ParfocalError(
                f"{file} cannot be written ({error}). Make room on the disk, or name another file."
            ) from error
        finally:
            with contextlib.suppress(OSError):
                part.unlink()
        return file

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _call(
        self,
        method: str,
        path: str,
        *,
        answer: Answer = "json",
        query: Mapping[str, Any] | None = None,
        body: Mapping[str, Any] | None = None,
        content: bytes | None = None,
        media_type: str | None = None,
    ) -> Any:
        self._look_at_version()
        response = self._send(**request(self.address, method, path, query, body, content, media_type))
        # A server that is failing says so with a status of its own, and with all it knows.
        return read(response, answer, may_fail=path == _HEALTH)

    def _send(self, **arguments: Any) -> httpx.Response:
        try:
            return self._http.request(**arguments)
        except httpx.TransportError as error:
            raise self.address.unreachable(error) from error

    def _look_at_version(self) -> None:
        if not self._known:
            response = self._send(**request(self.address, "GET", _HEALTH, None, None, None, None))
            check_version(self.address, read(response, "json", may_fail=True))
            self._known = True


class AsyncClient(AsyncGroups):
    """The same as `Client`, for asyncio: ``await client.operator.choices()``, ``async for frame in …``."""

    def __init__(self, url: str, key: str | None = None, *, ca: str | Path | None = None) -> None:
        self.address = Address(url, key, ca)
        self._http = httpx.AsyncClient(**self.address.options())
        self._known = False
        self._make_groups(self._call)

    async def sign_in(self, name: str, passphrase: str) -> None:
        """Sign in under a personal account, as everything that belongs to a study needs it."""
        signed_in = await self.accounts.sign_in(name=name, passphrase=passphrase, as_bearer=True)
        self.address.key = signed_in.get("token")

    async def frames(self, *, role: str | None = None, screen: int | None = None) -> AsyncIterator[Frame]:
        """Yield live pictures, each the latest there is when the next is asked for; see `Client.frames`."""
        await self._look_at_version()
        viewer = Viewer(self.address, role, screen)
        try:
            connection = await connect_async(viewer.url, **viewer.options())
        except (OSError, InvalidHandshake) as error:
            raise viewer.refused(error) from error
        async with connection:
            try:
                for message in viewer.greeting():
                    await connection.send(message)
                while True:
                    frame = viewer.take(await connection.recv())
                    if frame is not None:
                        yield frame
                        await connection.send(viewer.drawn(frame))
            except ConnectionClosed as error:
                raise viewer.ended(error) from error

    async def close(self) -> None:
        """Close the connections."""
        await self._http.aclose()

    async def __aenter__(self) -> AsyncClient:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def _call(
        self,
        method: str,
        path: str,
        *,
        answer: Answer = "json",
        query: Mapping[str, Any] | None = None,
        body: Mapping[str, Any] | None = None,
        content: bytes | None = None,
        media_type: str | None = None,
    ) -> Any:
        await self._look_at_version()
        response = await self._send(**request(self.address, method, path, query, body, content, media_type))
        return read(response, answer, may_fail=path == _HEALTH)

    async def _send(self, **arguments: Any) -> httpx.Response:
        try:
            return await self._http.request(**arguments)
        except httpx.TransportError as error:
            raise self.address.unreachable(error) from error

    async def _look_at_version(self) -> None:
        if not self._known:
            response = await self._send(**request(self.address, "GET", _HEALTH, None, None, None, None))
            check_version(self.address, read(response, "json", may_fail=True))
            self._known = True
