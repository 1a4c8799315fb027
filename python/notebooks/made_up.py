"""Sessions that nobody had, by simulated devices: what the notebooks show, and the tests read."""

from __future__ import annotations

import hashlib
import random
import subprocess
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from parfocal import Client, Server
from parfocal.program import find_program

PASSPHRASE = "correct horse battery staple"

PROTOCOL = """\
name = "three-policies"
title = "Comparison of three focus settings"
researcher_title = "Three policies, once each"
policies = ["fixed", "mgm-hill-climber", "parfocal"]
repeats = 1
order = "balanced"
segment_seconds = 60

[[after_segment]]
id = "sharpness"
text = "With this setting, what I wanted to see was in focus."
kind = "likert"
points = 7
low = "Strongly disagree"
high = "Strongly agree"
"""

DEFINITION = """\
name = "made-up"
title = "A study that nobody took part in"
order = "balanced"
aborted = "same-place"
withdrawn = "next-spare"
repeated = "refuse"
when_used_up = "Call the trial office."
may_unblind = ["Dr Ada Lovelace"]
analysis = "Friedman over policies"

[[protocols]]
name = "three-policies"
sha256 = "{sha256}"

[[sites]]
name = "leeds"
title = "Leeds General Infirmary"
surgeons = 6
spares = 0
"""


def walk_through(
    operator: Client, surgeon: Client, session: str, words: Iterator[str], ratings: Iterator[int], frames: int
) -> None:
    """Take a session from its start to its end, as operator and surgeon would."""
    operator.operator.act(session=session, action="start")
    while (now := view(surgeon))["phase"] not in ("completed", "aborted"):
        segment = now.get("segment")
        if now["phase"] == "notice":
            surgeon.surgeon.act(session=session, action="acknowledge", segment=segment)
        elif now["phase"] == "inspecting":
            for _ in range(2):
                # The focal path comes of the frames in between.
                watch(surgeon, frames // 2)
                surgeon.surgeon.comment(
                    key=str(uuid.uuid4()), session=session, segment=segment, kind="text", text=next(words)
                )
            surgeon.surgeon.act(session=session, action="finish-segment", segment=segment)
        else:
            for question in now["questions"]:
                value: Any = next(ratings) if question["kind"] == "likert" else "nothing"
                surgeon.surgeon.answer(
                    key=str(uuid.uuid4()),
                    session=session,
                    segment=segment,
                    question=question["id"],
                    value=value,
                )
            surgeon.surgeon.act(session=session, action="finish-questions", segment=segment)


def view(surgeon: Client) -> dict[str, Any]:
    """Return the session as the surgeon's page gets it."""
    seen = surgeon.surgeon.session()
    if seen is None:
        raise RuntimeError("no session is under way")
    return dict(seen)


def watch(client: Client, count: int) -> None:
    """Look at some live pictures."""
    for _, frame in zip(range(count), client.frames(), strict=False):
        del frame


def session(server: Server, words: Iterator[str], frames: int = 40) -> str:
    """Run a practice session; return its identifier."""
    with server.client("operator") as operator, server.client("surgeon") as surgeon:
        operator.operator.add_participant(code="S-01")
        made = operator.operator.create(participant="S-01", protocol="practice")
        if made is None:
            raise RuntimeError("no session was made")
        walk_through(operator, surgeon, made["session"], words, iter(lambda: 5, 0), frames)
        return made["session"]


def protocols(folder: Path) -> Path:
    """Write the study's protocol into a folder of its own, for `Server(protocols=...)`."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "three-policies.toml").write_text(PROTOCOL)
    return folder


def lead(server: Server) -> Client:
    """Make an account for a lead; return a client that is signed in."""
    command = [find_program(), "account", "add", "ada", "--role", "lead", "--display", "Dr Ada Lovelace"]
    command += ["--data-dir", str(server.data)]
    subprocess.run(command, input=f"{PASSPHRASE}\n", text=True, check=True, capture_output=True)
    client = Client(server.url)
    client.sign_in("ada", PASSPHRASE)
    return client


def study(server: Server, to: Path, surgeons: int = 6, frames: int = 4) -> Path:
    """Run a whole study and unblind it; save its package as a ZIP file and return that."""
    chance = random.Random(1)
    with lead(server) as ada:
        sha256 = hashlib.sha256(PROTOCOL.encode()).hexdigest()
        ada.researcher.plan_study(definition=DEFINITION.format(sha256=sha256), reason="made up")
        ada.researcher.change_study("made-up", change="open", reason="made up")
        for number in range(1, surgeons + 1):
            ada.operator.add_participant(code=f"S-{number:02}")
            place: Any = {"study": "made-up", "site": "leeds"}
            made = ada.operator.create(participant=f"S-{number:02}", protocol="three-policies", study=place)
            if made is None:
                raise RuntimeError("no session was made")
            with Client(server.url, link_key(ada)) as surgeon:
                ratings = iter(lambda: chance.randint(1, 7), 0)
                walk_through(ada, surgeon, made["session"], iter(lambda: "as before", ""), ratings, frames)
            ada.operator.dismiss(session=made["session"])

        ada.researcher.change_study("made-up", change="close", reason="made up")
        for change in ("lock", "unblind"):
            more = {"despite_outstanding": True} if change == "lock" else {}
            ada.researcher.change_study(
                "made-up", change=change, reason="made up", passphrase=PASSPHRASE, **more
            )
        ada.researcher.start_study_export("made-up", unblinded=True)
        while True:
            state: Any = ada.researcher.study_export("made-up")
            if state["state"] == "ready":
                return ada.download("/api/researcher/studies/made-up/export.zip", to)
            if state["state"] != "running":
                raise RuntimeError(f"the export failed: {state}")
            time.sleep(0.1)


def link_key(operator: Client) -> str:
    """Return the key in the link of the session's surgeon."""
    return operator.operator.link()["link"].split("key=")[1]
