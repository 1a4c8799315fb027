"""Exports of sessions, and packages of whole studies, as labelled DataFrames."""

from __future__ import annotations

import hashlib
import io
import json
import os
import subprocess
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd

from .errors import BadExport
from .program import find_program, last_words, starting

NEWEST_FORMAT = 1
"""The newest format of exports that this version reads."""

# Columns of words that stand for groups, in whatever table they are.
_GROUPS = frozenset(
    {
        "device", "ended", "how", "kind", "media_type", "medium", "participant", "policy", "protocol",
        "question", "role", "segment", "session", "site", "standing", "status", "study", "subject",
    }
)  # fmt: skip

# What a spreadsheet would take for the beginning of a formula; such texts have an apostrophe before them.
_FORMULA = ("=", "+", "-", "@", "＝", "＋", "－", "＠", "\t", "\r", "\n")  # noqa: RUF001

# Largest integer of an ``Int64``.
_MOST = (1 << 63) - 1

# Tables with a row for each frame. In a study's package only the sessions' own exports have them as CSV.
_LONG = ("telemetry", "policy_steps")

# The columns that tell apart the rows of a package's sessions, in their order.
_OF_SESSIONS = ("site", "session")


class _Files:
    """The files of an export, in a folder or a ZIP file, without those that operating systems add."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._zip: zipfile.ZipFile | None = None
        self._prefix = ""
        if path.is_dir():
            below = (file.relative_to(path).as_posix() for file in path.rglob("*") if file.is_file())
            self.names = {name for name in below if not _is_systems_own(name)}
            return
        if not path.exists():
            raise BadExport(f"There is no export at {path}. Check the path.")
        try:
            self._zip = zipfile.ZipFile(path)
        except (zipfile.BadZipFile, OSError) as error:
            raise BadExport(
                f"{path} is neither an export's folder nor its ZIP file ({error}). "
                "If it was downloaded, the download may be cut off: download it again."
            ) from error
        names = [
            name for name in self._zip.namelist() if not name.endswith("/") and not _is_systems_own(name)
        ]
        # A ZIP file made of a folder has the folder's name in front.
        tops = {name.split("/")[0] for name in names}
        if "datapackage.json" not in names and len(tops) == 1:
            self._prefix = f"{tops.pop()}/"
        self.names = {name.removeprefix(self._prefix) for name in names}

    def read(self, name: str) -> bytes:
        if name not in self.names:
            raise BadExport(
                f"{self.path} lacks the file {name}. The copy is not complete: copy or download the export again."
            )
        try:
            if self._zip is None:
                return (self.path / name).read_bytes()
            return self._zip.read(self._prefix + name)
        except (OSError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
            # A RuntimeError is a way of packing that Python does not know, or a passphrase.
            raise BadExport(
                f"{self.path}: {name} cannot be read ({error}). Copy the export again."
            ) from error

    def size(self, name: str) -> int:
        if self._zip is None:
            return (self.path / name).stat().st_size
        return self._zip.getinfo(self._prefix + name).file_size


def _is_systems_own(name: str) -> bool:
    """Whether a file is not the export's but an operating system's, as the program tells it."""
    parts = name.lower().split("/")
    return any(part.startswith(".") or part in ("thumbs.db", "desktop.ini") for part in parts)


class Export(Mapping[str, pd.DataFrame]):
    """An export of a session, or a study's package: its tables by name, read when they are first used.

    Each table's ``attrs`` hold ``description``, and for each column ``descriptions`` and ``units``.
    """

    def __init__(self, files: _Files, package: dict[str, Any], parent: str = "") -> None:
        self._files = files
        self._parent = parent
        self.description = package
        """``datapackage.json`` as it is."""
        self._resources: dict[str, dict[str, Any]] = {
            resource["name"]: resource
            for resource in package.get("resources", [])
            if isinstance(resource, dict) and resource.get("format") == "csv"
        }
        self._tables: dict[str, pd.DataFrame] = {}
        # Tables that a package has only as Parquet are joined from its sessions' own.
        self._joined = [
            name
            for name in _LONG
            if self.is_package
            and name not in self._resources
            and any(file.startswith("sessions/") and file.endswith(f"/{name}.csv") for file in files.names)
        ]

    @property
    def path(self) -> Path:
        """The folder or ZIP file."""
        return self._files.path

    @property
    def about(self) -> dict[str, Any]:
        """What parfocal says of the export: version, format, blinded, study."""
        about = self.description.get("parfocal")
        return about if isinstance(about, dict) else {}

    @property
    def blinded(self) -> bool:
        """Whether it tells no policies."""
        return bool(self.about.get("blinded", True))

    @property
    def is_package(self) -> bool:
        """Whether it is a whole study's package."""
        return self.about.get("package") == "study"

    @property
    def sessions(self) -> dict[str, Export]:
        """The exports of a package's sessions, by the session's identifier."""
        names = sorted({file.split("/")[1] for file in self._files.names if file.startswith("sessions/")})
        return {
            name: Export(self._files, _package(self._files, f"sessions/{name}/"), f"sessions/{name}/")
            for name in names
        }

    def columns(self, table: str) -> pd.DataFrame:
        """Return the data dictionary of a table: a row for each column, with type, unit and meaning."""
        fields = self._fields(self._resource(table))
        rows = [[field.get(key, "") for key in ("type", "unit", "description")] for field in fields]
        index = pd.Index([field["name"] for field in fields], name="column")
        return pd.DataFrame(rows, index=index, columns=["type", "unit", "description"])

    def verify(self, program: str | os.PathLike[str] | None = None) -> pd.DataFrame:
        """Check the export as ``parfocal verify`` does: checksums, chain of records, commitments.

        Returns the checks. Raises `BadExport` if one failed.
        """
        if self.path.is_file():
            raise BadExport(f"{self.path} is a ZIP file: unpack it, then load and verify the folder.")
        command = [find_program(program), "verify", str(self.path), "--json"]
        with starting(command[0]):
            done = subprocess.run(
                command, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False
            )
        try:
            checks = pd.DataFrame(json.loads(done.stdout), columns=["name", "verdict", "detail"])
        except ValueError:
            raise BadExport(f"{self.path} cannot be verified: {last_words(done.stderr)}") from None
        failed = checks[checks["verdict"] == "failed"]
        if done.returncode != 0 or len(failed):
            why = "; ".join(f"{row['name']}: {row['detail']}" for _, row in failed.iterrows())
            raise BadExport(f"{self.path} does not verify: {why or last_words(done.stderr)}. Do not use it.")
        return checks

    def verify_checksums(self) -> None:
        """Check every file against ``SHA256SUMS``. Needs no program, and finds damage, not forgery."""
        listed: set[str] = set()
        # A damaged name is then that of a file which is not there.
        sums = self._files.read(f"{self._parent}SHA256SUMS").decode(errors="replace")
        for line in sums.splitlines():
            sha256, _, name = line.partition("  ")
            listed.add(name)
            if hashlib.sha256(self._files.read(self._parent + name)).hexdigest() != sha256:
                raise BadExport(
                    f"{self.path} does not verify: {name} was changed or damaged after the export. Export again."
                )
        own = {name.removeprefix(self._parent) for name in self._files.names if name.startswith(self._parent)}
        extra = own - listed - {"SHA256SUMS"}
        if extra:
            raise BadExport(
                f"{self.path} does not verify: {min(extra)} does not belong to the export. Remove it, or export again."
            )

    def __getitem__(self, name: str) -> pd.DataFrame:
        if name not in self._tables:
            self._tables[name] = (
                self._join(name) if name in self._joined else self._read(self._resource(name))
            )
        return self._tables[name]

    def __iter__(self) -> Iterator[str]:
        yield from self._resources
        yield from self._joined

    def __len__(self) -> int:
        return len(self._resources) + len(self._joined)

    def __repr__(self) -> str:
        kind = "package of a study" if self.is_package else "export of a session"
        return f"<parfocal {kind}, {'blinded' if self.blinded else 'unblinded'}: {', '.join(self)}>"

    def _resource(self, name: str) -> dict[str, Any]:
        if name in self._resources:
            return self._resources[name]
        if name in self._joined:
            return self._joined_resource(name)
        raise KeyError(f"{name}: the export has no such table; it has {', '.join(self)}")

    def _joined_resource(self, name: str) -> dict[str, Any]:
        """Return the description of a joined table: its own columns, after those that tell its sessions apart."""
        own = next(export._resources[name] for export in self.sessions.values() if name in export)
        fields = self._fields(own)
        known = {field["name"] for field in fields}
        added = [
            field
            for field in self._fields(self._resource("sessions"))
            if field["name"] in _OF_SESSIONS and field["name"] not in known
        ]
        added.sort(key=lambda field: _OF_SESSIONS.index(field["name"]))
        return {**own, "schema": {**own.get("schema", {}), "fields": added + fields}}

    @staticmethod
    def _fields(resource: dict[str, Any]) -> list[dict[str, Any]]:
        fields: list[dict[str, Any]] = resource.get("schema", {}).get("fields", [])
        return fields

    def _read(self, resource: dict[str, Any]) -> pd.DataFrame:
        path = resource["path"]
        raw = self._files.read(self._parent + path)
        missing = resource.get("schema", {}).get("missingValues", [""])
        try:
            texts = pd.read_csv(io.BytesIO(raw), dtype=str, keep_default_na=False, encoding="utf-8")
        except (ValueError, pd.errors.ParserError) as error:
            raise BadExport(f"{self.path}: {path} is damaged ({error}). Export again.") from error

        columns: dict[str, pd.Series[Any]] = {}
        for field in self._fields(resource):
            name = field["name"]
            if name not in texts:
                raise BadExport(f"{self.path}: {path} lacks its column '{name}'. Export again.")
            try:
                columns[name] = _typed(texts[name], field, missing)
            except (ValueError, TypeError) as error:
                kind = field.get("type")
                raise BadExport(
                    f"{self.path}: in {path}, column '{name}' is not of its type {kind} ({error}). Export again."
                ) from error
        return self._described(pd.DataFrame(columns), resource)

    def _join(self, name: str) -> pd.DataFrame:
        parts = []
        for session, export in self.sessions.items():
            if name in export:
                part = export[name]
                site = self["sessions"].set_index("session")["site"].get(session)
                part.insert(0, "site", site)
                if "session" not in part:
                    part.insert(1, "session", session)
                parts.append(part)
        joined = pd.concat(parts, ignore_index=True)
        for column in joined.columns.intersection(list(_GROUPS)):
            joined[column] = joined[column].astype("category")
        return self._described(joined, self._resource(name))

    def _described(self, table: pd.DataFrame, resource: dict[str, Any]) -> pd.DataFrame:
        fields = self._fields(resource)
        table.attrs["description"] = resource.get("description", "")
        table.attrs["descriptions"] = {field["name"]: field.get("description", "") for field in fields}
        table.attrs["units"] = {field["name"]: field["unit"] for field in fields if field.get("unit")}
        return table


def load(
    path: str | os.PathLike[str],
    *,
    verify: bool | Literal["checksums"] = False,
    program: str | os.PathLike[str] | None = None,
) -> Export:
    """Load an export of a session, or a study's package: a folder, or the ZIP file of a page.

    ``verify=True`` checks it as ``parfocal verify`` does and needs the program; ``verify="checksums"``
    compares its files with their checksums alone.
    """
    files = _Files(Path(path))
    if "datapackage.json" not in files.names:
        raise BadExport(
            f"{path} is not an export: it has no datapackage.json. Name the folder that 'parfocal export' wrote; "
            "if it was copied, copy it again."
        )
    package = _package(files, "")
    export = Export(files, package)
    _check_complete(export, files)
    if export.is_package:
        exports = export.sessions
        for session in export["sessions"]["session"]:
            if session not in exports:
                raise BadExport(
                    f"{path} lacks the export of session {session}. The copy is not complete: copy or download the "
                    "package again."
                )
            _check_complete(exports[session], files)
    if verify == "checksums":
        export.verify_checksums()
    elif verify:
        export.verify(program)
    return export


def _package(files: _Files, parent: str) -> dict[str, Any]:
    raw = files.read(f"{parent}datapackage.json")
    try:
        package = json.loads(raw)
    except ValueError as error:
        raise BadExport(
            f"{files.path}: {parent}datapackage.json is cut off or damaged ({error}). Copy the export again."
        ) from error
    about = package.get("parfocal") if isinstance(package, dict) else None
    if not isinstance(about, dict):
        raise BadExport(f"{files.path} is a data package, but not one that parfocal wrote.")
    form = about.get("format")
    if not isinstance(form, int) or form > NEWEST_FORMAT:
        raise BadExport(
            f"{files.path} has format {form} and was written by parfocal {about.get('version', 'of another version')}; "
            f"this package reads formats up to {NEWEST_FORMAT}. Update it: pip install --upgrade parfocal."
        )
    assert isinstance(package, dict)
    return package


def _check_complete(export: Export, files: _Files) -> None:
    """Every file that the description names is there with all its bytes."""
    for resource in export.description.get("resources", []):
        path = export._parent + resource["path"]
        if path not in files.names:
            raise BadExport(
                f"{files.path} lacks the file {path}. The copy is not complete: copy or download the export again."
            )
        size = resource.get("bytes")
        if isinstance(size, int) and files.size(path) != size:
            raise BadExport(
                f"{files.path}: {path} has {files.size(path)} bytes instead of {size}. It was cut off or changed: "
                "copy or download the export again."
            )


def _typed(texts: pd.Series[str], field: dict[str, Any], missing: list[str]) -> pd.Series[Any]:
    """Return a column with the type that its field names."""
    absent = texts.isin(missing)
    match field.get("type"):
        case "integer":
            # Through objects: float64 would round large times in nanoseconds.
            numbers = [pd.NA if no else int(text) for text, no in zip(texts, absent, strict=True)]
            # Only a faulty page sends a number beyond 63 bits, such as that of a frame; as in the Parquet files, the
            # cell is empty.
            fitting = [pd.NA if number is pd.NA or number > _MOST else number for number in numbers]
            return pd.Series(fitting, index=texts.index, dtype="Int64")
        case "number":
            return texts.mask(absent, "nan").astype(np.float64)
        case "boolean":
            unknown = set(texts[~absent]) - {"true", "false"}
            if unknown:
                raise ValueError(f"'{min(unknown)}' is neither true nor false")
            return (texts == "true").astype("boolean").mask(absent)
        case "datetime":
            return pd.to_datetime(texts.mask(absent), utc=True, format="ISO8601")
        case _:
            read = texts.map(_text).mask(absent)
            constraints = field.get("constraints", {})
            allowed = field.get("categories") or constraints.get("enum")
            if allowed:
                return read.astype(pd.CategoricalDtype(allowed))
            return read.astype("category") if field["name"] in _GROUPS else read.astype("string")


def _text(cell: str) -> str:
    """Return a text without the apostrophe that keeps a spreadsheet from running it."""
    return cell[1:] if cell.startswith("'") and cell.lstrip("'").startswith(_FORMULA) else cell
