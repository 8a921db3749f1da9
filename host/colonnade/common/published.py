"""The published files that Colonnade fetches on demand: meshes and standard-cell libraries.

None of them is a part of Colonnade; their publishers state the terms of use. Meshes are the figures', byte for
byte.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from colonnade.common.downloads import Download


def github(repository: str, commit: str, path: str, sha256: str) -> Download:
    """A file of a repository's commit on GitHub."""
    return Download(f"https://raw.githubusercontent.com/{repository}/{commit}/{path}", sha256)


def _common(name: str, sha256: str) -> Download:
    """A mesh of Alec Jacobson's collection."""
    commit = "8a4f8642acaf43f9cd7b67858a1502e1055ef202"
    return github("alecjacobson/common-3d-test-models", commit, f"data/{name}.obj", sha256)


def _sta(path: str, sha256: str) -> Download:
    """A library that OpenSTA ships."""
    return github("parallaxsw/OpenSTA", "737b52f33b66e4c2ccc3e3ef22c3adfe9aec8d09", path, sha256)


#: Meshes by name.
MESHES: Mapping[str, Download] = {
    "armadillo": github(
        "libigl/libigl-tutorial-data",
        "c1f9ede366d02e3531ecbaec5e3769312f31cccd",
        "armadillo.obj",
        "c007ebd11e541a2b1ab86a4c376653579281265f2c6c786a4a7bf47ba84d6879",
    ),
    "bunny": _common("stanford-bunny", "1eb35d1e21ce99e5ce911353b6be278990713448dd9e8f5c9387f9de39b32205"),
    "cheburashka": _common("cheburashka", "b2ac59bc1112f1b3e086ac0285d9be7fdefef278a32151a79e650414b2244f3f"),
    "dragon": Download(
        "http://graphics.stanford.edu/pub/3Dscanrep/dragon/dragon_recon.tar.gz",
        "f32b87762894bde78cd45dc05aa9fde0f5ad390c944168a96e97191ff1fc6d45",
        "dragon_vrip_res3.ply",
    ),
    "duck": Download(
        "https://www.cs.cmu.edu/~kmcrane/Projects/ModelRepository/bob.zip",
        "74b86d84d751228e0a4ecd291984eaec1ac630a050396c0d63dee8440ba1e4e7",
        "bob_controlmesh.obj",
    ),
    "fandisk": _common("fandisk", "ea5bab2fbf545b1915f0d9faf6cc61ff8c18e0d8174ad61f8e35de15d8f6e3f8"),
    "rocker-arm": _common("rocker-arm", "590257e6d01e689354821d807854306c3bfbb02d9cca73404d5a4924f105c287"),
}


@dataclass(frozen=True)
class Library:
    """A standard-cell library at its typical corner.

    Attributes:
        title: What it is, and its corner.
        files: Its liberty files.
    """

    title: str
    files: tuple[Download, ...]


#: Standard-cell libraries by name.
LIBRARIES: Mapping[str, Library] = {
    "asap7": Library(
        "ASAP7, 7.5 tracks, RVT, TT, 0.7 V, 25 °C",
        (
            _sta("test/asap7_simple.lib.gz", "2f501ae61af87fcf3b6a9d3d30ea8a7da5a893cc6279afdb29611bd160176894"),
            _sta("test/asap7_seq.lib.gz", "0125595067906f29681eaba35743eaba815ffd6ebd4863a259bae9dc779ed585"),
            _sta("test/asap7_invbuf.lib.gz", "81d6671f985f76a5247a5ee18d008f9437613e277c7f9d77b63f269189797694"),
        ),
    ),
    "sky130": Library(
        "SkyWater 130 nm, high density, TT, 1.8 V, 25 °C",
        (_sta("examples/sky130hd_tt.lib.gz", "210e56be3a3a0907b5241a34d277f664cf4b4d91dcb49a27ff813df4406a5889"),),
    ),
}
