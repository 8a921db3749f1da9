"""Fills the folder of a release from the jar and the site of tools/release: ``… JAR SITE OUTPUT TIME PYTHON…``."""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import archives
import designs
import wheels

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[2]
CHECKSUMS = "SHA256SUMS"


def main(arguments: list[str]) -> None:
    """Make the files; ``TIME`` is the time of all of them, in seconds of Unix. ``PYTHON…`` compile the wheels."""
    jar, site, output = map(Path, arguments[:3])
    time = int(arguments[3])
    version = tomllib.loads((ROOT / "host" / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    with tempfile.TemporaryDirectory(dir=jar.parent) as folder:
        work, files = Path(folder), Path(folder) / "files"
        files.mkdir()
        for target in wheels.TARGETS:
            _say(f"the wheel for {target.processor}")
            wheels.build(target, jar, arguments[4:], work / target.processor, files)
        shutil.copy(jar, files / f"colonnade-generator-{version}.jar")
        for preset in sorted(path.stem for path in (ROOT / "configs").glob("*.json")):
            _say(f"the design of preset {preset}")
            designs.write(
                preset, designs.by_jar(jar), work / "designs", files / f"colonnade-{preset}-{version}.tar.gz", time
            )
        archives.write_tar(site, "colonnade-docs", files / f"colonnade-docs-{version}.tar.gz", time)
        materials = subprocess.check_output([sys.executable, ROOT / "tools" / "supply_chain", "sbom"])
        (files / f"colonnade-{version}.cdx.json").write_bytes(materials)
        _write_checksums(files)
        shutil.rmtree(output, ignore_errors=True)
        shutil.move(files, output)
    for path in sorted(output.iterdir()):
        print(f"{path.stat().st_size / 1e6:8.2f} MB  {path.name}")


def _write_checksums(folder: Path) -> None:
    """Write the file that ``sha256sum --check`` reads."""
    lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in sorted(folder.iterdir())]
    (folder / CHECKSUMS).write_text("".join(lines), encoding="utf-8")


def _say(what: str) -> None:
    print(f"colonnade: making {what}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
