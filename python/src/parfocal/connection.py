"""What the clients share: addresses, keys, the server's version, and how answers become values or errors."""

from __future__ import annotations

import json
import ssl
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal
from urllib.parse import parse_qs, urlsplit

import httpx

from . import interface
from .errors import IncompatibleServer, ParfocalError, ServerError, ServerGone

Answer = Literal["json", "text", "bytes", "nothing"]

TIMEOUT = httpx.Timeout(30.0, read=300.0)
"""Making an export of a long session takes the server a while."""


class Address:
    """A server's address, and the key with which it is asked."""

    def __init__(self, url: str, key: str | None, ca: str | Path | None) -> None:
        try:
            parts = urlsplit(url if "//" in url else f"http://{url}")
            is_address = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
        except ValueError:
            # A port that is no number, or brackets without an address.
            is_address = False
        if not is_address:
            raise ParfocalError(f"'{url}' is not a server's address; one looks like http://127.0.0.1:8080.")
        # The link that the server prints for a role has the key in it.
        in_link = parse_qs(parts.query).get("key", [None])[0]
        self.url = f"{parts.scheme}://{parts.netloc}"
        self.key = key if key is not None else in_link
        self.ssl: ssl.SSLContext | None = None
        if parts.scheme == "https":
            try:
                self.ssl = ssl.create_default_context(cafile=str(ca) if ca is not None else None)
            except (OSError, ssl.SSLError) as error:
                raise ParfocalError(
                    f"The certificate {ca} cannot be read ({error}). "
                    "Name the authority's certificate, such as data/tls/authority.crt."
                ) from error

    @property
    def headers(self) -> dict[str, str]:
        """What every request carries."""
        headers = {"User-Agent": f"parfocal-python/{interface.VERSION}", "Accept": "application/json"}
        if self.key:
            headers["Authorization"] = f"Bearer {self.key}"
        return headers

    @property
    def websocket(self) -> str:
        """The address for WebSockets."""
        return "ws" + self.url.removeprefix("http")

    def options(self) -> dict[str, Any]:
        """What both kinds of httpx client are made with."""
        # The server is beside us or in the same room: no proxy has to do with it.
        verify: Any = self.ssl if self.ssl is not None else True
        return {"base_url": self.url, "timeout": TIMEOUT, "trust_env": False, "verify": verify}

    def unreachable(self, error: Exception) -> ServerGone:
        """Return the error for a server that does not answer."""
        why = str(error) or type(error).__name__
        hint = "Check that it runs, and the address."
        if "CERTIFICATE_VERIFY_FAILED" in why:
            hint = (
                "Its certificate is not trusted: give the authority's certificate, "
                "Client(..., ca='data/tls/authority.crt')."
            )
        return ServerGone(f"The server at {self.url} does not answer: {why}. {hint}")


def request(
    address: Address,
    method: str,
    path: str,
    query: Mapping[str, Any] | None,
    body: Mapping[str, Any] | None,
    content: bytes | None,
    media_type: str | None,
) -> dict[str, Any]:
    """Return the arguments of httpx's request."""
    arguments: dict[str, Any] = {"method": method, "url": path, "headers": address.headers}
    if query:
        arguments["params"] = {name: _plain(value) for name, value in query.items() if value is not None}
    if body is not None:
        arguments["json"] = {name: value for name, value in body.items() if value is not None}
    if content is not None:
        arguments["content"] = content
        arguments["headers"]["Content-Type"] = media_type or "application/octet-stream"
    return arguments


def _plain(value: Any) -> Any:
    return str(value).lower() if isinstance(value, bool) else value


def read(response: httpx.Response, answer: Answer, *, may_fail: bool = False) -> Any:
    """Return a response as the value that the interface promises, or raise the server's sentence."""
    if response.has_redirect_location:
        # What a server that encrypts answers on unencrypted connections.
        raise IncompatibleServer(
            f"{response.url} leads to {response.headers['Location']}: use that server's address. One with https "
            "may need the authority's certificate, Client(..., ca='data/tls/authority.crt')."
        )
    if not response.is_success and not may_fail:
        raise refusal(response.status_code, response.content)
    match answer:
        case "nothing":
            return None
        case "bytes":
            return response.content
        case "text":
            return response.text
    try:
        return response.json()
    except ValueError:
        raise IncompatibleServer(
            f"{response.url} did not answer with JSON. Is this the address of a parfocal server?"
        ) from None


def refusal(status: int, content: bytes) -> ServerError:
    """Return the error that a response with this status and content stands for."""
    sign_in = False
    sentence = ""
    try:
        found = json.loads(content)
        sentence = str(found["error"])
        sign_in = bool(found.get("sign_in", False))
    except (ValueError, KeyError, TypeError, AttributeError):
        sentence = f"The server answered with status {status} and no reason."
    return ServerError(status, sentence, sign_in=sign_in)


def check_version(address: Address, health: Any) -> None:
    """Refuse a server whose interface this package does not know."""
    version = health.get("version") if isinstance(health, dict) else None
    if not isinstance(version, str):
        raise IncompatibleServer(f"{address.url} answers, but is not a parfocal server. Check the address.")
    # As everywhere before 1.0, the second number counts what breaks.
    if _series(version) != _series(interface.VERSION):
        raise IncompatibleServer(
            f"The server at {address.url} is parfocal {version}; this package speaks with "
            f"{'.'.join(_series(interface.VERSION))}. Install the package of the server's version: "
            f"pip install 'parfocal=={'.'.join(_series(version))}.*'."
        )


def _series(version: str) -> list[str]:
    numbers = version.split(".")
    return numbers[:2] if numbers[0] == "0" else numbers[:1]
