"""An emulated lens in a process of its own, with faults that can be switched on."""

from __future__ import annotations

import contextlib
import os
import subprocess
import threading
from pathlib import Path
from queue import Empty, Queue
from typing import Literal

from .errors import NoProgram, ParfocalError, ProgramEnded
from .program import find_program, last_words, starting

Fault = Literal[
    "none",
    "garbage",
    "wrong-checksum",
    "wrong-read-back",
    "silent",
    "errors",
    "drops-commands",
    "stranger",
    "noisy-line",
]
Glitch = Literal["noise", "checksum", "late"]

# The emulator answers a command within a few milliseconds; a busy machine takes longer.
_ANSWER_SECONDS = 20.0


class EmulatedLens:
    """An emulated Optotune Lens Driver 4 behind a serial port, as ``parfocal lens emulate`` makes it.

    ``Server(lens=lens)`` uses it. Every method takes effect before it returns.
    """

    def __init__(
        self, *, program: str | os.PathLike[str] | None = None, arguments: list[str] | None = None
    ) -> None:
        command = [find_program(program), "lens", "emulate", *(arguments or [])]
        with starting(command[0]):
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
        self._said: Queue[str] = Queue()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()
        assert self._process.stdout is not None
        port = self._process.stdout.readline().strip()
        if not port:
            self._process.wait()
            self._listener.join()
            said = []
            while not self._said.empty():
                said.append(self._said.get())
            self.close()
            raise NoProgram(f"The emulated lens did not start: {last_words(chr(10).join(said))}")
        self.port = Path(port)
        """Its serial port."""
        # What it can do is printed once, before the first answer.
        while self._answer() != "Ctrl-C stops it":
            pass

    @property
    def spec(self) -> str:
        """What ``parfocal serve --lens`` takes to use it."""
        return f"optotune:{self.port}"

    def fault(self, name: Fault) -> None:
        """Begin a lasting fault; ``"none"`` ends it."""
        self._do(f"fault {name}")

    def glitch(self, name: Glitch, replies: int = 1) -> None:
        """Spoil the next replies."""
        self._do(f"glitch {name} {replies}")

    def unplug(self) -> None:
        """Pull its USB cable."""
        self._do("unplug")

    def plug_in(self) -> None:
        """Plug its USB cable in again."""
        self._do("plug-in")

    def restart(self) -> None:
        """Cut its power for a moment."""
        self._do("restart")

    def take_lens_out(self) -> None:
        """Pull the lens's own cable."""
        self._do("lens out")

    def put_lens_in(self) -> None:
        """Plug the lens's own cable in again."""
        self._do("lens in")

    def temperature(self, celsius: float) -> None:
        """Set the lens's temperature; it warns outside 20 to 40 °C."""
        self._do(f"temperature {celsius}")

    def latency(self, milliseconds: float) -> None:
        """Set the time that it takes to answer a request."""
        self._do(f"latency {milliseconds}")

    def glass(self) -> float:
        """Return where the glass stands, as focal power 0..1, which no driver can read."""
        return float(self._ask("glass").split()[2].rstrip(","))

    def close(self) -> None:
        """End it."""
        if self._process.poll() is None:
            self._process.terminate()
        self._process.wait()
        self._listener.join()
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):
                    pipe.close()

    def __enter__(self) -> EmulatedLens:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _listen(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self._said.put(line.rstrip("\n"))

    def _do(self, command: str) -> None:
        answer = self._ask(command)
        if answer != "done":
            raise ParfocalError(f"The emulated lens refused '{command}': {answer}.")

    def _ask(self, command: str) -> str:
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(f"{command}\n")
            self._process.stdin.flush()
        except (BrokenPipeError, ValueError):
            raise ProgramEnded("The emulated lens has ended. Start another one.") from None
        return self._answer()

    def _answer(self) -> str:
        try:
            return self._said.get(timeout=_ANSWER_SECONDS)
        except Empty:
            raise ProgramEnded("The emulated lens does not answer. Start another one.") from None
