"""What commands that solve share: findings on the scene, the solve with its progress, and how it ended."""

from __future__ import annotations

from typing import TYPE_CHECKING

import isolux
from isolux.cli import tables
from isolux.cli.progress import showing
from isolux.cli.terminal import say

if TYPE_CHECKING:
    from collections.abc import Callable

    from isolux import Progress
    from isolux.cli.options import ProgressMode
    from isolux.cli.terminal import Interrupts
    from isolux.viewer.server import ViewServer

__all__ = ["ending", "solved", "tell_of"]

NOT_CONVERGED, CANCELLED = 4, 130


def tell_of(scene: isolux.Scene) -> None:
    """Warnings on a scene one by one, notes only as a number; then its light."""
    issues = scene.issues + scene.audit()
    warnings = [issue for issue in issues if issue.severity == "warning"]
    for issue in warnings:
        hint = " (--light studio, --lamp 1500lm@X,Y,Z and --sun add some)" if issue.kind == "no-light" else ""
        say(f"warning: {issue.object}: {issue.message}{hint}")
    notes = len(issues) - len(warnings)
    if notes:
        say(f"{notes} note{'s' if notes > 1 else ''} on the scene (isolux inspect shows them)")
    say(tables.power(scene))


def solved(
    scene: isolux.Scene,
    settings: isolux.Settings,
    hand: Interrupts,
    progress: ProgressMode,
    server: ViewServer | None = None,
) -> isolux.Solution:
    """Solve a scene, showing progress, also on a page; after one Ctrl-C what there is, after two nothing."""
    hand.keep()
    try:
        with showing(progress) as hear:
            told = hand.hearing(hear if server is None else _telling(server, hear))
            pictures = None if server is None else server.picture
            return isolux.solve(scene, settings, progress=told, pictures=pictures)
    except isolux.Cancelled as cancelled:
        if cancelled.solution is None or hand.presses > 1:
            raise KeyboardInterrupt from None
        return cancelled.solution


def _telling(server: ViewServer, show: Callable[[Progress], None] | None) -> Callable[[Progress], None]:
    """Give what tells both the page and whoever shows progress."""

    def tell(state: Progress) -> None:
        server.tell(state)
        if show is not None:
            show(state)

    return tell


def ending(report: isolux.Report, where: str) -> int:
    """Exit code by how a solve ended; unless it converged, say so, and where the result is."""
    match report.status:
        case "converged":
            return 0
        case "iteration-limit":
            steps = (
                f"{len(report.stages)} stages" if report.stages else f"{len(report.iterations)} iterations"
            )
            say(f"warning: not converged in {steps}; the result is {where}")
            return NOT_CONVERGED
        case "bounded":
            bound = "a bound" if report.bound is None else f"the bound --{report.bound.replace('_', '-')}"
            say(f"warning: stopped by {bound} before it converged; the result is {where}")
            return NOT_CONVERGED
        case "cancelled":
            say(f"cancelled; what was computed is {where}")
            return CANCELLED
