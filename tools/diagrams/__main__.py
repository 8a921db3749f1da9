"""Draws docs/diagrams: each ``*.toml`` (blocks and arrows) and ``*.json`` (WaveDrom) becomes an SVG of its name.

``python tools/diagrams`` draws what is out of date; it needs the packages of host/locks/docs.txt. ``… --check`` needs
nothing but Python: each SVG names the digests of its source with the files of this folder, and of its own contents.
"""

from __future__ import annotations

import hashlib
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "docs" / "diagrams"
_MARK = "<!-- Made by tools/diagrams from {name}; source {source} drawing {drawing} -->\n"


def main(arguments: list[str]) -> int:
    """Draw, or with ``--check`` name what is out of date; the exit status is then 1."""
    if arguments not in ([], ["--check"]):
        print("usage: python tools/diagrams [--check]", file=sys.stderr)
        return 2
    sources = sorted(path for path in FOLDER.iterdir() if path.suffix in (".toml", ".json"))
    stale = [source for source in sources if not _is_current(source)]
    orphans = sorted(set(FOLDER.glob("*.svg")) - {_drawing_of(source) for source in sources})
    if arguments:
        for source in stale:
            print(f"diagrams: {_drawing_of(source).relative_to(ROOT)} is out of date; run: make docs", file=sys.stderr)
        for orphan in orphans:
            print(f"diagrams: {orphan.relative_to(ROOT)} has no source", file=sys.stderr)
        return 1 if stale or orphans else 0
    for source in stale:
        _draw(source)
    for orphan in orphans:
        orphan.unlink()
    return 0


def _draw(source: Path) -> None:
    # Imported here, so that the check needs none of the packages
    import blocks
    import timing

    draw = {".toml": blocks.draw, ".json": timing.draw}[source.suffix]
    drawing = draw(source.read_text(encoding="utf-8"))
    _drawing_of(source).write_text(_mark(source, drawing) + drawing, encoding="utf-8")
    print(f"diagrams: drew {_drawing_of(source).relative_to(ROOT)}")


def _is_current(source: Path) -> bool:
    drawing = _drawing_of(source)
    if not drawing.is_file():
        return False
    first, _, rest = drawing.read_text(encoding="utf-8").partition("\n")
    return first + "\n" == _mark(source, rest)


def _mark(source: Path, drawing: str) -> str:
    generator = b"".join(path.read_bytes() for path in sorted(Path(__file__).parent.glob("*.py")))
    digests = [hashlib.sha256(data).hexdigest()[:16] for data in (source.read_bytes() + generator, drawing.encode())]
    return _MARK.format(name=source.name, source=digests[0], drawing=digests[1])


def _drawing_of(source: Path) -> Path:
    return source.with_suffix(".svg")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
