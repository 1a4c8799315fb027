"""Servers and lenses for tests, and the pytest plugin."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import pytest

import parfocal
from parfocal import EmulatedLens, Server


def wait_until(happened: Callable[[], bool]) -> None:
    for _ in range(200):
        if happened():
            return
        time.sleep(0.05)
    raise AssertionError("it did not happen within ten seconds")


def test_a_server_ends_cleanly_and_leaves_nothing() -> None:
    with Server() as server:
        data = server.data
        assert server.running
        assert (data / "parfocal.db").exists()
    assert not server.running
    assert not data.exists()


def test_a_data_folder_that_was_given_stays(tmp_path: Path) -> None:
    with Server(data=tmp_path / "data") as server, server.client() as client:
        client.operator.add_participant(code="S-01")
    with Server(data=tmp_path / "data") as server, server.client() as client:
        assert client.operator.choices()["participants"] == ["S-01"]


def test_a_server_that_does_not_start_says_why(tmp_path: Path) -> None:
    with pytest.raises(parfocal.NoProgram, match=r"(?s)did not start: it ended with exit code.*telescope"):
        Server(camera="telescope")
    with pytest.raises(parfocal.NoProgram, match=r"'/nowhere/parfocal' was not found.*PARFOCAL"):
        Server(program="/nowhere/parfocal")
    stranger = tmp_path / "parfocal"
    stranger.write_text("#!/bin/sh\nexec sleep 60\n")
    stranger.chmod(0o755)
    with pytest.raises(parfocal.NoProgram, match=r"not ready after 0.2 s"):
        Server(program=stranger, timeout=0.2)


def test_faults_of_a_lens_can_be_switched_on_and_off() -> None:
    with EmulatedLens() as lens, Server(lens=lens, fps=10) as server, server.client() as client:
        client.operator.focus(focal_power=0.75)
        wait_until(lambda: abs(lens.glass() - 0.75) < 0.01)
        lens.fault("silent")
        wait_until(lambda: not client.service.healthz()["lens"])
        lens.fault("none")
        wait_until(lambda: client.service.healthz()["lens"])
        lens.unplug()
        wait_until(lambda: not client.service.healthz()["lens"])
        lens.plug_in()
        wait_until(lambda: client.service.healthz()["lens"])
    with pytest.raises(parfocal.ProgramEnded):
        lens.fault("none")


def test_a_lens_refuses_what_it_cannot_do() -> None:
    with EmulatedLens() as lens, pytest.raises(parfocal.ParfocalError, match=r"refused 'temperature 900'"):
        lens.temperature(900)


def test_a_marker_sets_the_servers_arguments(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(
        """
        import pytest

        @pytest.mark.parfocal(lens="emulated", fps=5)
        def test_it(parfocal_server):
            with parfocal_server.client() as client:
                assert "emulated" in next(client.frames()).status["lens"]["name"].lower()
        """
    )
    pytester.runpytest_subprocess("-p", "parfocal.pytest_plugin", "--strict-markers").assert_outcomes(
        passed=1
    )


def test_without_the_program_a_test_fails_with_a_sentence(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PARFOCAL", "/nowhere/parfocal")
    pytester.makepyfile("def test_it(parfocal_server): pass")
    result = pytester.runpytest_subprocess("-p", "parfocal.pytest_plugin")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*was not found. Install parfocal, or set*PARFOCAL*"])
