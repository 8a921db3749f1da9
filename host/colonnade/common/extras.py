"""Packages that only some commands need: the extras of the distribution."""

from __future__ import annotations

from importlib.util import find_spec

from colonnade.common.errors import UserError

#: Modules of each extra, by its name in pyproject.toml, and where a package exists if that is not everywhere.
EXTRAS = {
    "reference": {"embreex": "Linux on x86_64 and macOS"},
    "quality": {"flip_evaluator": "Linux on x86_64 and macOS, Python up to 3.13"},
    "panorama": {"OpenImageIO": ""},
    "denoise": {"pyoidn": ""},
    "capture": {"lzfse": "", "imageio_ffmpeg": ""},
    "integration": {"systemrdl": "", "peakrdl_cheader": "", "peakrdl_html": "", "peakrdl_ipxact": ""},
}


def require_extra(extra: str, purpose: str) -> None:
    """Check that the packages of an extra are installed.

    Args:
        extra: A key of `EXTRAS`.
        purpose: Completes "which … needs", e.g. ``"colonnade compare"``.

    Raises:
        UserError: One is missing.
    """
    for module, platforms in EXTRAS[extra].items():
        if find_spec(module) is None:
            advice = f"pip install 'colonnade[{extra}]'" + (f" ({platforms})" if platforms else "")
            advice += ", or make setup in a checkout" if extra != "denoise" else ""
            raise UserError(f"no package {module} found, which {purpose} needs: {advice}")
