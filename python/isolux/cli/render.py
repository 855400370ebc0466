"""``isolux render``: a solution becomes a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import isolux
from isolux.cli.options import GatherRays, Jobs, JsonTarget, ProgressOption, exposure_factor, point, size
from isolux.cli.progress import showing
from isolux.cli.targets import Targets, write_json
from isolux.cli.terminal import interrupts, say

__all__ = ["render"]


def render(
    solution: Annotated[Path, typer.Argument(metavar="SOLUTION", help="What isolux solve wrote.")],
    out: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="The picture: .png or .exr.")],
    camera: Annotated[str | None, typer.Option(metavar="NAME", help="A camera of the scene.")] = None,
    eye: Annotated[str | None, typer.Option(metavar="X,Y,Z", help="Look from here, metres.")] = None,
    at: Annotated[str | None, typer.Option(metavar="X,Y,Z", help="Look at this point, metres.")] = None,
    angle: Annotated[
        float, typer.Option(metavar="DEGREES", help="Vertical opening with --eye and --at.")
    ] = 60.0,
    pixels: Annotated[
        str, typer.Option("--size", metavar="WxH", help="Width and height in pixels.")
    ] = "960x720",
    samples: Annotated[
        int, typer.Option(min=1, max=64, metavar="N", help="Samples per pixel are the square of this.")
    ] = 2,
    exposure: Annotated[
        str | None,
        typer.Option(
            metavar="X", help="Factor on radiance, or stops with a sign (+1) relative to the automatic one."
        ),
    ] = None,
    gather: GatherRays = None,
    threads: Jobs = 0,
    json: JsonTarget = None,
    progress: ProgressOption = "auto",
) -> int:
    """Draw a solution: tone-mapped PNG, or linear EXR.

    Without a camera and an eye, the first camera of the scene is taken, or a view that shows all of it.

    For example:
        isolux render room.isolux -o room.png

        isolux render room.isolux -o hall.png --camera hall --exposure +0.5

        isolux render room.isolux -o sharp.png --gather

        isolux render room.isolux -o desk.exr --eye 2,1.6,3 --at 0,0.8,0 --size 1920x1080
    """
    if (eye is None) != (at is None):
        raise typer.BadParameter("it and --at belong together: give both or neither", param_hint="--eye")
    if camera is not None and eye is not None:
        raise typer.BadParameter(
            "it and --eye say the same thing twice: give one of them", param_hint="--camera"
        )
    look_from, look_at, wanted = point("--eye", eye), point("--at", at), size(pixels)
    targets = Targets(solution)
    targets.check(out, (".png", ".exr"))
    targets.check_json(json)
    with interrupts():
        opened = isolux.open(solution)
        factor = exposure_factor(exposure, opened.exposure)
        with showing(progress) as hear:
            picture = opened.render(
                camera,
                eye=look_from,
                at=look_at,
                vertical_angle=angle,
                size=wanted,
                samples=samples,
                gather=gather,
                threads=threads,
                progress=hear,
            )
        opened.write_image(out, picture, exposure=factor)
    if not write_json(json, {"output": str(out), "exposure": factor, "size": list(wanted)}):
        say(f"wrote {out} (exposure {factor:.4g})")
    return 0
