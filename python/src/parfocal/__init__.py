"""parfocal for Python: exports, recordings, a client, a server for tests, and training environments.

Everything is imported when it is first used, so ``import parfocal`` is quick.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from .errors import (
    BadExport,
    BadRecording,
    IncompatibleServer,
    NoProgram,
    ParfocalError,
    ProgramEnded,
    ServerError,
    ServerGone,
)

if TYPE_CHECKING:
    from .client import AsyncClient, Client
    from .environment import FocusEnv, FocusVectorEnv
    from .export import Export, load
    from .lens import EmulatedLens
    from .live import Frame
    from .recording import Recording, open_recording
    from .server import Server

__version__ = "0.1.0"

_HOMES = {
    "AsyncClient": "client",
    "Client": "client",
    "EmulatedLens": "lens",
    "Export": "export",
    "FocusEnv": "environment",
    "FocusVectorEnv": "environment",
    "Frame": "live",
    "Recording": "recording",
    "Server": "server",
    "load": "export",
    "open_recording": "recording",
}

__all__ = [
    "AsyncClient",
    "BadExport",
    "BadRecording",
    "Client",
    "EmulatedLens",
    "Export",
    "FocusEnv",
    "FocusVectorEnv",
    "Frame",
    "IncompatibleServer",
    "NoProgram",
    "ParfocalError",
    "ProgramEnded",
    "Recording",
    "Server",
    "ServerError",
    "ServerGone",
    "__version__",
    "load",
    "open_recording",
]


def __getattr__(name: str) -> object:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'parfocal' has no attribute '{name}'")
    return getattr(import_module(f".{home}", __name__), name)


def __dir__() -> list[str]:
    return __all__
