"""Computes the chain of an export again, from docs/evidence.md alone, with nothing but Python's own library."""

import csv
import hashlib
import json
import pathlib
import sys

FORMULA = tuple("=+-@＝＋－＠\t\r\n")


def rows(folder, name):
    with open(folder / f"{name}.csv", newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def sha256(*fields):
    digest = hashlib.sha256()
    for field in fields:
        field = field.encode()
        digest.update(b"%d:%s," % (len(field), field))
    return digest.hexdigest()


def text(cell):
    """A text without the apostrophe that keeps spreadsheets from running it."""
    return cell[1:] if cell.startswith("'") and cell.lstrip("'").startswith(FORMULA) else cell


OPEN = {
    "run": ("runs", "run wall monotonic_ns version camera lens calibration blur"),
    "session": (
        "sessions",
        "session participant protocol protocol_sha256 practice algorithm commitment wall run monotonic_ns segments",
    ),
    "event": (
        "events",
        "session number wall run monotonic_ns role kind segment inspected_ms emergency about focal_power left_at "
        "hidden picture_width picture_height pictures over_ms frame touched_x touched_y patch_across patch_down",
    ),
    "comment": (
        "comments",
        "key session segment kind frame frame_run picture_width pictures_per_second wall run monotonic_ns "
        "client_millis waited_ms waited_by device sequence late",
    ),
    "answer": (
        "answers",
        "key session segment question wall run monotonic_ns client_millis waited_ms waited_by device sequence late",
    ),
    "device": ("devices", "number wall run monotonic_ns device working message"),
    "access": ("accesses", "number wall run monotonic_ns role kind session detail"),
    "correction": ("corrections", "number session subject record field role wall run monotonic_ns"),
    "consent": ("consents", "number session text_version given_on medium role wall run monotonic_ns"),
    "erasure": ("erasures", "number session subject record role wall run monotonic_ns"),
    "study": ("studies", "study definition_sha256 sites wall"),
    "study-event": (
        "study_events",
        "study number wall run monotonic_ns role person kind about_session commitment",
    ),
    "study-session": ("study_sessions", "session study site protocol place"),
    "actor": ("actors", "number kind record session account display"),
    "voice-piece": (
        "voice_pieces",
        "number session comment piece media_type through_ms ended bytes sha256 wall run monotonic_ns",
    ),
}
SEALED = {
    "event": ["reason"],
    "comment": ["text"],
    "answer": ["given_value"],
    "correction": ["old_value", "new_value", "reason"],
    "consent": ["obtained_by"],
    "erasure": ["reason"],
    "study-event": ["reason"],
}


def main(folder):
    tables = {kind: rows(folder, table) for kind, (table, _) in OPEN.items()}
    segments = rows(folder, "segments")
    tables["session"][0]["segments"] = ",".join(row["segment"] for row in segments)
    setting = {row["segment"]: row["setting"] for row in segments}
    salts = {}
    steps = None
    if (folder / "chain_salts.csv").exists():
        salts = {row["number"]: row["salt"] for row in rows(folder, "chain_salts")}
        steps = rows(folder, "policy_steps")
        reason = json.loads((folder / "allocation.json").read_text())["unblinding_reason"]
        for event in tables["event"]:
            if event["kind"] == "unblinded":
                event["reason"] = reason
    telemetry = rows(folder, "telemetry")

    keys = {
        "run": lambda row: row["run"],
        "session": lambda row: row["session"],
        "event": lambda row: f"{row['session']}/{row['number']}",
        "comment": lambda row: row["key"],
        "answer": lambda row: row["key"],
        "device": lambda row: row["number"],
        "access": lambda row: row["number"],
        "correction": lambda row: row["number"],
        "consent": lambda row: row["number"],
        "erasure": lambda row: row["number"],
        "study": lambda row: row["study"],
        "study-event": lambda row: f"{row['study']}/{row['number']}",
        "study-session": lambda row: row["session"],
        "actor": lambda row: row["number"],
        "voice-piece": lambda row: row["number"],
    }
    records = {(kind, keys[kind](row)): row for kind, found in tables.items() for row in found}

    previous = "0" * 64
    seen = withheld = 0
    for number, row in enumerate(rows(folder, "chain"), 1):
        assert row["number"] == str(number), f"row {number} is missing"
        if row["kind"]:
            kind, sealed = row["kind"], row["sealed"]
            salt = row["sealed_salt"] or salts.get(row["number"])
            if kind == "telemetry":
                segment, first, last = row["key"].split("/")
                part = slice(int(first) - 1, int(last))
                of_it = [step for step in telemetry if step["setting"] == setting[segment]][part]
                names = "run frame exposed_ns asked measured held optimal picture_width patch_x patch_y".split()
                open_hash = sha256("parfocal-steps-1", *(step[name] for step in of_it for name in names))
                content = ["segment", segment, "first", first, "last", last, "steps_sha256", open_hash]
                hidden = None
                if steps is not None:
                    of_it = [step for step in steps if step["setting"] == setting[segment]][part]
                    names = "policy metric policy_micros latency_micros held".split()
                    hidden = [step[name] for step in of_it for name in names]
            else:
                record = records.pop((kind, row["key"]))
                content = [part for name in OPEN[kind][1].split() for part in (name, text(record[name]))]
                hidden = [text(record[name]) for name in SEALED.get(kind, [])] or None
            if salt and hidden is not None:
                assert sha256("parfocal-sealed-1", salt, *hidden) == sealed, f"{kind} {row['key']} was changed"
            elif sealed:
                withheld += 1
            found = sha256("parfocal-record-1", kind, *content, sealed)
            assert found == row["content"], f"{kind} {row['key']} was changed"
            before = [row[name] for name in "salt wall kind key session place".split()]
            found = sha256("parfocal-entry-1", *before, "false", row["sealed"], row["content"])
            assert found == row["entry"], f"row {number} was changed"
            seen += 1
        found = sha256("parfocal-chain-1", str(number), previous, row["entry"])
        assert found == row["hash"], f"row {number} was changed"
        previous = row["hash"]
    assert not records, f"no row tells of {sorted(records)[0]}"
    print(json.dumps({"head": f"{number}:{previous}", "whole": seen, "withheld": withheld}))


main(pathlib.Path(sys.argv[1]))
