"""Finds the program ``parfocal`` and reads how it failed."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from .errors import NoProgram


def find_program(program: str | os.PathLike[str] | None = None) -> str:
    """Return the program's path: the given one, else that of ``$PARFOCAL``, else the one on the ``PATH``."""
    if program is None:
        program = os.environ.get("PARFOCAL") or "parfocal"
    found = shutil.which(os.fspath(program))
    if found is None:
        raise NoProgram(
            f"The program '{os.fspath(program)}' was not found. Install parfocal, or set the environment "
            "variable PARFOCAL to the program's path, such as target/release/parfocal."
        )
    return str(Path(found).absolute())


@contextlib.contextmanager
def starting(program: str) -> Iterator[None]:
    """Raise `NoProgram` for a program that the system cannot start, such as one for another processor."""
    try:
        yield
    except OSError as error:
        raise NoProgram(f"{program} cannot be started: {error}.") from error


def last_words(text: str, lines: int = 5) -> str:
    """Return the last lines of a program's output, for a message."""
    said = [line for line in text.strip().splitlines() if line.strip()]
    return "\n".join(said[-lines:]) or "it printed nothing"
