"""The WebAssembly of the page that `make browser` has built, and the node that runs it in tests."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import playwright
import pytest

ROOT = Path(__file__).resolve().parents[2]
MODULE, RTL = (ROOT / ".cache" / "browser-objects" / f"{name}.wasm" for name in ("colonnade", "tiny"))
#: The mark of tests that need it.
NEEDS_MODULE = pytest.mark.skipif(not MODULE.is_file(), reason="the page is not built: run `make browser`")


def run_node(program: str, folder: Path, job: dict[str, Any]) -> None:
    """Run a program of tests/browser on a folder with the job, by the node that Playwright brings, or the system's."""
    own = Path(playwright.__file__).parent / "driver" / "node"
    node = str(own) if own.is_file() else shutil.which("node")
    if node is None:
        pytest.skip("no node")
    (folder / "job.json").write_text(json.dumps(job))
    subprocess.run([node, Path(__file__).with_name("browser") / program, folder], check=True)
