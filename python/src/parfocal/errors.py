"""What can go wrong. Every message is a sentence that says what happened and what to do."""

from __future__ import annotations


class ParfocalError(Exception):
    """Base of all errors of this package."""


class BadExport(ParfocalError):
    """A folder or file is not an export that this version can read, or it does not verify."""


class BadRecording(ParfocalError):
    """A folder is not a recording that this version can read."""


class NoProgram(ParfocalError):
    """The program ``parfocal`` was not found, or it did not start."""


class ProgramEnded(ParfocalError):
    """A program that this package started has ended or no longer answers."""


class IncompatibleServer(ParfocalError):
    """The address answers, but not as a server of a version that this package knows."""


class ServerGone(ParfocalError):
    """The server cannot be reached, or ended in the middle of something."""


class ServerError(ParfocalError):
    """The server refused a request; the message is its own sentence."""

    def __init__(self, status: int, message: str, *, sign_in: bool = False) -> None:
        super().__init__(message)
        self.status = status
        """The HTTP status."""
        self.sign_in = sign_in
        """Whether signing in under a personal account would help."""
