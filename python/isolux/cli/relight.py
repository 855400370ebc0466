"""``isolux relight``: a solution whose lights are dimmed, or surfaces repainted, becomes another."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import isolux
from isolux.cli import tables
from isolux.cli.options import Jobs, JsonTarget
from isolux.cli.reading import Reading, load_scene, reads_scene
from isolux.cli.targets import SCENES_AND_PICTURES, Targets, write_json
from isolux.cli.terminal import interrupts, show
from isolux.exceptions import SolutionFileError

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["relight"]


@reads_scene()
def relight(
    *,
    solution: Annotated[
        Path, typer.Argument(metavar="SOLUTION", help="What isolux solve wrote (schedule wavefront).")
    ],
    out: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The solution as it is lit now.")
    ],
    weights: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=W",
            help="Factor on a light group's emission, one number or red,green,blue; groups that are not "
            "named get 1, as they were solved. May be repeated.",
        ),
    ] = None,
    reflectance: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=R",
            help="Diffuse reflectance of a material, one number or red,green,blue: gathered anew over the "
            "links that are there. May be repeated.",
        ),
    ] = None,
    scene: Annotated[
        Path | None,
        typer.Option(metavar="SCENE", help="Make sure that the solution is one of this scene."),
    ] = None,
    reading: Reading,
    threads: Jobs = 0,
    json: JsonTarget = None,
) -> int:
    """Dim, brighten or colour the lights of a solution, or change reflectances, without solving again.

    isolux inspect lists the light groups of a scene.

    For example:
        isolux relight room.isolux --set "desk lamp=0.3" --set sun=0 -o evening.isolux

        isolux relight room.isolux --set "window=1,0.6,0.3" -o sunset.isolux

        isolux relight room.isolux --reflectance "oak floor=0.2,0.18,0.1" -o dark-floor.isolux

        isolux relight room.isolux --scene room.glb --set sun=0 -o night.isolux
    """
    if scene is None:
        reading.refuse("it belongs to --scene, which is not given")
    targets = Targets(solution, scene)
    targets.check(out, refused=SCENES_AND_PICTURES)
    targets.check_json(json)
    lights, paints = _named("--set", weights), _named("--reflectance", reflectance)
    with interrupts():
        opened = isolux.open(solution)
        if scene is not None:
            _check_scene(opened, solution, scene, load_scene(scene, reading))
        relit = opened.relight(lights, reflectance=paints, threads=threads)
        relit.save(out)
        values = {"output": str(out), "report": relit.report.to_dict()}
        if not write_json(json, values):
            show(
                tables.relit(relit.report, str(out)),
                "",
                tables.light_groups(relit.light_groups, relit.scene.unit),
            )
    return 0


def _check_scene(opened: isolux.Solution, solution: Path, scene: Path, loaded: isolux.Scene) -> None:
    if not opened.matches(loaded):
        relit = opened.report.relit
        solved = opened.report.scene_hash if relit is None else relit.scene_hash
        raise SolutionFileError(
            f"{solution}: solved for another scene than {scene}: its hash is {solved[:12]}, "
            f"that of the scene {loaded.hash[:12]}"
        )


def _named(option: str, given: Sequence[str] | None) -> dict[str, tuple[float, ...]]:
    """``name=1`` or ``name=1,0.5,0`` by name."""
    values: dict[str, tuple[float, ...]] = {}
    for text in given or ():
        name, equals, numbers = text.rpartition("=")
        try:
            bands = tuple(float(number) for number in numbers.split(","))
        except ValueError:
            bands = ()
        if not (name and equals and len(bands) in (1, 3)):
            raise typer.BadParameter(
                f"'{text}' is neither NAME=NUMBER nor NAME=RED,GREEN,BLUE", param_hint=option
            )
        if name in values:
            raise typer.BadParameter(f"'{name}' is given twice", param_hint=option)
        values[name] = bands if len(bands) == 3 else bands * 3
    return values
