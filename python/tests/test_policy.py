"""Policies in processes of their own, run by the real program."""

from __future__ import annotations

import hashlib
import json
import shlex
import subprocess
import sys
import time
import uuid
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import made_up
import pytest

import parfocal
import parfocal.policy
from parfocal import Server
from parfocal.program import find_program

from .conftest import ROOT

# The paper's hill-climber, written anew.
CLIMBER = """
import numpy as np
import parfocal.policy

state = {}

def reset():
    state.update(last=-np.inf, direction=1.0)

def step(picture, focal_power):
    padded = np.pad(picture, 1, mode="edge")
    smooth = padded[:-2] + 2 * padded[1:-1] + padded[2:]
    slope = padded[2:] - padded[:-2]
    across = smooth[:, 2:] - smooth[:, :-2]
    down = slope[:, :-2] + 2 * slope[:, 1:-1] + slope[:, 2:]
    metric = float(np.sqrt(across * across + down * down).sum(0).astype(float).sum() / 1024)
    if not (1e-9 < focal_power < 1 - 1e-9 and metric > state["last"]):
        state["direction"] *= -1
    state["last"] = metric
    return state["direction"] * 0.05

parfocal.policy.serve(step, reset=reset)
"""

# Does what a file says, which a test may change while it runs.
OBEDIENT = """
import os, sys, time
import parfocal.policy

def step(picture, focal_power):
    print("overheard")
    order = open(sys.argv[1]).read()
    if order == "hang":
        time.sleep(1000)
    if order == "end":
        sys.exit(3)
    if order == "nonsense":
        os.write(int(os.environ["PARFOCAL_POLICY_SOCKET"]), b"hello, lens")
    if order == "not a number":
        return float("nan")
    return parfocal.policy.Move(target=0.75, metric=5.0, belief=[0.0, 0.25, 0.75])

parfocal.policy.serve(step)
"""


def command(folder: Path, source: str, *arguments: object) -> str:
    file = folder / "mine.py"
    file.write_text(source)
    return "exec:" + shlex.join([sys.executable, "-s", str(file), *map(str, arguments)])


def evaluate(*policies: str, count: int = 1) -> subprocess.CompletedProcess[str]:
    words = [find_program(), "evaluate", "--json", "--count", str(count)]
    for policy in policies:
        words += ["--policies", policy]
    return subprocess.run(words, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)


def refusal(*policies: str) -> str:
    done = evaluate(*policies)
    assert done.returncode == 1, done.stdout
    return done.stderr


def wait_until(happened: Callable[[], Any], seconds: float = 60) -> None:
    for _ in range(int(seconds * 20)):
        if happened():
            return
        time.sleep(0.05)
    raise AssertionError(f"it did not happen within {seconds} s")


def running(word: str) -> list[str]:
    """Policies' processes whose command has ``word``."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            words = (process / "cmdline").read_text().split("\0")
        except OSError:
            continue
        if words[0] == sys.executable and any(word in one for one in words):
            found.append(process.name)
    return found


def test_a_process_has_the_figures_of_the_same_policy_built_in(tmp_path: Path) -> None:
    done = evaluate("mgm-hill-climber", command(tmp_path, CLIMBER), count=3)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    rows = [row for row in report["rows"] if row["policy"] != "oracle"]
    built_in, mine = ({**row, "policy": ""} for row in rows)
    assert mine == built_in
    # Its program and its script are identified as weights are.
    files = [Path(sys.executable).resolve().read_bytes(), (tmp_path / "mine.py").read_bytes()]
    assert report["weights"][rows[1]["policy"]] == hashlib.sha256(b"".join(files)).hexdigest()
    wait_until(lambda: not running(str(tmp_path)))


def test_what_a_process_prints_confuses_nothing(tmp_path: Path) -> None:
    (tmp_path / "order").write_text("follow")
    done = evaluate(command(tmp_path, OBEDIENT, tmp_path / "order"))
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)
    assert "policy: overheard" in done.stderr


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ("end", "it failed at a test picture: its process ended (exit code 3); its last line: overheard"),
        ("nonsense", "it sent 11 bytes where an answer has 40"),
        ("not a number", "it sent NaN as a focal power"),
    ],
)
def test_a_process_that_fails_ends_an_evaluation_with_a_sentence(
    tmp_path: Path, order: str, words: str
) -> None:
    (tmp_path / "order").write_text(order)
    assert words in refusal(command(tmp_path, OBEDIENT, tmp_path / "order"))
    wait_until(lambda: not running(str(tmp_path)))


@pytest.mark.parametrize(
    ("does", "words"),
    [
        ("sys.exit(5)", "at frame 10, its process ended (exit code 5)"),
        ("time.sleep(1000)", "at frame 10, it did not answer in time"),
    ],
)
def test_a_process_that_fails_later_is_reported_with_the_frame(tmp_path: Path, does: str, words: str) -> None:
    # Two test pictures come before the scan.
    source = f"""
import sys, time
import parfocal.policy

seen = []

def step(pictures, focal_power):
    assert pictures.shape == (3, 32, 32) and (pictures >= 0).all() and (pictures <= 255).all()
    seen.append(focal_power)
    if len(seen) == 12:
        {does}
    return 0

parfocal.policy.serve(step, view="view")
"""
    assert words in refusal(command(tmp_path, source))
    wait_until(lambda: not running(str(tmp_path)))


def test_the_process_in_c_of_the_documentation_works(tmp_path: Path) -> None:
    document = (ROOT / "docs" / "policies.md").read_text()
    (tmp_path / "mine.c").write_text(document.split("```c\n")[1].split("```")[0])
    program = tmp_path / "mine"
    subprocess.run(["cc", "-Wall", "-Werror", "-o", program, tmp_path / "mine.c"], check=True)
    done = evaluate(f"exec:{program}")
    assert done.returncode == 0, done.stderr
    # It moves by a step in every frame.
    row = next(row for row in json.loads(done.stdout)["rows"] if row["policy"] != "oracle")
    assert 0 < row["travel"] <= 0.0501


def test_a_surgeon_hears_nothing_of_a_process(tmp_path: Path) -> None:
    (tmp_path / "order").write_text("follow")
    policy = command(tmp_path, OBEDIENT, tmp_path / "order")
    protocol = made_up.PROTOCOL.replace('"mgm-hill-climber", "parfocal"', json.dumps(policy))
    folder = tmp_path / "protocols"
    folder.mkdir()
    (folder / "three-policies.toml").write_text(protocol)

    with Server(policy=policy, protocols=folder, fps=10) as server:
        heard: list[str] = []
        with server.client() as operator, server.client("surgeon") as surgeon:
            operator.operator.add_participant(code="S-01")
            made = operator.operator.create(participant="S-01", protocol="three-policies")
            assert made is not None
            session = made["session"]
            operator.operator.act(session=session, action="start")
            for _ in range(2):
                now = made_up.view(surgeon)
                act = partial(surgeon.surgeon.act, session=session, segment=now["segment"])
                act(action="acknowledge")
                for _, frame in zip(range(15), surgeon.frames(), strict=False):
                    heard += [json.dumps(part) for part in (frame.header, frame.status, frame.session)]
                act(action="finish-segment")
                now = made_up.view(surgeon)
                heard.append(json.dumps(now))
                for question in now["questions"]:
                    surgeon.surgeon.answer(
                        key=str(uuid.uuid4()),
                        session=session,
                        segment=now["segment"],
                        question=question["id"],
                        value=4,
                    )
                act(action="finish-questions")
            heard.append(json.dumps(made_up.view(surgeon)))
        assert len(heard) > 60
        for word in ("exec", "mine.py", "overheard", "python", "polic"):
            assert not [said for said in heard if word in said]
            assert word in ("polic", "python") or word not in server.log


def test_a_process_that_does_not_start_is_refused_with_the_reason(tmp_path: Path) -> None:
    assert "there is no program 'no-such-policy' on the PATH" in refusal("exec:no-such-policy --fast")
    assert "never closed" in refusal("exec:python3 'mine.py")
    ended = refusal(command(tmp_path, "import no_such_package"))
    assert "its process ended (exit code 1)" in ended
    assert "its last line: ModuleNotFoundError: No module named 'no_such_package'" in ended
    with pytest.raises(parfocal.NoProgram, match="there is no program 'no-such-policy'"):
        Server(policy="exec:no-such-policy")


def test_a_policy_started_by_hand_says_who_must_start_it() -> None:
    with pytest.raises(parfocal.ParfocalError, match="exec:python3 FILE"):
        parfocal.policy.serve(lambda picture, focal_power: 0.0)


def is_held(hold: str, frame: Any) -> bool:
    return bool(frame.status["held"] == hold)


def test_a_process_drives_a_lens_fails_and_comes_back(tmp_path: Path) -> None:
    order = tmp_path / "order"
    order.write_text("follow")
    policy = command(tmp_path, OBEDIENT, order)
    with Server(policy=policy, fps=10) as server, server.client() as client:
        client.operator.focus(policy=policy)
        frames = client.frames()

        def until(wanted: Callable[[Any], bool]) -> Any:
            end = time.monotonic() + 60
            for frame in frames:
                if wanted(frame):
                    return frame
                assert time.monotonic() < end, frame.status
            raise AssertionError("the frames ended")

        until(lambda frame: frame.focal_power == 0.75)
        assert "overheard" not in server.log

        failures = [("hang", "policy-slow"), ("end", "policy-panicked"), ("nonsense", "policy-nonsense")]
        for failure, held in failures:
            order.write_text(failure)
            failing = until(partial(is_held, held))
            assert "the lens is held" in failing.status["message"]
            order.write_text("follow")
            until(lambda frame: frame.status["held"] is None)

        assert len(running(str(order))) == 1
    wait_until(lambda: not running(str(order)))


def test_a_policy_in_use_can_be_chosen_again_and_for_a_session(tmp_path: Path) -> None:
    order = tmp_path / "order"
    order.write_text("follow")
    policy = command(tmp_path, OBEDIENT, order)
    folder = tmp_path / "protocols"
    folder.mkdir()
    protocol = made_up.PROTOCOL.replace('"mgm-hill-climber", "parfocal"', json.dumps(policy))
    (folder / "three-policies.toml").write_text(protocol)

    with Server(policy=policy, protocols=folder, fps=10) as server, server.client() as client:
        client.operator.focus(policy=policy)
        assert next(frame for frame in client.frames() if frame.focal_power == 0.75)
        client.operator.focus(policy=policy)
        client.operator.add_participant(code="S-01")
        assert client.operator.create(participant="S-01", protocol="three-policies") is not None
        # Whether it can run is known without a second process, which could take long to start.
        assert len(running(str(order))) == 1


def test_a_process_that_fails_again_and_again_is_said_to_fail(tmp_path: Path) -> None:
    order = tmp_path / "order"
    order.write_text("follow")
    source = OBEDIENT.replace("order = open", "seen.append(1)\n    order = len(seen) > 2 and open")
    policy = command(tmp_path, "seen = []\n" + source, order)
    with Server(policy=policy, fps=10) as server, server.client() as client:
        client.operator.focus(policy=policy)
        frames = client.frames()
        next(frame for frame in frames if frame.focal_power == 0.75)
        order.write_text("end")
        next(frame for frame in frames if is_held("policy-panicked", frame))
        # It starts well each time and ends at its first frame, after longer and longer breaks.
        held = [frame.status or {} for _, frame in zip(range(30), frames, strict=False)]
        assert {status["held"] for status in held} == {"policy-panicked"}
        assert all("failed" in status["message"] for status in held)


def test_no_process_is_left_by_a_server_that_is_killed(tmp_path: Path) -> None:
    (tmp_path / "order").write_text("hang")
    # It passes the test pictures, and hangs where nothing reaches it.
    source = OBEDIENT.replace('print("overheard")', "seen.append(1)").replace(
        "order = open(sys.argv[1]).read()", 'order = open(sys.argv[1]).read() if len(seen) > 2 else ""'
    )
    policy = command(tmp_path, "seen = []\n" + source, tmp_path / "order")
    server = Server(policy=policy, fps=10)
    with server.client() as client:
        client.operator.focus(policy=policy)
        assert running(str(tmp_path / "order"))
    server.kill()
    wait_until(lambda: not running(str(tmp_path / "order")))
    server.close()
