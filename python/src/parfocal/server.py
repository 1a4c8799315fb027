"""A server of one's own, for tests and notebooks."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import tempfile
import threading
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from .errors import NoProgram, ProgramEnded
from .program import find_program, last_words, starting

if TYPE_CHECKING:
    from .client import AsyncClient, Client
    from .lens import EmulatedLens

Role = Literal["surgeon", "operator", "researcher"]

_READY = "Ctrl-C stops the server."
_LINK = re.compile(r"^\s*(surgeon|operator|researcher)\s+(\S+/enter\?key=(\S+))$")

# A server saves what it holds and takes the current from the lens; this is far more than it needs.
_END_SECONDS = 30.0


class Server:
    """Starts ``parfocal serve`` on a free port with a folder of its own, and waits until it is ready.

    ``camera`` and ``lens`` are named as for ``parfocal serve``: simulated by default, ``"emulated"``,
    ``"recording:DIR"``, an `EmulatedLens`. ``policy`` adds policies of your own: ``"exec:COMMAND"`` or
    ``"file:PATH"``, one or several. Use it in a ``with`` block, or call `close`.
    """

    def __init__(
        self,
        camera: str = "phantom",
        lens: str | EmulatedLens = "simulated",
        *,
        fps: int | None = None,
        seed: int | None = None,
        data: str | os.PathLike[str] | None = None,
        protocols: str | os.PathLike[str] | None = None,
        policy: str | Sequence[str] = (),
        arguments: Sequence[str] = (),
        program: str | os.PathLike[str] | None = None,
        timeout: float = 60.0,
    ) -> None:
        found = find_program(program)
        self._own = tempfile.TemporaryDirectory(prefix="parfocal-")
        self.data = Path(self._own.name, "data") if data is None else Path(data)
        """The data folder; removed at the end, unless it was given."""

        command = [found, "serve", "--bind", "127.0.0.1:0", "--data-dir", str(self.data), "--camera", camera]
        command += ["--lens", lens if isinstance(lens, str) else lens.spec]
        for option, value in (("--fps", fps), ("--seed", seed), ("--protocols", protocols)):
            if value is not None:
                command += [option, str(value)]
        for added in [policy] if isinstance(policy, str) else policy:
            command += ["--policy", added]
        command += arguments

        # Its messages go into a file, so that no full pipe can ever hold the server up.
        self._log = Path(self._own.name, "log")
        try:
            with starting(found), self._log.open("w") as log:
                self._process = subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, text=True
                )
        except NoProgram:
            self._own.cleanup()
            raise
        self._finalizer = weakref.finalize(self, _end, self._process)
        self._said: list[str] = []
        self._ready = threading.Event()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

        in_time = self._ready.wait(timeout)
        links = [match for line in self._said if (match := _LINK.match(line))]
        if not in_time or len(links) != 3:
            ended = self._process.poll()
            if not in_time:
                why = f"it was not ready after {timeout:g} s"
            else:
                ended = self._process.wait(timeout=_END_SECONDS)
                why = f"it ended with exit code {ended}"
            said = self.log
            self.kill()
            self.close()
            raise NoProgram(f"The server did not start: {why}.\n{last_words(said)}")
        self.links: dict[str, str] = {match[1]: match[2] for match in links}
        """Each role's link."""
        self.keys: dict[str, str] = {match[1]: match[3] for match in links}
        """Each role's key."""
        self.url = links[0][2].split("/enter")[0]
        """Its address."""

    def client(self, role: Role = "operator") -> Client:
        """Return a client with a role's key."""
        from .client import Client

        return Client(self.url, self.keys[role], ca=self._authority())

    def async_client(self, role: Role = "operator") -> AsyncClient:
        """Return a client with a role's key, for asyncio."""
        from .client import AsyncClient

        return AsyncClient(self.url, self.keys[role], ca=self._authority())

    @property
    def log(self) -> str:
        """What it has told so far on standard error."""
        return self._log.read_text(errors="replace") if self._log.exists() else ""

    @property
    def running(self) -> bool:
        """Whether it runs."""
        return self._process.poll() is None

    def kill(self) -> None:
        """End it at once, as a power cut would."""
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """End it as Ctrl-C does, wait for it, and remove its folder."""
        stuck = False
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
            try:
                self._process.wait(timeout=_END_SECONDS)
            except subprocess.TimeoutExpired:
                stuck = True
                self._process.kill()
                self._process.wait()
        self._finalizer.detach()
        self._listener.join()
        assert self._process.stdout is not None
        self._process.stdout.close()
        self._own.cleanup()
        if stuck:
            raise ProgramEnded(f"The server did not end within {_END_SECONDS:g} s of Ctrl-C and was killed.")

    def __enter__(self) -> Server:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _authority(self) -> Path | None:
        file = self.data / "tls" / "authority.crt"
        return file if file.exists() else None

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self._said.append(line.rstrip("\n"))
            if line.startswith(_READY):
                self._ready.set()
        # It ended before it was ready; whoever waits should know now.
        self._ready.set()


def _end(process: subprocess.Popen[str]) -> None:
    """End a server that nobody closed."""
    if process.poll() is None:
        process.terminate()
        process.wait()
