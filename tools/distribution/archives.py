"""Archives that are the same for the same content: sorted entries, one time, no owner."""

from __future__ import annotations

import gzip
import io
import tarfile
import zipfile
from pathlib import Path

_FIRTOOL = "org.chipsalliance/llvm-firtool/"


def write_tar(folder: Path, name: str, archive: Path, time: int) -> None:
    """Pack the files of a folder under ``name/`` into a ``.tar.gz``; all have ``time``, in seconds of Unix."""
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w", format=tarfile.PAX_FORMAT) as tar:
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            entry = tarfile.TarInfo(f"{name}/{path.relative_to(folder).as_posix()}")
            entry.size, entry.mtime = path.stat().st_size, time
            entry.mode = 0o755 if path.stat().st_mode & 0o100 else 0o644
            with path.open("rb") as stream:
                tar.addfile(entry, stream)
    archive.write_bytes(gzip.compress(content.getvalue(), mtime=time))


def copy_jar(jar: Path, copy: Path, platform: str) -> None:
    """Copy the generator without the firtools of other platforms than e.g. ``linux-x64``."""
    with zipfile.ZipFile(jar) as source, zipfile.ZipFile(copy, "w", zipfile.ZIP_DEFLATED) as target:
        for entry in source.infolist():
            inside = entry.filename.removeprefix(_FIRTOOL)
            foreign = inside != entry.filename and "/bin/" in inside and not inside.startswith(f"{platform}/")
            if not foreign and not entry.is_dir():
                target.writestr(entry, source.read(entry))
