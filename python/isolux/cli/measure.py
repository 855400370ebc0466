"""``isolux measure``: a solution becomes illuminances on planes, at points and on surfaces."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import isolux
from isolux.cli import tables
from isolux.cli.options import Jobs, JsonTarget, ProgressOption
from isolux.cli.progress import showing
from isolux.cli.targets import Targets, write_json
from isolux.cli.terminal import interrupts, say, show
from isolux.grids import BORDER
from isolux.io import measures_file
from isolux.io.together import write_together
from isolux.measures import SAMPLES, Plane, Surface
from isolux.measures import measure as run

if TYPE_CHECKING:
    from collections.abc import Sequence

    from isolux.measures import Spec

__all__ = ["PlaneOption", "Quantities", "SamplesOption", "measure", "specs"]

PlaneOption = Annotated[
    list[str] | None,
    typer.Option(
        "--plane",
        metavar="OBJECT+H|CORNERS",
        help="A plane H metres over an object, e.g. floor+0.75; or a rectangle by two opposite corners "
        "x,y,z:x,y,z (level), or by three. May be repeated.",
    ),
]
Quantities = Annotated[
    list[str] | None,
    typer.Option(
        "--quantity",
        metavar="WORD",
        help="What to measure on planes and at points: plane, horizontal, cylindrical, vertical:DIR or "
        "semicylindrical:DIR, with DIR +x, -x, +z, -z or degrees from +x. May be repeated.  [default: plane]",
    ),
]
SamplesOption = Annotated[
    int, typer.Option("--samples", min=8, max=65_536, metavar="N", help="Rays around each point.")
]


def measure(
    solution: Annotated[Path, typer.Argument(metavar="SOLUTION", help="What isolux solve wrote.")],
    plane: PlaneOption = None,
    surface: Annotated[
        list[str] | None,
        typer.Option(
            metavar="OBJECT", help="An object's surfaces, from the solve's elements. May be repeated."
        ),
    ] = None,
    points: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE.csv", help="Points x,y,z, or with normals x,y,z,nx,ny,nz. May be repeated."
        ),
    ] = None,
    measures: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A TOML or JSON file of planes, points and surfaces."),
    ] = None,
    quantity: Quantities = None,
    border: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            metavar="M",
            help=f"Zone along outlines that is left out.  [default: {BORDER} over objects, else 0]",
        ),
    ] = None,
    spacing: Annotated[
        float | None,
        typer.Option(metavar="M", help="Largest distance of grid points.  [default: that of EN 12464-1]"),
    ] = None,
    samples: SamplesOption = SAMPLES,
    out: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FILE.csv", help="Every value, point by point."),
    ] = None,
    summary: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="The table of averages and so on.")
    ] = None,
    threads: Jobs = 0,
    json: JsonTarget = None,
    progress: ProgressOption = "auto",
) -> int:
    """Measure illuminance in a solution, on planes, at points and on surfaces: average, extremes, uniformity.

    Points inside solid things, or behind the room's walls, are left out and counted.

    For example:
        isolux measure room.isolux --plane floor+0.75 -o desk.csv

        isolux measure room.isolux --plane floor+1.2 --quantity cylindrical --quantity vertical:+x

        isolux measure room.isolux --plane 1,0.75,1:2.6,0.75,1.8 --surface "north wall" --summary table.csv

        isolux measure room.isolux --measures office.toml --json office.json
    """
    asked = specs(plane, surface, points, measures, quantity, border, spacing)
    targets = Targets(solution, measures, *(points or ()))
    targets.check(out, (".csv",))
    targets.check(summary, (".csv",), option="--summary")
    targets.check_json(json)
    with interrupts():
        opened = isolux.open(solution)
        with showing(progress) as hear:
            found = run(opened, asked, samples=samples, threads=threads, progress=hear)
        texts = {out: found.to_csv(), summary: found.summary_csv()}
        write_together({path: text.encode() for path, text in texts.items() if path is not None})
        if not write_json(json, found.to_dict()):
            show(tables.measurements(found))
    for entry in found.measurements:
        if entry.left_out:
            say(
                f"{entry.name}: {entry.left_out:,} of {len(entry.points):,} points are left out: "
                "inside something solid, or behind walls"
            )
    return 0


def specs(
    planes: Sequence[str] | None,
    surfaces: Sequence[str] | None,
    points: Sequence[Path] | None,
    measures: Path | None,
    quantity: Sequence[str] | None,
    border: float | None,
    spacing: float | None,
) -> list[Spec]:
    """What options ask for, together with a file of measures."""
    quantities = tuple(quantity or ("plane",))
    asked: list[Spec] = [] if measures is None else measures_file.read(measures)
    asked += [_plane(text, quantities, border, spacing) for text in planes or ()]
    asked += [measures_file.read_points(path, path.stem, quantities) for path in points or ()]
    asked += [Surface(name) for name in surfaces or ()]
    if not asked:
        raise typer.BadParameter("give --plane, --points, --surface or --measures", param_hint="--plane")
    return asked


def _plane(text: str, quantities: Sequence[str], border: float | None, spacing: float | None) -> Plane:
    """``floor+0.75``, ``x,y,z:x,y,z`` or ``x,y,z:x,y,z:x,y,z``."""
    parts = text.split(":")
    if len(parts) in (2, 3):
        try:
            corners = [tuple(float(number) for number in part.split(",")) for part in parts]
        except ValueError:
            corners = []
        if corners and all(len(corner) == 3 for corner in corners):
            return Plane(text, corners=corners, border=border, spacing=spacing, quantities=quantities)
    name, sign, number = text.rpartition("+")
    try:
        height = float(number)
    except ValueError:
        height = -1.0
    if not (name and sign and height >= 0.0):
        raise typer.BadParameter(
            f"'{text}' is neither OBJECT+HEIGHT nor x,y,z:x,y,z nor three such corners", param_hint="--plane"
        )
    return Plane(text, over=name, height=height, border=border, spacing=spacing, quantities=quantities)
