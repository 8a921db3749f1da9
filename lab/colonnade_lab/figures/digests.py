"""Digests of what figures are measured on: the Verilog of configurations, sources of the host, scenes and studies.

A digest of Verilog or sources is the SHA-256 of texts without comments, imports, places of assertions and white space
that no meaning depends on, in any order: a renamed file is the same text.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from colonnade.common import cache
from colonnade.common.toml_files import parse_toml
from colonnade.design.config_name import find_configuration
from colonnade.design.generator import design_for, source_hash
from colonnade.design.toolchain import cache_directory, project_root
from colonnade.design.verilog import without_places

from colonnade_lab.common.parallel import in_order, processors
from colonnade_lab.figures.catalog import Design, Entry

#: Files of the host that decide figures, by what they are called in data files.
SOURCES: Mapping[str, tuple[str, ...]] = {
    "live": ("host/cpp/live/*.[ch]*",),
    "model": ("host/cpp/model/*.hpp",),
    "cycles": ("host/cpp/cycles/*.[ch]pp",),
    "maps": tuple(f"host/colonnade/maps/{each}.py" for each in ("*_encoder", "*_fit", "slic", "palette", "heap")),
    "rays": ("host/colonnade/rays/*.py", "host/cpp/rays/*.[ch]pp", "tools/ray_suites/*"),
    "roomLight": ("host/colonnade/environment/*_fit.py", "host/colonnade/maps/room_light.py"),
    "tree": ("host/cpp/*bvh.hpp", "host/cpp/reinsertion.hpp", "host/cpp/packer/tree.hpp", "host/cpp/packer/pairs.hpp"),
}

#: Strings, which stay, and comments and includes, of C++ and Verilog; comments, docstrings and imports of Python.
_C = re.compile(r'("(?:\\.|[^"\\\n])*")|//[^\n]*|/\*.*?\*/|^[ \t]*#[ \t]*(?:include|pragma once)[^\n]*', re.S | re.M)
_PYTHON = re.compile(
    r'("(?:\\.|[^"\\\n])+")|#[^\n]*|^[ \t]*""".*?"""|^[ \t]*(?:from \S+ )?import (?:\([^)]*\)|[^\n]*)', re.S | re.M
)

#: What digests of scenes and studies are called.
SCENES = "scenes"


def digest_of(files: Iterable[Path]) -> str:
    """The digest of files of C++, SystemVerilog or Python."""
    digests = (hashlib.sha256(_normal(file).encode()).hexdigest() for file in files)
    return hashlib.sha256("\n".join(sorted(digests)).encode()).hexdigest()


def _normal(file: Path) -> str:
    is_python = file.suffix == ".py"
    text = (_PYTHON if is_python else _C).sub(lambda found: found[1] or "", file.read_text(encoding="utf-8"))
    if is_python:
        # Indentation has a meaning
        return "\n".join(line.rstrip() for line in text.splitlines() if line.strip())
    text = without_places(text)
    if not file.suffix.endswith("v"):
        # Where macros and strings of C++ are broken has no meaning
        text = re.sub(r'" *"', "", " ".join(text.replace("\\\n", " ").split()))
    return re.sub(r" ?([^\w ]) ?", r"\1", " ".join(text.split()))


def digest_of_scenes(files: Iterable[Path]) -> str:
    """The digest of the values of scenes, and of studies with the scenes that they name."""
    contents = []
    for file in files:
        content = parse_toml(file.read_bytes(), f"scene {file.name}")
        named = [file.parent / name for name in content.get("workload", {}).get("scenes", ())]
        others = [parse_toml(one.read_bytes(), f"scene {one.name}") for one in named]
        contents.append([{key: value for key, value in content.items() if key not in ("title", "description")}, others])
    return hashlib.sha256(json.dumps(contents, sort_keys=True).encode()).hexdigest()


def digests_of(entry: Entry) -> dict[str, str | None]:
    """What an entry would be measured on: digests by configuration, and of sources; None if they are not cached."""
    root, texts = project_root(), {}
    for name in entry.sources:
        texts[name] = digest_of(file for pattern in SOURCES[name] for file in root.glob(pattern))
    if entry.scenes:
        texts[SCENES] = digest_of_scenes([root / name for name in entry.scenes])
    return {design.name: _cached(design) for design in entry.hardware} | texts


def emit(entries: Iterable[Entry]) -> None:
    """Generate the Verilog of entries, each configuration once; its digests are cached.

    Raises:
        UserError: The generator refuses a configuration.
    """
    designs = dict.fromkeys(design for entry in entries for design in entry.hardware)
    missing = [design for design in designs if _cached(design) is None]
    for number, _ in enumerate(in_order(_store, missing, processors())):
        print(f"figures: Verilog of {missing[number].name}", flush=True)


def _store(design: Design) -> None:
    file, key = _place(design)
    cache.store(file, key, {"digest": digest_of(design_for(design.config, design.overrides).sources)})


def _cached(design: Design) -> str | None:
    content = cache.stored(*_place(design))
    return None if content is None else str(content["digest"])


def _place(design: Design) -> tuple[Path, dict[str, str]]:
    """The file of a digest in the cache, and its key."""
    root = project_root()
    preset = find_configuration(design.config, design.overrides, root).path.read_bytes()
    key = {"generator": source_hash(root), "design": design.name, "preset": hashlib.sha256(preset).hexdigest()}
    name = hashlib.sha256("\n".join(key.values()).encode()).hexdigest()[:20]
    return cache_directory(root) / "digests" / f"{name}.json", key


def stale(entry: Entry, measured: Mapping[str, str]) -> Iterator[str]:
    """One line for each configuration or source whose digest differs from a data file's."""
    today = digests_of(entry)
    for name in sorted(today.keys() ^ measured.keys()):
        yield f"it has no digest of {name}" if name in today else f"its digest of {name} belongs to no measurement"
    for name, digest in today.items():
        if digest is not None and measured.get(name, digest) != digest:
            changed = "sources of " if name in SOURCES else "" if name == SCENES else "the Verilog of "
            yield f"{changed}{name} changed"
