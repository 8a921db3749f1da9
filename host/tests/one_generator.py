"""One Java for all designs of a test run: starting it and loading its classes takes longer than most designs."""

from __future__ import annotations

import subprocess
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from colonnade.design.generator import WRITE_ARCHIVE

ROOT = Path(__file__).resolve().parents[2]
GENERATOR, SERVER = "colonnade.Generate", Path(__file__).with_name("GeneratorServer.java")


class OneGenerator:
    """Takes the place of `processes.run`: runs of the checkout's generator share a process, others have their own."""

    def __init__(self, run: Callable[..., subprocess.CompletedProcess[str]]) -> None:
        self._run, self._lock = run, threading.Lock()
        self._server: subprocess.Popen[str] | None = None

    def __call__(self, command: Sequence[str], **options: Any) -> subprocess.CompletedProcess[str]:
        if GENERATOR not in command or options != {"cwd": ROOT}:
            return self._run(command, **options)
        at = command.index(GENERATOR)
        with self._lock:
            if self._server is None or self._server.poll() is not None:
                java = [word for word in command[:at] if not word.startswith(WRITE_ARCHIVE)]
                pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
                self._server = subprocess.Popen([*java, SERVER], cwd=ROOT, stderr=subprocess.STDOUT, text=True, **pipes)
            assert self._server.stdin is not None and self._server.stdout is not None
            print(*command[at + 1 :], sep="\t", file=self._server.stdin, flush=True)
            lines = list[str]()
            for line in self._server.stdout:
                if line.startswith("status "):
                    return subprocess.CompletedProcess(command, int(line.split()[1]), "", "".join(lines))
                lines.append(line)
            return subprocess.CompletedProcess(command, self._server.wait(), "", "".join(lines))

    def close(self) -> None:
        """Java ends with its input."""
        if self._server is not None:
            self._server.communicate()
