"""``isolux bake``: a solution becomes a lit file, or one with lightmaps, or both."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

import isolux
from isolux.cli.options import GatherRays, Jobs, JsonTarget, ProgressOption, exposure_factor
from isolux.cli.progress import showing
from isolux.cli.targets import Targets, write_json
from isolux.cli.terminal import interrupts, say

if TYPE_CHECKING:
    from isolux.cli.options import ProgressMode
    from isolux.lightmap import Part

__all__ = ["bake"]


def bake(
    solution: Annotated[Path, typer.Argument(metavar="SOLUTION", help="What isolux solve wrote.")],
    out: Annotated[
        Path,
        typer.Option(
            "-o", "--output", metavar="FILE", help="The lit file: .glb, .ply or .vtu; with lightmaps .glb."
        ),
    ],
    to: Annotated[
        Literal["vertex", "lightmap", "both"],
        typer.Option(
            help="Where the light goes: colours of vertices, or pictures beside the file; both: two files, "
            "the second named after the first, FILE-lightmap.glb."
        ),
    ] = "vertex",
    exposure: Annotated[
        str | None,
        typer.Option(
            metavar="X", help="Factor on radiance, or stops with a sign (+1) relative to the automatic one."
        ),
    ] = None,
    gather: GatherRays = None,
    texels_per_metre: Annotated[
        float | None,
        typer.Option(
            "--texels-per-metre",
            metavar="N",
            help="Lightmap: density, on as many maps as it needs. Without it: as dense as one map holds.",
        ),
    ] = None,
    size: Annotated[
        int | None,
        typer.Option(
            "--size",
            metavar="N",
            help="Lightmap: texels along each side of a map, 16 to 8192; 1024 if alone.",
        ),
    ] = None,
    padding: Annotated[
        int | None,
        typer.Option(
            "--padding", metavar="N", help="Lightmap: texels of light around each chart; 2 if not given."
        ),
    ] = None,
    parts: Annotated[
        str | None,
        typer.Option(
            "--parts",
            metavar="PART[,PART]",
            help="Lightmap: pictures of direct and indirect light as well (direct, indirect).",
        ),
    ] = None,
    values: Annotated[
        Literal["smooth", "elements"] | None,
        typer.Option(
            "--values",
            help="Lightmap: smooth (what isolux render shows; the default), or of elements: closer to the "
            "truth where shadows are fine, with steps where elements meet.",
        ),
    ] = None,
    scene: Annotated[
        Path | None,
        typer.Option(
            "--scene",
            metavar="FILE",
            help="Lightmap: the glTF or GLB file that was solved; all of it is kept, its materials included.",
        ),
    ] = None,
    threads: Jobs = 0,
    json: JsonTarget = None,
    progress: ProgressOption = "auto",
) -> int:
    """Write the lit surfaces of a solution: glTF with vertex colours or lightmaps, PLY, or VTU for ParaView.

    For example:
        isolux bake room.isolux -o lit.glb

        isolux bake room.isolux -o lit.glb --exposure +1

        isolux bake room.isolux -o room.vtu

        isolux bake room.isolux -o sharp.glb --gather 1024

        isolux bake room.isolux -o lit.glb --to lightmap --scene room.glb --texels-per-metre 40

        isolux bake room.isolux -o lit.glb --to both
    """
    if to != "vertex":
        options: dict[str, Any] = {
            "texels_per_metre": texels_per_metre,
            "size": size,
            "padding": padding,
            "parts": _parts(parts),
            "values": values,
            "scene": scene,
            "gather": gather,
            "threads": threads,
        }
        given = {name: value for name, value in options.items() if value is not None}
        return _lightmap(solution, out, exposure, given, json, progress, both=to == "both")
    maps_only = {
        "--texels-per-metre": texels_per_metre,
        "--size": size,
        "--padding": padding,
        "--parts": parts,
        "--values": values,
        "--scene": scene,
    }
    for option, value in maps_only.items():
        if value is not None:
            raise typer.BadParameter("it belongs to --to lightmap or both", param_hint=option)
    targets = Targets(solution)
    targets.check(out, (".glb", ".ply", ".vtu"))
    targets.check_json(json)
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


def _lightmap(
    solution: Path,
    out: Path,
    exposure: str | None,
    options: dict[str, Any],
    json: str | None,
    progress: ProgressMode,
    *,
    both: bool,
) -> int:
    """Bake lightmaps; tell what was written, and what is not as it was asked for.

    `both`: beside a file with lit vertices, which has the name that was asked for. They are two, for what
    shows both kinds of light multiplies them; both appear, or none.
    """
    from isolux.lightmap import bake as bake_lightmap  # noqa: PLC0415 (see `Solution.bake_lightmap`)

    mapped = out.with_name(f"{out.stem}-lightmap{out.suffix}") if both else out
    targets = Targets(solution, options.get("scene"))
    targets.check(out, (".glb",))
    if both:
        targets.check(mapped, (".glb",))
    _check_maps(targets, mapped, options, json)
    with interrupts():
        opened = isolux.open(solution)
        factor = exposure_factor(exposure, opened.exposure)
        lit = {}
        if both:
            with showing(progress) as hear:
                given = {name: options.get(name) for name in ("gather", "threads")}
                lit[out] = _lit(opened, out, exposure=factor, progress=hear, **given)
        with showing(progress) as hear:
            manifest = bake_lightmap(opened, mapped, exposure=factor, progress=hear, beside=lit, **options)
    for note in manifest["notes"]:
        say(f"note: {note}")
    values = {"output": str(mapped), **manifest}
    if both:
        values = {"output": str(out), "exposure": factor, "lightmap": values}
    if not write_json(json, values):
        if both:
            say(f"wrote {out} with lit vertices (exposure {factor:.4g})")
        say(f"wrote {mapped} and {_maps(manifest)}")
    return 0


def _lit(opened: isolux.Solution, out: Path, **options: Any) -> bytes:  # noqa: ANN401 (those of `Solution.bake`)
    """Bytes of a file with lit vertices, made on the disk that it is for."""
    with tempfile.TemporaryDirectory(dir=out.parent, prefix=".isolux-", suffix=".tmp") as folder:
        lit = Path(folder) / out.name
        opened.bake(lit, **options)
        return lit.read_bytes()


def _check_maps(targets: Targets, out: Path, options: dict[str, Any], json: str | None) -> None:
    """What a bake of lightmaps reads and writes beside its scene."""
    from isolux.lightmap import manifest_of  # noqa: PLC0415 (see `Solution.bake_lightmap`)

    scene: Path | None = options.get("scene")
    targets.check(manifest_of(out), option="--to")
    targets.check_json(json)
    if scene is not None and scene.suffix.lower() not in (".glb", ".gltf"):
        raise typer.BadParameter(f"{scene} is neither .glb nor .gltf: leave it out", param_hint="--scene")


def _maps(manifest: dict[str, Any]) -> str:
    """Maps in words: how many, how large, how bright."""
    count = len(manifest["maps"])
    side = manifest["maps"][0]["width"]
    return (
        f"{count} {'map' if count == 1 else 'maps'} of {side} x {side} texels, "
        f"{manifest['texelsPerMetre']:.3g} per metre (exposure {manifest['exposure']:.4g}, "
        f"{manifest['texelsPerSecond']:,} texels/s)"
    )


def _parts(text: str | None) -> list[Part] | None:
    """``direct,indirect`` as words."""
    if text is None:
        return None
    parts: list[Part] = []
    for word in text.split(","):
        match word.strip():
            case "direct":
                parts.append("direct")
            case "indirect":
                parts.append("indirect")
            case other:
                raise typer.BadParameter(f"'{other}' is neither direct nor indirect", param_hint="--parts")
    return list(dict.fromkeys(parts))
