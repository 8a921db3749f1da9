"""``colonnade render``: one frame of a scene, or the frames of its motion."""

from __future__ import annotations

from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from colonnade.cli.options import (
    FILE,
    SCENE,
    Command,
    animation_option,
    background_option,
    configuration_options,
    echo,
    encoder_option,
    finish,
    json_option,
    mesh_option,
    require_outputs,
    require_suffix,
    simplify_option,
    size_option,
    strict_option,
)
from colonnade.common.errors import UserError
from colonnade.common.limits import MAX_FRAMES, MAX_SAMPLES
from colonnade.maps.encoders import Encoder

if TYPE_CHECKING:
    from colonnade.common.types import Floats
    from colonnade.render.report import FrameReport
    from colonnade.render.request import Backend
    from colonnade.scene.model import Denoiser


class _Render(Command):
    """``--denoise`` has an optional value: the word after it is no value if it is the scene."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the words of the command line."""
        pairs = pairwise([*args, ""])
        return super().parse_args(
            ctx,
            ["--denoise=atrous" if word == "--denoise" and _is_scene(following) else word for word, following in pairs],
        )


def _is_scene(word: str) -> bool:
    """Whether a word is the name of a scene, of a TOML file or of a mesh file."""
    from colonnade.scene.parser import is_mesh_file, scene_file

    try:
        return word.endswith(".toml") or is_mesh_file(Path(word)) or scene_file(word).is_file()
    except (UserError, OSError, ValueError):
        return False


@click.command(cls=_Render, short_help="Render frames with the RTL, its model, or Embree.")
@click.argument("scene", type=SCENE)
@configuration_options
@click.option(
    "--backend",
    type=click.Choice(["rtl", "model", "reference"]),
    default="rtl",
    show_default=True,
    help="rtl: the generated Verilog in a simulator; model: its bit-exact model; reference: Embree in floating point.",
)
@size_option("Frame size in pixels, e.g. 640x480.  [default: the scene's]")
@mesh_option
@simplify_option
@background_option
@animation_option
@encoder_option
@click.option("--relit", is_flag=True, help="Show the room shaded by the scene's lights instead of its photo.")
@click.option(
    "--truth",
    type=FILE,
    metavar="MESH",
    help="With --backend reference: trace the room's real geometry, a mesh in the room's world, not its depth map.",
)
@click.option(
    "--frames",
    type=click.IntRange(min=1, max=MAX_FRAMES),
    metavar="N",
    help="Render N frames of the scene's [motion], or of one full turn of the object; or the first N frames of"
    " --sequence. Output files are numbered.",
)
@click.option(
    "--sequence",
    "sequence_file",
    type=FILE,
    metavar="FILE",
    help="Render the object in every frame of a moving camera: a sequence.toml that colonnade capture writes."
    " It stands where the first frame has a place for it. Output files are numbered.",
)
@click.option(
    "--keyframes",
    type=click.IntRange(min=1, max=MAX_FRAMES),
    metavar="N",
    help="With --sequence: encode the room's maps in every Nth frame only.  [default: maps.every of the file, or 1]",
)
@click.option(
    "--samples",
    type=click.IntRange(min=1, max=MAX_SAMPLES),
    metavar="N",
    help="Trace N samples a pixel, as N passes over the frame.  [default: the scene's; if it names none, what"
    " frame.budget allows with gathered light, 4 in the photo of a room, otherwise 1]",
)
@click.option(
    "--denoise",
    type=click.Choice(["atrous", "oidn", "none"]),
    is_flag=False,
    flag_value="atrous",
    metavar="[atrous|oidn|none]",
    help="Filter the noise of gathered light, as the key frame.denoise; not of the reference. Without a value by"
    " atrous, a wavelet; oidn is Open Image Denoise; none shows the noise.",
)
@click.option(
    "--output", type=FILE, metavar="FILE", help="Write a PNG picture, or of several frames a .webp animation."
)
@click.option(
    "--preview",
    "preview_file",
    type=FILE,
    metavar="FILE",
    help="Of several samples also write the PNG picture of the first one, as soon as it is there, not filtered.",
)
@click.option("--video", "video_file", type=FILE, metavar="FILE", help="Of several frames also write an .mp4 video.")
@click.option("--hits", "hits_file", type=FILE, metavar="FILE", help="Write hit triangles and distances as .npz.")
@click.option(
    "--waveform",
    type=FILE,
    metavar="FILE",
    help="Write a VCD waveform of the device, its first column and first traversal unit; for small frames.",
)
@strict_option
@json_option
def render(
    scene: Path,
    config: str,
    overrides: tuple[str, ...],
    backend: Backend,
    size: str | None,
    mesh: str | None,
    simplify: int | None,
    background: Path | None,
    animation: str | None,
    encoder: Encoder | None,
    relit: bool,
    truth: Path | None,
    frames: int | None,
    sequence_file: Path | None,
    keyframes: int | None,
    samples: int | None,
    denoise: Denoiser | Literal["none"] | None,
    output: Path | None,
    preview_file: Path | None,
    video_file: Path | None,
    hits_file: Path | None,
    waveform: Path | None,
    json_file: Path | None,
) -> None:
    """Render SCENE, a TOML file or the name of one such as room, and print its rays, cycles and seconds.

    SCENE may be a mesh, such as my.glb: a camera then frames it, with the materials of its file.

    With --frames the object or a light moves, with --sequence the camera.
    """
    from colonnade.common.extras import require_extra
    from colonnade.common.frame_size import parse_size
    from colonnade.common.input_files import require_regular
    from colonnade.render.sequence import numbered, picture_files

    pixels = parse_size(size) if size is not None else None
    sequence = None
    if sequence_file is not None:
        from colonnade.environment.sequence import load_sequence

        sequence = load_sequence(sequence_file)
        frames = frames or len(sequence)
    elif keyframes is not None:
        raise click.UsageError("--keyframes needs --sequence", click.get_current_context())
    pictures = [output] if output is not None else []
    hits_files = [hits_file] if hits_file is not None else []
    if frames is not None:
        pictures = picture_files(output, frames) if output is not None else []
        hits_files = numbered(hits_file, frames) if hits_file is not None else []
    else:
        require_suffix("--output", output, ".png")
        if video_file is not None:
            raise click.UsageError("--video needs --frames or --sequence", click.get_current_context())
    if preview_file is not None and (frames is not None or backend == "reference"):
        raise click.UsageError("--preview is of one frame, not of the reference", click.get_current_context())
    require_suffix("--preview", preview_file, ".png")
    require_suffix("--video", video_file, ".mp4")
    require_suffix("--hits", hits_file, ".npz")
    require_suffix("--waveform", waveform, ".vcd")
    require_outputs(*pictures, preview_file, *hits_files, video_file, waveform, json_file)
    if video_file is not None:
        require_extra("capture", "--video")
    if truth is not None:
        require_regular(truth, "the room's geometry")

    from colonnade.common.hits import write_hits
    from colonnade.common.image_io import FRAME_MILLISECONDS, encode_srgb, write_png, write_webp
    from colonnade.common.progress import for_terminal
    from colonnade.render.frames import render_frames
    from colonnade.render.report import sequence_report
    from colonnade.render.request import RenderRequest
    from colonnade.render.video import video

    progress = for_terminal()

    def show(picture: Floats) -> None:
        assert preview_file is not None
        write_png(preview_file, picture)
        progress.note(f"{preview_file} shows the first sample of each pixel, the others follow")

    request = RenderRequest(
        scene=scene,
        config=config,
        overrides=overrides,
        backend=backend,
        size=pixels,
        frames=frames or 1,
        samples=samples,
        mesh=mesh,
        simplify=simplify,
        background=background,
        animation=animation,
        sequence=sequence,
        keyframes=keyframes,
        encoder=encoder,
        hits=hits_file is not None,
        relit=relit,
        truth=truth,
        waveform=waveform,
        denoise=False if denoise == "none" else denoise,
        preview=None if preview_file is None else show,
    )
    results = render_frames(request, progress)
    is_film = pictures != [] and pictures[0].suffix.lower() == ".webp"
    rate = 1e3 / FRAME_MILLISECONDS if sequence is None else sequence.content.rate
    reports, film = [], []
    with ExitStack() as stack:
        take_frame = None
        for index, result in enumerate(results):
            if is_film:
                film.append(encode_srgb(result.image))
            elif pictures:
                write_png(pictures[index], result.image)
            if hits_files:
                write_hits(hits_files[index], result.hits())
            if video_file is not None:
                height, width = result.image.shape[:2]
                take_frame = take_frame or stack.enter_context(video(video_file, width, height, rate))
                take_frame(encode_srgb(result.image))
            reports.append(result.report)
    if is_film:
        with progress.step(f"writing {pictures[0].name}"):
            write_webp(pictures[0], film)
    report = reports[0] if frames is None else sequence_report(reports)
    echo(summary(report))
    finish(report.as_json(), json_file)


def summary(report: FrameReport) -> str:
    """The report as one line of text."""
    sequence = f"{len(report.frames)} frames, " if report.frames else ""
    if report.samples > 1:
        sequence += f"{report.samples} samples a pixel, "
    words = [
        f"{report.backend}: {sequence}{report.mesh.triangles:,} triangles",
        f"{report.all_rays:,} rays",
    ]
    if report.cycles:
        words.append(f"{report.cycles:,} cycles")
        if report.samples > 1:
            words.append(f"{report.cycles_per_sample:,.0f} a sample")
        words.append(f"{report.rays_per_cycle_in_box:.3f} rays per cycle in box")
        words.append(f"{report.rays_per_cycle:.3f} of all")
    if report.room is not None:
        words.append(f"{report.room.look_ups:,} environment lookups")
    seconds = ", ".join(f"{step} {value:.1f} s" for step, value in report.seconds.items() if value is not None)
    return ", ".join(words) + (f" ({seconds})" if seconds else "")
