"""Compiles packer, model, live encoder and colonnade_view to WebAssembly, and the library of rays to its own module."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Collection, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
ENVIRONMENT = ROOT / ".cache" / "zig-environment"
OBJECTS = ROOT / ".cache" / "browser-objects"
LIBRARY = ROOT / "host" / "cpp" / "library"
LIVE = ROOT / "host" / "cpp" / "live"
DRIVER = ROOT / "driver"

TARGET = ("-target", "wasm32-wasi", "-O2", "-DNDEBUG", "-ffp-contract=off")
#: A throw ends the module: it has no exceptions.
PLAIN = ("-std=gnu++17", "-fno-exceptions", "-fno-rtti", "-Wno-keyword-macro", "-Wno-unused-value")
CPP = (*PLAIN, "-Dthrow=__builtin_trap(),")
#: Sources that run once for a scene, or for microseconds once a frame: compiled for size, not for speed.
SMALL = (
    *("colonnade_pack", "colonnade_surfaces", "colonnade_environment", "colonnade_instances", "colonnade_motion"),
    *("colonnade_mesh_build", "colonnade_mesh_file", "colonnade_motion_bend", "colonnade_read", "colonnade_view"),
    *("colonnade_view_file", "colonnade_view_outline", "colonnade_view_poses", "colonnade_words"),
)
Source = tuple[str, Path, tuple[str, ...]]
SOURCES: tuple[Source, ...] = (
    *(
        ("c++", file, (*CPP, f"-I{ROOT / 'host' / 'cpp'}", f"-I{DRIVER / 'include'}"))
        for file in (*sorted(LIBRARY.glob("colonnade_*.cpp")), LIVE / "live.cpp", LIVE / "kernels.cpp")
    ),
    *(
        ("cc", file, ("-std=c11", f"-I{DRIVER / 'include'}"))
        for file in sorted([*(DRIVER / "src").glob("colonnade_*.c"), *LIBRARY.glob("colonnade_*.c")])
    ),
)
HEADERS = (
    LIBRARY / "colonnade_model.h",
    LIBRARY / "colonnade_environment.h",
    LIBRARY / "colonnade_read.h",
    LIVE / "live.h",
    DRIVER / "include" / "colonnade_view.h",
)
#: The library of rays: the text of a refusal stays, and a batch is one thread's.
HERE = Path(__file__).parent
INCLUDED = tuple(f"-include{HERE / name}.hpp" for name in ("threads", "refusals"))
RAYS = ROOT / "host" / "cpp" / "rays" / "rays.cpp"
RAY_OPTIONS = (f"-I{ROOT / 'host' / 'cpp'}", f"-I{DRIVER / 'include'}", *INCLUDED, "-Dthrow=colonnade::Refused{} =")


def compile_modules(model: Path, rays: Path) -> None:
    """Write the modules of the model and of rays; they export the functions of their headers, and malloc and free.

    Raises:
        subprocess.CalledProcessError: The compiler found an error; it has printed it.
    """
    OBJECTS.mkdir(parents=True, exist_ok=True)
    _compile_module(model, SOURCES, HEADERS, {"colonnade_view_size"})
    header = DRIVER / "include" / "colonnade_rays.h"
    # A page has no environment
    lacks = {"colonnade_rays_open_environment"}
    _compile_module(rays, [("c++", RAYS, (*PLAIN, *RAY_OPTIONS))], [header], {"colonnade_refusal"}, lacks)


def _compile_module(
    output: Path, sources: Iterable[Source], headers: Iterable[Path], others: set[str], lacks: Collection[str] = ()
) -> None:
    with ThreadPoolExecutor() as pool:
        objects = list(pool.map(lambda source: _compile(*source), sources))
    names = {name for header in headers for name in re.findall(r"\b(colonnade_\w+)\(", header.read_text("utf-8"))}
    exports = [f"-Wl,--export={name}" for name in sorted((names | others | {"malloc", "free"}) - {*lacks})]
    zig("c++", *TARGET, "-mexec-model=reactor", "-s", *map(str, objects), *exports, "-o", str(output))


def _compile(language: str, source: Path, options: tuple[str, ...]) -> Path:
    target = OBJECTS / f"{source.stem}.o"
    # zig takes -Oz for -Os
    size = ("-Os", "-Xclang", "-Oz") if source.stem in SMALL and language == "c++" else ()
    zig(language, *TARGET, *options, *size, "-c", str(source), "-o", str(target))
    return target


def zig(*arguments: str) -> None:
    """Run the compiler."""
    cache = str(ROOT / ".cache" / "zig")
    environment = os.environ | {"ZIG_GLOBAL_CACHE_DIR": cache, "ZIG_LOCAL_CACHE_DIR": cache}
    subprocess.run([ENVIRONMENT / "bin" / "python", "-m", "ziglang", *arguments], check=True, env=environment)
