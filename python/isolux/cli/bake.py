"""``isolux bake``: a solution becomes a lit file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

import isolux
from isolux.cli.options import (
    GatherRays,
    Jobs,
    JsonTarget,
    ProgressOption,
    check_target,
    exposure_factor,
    write_json,
)
from isolux.cli.progress import showing
from isolux.cli.terminal import interrupts, say

__all__ = ["bake"]


def bake(
    solution: Annotated[Path, typer.Argument(metavar="SOLUTION", help="What isolux solve wrote.")],
    out: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The lit file: .glb, .ply or .vtu.")
    ],
    to: Annotated[  # noqa: ARG001
        Literal["vertex"], typer.Option(help="Where the light goes: colours of vertices.")
    ] = "vertex",
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
    """Write the lit surfaces of a solution: glTF with vertex colours, PLY, or VTU for ParaView.

    For example:
        isolux bake room.isolux -o lit.glb

        isolux bake room.isolux -o lit.glb --exposure +1

        isolux bake room.isolux -o room.vtu

        isolux bake room.isolux -o sharp.glb --gather 1024
    """
    check_target(out, solution, (".glb", ".ply", ".vtu"))
    with interrupts():
        opened = isolux.open(solution)
        factor = exposure_factor(exposure, opened.exposure)
        if gather is None:
            opened.bake(out, exposure=factor)
        else:
            with showing(progress) as hear:
                opened.bake(out, exposure=factor, gather=gather, threads=threads, progress=hear)
    if not write_json(json, {"output": str(out), "exposure": factor}):
        say(f"wrote {out} (exposure {factor:.4g})")
    return 0
