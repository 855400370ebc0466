"""``isolux study``: how well the method scales, as one report."""

from __future__ import annotations

import json as json_format
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

import isolux
from isolux.cli.options import Jobs, JsonTarget, ProgressMode, ProgressOption
from isolux.cli.progress import showing
from isolux.cli.reading import Reading, UnitsOption, load_scene
from isolux.cli.targets import Targets, check_folder, write_json
from isolux.cli.terminal import Interrupts, interrupts, say
from isolux.study import plan as plans
from isolux.study import report, size, sweep
from isolux.study.claims import claims
from isolux.study.data import Data
from isolux.study.engine import engine
from isolux.study.plan import FIGURES, Machine, Wish
from isolux.study.runs import SCHEDULES, Result, Run
from isolux.study.store import Store

if TYPE_CHECKING:
    from collections.abc import Callable

    from isolux.scene import Scene

__all__ = ["study"]

Word = TypeVar("Word", bound=str)

CANCELLED = 130


def study(
    scene: Annotated[
        Path | None,
        typer.Argument(metavar="SCENE", help="glTF (.glb, .gltf) or OBJ.  [default: isolux's own room]"),
    ] = None,
    out: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="The report's folder.")
    ] = Path("report"),
    quick: Annotated[bool, typer.Option("--quick", help="A minute's version: coarser, fewer runs.")] = False,
    figure: Annotated[
        list[str] | None,
        typer.Option(metavar="5|6|7", help="Only what this figure of the paper needs; may be repeated."),
    ] = None,
    machine: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME|FILE.toml",
            help="A machine beside SB-PRAM and DASH, by name or by a file of its figures; may be repeated.",
        ),
    ] = None,
    schedule: Annotated[
        list[str] | None,
        typer.Option(metavar="splash|sbpram|wavefront", help="Only this schedule; may be repeated."),
    ] = None,
    processors: Annotated[
        str | None,
        typer.Option(metavar="P,P,...", help="Numbers of processors; 1 is always among them."),
    ] = None,
    orders: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="Count N random insertion orders, then write the report from what there is."
        ),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Discard the runs of another study in the folder.")
    ] = False,
    threads: Jobs = 0,
    units: UnitsOption = None,
    json: JsonTarget = None,
    progress: ProgressOption = "auto",
) -> int:
    """Find out how many processors the method can feed, and what stops it: simulated runs, one HTML report.

    Every run is kept in FOLDER/runs: after Ctrl-C the same command goes on where it stopped.

    For example:
        isolux study -o report/

        isolux study room.glb -o report/ --quick

        isolux study -o report/ --figure 6 --machine my.toml --processors 1,16,256

        isolux study -o report/ --orders 1000
    """
    report.check_matplotlib()
    counts = _processors(processors)
    schedules = _chosen("--schedule", schedule, SCHEDULES) or SCHEDULES
    figures = _chosen("--figure", figure, FIGURES)
    if orders is not None and not 1 <= orders <= _MOST_ORDERS:
        raise typer.BadParameter(f"{orders} is not from 1 to {_MOST_ORDERS:,}", param_hint="--orders")
    machines = _machines(machine or [])
    Targets(scene).check_json(json)
    with interrupts() as hand:
        loaded, is_room = _scene(scene, units)
        wish = Wish(
            level=size.of_scene(is_room, quick),
            machines=machines,
            schedules=schedules,
            processors=counts,
            figures=figures,
        )
        runs = plans.plan(wish)
        check_folder(out)
        store = Store(
            out,
            version=isolux.__version__,
            scene_hash=loaded.hash,
            level=wish.level,
            machines=machines,
        )
        store.open(overwrite=overwrite)
        study = _Study(loaded, wish, store, hand, threads)
        try:
            data = study.make(runs, orders, progress)
        except sweep.Stopped as stopped:
            say(f"cancelled: {stopped}; the same command goes on from there")
            return CANCELLED
        hand.let_go()
        page = report.write(data, wish, store)
        return _show(page, data, study, json)


#: Orders are counted in milliseconds each: more than these is a slip of the finger.
_MOST_ORDERS = 1_000_000


class _Study:
    """A study on its way: what it is of, and who is to hear of it."""

    def __init__(self, scene: Scene, wish: Wish, store: Store, hand: Interrupts, threads: int) -> None:
        self._scene = scene
        self._wish = wish
        self._store = store
        self._hand = hand
        self._threads = threads
        #: Runs that were made now, not found.
        self.simulated = 0

    def make(self, runs: list[Run], orders: int | None, progress: ProgressMode) -> Data:
        """Have made what is missing: with `orders` those orders alone, else all runs and the usual orders."""
        level = self._wish.level
        problem = self._problem("1")
        self._hand.keep()
        results: dict[Run, Result]
        if orders is None:
            with showing(progress) as hear:
                results, self.simulated = sweep.make(
                    runs,
                    self._store,
                    problem=lambda share, stop: problem if share == "1" else self._problem(share, stop),
                    machines=self._wish.machines,
                    jobs=self._jobs("runs", hear),
                )
            # What --orders asked for before is there, or is made now.
            wanted = max(level.orders, self._store.orders_asked()) if self._wish.wants(None) else 0
        else:
            found = ((run, self._store.get(run)) for run in runs)
            results = {run: result for run, result in found if result is not None}
            wanted = max(orders, self._store.orders_asked())
            self._store.ask_orders(wanted)
        more = wanted > level.orders or orders is not None
        worked = min(wanted, level.most_worked_orders if more else level.worked_orders)
        # A progress of its own: its time left is reckoned from its own beginning.
        with showing(progress) as hear:
            counted = sweep.count_orders(
                sweep.order_batches(wanted, worked) if wanted else [],
                self._store,
                scene=self._scene._inner,
                level=level,
                jobs=self._jobs("orders", hear),
            )
        return Data(
            scene=self._scene.name,
            scene_hash=self._scene.hash,
            version=isolux.__version__,
            level=level,
            problem=json_format.loads(problem.describe()),
            results=results,
            orders=counted,
            lines=json_format.loads(engine().schedule_lines()),
        )

    def _problem(self, share: str, stop: Callable[[], bool] | None = None) -> Any:  # noqa: ANN401
        settings = {
            **self._wish.level.epsilons[share].to_dict(),
            "order": size.ORDER,
            "seed": 0,
            "roots": "fragments",
        }
        return engine().StudyProblem(self._scene._inner, json_format.dumps(settings), stop)

    def _jobs(self, phase: str, hear: Callable[[sweep.State], None] | None) -> sweep.Jobs:
        return sweep.Jobs(phase, self._threads, hear or (lambda _: None), lambda: self._hand.presses > 0)


def _scene(path: Path | None, units: str | None) -> tuple[Scene, bool]:
    """The scene, and whether it is the room that comes with the package, wherever it was read from."""
    with resources.as_file(resources.files("isolux.study") / "room.glb") as own:
        room = load_scene(own, Reading())
    if path is None:
        if units is not None:
            raise typer.BadParameter("the room that comes with isolux has its own", param_hint="--units")
        return room, True
    loaded = load_scene(path, Reading(units=units))
    return loaded, loaded.hash == room.hash


def _machines(further: list[str]) -> dict[str, Machine]:
    """The paper's machines and what was added, by name."""
    machines: dict[str, Machine] = {}
    for source in (plans.SB_PRAM, plans.DASH, *further):
        found = plans.find_machine(source)
        before = machines.get(found.name)
        if before is not None and before.figures != found.figures:
            raise typer.BadParameter(
                f"{source} calls itself '{found.name}', as another machine does: give it a name of its own",
                param_hint="--machine",
            )
        machines.setdefault(found.name, found)
    return machines


def _chosen(option: str, given: list[str] | None, known: tuple[Word, ...]) -> tuple[Word, ...]:
    """What was chosen of a few words, in their order."""
    for word in given or ():
        if word not in known:
            raise typer.BadParameter(f"'{word}' is not one of {', '.join(known)}", param_hint=option)
    return tuple(word for word in known if word in (given or ()))


def _processors(text: str | None) -> tuple[int, ...] | None:
    """``1,2,4`` as numbers."""
    if text is None:
        return None
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f"'{text}' is not P,P,...", param_hint="--processors") from None


def _show(page: Path, data: Data, made: _Study, json: str | None) -> int:
    checked = claims(data)
    values: dict[str, Any] = {
        "output": str(page),
        "scene": data.scene,
        "scene_hash": data.scene_hash,
        "runs": {"planned": len(data.results), "simulated": made.simulated},
        "orders": len(data.orders),
        "claims": [
            {"what": claim.what, "source": claim.source, "verdict": claim.verdict, "figures": claim.figures}
            for claim in checked
        ],
    }
    if not write_json(json, values):
        say(f"wrote {page} ({len(data.results):,} runs, {made.simulated:,} of them new)")
    return 0
