"""What the tests share: the program of this checkout, and a session with its export."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "python" / "notebooks"))

import made_up  # noqa: E402

from parfocal import Client, Server  # noqa: E402

pytest_plugins = ["pytester"]


def pytest_configure() -> None:
    if "PARFOCAL" not in os.environ:
        target = ROOT / (os.environ.get("CARGO_TARGET_DIR") or "target")
        built = [target / profile / "parfocal" for profile in ("release", "debug")]
        newest = max(
            (path for path in built if path.exists()), key=lambda path: path.stat().st_mtime, default=None
        )
        if newest is None:
            pytest.exit("The program is not built; run: cargo build", returncode=2)
        os.environ["PARFOCAL"] = str(newest)


@dataclass
class Course:
    """A practice session that ran to its end, on a server that still runs."""

    server: Server
    session: str
    researcher: Client

    def save(self, to: Path) -> Path:
        """Save its export as a ZIP file."""
        return self.researcher.download(f"/api/researcher/sessions/{self.session}/export.zip", to)


# What a spreadsheet would run, and what it would not.
SAID = ["=1+1", "'quoted'", "blurred à gauche", "'=twice"]


@pytest.fixture(scope="session")
def course() -> Iterator[Course]:
    with Server(fps=10, seed=1) as server, server.client("researcher") as researcher:
        session = made_up.session(server, iter(SAID), frames=8)
        yield Course(server, session, researcher)


@pytest.fixture(scope="session")
def archive(course: Course, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The blinded export of the session, as a ZIP file."""
    return course.save(tmp_path_factory.mktemp("export") / "session.zip")


@pytest.fixture
def folder(archive: Path, tmp_path: Path) -> Path:
    """The same, unpacked."""
    import zipfile

    with zipfile.ZipFile(archive) as packed:
        packed.extractall(tmp_path / "export")
    inside = list((tmp_path / "export").iterdir())
    return inside[0] if len(inside) == 1 and inside[0].is_dir() else tmp_path / "export"
