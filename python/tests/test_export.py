"""Exports as DataFrames: types, texts as they were said, and what is refused with which sentence."""

from __future__ import annotations

import csv
import json
import shutil
import zipfile
from pathlib import Path
from typing import Any

import made_up
import numpy as np
import pandas as pd
import pytest

import parfocal
from parfocal import Server

from .conftest import SAID, Course


def test_tables_have_the_types_units_and_missing_values_of_their_description(folder: Path) -> None:
    export = parfocal.load(folder, verify="checksums")
    package = json.loads((folder / "datapackage.json").read_text())
    assert set(export) == {resource["name"] for resource in package["resources"]}

    comments = export["comments"]
    assert str(comments["monotonic_ns"].dtype) == "Int64"
    assert isinstance(comments["wall"].dtype, pd.DatetimeTZDtype)
    assert isinstance(comments["kind"].dtype, pd.CategoricalDtype)
    assert comments["waited_ms"].isna().all()
    assert str(comments["late"].dtype) == "boolean"

    path = export["telemetry"]
    assert path["asked"].dtype == np.float64
    assert path["asked"].between(0, 1).all()
    assert len(path) > 5
    assert path.attrs["units"]["exposed_ns"] == "ns"
    assert export.columns("telemetry").loc["exposed_ns", "unit"] == "ns"


def test_texts_are_as_they_were_said(folder: Path) -> None:
    assert list(parfocal.load(folder)["comments"]["text"]) == SAID


def test_nanoseconds_are_not_rounded(folder: Path) -> None:
    export = parfocal.load(folder)
    raw = [line.split(",") for line in (folder / "telemetry.csv").read_text().splitlines()]
    column = raw[0].index("exposed_ns")
    assert [str(value) for value in export["telemetry"]["exposed_ns"]] == [row[column] for row in raw[1:]]


def test_a_zip_file_reads_as_its_folder(archive: Path, folder: Path) -> None:
    packed, unpacked = parfocal.load(archive, verify="checksums"), parfocal.load(folder)
    assert packed.blinded
    assert "blinded" in repr(packed)
    for name in unpacked:
        pd.testing.assert_frame_equal(packed[name], unpacked[name])


def test_the_program_verifies_it(folder: Path) -> None:
    checks = parfocal.load(folder, verify=True).verify()
    assert set(checks["verdict"]) <= {"passed", "not-checked"}
    assert "passed" in set(checks["verdict"])


def damage(folder: Path, what: str) -> Any:
    package = folder / "datapackage.json"
    described = json.loads(package.read_text())
    match what:
        case "a table is gone":
            (folder / "comments.csv").unlink()
        case "a table is cut off":
            content = (folder / "telemetry.csv").read_bytes()
            (folder / "telemetry.csv").write_bytes(content[:-10])
        case "a newer format":
            described["parfocal"] |= {"format": 99, "version": "9.1.0"}
            package.write_text(json.dumps(described))
        case "another's package":
            del described["parfocal"]
            package.write_text(json.dumps(described))
        case "the description is cut off":
            package.write_text(package.read_text()[:500])
        case "no description":
            package.unlink()


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        ("a table is gone", "lacks the file comments.csv. The copy is not complete"),
        ("a table is cut off", "telemetry.csv has .* bytes instead of .*cut off or changed"),
        ("a newer format", "format 99 and was written by parfocal 9.1.0.*pip install --upgrade"),
        ("another's package", "not one that parfocal wrote"),
        ("the description is cut off", "datapackage.json is cut off or damaged.*Copy the export again"),
        ("no description", "is not an export: it has no datapackage.json"),
    ],
)
def test_what_cannot_be_loaded_is_refused_with_a_sentence(folder: Path, what: str, sentence: str) -> None:
    damage(folder, what)
    with pytest.raises(parfocal.BadExport, match=sentence):
        parfocal.load(folder)


def test_a_changed_value_loads_but_does_not_verify(folder: Path) -> None:
    table = folder / "comments.csv"
    changed = table.read_text().replace("blurred", "sharper")
    table.write_text(changed)
    assert "sharper à gauche" in set(parfocal.load(folder)["comments"]["text"])
    with pytest.raises(parfocal.BadExport, match=r"does not verify: comments.csv was changed"):
        parfocal.load(folder, verify="checksums")
    with pytest.raises(parfocal.BadExport, match=r"does not verify.*Do not use it"):
        parfocal.load(folder, verify=True)


def test_damaged_checksums_do_not_verify(folder: Path) -> None:
    sums = folder / "SHA256SUMS"
    sums.write_bytes(sums.read_bytes().replace(b"comments.csv", b"comments.\xff\xfev"))
    with pytest.raises(parfocal.BadExport, match=r"lacks the file comments"):
        parfocal.load(folder, verify="checksums")


def test_a_file_that_does_not_belong_to_it_does_not_verify(folder: Path) -> None:
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(parfocal.BadExport, match=r"notes.txt does not belong"):
        parfocal.load(folder, verify="checksums")


def test_files_of_operating_systems_do_not_belong_to_it(folder: Path, tmp_path: Path) -> None:
    (folder / ".DS_Store").write_bytes(b"\0")
    (folder / "thumbs.db").write_bytes(b"\0")
    assert list(parfocal.load(folder, verify="checksums")["comments"]["text"]) == SAID

    packed = tmp_path / "packed.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("__MACOSX/export/._comments.csv", "")
        for file in folder.iterdir():
            archive.write(file, f"export/{file.name}")
    assert list(parfocal.load(packed, verify="checksums")["comments"]["text"]) == SAID


def test_a_number_beyond_63_bits_leaves_its_cell_empty_and_the_others_as_they_are(folder: Path) -> None:
    table = folder / "comments.csv"
    columns, *rows = csv.reader(table.read_text().splitlines())
    frame = columns.index("frame")
    rows[0][frame] = str((1 << 64) - 1)
    rows[1][frame] = str((1 << 63) - 1)
    with table.open("w", newline="") as out:
        csv.writer(out).writerows([columns, *rows])
    described = json.loads((folder / "datapackage.json").read_text())
    next(one for one in described["resources"] if one["name"] == "comments")["bytes"] = table.stat().st_size
    (folder / "datapackage.json").write_text(json.dumps(described))

    frames = parfocal.load(folder)["comments"]["frame"]
    assert frames.isna()[0]
    assert frames[1] == (1 << 63) - 1


def test_a_download_that_was_cut_off_is_no_export(archive: Path, tmp_path: Path) -> None:
    part = tmp_path / "part.zip"
    part.write_bytes(archive.read_bytes()[:-200])
    with pytest.raises(parfocal.BadExport, match=r"download it again"):
        parfocal.load(part)
    with pytest.raises(parfocal.BadExport, match=r"There is no export at"):
        parfocal.load(tmp_path / "nowhere")


def test_what_a_package_lacks_of_a_session_is_noticed(tmp_path: Path) -> None:
    with Server(fps=10, seed=1, protocols=made_up.protocols(tmp_path / "protocols")) as server:
        packed = made_up.study(server, tmp_path / "package.zip", surgeons=2)
    with zipfile.ZipFile(packed) as archive:
        archive.extractall(tmp_path / "unpacked")
    (package,) = (tmp_path / "unpacked").iterdir()
    export = parfocal.load(package, verify="checksums")
    first, second = export.sessions
    assert set(export["telemetry"]["session"]) == {first, second}
    columns = export.columns("telemetry")
    assert list(columns.index) == list(export["telemetry"].columns)
    assert columns["description"].str.len().gt(0).all()

    telemetry = package / "sessions" / first / "telemetry.csv"
    telemetry.write_bytes(b"".join(telemetry.read_bytes().splitlines(keepends=True)[:-1]))
    with pytest.raises(parfocal.BadExport, match=rf"sessions/{first}/telemetry.csv has .* bytes instead of"):
        parfocal.load(package)
    shutil.rmtree(package / "sessions" / second)
    shutil.rmtree(package / "sessions" / first)
    with pytest.raises(parfocal.BadExport, match=r"lacks the export of session .* not complete"):
        parfocal.load(package)


def test_a_table_that_is_not_there_is_named_with_those_that_are(folder: Path) -> None:
    with pytest.raises(KeyError, match=r"no such table; it has .*telemetry"):
        parfocal.load(folder)["ratings"]


def test_the_description_of_an_unblinded_session_adds_policies(course: Course, tmp_path: Path) -> None:
    course.researcher.researcher.unblind(course.session, reason="practice", despite_outstanding=True)
    zipped = tmp_path / "unblinded.zip"
    path = f"/api/researcher/sessions/{course.session}/export.zip?unblinded=true"
    export = parfocal.load(course.researcher.download(path, zipped))
    assert not export.blinded
    assert set(export["policy_steps"]["policy"].cat.categories) == {"fixed", "mgm-hill-climber"}
