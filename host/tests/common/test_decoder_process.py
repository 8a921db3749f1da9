"""Decoders run with the same limits on every machine."""

from __future__ import annotations

import subprocess
from typing import Any

import pytest

from colonnade.common import decoder_process


@pytest.mark.parametrize("threads", ["1", "64"])
def test_a_decoder_has_one_thread_of_linear_algebra_whatever_its_parent_has(
    threads: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each thread takes address space, which the limit of the process would count."""
    given: dict[str, Any] = {}

    def run(command: list[str], **options: Any) -> subprocess.CompletedProcess[bytes]:
        given.update(options["env"])
        return subprocess.CompletedProcess(command, 0, b"", b"")

    monkeypatch.setenv("OPENBLAS_NUM_THREADS", threads)
    monkeypatch.setenv("OF_THE_USER", "kept")
    monkeypatch.setattr(subprocess, "run", run)
    decoder_process.decode("any", 1 << 30, 60)
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OF_THE_USER")
    assert [given[name] for name in names] == ["1", "1", "1", "kept"]
