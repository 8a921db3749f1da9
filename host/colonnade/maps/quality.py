"""Quality of encoded maps: decoded against original maps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colonnade.common.image_io import encode_srgb
from colonnade.environment.model import Environment
from colonnade.maps.image import AttributeImage
from colonnade.maps.planes import PlaneProjection
from colonnade.quality.image_metrics import compare_pictures

#: Lamps of `relit`: direction to the lamp in view space, and intensity; plus ambient light.
LAMPS = (((-0.5, -0.8, -0.4), 0.6), ((0.7, -0.3, -0.6), 0.35))
AMBIENT = 0.3


def relit(albedo: NDArray[np.float64], normals: NDArray[np.float64]) -> NDArray[np.float64]:
    """Relight maps with `LAMPS`, linear, float64 [height, width, 3]: albedo * (ambient + sum of i * max(0, n . l))."""
    light = np.full(normals.shape[:2], AMBIENT)
    for to_lamp, intensity in LAMPS:
        direction = np.array(to_lamp) / np.linalg.norm(to_lamp)
        light += intensity * np.maximum(0.0, normals @ direction)
    lit: NDArray[np.float64] = albedo * light[..., np.newaxis]
    return lit


def angles(reference: NDArray[np.float64], test: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles between vectors [..., 3], degrees."""
    lengths = np.linalg.norm(reference, axis=-1) * np.linalg.norm(test, axis=-1)
    cosine = np.einsum("...c,...c->...", reference, test) / np.maximum(lengths, 1e-12)
    degrees: NDArray[np.float64] = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return degrees


def ray_errors(environment: Environment, depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance along the view ray between a depth map and the environment's, metres: float64 [height, width]."""
    lengths = np.linalg.norm(environment.camera.directions(environment.width, environment.height), axis=2)
    errors: NDArray[np.float64] = np.abs(depth - environment.depth) * lengths
    return errors


def measure(environment: Environment, image: AttributeImage, with_dists: bool = True) -> dict[str, Any]:
    """Measure sizes and losses, as a JSON object; ``dists`` is None if its weights are not available."""
    albedo, normals = image.decoded_albedo(), image.decoded_normals()
    degrees = angles(environment.normals, normals)
    centimetres = 100.0 * ray_errors(
        environment, image.decoded_depth(PlaneProjection.of(environment, image.depth_unit))
    )
    return {
        "room": environment.name,
        "encoding": image.layout.encoding,
        "size": [environment.width, environment.height],
        "bytes": image.byte_counts(),
        "ratio": {name: image.source_bytes / count for name, count in image.byte_counts().items()},
        "albedo": _pictures(environment.albedo, albedo, with_dists),
        "normals": {"mean_degrees": float(degrees.mean()), "p95_degrees": float(np.percentile(degrees, 95))},
        "relit": _pictures(relit(environment.albedo, environment.normals), relit(albedo, normals), with_dists),
        "planes": {
            "mean_cm": float(centimetres.mean()),
            "median_cm": float(np.median(centimetres)),
            "p95_cm": float(np.percentile(centimetres, 95)),
            "beyond_5_cm": float(np.mean(centimetres > 5.0)),
        },
        "depth_unit": image.depth_unit,
        "bounding_planes": int(np.count_nonzero(image.planes.bounding[:, 0])),
    }


def _pictures(reference: NDArray[np.float64], test: NDArray[np.float64], with_dists: bool) -> dict[str, Any]:
    """PSNR, SSIM, FLIP and DISTS of two linear pictures."""
    from colonnade.quality.dists import dists_or_none

    pair = encode_srgb(reference), encode_srgb(test)
    difference = asdict(compare_pictures(*pair))
    return {key: difference[key] for key in ("psnr", "ssim", "flip")} | {
        "dists": dists_or_none(*pair) if with_dists else None
    }


def report_lines(report: dict[str, Any]) -> Iterable[str]:
    """Format the report of `measure` as text lines."""
    width, height = report["size"]
    yield f"room        {report['room']}, {width}x{height}, {report['encoding']}"
    for name, count in report["bytes"].items():
        yield f"{name:<12}{count:>7,} bytes, a {report['ratio'][name]:.1f}x reduction from {width * height * 3:,}"
    for name in ("albedo", "relit"):
        loss = report[name]
        yield (
            f"{name:<12}PSNR {loss['psnr']:.1f} dB, SSIM {_format_number(loss['ssim'])}, FLIP {loss['flip']:.3f}, DISTS"
            + (f" {_format_number(loss['dists'])}")
        )
    degrees, planes = report["normals"], report["planes"]
    yield f"normals     {degrees['mean_degrees']:.2f} degrees off, {degrees['p95_degrees']:.1f} for 5 % of the pixels"
    yield f"surfaces    {planes['mean_cm']:.2f} cm off along the view ray, median {planes['median_cm']:.2f}," + (
        f" {planes['p95_cm']:.2f} for 5 % of the pixels; {planes['beyond_5_cm']:.1%} off by 5 cm"
    )
    yield f"bounding    {report['bounding_planes']} planes around the room"


def _format_number(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"
