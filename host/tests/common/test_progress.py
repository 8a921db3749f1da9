"""Progress outside a terminal: lines for long steps on standard error, none for short steps."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace

import pytest

from colonnade.common import progress
from colonnade.common.errors import UserError
from colonnade.common.progress import LineProgress, for_terminal, hidden


class Clock:
    """The time of lines, which passes as a test says."""

    def __init__(self) -> None:
        self._now, self._waits = 0.0, threading.Semaphore(0)
        self._lines: list[threading.Condition] = []

    def monotonic(self) -> float:
        """Seconds."""
        return self._now

    def condition(self) -> threading.Condition:
        """One whose waits end when time passes."""
        condition = threading.Condition()
        wait = condition.wait

        def waits(timeout: float) -> bool:
            self._waits.release()
            return wait()

        condition.wait = waits  # type: ignore[method-assign,assignment]
        self._lines.append(condition)
        return condition

    def passes(self, seconds: float) -> None:
        """Let time pass, and the only lines print what is due."""
        self._waits.acquire()
        self.jumps(seconds)
        self._waits.acquire()
        self._waits.release()

    def jumps(self, seconds: float) -> None:
        """Let time pass."""
        with self._lines[0]:
            self._now += seconds
            self._lines[0].notify_all()


@pytest.fixture(autouse=True)
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(progress, "MIN_STEP_SECONDS", 0.0)
    monkeypatch.setattr(progress, "time", clock)
    monkeypatch.setattr(progress, "threading", SimpleNamespace(**{**vars(threading), "Condition": clock.condition}))
    monkeypatch.delenv("COLONNADE_PROGRESS", raising=False)
    return clock


def test_a_long_step_shows_its_share_and_seconds(capsys: pytest.CaptureFixture[str], clock: Clock) -> None:
    with LineProgress(0.25).step("rendering in the simulator") as report:
        report(0.372)
        # The interval doubles
        for seconds in (0.125, 0.125, 0.375, 0.125, 0.5):
            clock.passes(seconds)
    line = "colonnade: rendering in the simulator: 37 %, "
    assert capsys.readouterr() == ("", f"{line}0 s\n{line}1 s\n")


def test_a_step_without_a_share_shows_its_seconds(capsys: pytest.CaptureFixture[str], clock: Clock) -> None:
    with LineProgress(0.1).of("bunny").step("building the simulator"):
        clock.passes(0.2)
    assert capsys.readouterr().err == "colonnade: bunny: building the simulator: 0 s\n"


def test_steps_at_a_time_share_a_line(capsys: pytest.CaptureFixture[str], clock: Clock) -> None:
    lines = LineProgress(0.1)
    with lines.step("a"), lines.step("b"), lines.step("c"), lines.step("d"), lines.step("e"):
        clock.passes(0.2)
    assert capsys.readouterr().err == "colonnade: a: 0 s; b: 0 s; c: 0 s; d: 0 s; 1 more\n"


def test_quick_work_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    lines = for_terminal()
    assert isinstance(lines, LineProgress)
    for _ in range(100):
        with lines.step("packing"):
            pass
    assert capsys.readouterr().err == ""


def test_many_quick_steps_show_themselves(capsys: pytest.CaptureFixture[str], clock: Clock) -> None:
    lines = LineProgress(0.25)
    for _ in range(64):
        with lines.step("a frame"):
            clock.passes(1 / 64)
    assert capsys.readouterr().err.count("colonnade: a frame: 0 s\n") == 2


def test_can_be_silenced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLONNADE_PROGRESS", "off")
    assert for_terminal() is progress.QUIET
    monkeypatch.setenv("COLONNADE_PROGRESS", "loud")
    with pytest.raises(UserError, match="COLONNADE_PROGRESS"):
        for_terminal()


@pytest.mark.parametrize("is_of_command", [False, True])
def test_nothing_is_shown_while_paused(
    is_of_command: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, clock: Clock
) -> None:
    """Also by code that has not been given the display of its command."""
    monkeypatch.setattr(progress, "LineProgress", lambda: LineProgress(0.1))
    lines = for_terminal()
    with lines.step("work"):
        with hidden() if is_of_command else lines.paused():
            clock.jumps(0.3)
            time.sleep(0.1)
            assert capsys.readouterr().err == ""
        lines.note("something else")
        assert "colonnade: something else\n" in capsys.readouterr().err
