"""What a study calls in the extension, typed: the problem to simulate, the machines, the orders."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Protocol, cast

from isolux import _isolux

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = ["Engine", "Problem", "engine", "orders"]


class Problem(Protocol):
    """A scene with settings, ready to be simulated on any machine."""

    def describe(self) -> str:
        """JSON: polygons, roots, root pairs, order."""

    def simulate(self, run: str, stop: Callable[[], bool] | None = None, /) -> str:
        """Run once; JSON in, JSON out. `stop` is asked now and then; True ends it by an exception."""


class Engine(Protocol):
    """The extension, as far as a study needs it."""

    def StudyProblem(  # noqa: N802
        self,
        scene: Any,  # noqa: ANN401
        settings: str,
        stop: Callable[[], bool] | None = None,
        /,
    ) -> Problem:
        """A problem to simulate. `stop` is asked now and then; True ends it by an exception."""

    def machine_names(self) -> list[str]:
        """Machines that come with isolux."""

    def check_machine(self, name_or_path: str, /) -> str:
        """JSON: name, processors_max, uniform; an error names file and key."""

    def study_orders(
        self,
        scene: Any,  # noqa: ANN401
        request: str,
        stop: Callable[[], bool] | None = None,
        /,
    ) -> str:
        """JSON list: BSP size, root links and work by insertion order. `stop` as of `StudyProblem`."""

    def schedule_lines(self) -> str:
        """JSON: lines of code by schedule."""


def engine() -> Engine:
    """The extension."""
    return cast("Engine", _isolux)


def orders(
    scene: Any,  # noqa: ANN401
    names: list[str],
    seeds: list[int],
    coarse: dict[str, Any] | None,
    stop: Callable[[], bool] | None = None,
) -> list[dict[str, Any]]:
    """Count insertion orders, named and random by seed; with `coarse` settings, all of their work.

    `stop` is asked now and then; True ends it by an exception.
    """
    request = json.dumps({"orders": names, "seeds": seeds, "coarse": coarse})
    counted: list[dict[str, Any]] = json.loads(engine().study_orders(scene, request, stop))
    # Whatever else the extension counts on the way is not what was asked for.
    return [
        entry
        for entry in counted
        if (entry["order"] == "random" and entry["seed"] in seeds) or entry["order"] in names
    ]
