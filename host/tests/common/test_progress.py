"""Progress outside a terminal: lines for long steps on standard error, none for short steps."""

from __future__ import annotations

import re
import time

import pytest

from colonnade.common import progress
from colonnade.common.errors import UserError
from colonnade.common.progress import LineProgress, for_terminal, hidden


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "MIN_STEP_SECONDS", 0.0)
    monkeypatch.delenv("COLONNADE_PROGRESS", raising=False)


def test_a_long_step_shows_its_share_and_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    with LineProgress(0.2).step("rendering in the simulator") as report:
        report(0.372)
        time.sleep(0.9)
    out, err = capsys.readouterr()
    assert out == ""
    # Lines after 0.2 and 0.6 seconds: the interval doubles
    assert re.fullmatch(r"colonnade: rendering in the simulator: 37 %, 0 s\n(.*: 37 %, 1 s\n)", err)


def test_a_step_without_a_share_shows_its_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    with LineProgress(0.1).of("bunny").step("building the simulator"):
        time.sleep(0.2)
    assert capsys.readouterr().err == "colonnade: bunny: building the simulator: 0 s\n"


def test_steps_at_a_time_share_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    lines = LineProgress(0.1)
    with lines.step("a"), lines.step("b"), lines.step("c"), lines.step("d"), lines.step("e"):
        time.sleep(0.2)
    assert capsys.readouterr().err == "colonnade: a: 0 s; b: 0 s; c: 0 s; d: 0 s; 1 more\n"


def test_quick_work_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    lines = for_terminal()
    assert isinstance(lines, LineProgress)
    for _ in range(100):
        with lines.step("packing"):
            pass
    assert capsys.readouterr().err == ""


def test_many_quick_steps_show_themselves(capsys: pytest.CaptureFixture[str]) -> None:
    lines = LineProgress(0.2)
    end = time.monotonic() + 0.8
    while time.monotonic() < end:
        with lines.step("a frame"):
            time.sleep(0.01)
    assert capsys.readouterr().err.count("colonnade: a frame: 0 s\n") == 2


def test_can_be_silenced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLONNADE_PROGRESS", "off")
    assert for_terminal() is progress.QUIET
    monkeypatch.setenv("COLONNADE_PROGRESS", "loud")
    with pytest.raises(UserError, match="COLONNADE_PROGRESS"):
        for_terminal()


@pytest.mark.parametrize("is_of_command", [False, True])
def test_nothing_is_shown_while_paused(
    is_of_command: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also by code that has not been given the display of its command."""
    monkeypatch.setattr(progress, "LineProgress", lambda: LineProgress(0.1))
    lines = for_terminal()
    with lines.step("work"):
        with hidden() if is_of_command else lines.paused():
            time.sleep(0.3)
            assert capsys.readouterr().err == ""
        lines.note("something else")
        assert "colonnade: something else\n" in capsys.readouterr().err
