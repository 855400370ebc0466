"""``isolux solve``: a scene becomes a solution file and a report."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

import isolux
from isolux.cli import tables
from isolux.cli.options import (
    ErrorOption,
    Jobs,
    JsonTarget,
    MemoryOption,
    ProgressOption,
    QualityOption,
    TimeOption,
    asked_error,
    bytes_of,
    seconds_of,
)
from isolux.cli.reading import Reading, load_scene, reads_scene
from isolux.cli.solving import ending, solved, tell_of
from isolux.cli.targets import SCENES_AND_PICTURES, Targets, write_json
from isolux.cli.terminal import interrupts, show
from isolux.cli.view import live

__all__ = ["solve"]

_WAVEFRONT = "Schedule wavefront"
_EPSILONS = "Schedule sequential, expert: epsilons"
_METHOD = "Schedule sequential, expert: method"


@reads_scene()
def solve(
    *,
    scene: Annotated[Path, typer.Argument(metavar="SCENE", help="glTF (.glb, .gltf) or OBJ.")],
    out: Annotated[
        Path, typer.Option("-o", "--output", metavar="FILE", help="The solution, e.g. room.isolux.")
    ],
    error: ErrorOption = None,
    quality: QualityOption = None,
    schedule: Annotated[
        Literal["wavefront", "sequential"],
        typer.Option(
            help="wavefront: rounds on all cores until the estimated error is the one asked for; sequential: "
            "the paper's method."
        ),
    ] = "wavefront",
    threads: Jobs = 0,
    seed: Annotated[int, typer.Option(metavar="N", help="Seed of every pseudo-random choice.")] = 0,
    reading: Reading,
    json: JsonTarget = None,
    progress: ProgressOption = "auto",
    view: Annotated[
        bool,
        typer.Option("--view", help="Watch it in a browser while it runs; the page then stays until Ctrl-C."),
    ] = False,
    browser: Annotated[
        bool,
        typer.Option(
            "--browser/--no-browser", help="With --view: open a browser, or only print the address."
        ),
    ] = True,
    dark: Annotated[
        float | None,
        typer.Option(
            metavar="E",
            help="Asked error of the darker half, relative to its mean.",
            rich_help_panel=_WAVEFRONT,
        ),
    ] = None,
    max_elements: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="Stop before there are more elements (exit code 4).", rich_help_panel=_WAVEFRONT
        ),
    ] = None,
    min_area: Annotated[
        float | None,
        typer.Option(
            metavar="A",
            help="Smallest element to split, of the whole area.  "
            "[default: 1e-8; 1e-9 with lamps that have no surface]",
            rich_help_panel=_WAVEFRONT,
        ),
    ] = None,
    memory: MemoryOption = None,
    time: TimeOption = None,
    max_iterations: Annotated[
        int,
        typer.Option(metavar="N", help="Give up after these (exit code 4).", rich_help_panel=_EPSILONS),
    ] = 100,
    bf_eps: Annotated[
        float | None,
        typer.Option(
            metavar="E", help="Most a link may carry, relative to the mean.", rich_help_panel=_EPSILONS
        ),
    ] = None,
    partial_visibility: Annotated[
        float,
        typer.Option(
            metavar="V",
            help="What a sampled visibility counts for; 0: what it is.",
            rich_help_panel=_EPSILONS,
        ),
    ] = 0.5,
    partial_form_factor: Annotated[
        float,
        typer.Option(
            metavar="F",
            help="Largest form factor of links that see each other partly.",
            rich_help_panel=_EPSILONS,
        ),
    ] = 0.02,
    emission_weight: Annotated[
        float,
        typer.Option(metavar="W", help="Weight of a source's own emission.", rich_help_panel=_EPSILONS),
    ] = 0.1,
    area_eps: Annotated[
        float | None,
        typer.Option(
            metavar="E", help="Smallest element to split, of the whole area.", rich_help_panel=_EPSILONS
        ),
    ] = None,
    energy_eps: Annotated[
        float | None,
        typer.Option(metavar="E", help="Change of total radiosity to stop at.", rich_help_panel=_EPSILONS),
    ] = None,
    update: Annotated[
        Literal["in-place", "jacobi"],
        typer.Option(help="When others see a new radiosity.", rich_help_panel=_METHOD),
    ] = "in-place",
    form_factor: Annotated[
        Literal["lambert", "disks"], typer.Option(help="Form factor kernel.", rich_help_panel=_METHOD)
    ] = "lambert",
    rays: Annotated[
        int, typer.Option(metavar="16|256", help="Rays per visibility.", rich_help_panel=_METHOD)
    ] = 16,
    weighting: Annotated[
        Literal["carried", "equal"], typer.Option(help="What each ray counts for.", rich_help_panel=_METHOD)
    ] = "carried",
    covered: Annotated[
        Literal["left-out", "counted"],
        typer.Option(help="Parts of elements that something covers.", rich_help_panel=_METHOD),
    ] = "left-out",
    order: Annotated[
        str,
        typer.Option(
            metavar="ORDER",
            help="Insertion in the BSP tree: as-given, largest-first, fewest-cuts, random, random:SEED.",
            rich_help_panel=_METHOD,
        ),
    ] = "as-given",
    roots: Annotated[
        Literal["polygons", "fragments"],
        typer.Option(help="Roots of the quadtrees.", rich_help_panel=_METHOD),
    ] = "polygons",
    interpolation: Annotated[
        Literal["gathered", "averaged"],
        typer.Option(help="How vertices get their values.", rich_help_panel=_METHOD),
    ] = "gathered",
) -> int:
    """Solve a scene: write a solution file, show the report.

    Ctrl-C keeps what has been computed: a consistent, unfinished solution. A second Ctrl-C gives it up.

    For example:
        isolux solve room.glb -o room.isolux

        isolux solve room.glb -o room.isolux --quality preview -j 2

        isolux solve room.glb -o room.isolux --view

        isolux solve room.obj --units cm -o room.isolux --error 0.02 --json report.json

        isolux solve room.glb -o room.isolux --error 0.01 --time 2m --memory 2G

        isolux solve office.glb --lamp downlight.ies@5,2.7,3 --lamp spot.ldt@3,2.7,2,90,30 -o office.isolux

        isolux solve model.glb --light studio -o model.isolux

        isolux solve studio.glb --sun 48.1,11.6@2026-06-21T17:00+02:00 --north 20 -o studio.isolux

        isolux solve studio.glb --sky cie:16 --sky-illuminance 10000 -o overcast.isolux

        isolux solve studio.glb --sun 48.1,11.6@2026-06-21T17:00+02:00 --sky perez:700,120 -o clear.isolux
    """
    fields: dict[str, Any] = {
        "schedule": schedule,
        "error": asked_error(error, quality),
        "dark": dark,
        "max_elements": max_elements,
        "min_area": min_area,
        "memory": bytes_of(memory),
        "time": seconds_of(time),
        "bf_epsilon": bf_eps,
        "partial_visibility": partial_visibility,
        "partial_form_factor": partial_form_factor,
        "emission_weight": emission_weight,
        "area_epsilon": area_eps,
        "energy_epsilon": energy_eps,
        "update": update,
        "form_factor": form_factor,
        "rays": rays,
        "weighting": weighting,
        "covered": covered,
        "order": order,
        "roots": roots,
        "interpolation": interpolation,
        "seed": seed,
        "max_iterations": max_iterations,
        "threads": threads,
    }
    settings = isolux.Settings(**fields)
    targets = Targets(scene)
    targets.check(out, refused=SCENES_AND_PICTURES)
    targets.check_json(json)
    with interrupts() as hand:
        loaded = load_scene(scene, reading)
        tell_of(loaded)
        with live(browser=browser) if view else nullcontext() as watched:
            server = None if watched is None else watched.server
            solution = solved(loaded, settings, hand, progress, server)
            solution.save(out)
            report = solution.report
            if not write_json(json, {"output": str(out), "report": report.to_dict()}):
                show(tables.report(report, str(out)))
            code = ending(report, f"in {out}")
            if watched is not None:
                watched.stay(solution, hand)
            return code
