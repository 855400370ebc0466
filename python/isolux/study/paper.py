"""What the paper reports (Podehl, Rauber and Rünger, its Figure 7 and section 4), to be set beside ours."""

from __future__ import annotations

import dataclasses

__all__ = ["DEPARTURE", "EFFICIENCY_1024", "FASTER_AT_ONE", "FIGURE_7", "SPEEDUP_1024", "PaperPhase"]


@dataclasses.dataclass(frozen=True)
class PaperPhase:
    """A row of Figure 7.

    Parameters
    ----------
    phase
        Its name in the task program.
    what
        What is done in it.
    time_1, time_1024
        Seconds on 1 and on 1,024 processors.
    speedup
        On 1,024 processors, as printed.
    """

    phase: str
    what: str
    time_1: float
    time_1024: float
    speedup: float


#: By schedule; the last row of each is the total. Times in seconds of the simulated machine.
FIGURE_7: dict[str, tuple[PaperPhase, ...]] = {
    "splash": (
        PaperPhase("1", "BSP and form factors", 6898.7, 104.6, 66.0),
        PaperPhase("2", "iteration", 90726.0, 244.1, 371.7),
        PaperPhase("3", "interpolation", 33.782, 4.225, 8.0),
        PaperPhase("total", "", 97658.0, 353.2, 276.5),
    ),
    "sbpram": (
        PaperPhase("1'", "BSP", 7.805, 5.409, 1.44),
        PaperPhase("1''", "initial pairs", 6496.2, 7.413, 876.3),
        PaperPhase("2'", "iteration", 85487.0, 108.0, 791.5),
        PaperPhase("3'", "interpolation", 29.336, 0.036, 814.9),
        PaperPhase("total", "", 92021.0, 121.0, 760.5),
    ),
}
SPEEDUP_1024 = {"splash": 276.5, "sbpram": 760.5}
#: The abstract's and section 4's figure for the optimised version.
EFFICIENCY_1024 = 0.742
#: Share by which the optimised version is faster on one processor.
FASTER_AT_ONE = 0.058
#: A figure of ours that departs by more than this share from the paper's is marked.
DEPARTURE = 0.25
