"""Live pictures: a viewer of ``/live``, as the pages are."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from websockets.asyncio.client import connect as connect_async
from websockets.exceptions import ConnectionClosed, InvalidHandshake, InvalidStatus
from websockets.sync.client import connect

from .connection import Address, refusal
from .errors import IncompatibleServer, ParfocalError, ServerError, ServerGone

__all__ = ["Frame", "Viewer", "connect", "connect_async"]

# The server drops a viewer of which it hears nothing for ten seconds; a program may look at a frame for longer.
_PING_SECONDS = 3.0

_LINK_OVER = 4403


@dataclass(frozen=True)
class Frame:
    """A live picture with what the server says of it."""

    number: int
    """Number of the frame in the server's run."""
    jpeg: bytes = field(repr=False)
    """The picture as it came."""
    header: dict[str, Any]
    """All that came with it: run, age in ms, width, height, per_cell, patch, area, and for operators more."""
    status: dict[str, Any] | None = field(default=None, repr=False)
    """The latest state of the devices."""
    session: dict[str, Any] | None = field(default=None, repr=False)
    """The latest state of the session under way, if there is one."""

    @property
    def focal_power(self) -> float | None:
        """Focal power, 0..1, at which it was exposed.

        None for surgeons, while a session is under way, and while the lens stands where a session has left it.
        """
        measured = self.header.get("measured")
        return None if measured is None else float(measured)

    def picture(self) -> npt.NDArray[np.uint8]:
        """Return the picture as an array: height, width, 3. Needs Pillow: ``pip install parfocal[pictures]``."""
        try:
            from PIL import Image
        except ImportError:
            raise ParfocalError(
                "Decoding a picture needs Pillow: pip install 'parfocal[pictures]'; or use frame.jpeg."
            ) from None
        from io import BytesIO

        with Image.open(BytesIO(self.jpeg)) as picture:
            return np.asarray(picture.convert("RGB"))


class Viewer:
    """What a viewer remembers between messages, apart from the connection."""

    def __init__(self, address: Address, role: str | None, screen: int | None) -> None:
        self.address = address
        self.url = f"{address.websocket}/live" + (f"?role={role}" if role else "")
        self.screen = screen
        self._status: dict[str, Any] | None = None
        self._session: dict[str, Any] | None = None

    def options(self) -> dict[str, Any]:
        """What both kinds of connection are made with."""
        return {
            "additional_headers": self.address.headers,
            "ssl": self.address.ssl,
            "compression": None,
            "max_size": 64 << 20,
            "ping_interval": _PING_SECONDS,
            "ping_timeout": 20.0,
            "proxy": None,
            "user_agent_header": None,
        }

    def greeting(self) -> list[str]:
        """Return the messages to send first."""
        return [json.dumps({"type": "screen", "width": self.screen})] if self.screen is not None else []

    @staticmethod
    def drawn(frame: Frame) -> str:
        """Return the message that asks for the next frame."""
        return json.dumps({"type": "drawn", "frame": frame.number})

    def take(self, message: str | bytes) -> Frame | None:
        """Take a message; return the frame that it is, if it is one."""
        try:
            if isinstance(message, bytes):
                length = int.from_bytes(message[:2], "little")
                header = json.loads(message[2 : 2 + length])
                return Frame(header["frame"], message[2 + length :], header, self._status, self._session)
            state = json.loads(message)
            kind = state.pop("type", None)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            raise IncompatibleServer(
                f"The server at {self.address.url} sent something that is no frame and no state ({error}). "
                "Is the package of another version than the server?"
            ) from error
        if kind == "status":
            self._status = state
        elif kind == "session":
            self._session = state.get("view")
        return None

    def ended(self, error: ConnectionClosed) -> ParfocalError:
        """Return the error for a connection that the server closed."""
        code = error.rcvd.code if error.rcvd else None
        reason = (error.rcvd.reason if error.rcvd else "") or "the connection was cut"
        if code == _LINK_OVER:
            return ServerError(403, f"The server at {self.address.url} shows no more pictures: {reason}.")
        return ServerGone(
            f"The server at {self.address.url} went away while frames were coming: {reason}. "
            "Call frames() again once it is back."
        )

    def refused(self, error: Exception) -> ParfocalError:
        """Return the error for a connection that was not made."""
        if isinstance(error, InvalidStatus):
            return refusal(error.response.status_code, bytes(error.response.body or b""))
        if isinstance(error, InvalidHandshake):
            return IncompatibleServer(f"{self.address.url} gives no live view: {error}. Check the address.")
        return self.address.unreachable(error)
