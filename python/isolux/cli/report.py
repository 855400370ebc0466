"""``isolux report``: a solution and measures become a lighting report, HTML or PDF."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import isolux
from isolux.cli import measure as measuring
from isolux.cli.measure import PlaneOption, Quantities, SamplesOption
from isolux.cli.options import Jobs, JsonTarget, ProgressOption
from isolux.cli.progress import showing
from isolux.cli.targets import Targets, write_json
from isolux.cli.terminal import interrupts, say
from isolux.lighting.report import SUFFIXES, Header, check_packages, document, save
from isolux.measures import SAMPLES
from isolux.measures import measure as run

__all__ = ["report"]


def report(
    solution: Annotated[Path, typer.Argument(metavar="SOLUTION", help="What isolux solve wrote.")],
    out: Annotated[
        list[Path],
        typer.Option("-o", "--output", metavar="FILE", help="The report: .html or .pdf. May be given twice."),
    ],
    measures: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A TOML or JSON file of planes, points and surfaces."),
    ] = None,
    plane: PlaneOption = None,
    quantity: Quantities = None,
    title: Annotated[str, typer.Option(metavar="TEXT", help="The report's title.")] = "Lighting report",
    project: Annotated[str, typer.Option(metavar="TEXT", help="Name of the project.")] = "",
    client: Annotated[str, typer.Option(metavar="TEXT", help="Whom it is for.")] = "",
    author: Annotated[str, typer.Option(metavar="TEXT", help="Who prepared it.")] = "",
    date: Annotated[str, typer.Option(metavar="TEXT", help="Date on the report.  [default: today]")] = "",
    notes: Annotated[str, typer.Option(metavar="TEXT", help="Words that stand at its head.")] = "",
    samples: SamplesOption = SAMPLES,
    threads: Jobs = 0,
    json: JsonTarget = None,
    progress: ProgressOption = "auto",
) -> int:
    """Write a lighting report: plans in false colour, tables of measures, surfaces and lights, a signature.

    isolux study writes reports on scalability.

    For example:
        isolux report room.isolux --plane floor+0.75 -o report.html

        isolux report room.isolux --measures office.toml -o office.pdf --project "Office 3" --client "C. D."
    """
    specs = measuring.specs(plane, None, None, measures, quantity, None, None)
    targets = Targets(solution, measures)
    for target in out:
        targets.check(target, SUFFIXES)
    targets.check_json(json)
    check_packages({target.suffix.lower() for target in out})
    header = Header(title=title, project=project, client=client, author=author, date=date, notes=notes)
    with interrupts():
        opened = isolux.open(solution)
        with showing(progress) as hear:
            found = run(opened, specs, samples=samples, threads=threads, progress=hear)
        # A progress of its own: its time left is reckoned from its own beginning.
        with showing(progress) as hear:
            made = document(opened, found, header, threads=threads, progress=hear)
        for target in out:
            save(target, made)
    values = {"output": [str(target) for target in out], "measures": found.to_dict(points=False)}
    if not write_json(json, values):
        say(f"wrote {', '.join(map(str, out))}")
    return 0
