"""Colours and marks, the same in every figure; told apart by those who see fewer colours, too.

Schedules have the colours of Okabe and Ito (2008); machines differ by line and mark, grains by filled and
open marks.
"""

from __future__ import annotations

__all__ = ["CAUSE_COLOURS", "GREY", "LABEL_COLOURS", "LINES", "MARKS", "SCHEDULE_COLOURS", "label_group"]

GREY = "#777777"
SCHEDULE_COLOURS = {"splash": "#0072B2", "sbpram": "#D55E00", "wavefront": "#009E73"}
#: By machine; others take the last.
LINES = {"sb-pram": "-", "dash": "--", "": ":"}
MARKS = {"sb-pram": "o", "dash": "s", "": "^"}

#: Work is pale: what matters in these figures is what is lost.
CAUSE_COLOURS = {
    "work": "#DDDDDD",
    "queue": "#EECC66",
    "steal": "#EE99AA",
    "stall": "#994455",
    "lock wait": "#997700",
    "barrier wait": "#6699CC",
    "idle": "#004488",
}
#: Tasks by their letter, and what is no task.
LABEL_COLOURS = {
    "B": "#222255",
    "F": "#44AA99",
    "V": "#88CCEE",
    "R": "#DDCC77",
    "A": "#117733",
    "queue": "#AA4499",
    "steal": "#CC6677",
    "wait": "#F4F4F4",
}


def label_group(cause: str, label: str) -> str:
    """What a slice of a trace is drawn as."""
    if label in LABEL_COLOURS:
        return label
    if cause == "work":
        return label[:1] if label[:1] in LABEL_COLOURS else "queue"
    return cause if cause in ("queue", "steal") else "wait"
