"""Runs the Chisel generator and caches its output.

In a checkout sbt compiles the generator once for each state of its sources; a wheel carries it as a jar. After that,
each configuration is one Java run. The cache entries are ``generator/SOURCES/KEY``, where SOURCES is the hash of the
generator's sources, or of the jar. KEY is the hash of the configuration, its overrides and the kind of output. The
compiled classes are ``generator/SOURCES/jars``. ``generator/SOURCES/classes.jsa`` holds them as Java loads them,
which saves a fifth of the time of every run after the first one for Verilog.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from colonnade.common import cache, machine_limits, notes, processes
from colonnade.common.arguments import checked
from colonnade.common.errors import UserError
from colonnade.common.progress import QUIET, Progress
from colonnade.design.config_name import ConfigurationSource, Overrides, find_configuration
from colonnade.design.design_folder import check_replaceable, replace_folder
from colonnade.design.idle_parts import idle_notes
from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import cache_directory, find_java, generator_jar, printed, project_root
from colonnade.design.verilog import without_places

#: Source states to keep in the cache; older ones are removed when they were not used for a day.
KEPT_STATES = 4

#: Entries of the cache: the generator's output folder, and the file with the class path.
DESIGN = "design"
CLASSPATH = "classpath.json"

#: Java's archive of loaded classes, and its options to write and to read one; a damaged one is not read.
ARCHIVE, WRITE_ARCHIVE = "classes.jsa", "-XX:ArchiveClassesAtExit="
VERIFY_ARCHIVE, READ_ARCHIVE = "-XX:+VerifySharedSpaces", "-XX:SharedArchiveFile="

#: The generator's option for a manifest without SystemVerilog.
MANIFEST_ONLY = "--manifest-only"

#: Java's options come from this file of the checkout or wheel, and one against files of crashes.
JAVA_OPTIONS, NO_CRASH_FILE = ".jvmopts", "-XX:ErrorFile=/dev/null"

#: What Java prints of an exception that a program does not handle: it is one of the generator.
_CRASH = "Exception in thread"

#: Bytes of the shell's bus; auto: as the generator chooses for the design.
BusBytes: TypeAlias = int | Literal["auto"]

_ANSI = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")


@dataclass(frozen=True)
class GeneratedDesign:
    """The generator's output for one configuration.

    Attributes:
        dir: folder with ``manifest.json`` and, for a complete design, the SystemVerilog and ``filelist.f``.
        manifest: the parsed manifest.
    """

    dir: Path
    manifest: Manifest

    @property
    def sources(self) -> list[Path]:
        """The SystemVerilog files."""
        return sorted(path for path in self.dir.iterdir() if path.suffix in (".sv", ".v"))

    def digest(self) -> str:
        """SHA-256 of the SystemVerilog without places: designs with equal digests behave identically."""
        lines = []
        for path in self.sources:
            text = without_places(path.read_text(encoding="utf-8"))
            lines.append(f"{path.name} {hashlib.sha256(text.encode()).hexdigest()}\n")
        return hashlib.sha256("".join(lines).encode()).hexdigest()


def manifest_for(config: str, overrides: Sequence[str] = (), progress: Progress = QUIET) -> GeneratedDesign:
    """The manifest alone, enough for packing, the model and the frame registers."""
    return _cached(config, overrides, (MANIFEST_ONLY,), progress, takes_complete=True)


def design_for(config: str, overrides: Sequence[str] = (), progress: Progress = QUIET) -> GeneratedDesign:
    """Generate the SystemVerilog and the manifest, for simulation."""
    return _cached(config, overrides, (), progress)


def black_boxed_design_for(config: str, overrides: Sequence[str] = (), progress: Progress = QUIET) -> GeneratedDesign:
    """Generate with memories as black boxes and their shapes in ``memories.json``, for synthesis."""
    return _cached(config, overrides, ("--black-box-memories",), progress)


def shell_manifest_for(
    config: str,
    overrides: Sequence[str] = (),
    bus_bytes: BusBytes = "auto",
    progress: Progress = QUIET,
    refit: bool = False,
) -> GeneratedDesign:
    """Generate only ``manifest.json`` and ``shell.json``, enough for register descriptions."""
    options = (MANIFEST_ONLY, *_shell_options(bus_bytes, refit=refit))
    return _cached(config, overrides, options, progress, takes_complete=True)


def shell_design_for(
    config: str,
    overrides: Sequence[str] = (),
    bus_bytes: BusBytes = "auto",
    progress: Progress = QUIET,
    pixel_stream: bool = False,
    refit: bool = False,
) -> GeneratedDesign:
    """Generate the device in its AXI4 shell, for simulation; ``shell.json`` has the shell's registers."""
    return _cached(config, overrides, _shell_options(bus_bytes, pixel_stream, refit), progress)


def generate(
    config: str,
    overrides: Sequence[str],
    output: Path,
    manifest_only: bool = False,
    black_box_memories: bool = False,
    progress: Progress = QUIET,
    bus_bytes: BusBytes | None = None,
    pixel_stream: bool = False,
    refit: bool = False,
) -> GeneratedDesign:
    """Generate into the user's folder ``output``; `design_folder` defines which folders it may replace.

    Args:
        config: The configuration.
        overrides: Fields that replace some of it.
        output: The folder.
        manifest_only: Option of the generator.
        black_box_memories: Option of the generator.
        progress: Shows the steps.
        bus_bytes: Also generate the AXI4 shell, with a bus of so many bytes.
        pixel_stream: The shell has an AXI4-Stream of pixels.
        refit: The shell has a unit that bends meshes.
    """
    check_replaceable(output)
    options = (MANIFEST_ONLY,) * manifest_only + ("--black-box-memories",) * black_box_memories
    options += _shell_options(bus_bytes, pixel_stream, refit)
    design = _cached(config, overrides, options, progress)
    replace_folder(design.dir, output)
    return GeneratedDesign(output, design.manifest)


def source_hash(root: Path) -> str:
    """A short hash of the generator: of its source and build files, or of the jar."""
    jar = generator_jar(root)
    if jar is not None:
        return hashlib.sha256(jar.read_bytes()).hexdigest()[:20]
    sources = [*root.glob("*.sbt"), root / "project" / "build.properties", root / "project" / "dependencies.sha256"]
    sources += [*(root / "project").glob("*.sbt"), *(root / "project").glob("*.scala")]
    sources += [path for path in (root / "src" / "main").rglob("*") if path.is_file()]
    digest = hashlib.sha256()
    for path in sorted(sources):
        if path.is_file():
            content = path.read_bytes()
            digest.update(f"{path.relative_to(root).as_posix()} {len(content)}\n".encode() + content)
    return digest.hexdigest()[:20]


@checked
def _cached(
    config: str, overrides: Overrides, options: tuple[str, ...], progress: Progress, takes_complete: bool = False
) -> GeneratedDesign:
    root = project_root()
    source = find_configuration(config, overrides, root)
    if options == (MANIFEST_ONLY,) and (released := _released(root, source)) is not None:
        return released
    state = cache_directory(root) / "generator" / source_hash(root)
    entry = state / _key(source, options)
    # A design in the cache has its manifest beside the Verilog
    if takes_complete and cache.holds(complete := state / _key(source, options[1:])):
        entry = complete
    with cache.entry(entry, "design", progress) as empty:
        if empty is not None:
            java = find_java()
            jar = generator_jar(root)
            classpath = str(jar) if jar is not None else _compiled(root, state, progress)
            _run(root, java, classpath, source, options, empty / DESIGN, state, progress)
    cache.touch(state)
    manifest = Manifest.load(entry / DESIGN / "manifest.json")
    notes.report(idle_notes(manifest.config))
    return GeneratedDesign(entry / DESIGN, manifest)


def _released(root: Path, source: ConfigurationSource) -> GeneratedDesign | None:
    """The manifest of a preset that a wheel carries, so that its users need no Java for it."""
    folder = root / "manifests" / source.path.stem
    is_preset = source.path.parent == root / "configs" and not source.overrides
    if not is_preset or not (folder / "manifest.json").is_file():
        return None
    return GeneratedDesign(folder, Manifest.load(folder / "manifest.json"))


def _shell_options(bus_bytes: BusBytes | None, pixel_stream: bool = False, refit: bool = False) -> tuple[str, ...]:
    bus = () if bus_bytes is None else ("--axi", str(bus_bytes))
    return (*bus, *("--pixel-stream",) * pixel_stream, *("--refit",) * refit)


def _key(source: ConfigurationSource, options: Sequence[str]) -> str:
    parts = [source.path.read_bytes(), *(part.encode() for part in (*source.overrides, *options))]
    return hashlib.sha256(b"".join(f"{len(part)}:".encode() + part for part in parts)).hexdigest()[:20]


def _compiled(root: Path, state: Path, progress: Progress) -> str:
    """Return the class path of the compiled generator; compile it if this state is not cached."""

    def path(folder: Path) -> list[Path]:
        return [folder / entry for entry in json.loads((folder / CLASSPATH).read_text())]

    def has_libraries(folder: Path) -> bool:
        return all(entry.exists() for entry in path(folder))

    folder = state / "jars"
    with cache.entry(folder, "generator", progress, has_libraries) as empty:
        if empty is not None:
            entries = _compile(root, state.parent / "sbt.log", progress)
            # A later compile overwrites sbt's class folders: copy them
            for index, entry in enumerate(entries):
                if Path(entry).is_dir():
                    # Java archives no classes of a folder
                    entries[index] = Path(shutil.make_archive(str(empty / f"classes{index}"), "zip", entry)).name
            (empty / CLASSPATH).write_text(json.dumps(entries))
    _forget_old_states(state.parent)
    return os.pathsep.join(map(str, path(folder)))


def _compile(root: Path, log: Path, progress: Progress) -> list[str]:
    """Compile with sbt; returns the class path, whose folders are sbt's output folders."""
    with progress.step("compiling the generator"), log.open("w") as stream:
        command = [str(root / "tools" / "sbt"), "compile", "export Runtime/fullClasspath"]
        status = processes.run(command, stdout=stream, stderr=subprocess.STDOUT).returncode
    lines = _ANSI.sub("", log.read_text(errors="replace")).splitlines()
    if (limit := machine_limits.reached(status, "\n".join(lines))) is not None:
        raise UserError(f"compiling the generator reached this machine's limit of {limit} (full log: {log})")
    if status != 0:
        errors = [line.removeprefix("[error]").strip() for line in lines if line.startswith("[error]")]
        first = errors[0] if errors else (lines[-1] if lines else f"sbt ended with status {status}")
        raise UserError(f"the generator does not compile: {first} (full log: {log})")
    entries = next((line for line in reversed(lines) if ".jar" in line and os.pathsep in line), "").split(os.pathsep)
    if not any(entry and Path(entry).is_dir() for entry in entries):
        raise UserError(f"sbt printed no class path: check its Java, by JAVA_HOME or PATH (full log: {log})")
    return entries


def _run(
    root: Path,
    java: Path,
    classpath: str,
    source: ConfigurationSource,
    options: Sequence[str],
    design: Path,
    state: Path,
    progress: Progress,
) -> None:
    """Run the generator; status 2 becomes a UserError with the generator's message."""
    sets = [argument for override in source.overrides for argument in ("--set", override)]
    archive, written = state / ARCHIVE, design.with_name(ARCHIVE)
    archives = [] if MANIFEST_ONLY in options else [f"{WRITE_ARCHIVE}{written}"]
    if archive.is_file():
        archives = [VERIFY_ARCHIVE, f"{READ_ARCHIVE}{archive}"]
    command = [str(java), *_java_options(root), *archives, "-cp", classpath, "colonnade.Generate"]
    command += ["--config", str(source.path), "--output", str(design), *sets, *options]
    with progress.step("generating the manifest" if MANIFEST_ONLY in options else "generating the hardware"):
        done = processes.run(command, cwd=root)
    if written.is_file():
        written.replace(archive)
    if done.returncode == 2:
        lines = [line for line in done.stderr.splitlines() if line.strip()] or ["the generator refused its input"]
        raise UserError(re.sub(r"^(colonnade(\.Generate)?: )?error: ", "", lines[-1].strip()))
    if done.returncode != 0 or not (design / "manifest.json").is_file():
        log = state / "generate.log"
        log.write_text(done.stdout + done.stderr)
        if _CRASH in done.stderr:
            raise RuntimeError(f"the generator failed with status {done.returncode}: see {log}")
        raise UserError(f"{java} wrote no design: {printed(done)}: fix JAVA_HOME or PATH (full log: {log})")


def _java_options(root: Path) -> list[str]:
    lines = (root / JAVA_OPTIONS).read_text().splitlines()
    return [*(line for line in lines if line.startswith("-")), NO_CRASH_FILE]


def _forget_old_states(folder: Path) -> None:
    states = sorted((path for path in folder.iterdir() if path.is_dir()), key=lambda path: path.stat().st_mtime)
    for state in states[:-KEPT_STATES]:
        if time.time() - state.stat().st_mtime > 86_400:
            shutil.rmtree(state, ignore_errors=True)
