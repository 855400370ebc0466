"""Traces of runs: checked, and written for Perfetto."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from isolux.exceptions import InternalError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from isolux.study.runs import Result, Run

__all__ = ["Slice", "flat", "perfetto", "phase_spans"]

Slice = tuple[int, int, int, str, str]


def perfetto(run: Run, result: Result) -> bytes:
    """Make a trace that ui.perfetto.dev opens: one strictly nested track per processor, no arrows.

    The phases have a track of their own, above the processors'. Timestamps are integers and count the
    machine's unit; the viewer shows them as microseconds, which the metadata say.

    Raises
    ------
    InternalError
        Where two slices of a processor overlap, of which none holds the other.
    """
    phases = run.processors
    names = [*(f"processor {processor}" for processor in range(run.processors)), "phases"]
    events: list[dict[str, Any]] = [_named("process_name", {"name": str(run)})]
    for track, name in enumerate(names):
        events.append(_named("thread_name", {"name": name}, track))
        events.append(_named("thread_sort_index", {"sort_index": -1 if track == phases else track}, track))
    tracks: list[list[Slice]] = [[] for _ in names]
    tracks[phases] = [(phases, start, end, "phase", name) for name, start, end in phase_spans(result)]
    for entry in result.trace:
        tracks[entry[0]].append(entry)
    for slices in tracks:
        events += _track(run, slices)
    metadata = {
        "clock": f"1 timestamp is 1 {result.unit} of the simulated machine, not a microsecond",
        "machine": run.machine,
        "schedule": run.schedule,
        "variant": run.variant,
        "processors": run.processors,
    }
    text = ",\n".join(json.dumps(event, separators=(",", ":")) for event in events)
    head = json.dumps(metadata)
    return f'{{"displayTimeUnit":"ns","metadata":{head},"traceEvents":[\n{text}\n]}}\n'.encode()


def phase_spans(result: Result) -> list[tuple[str, int, int]]:
    """Phases with their start and end; they follow each other without a gap."""
    spans = []
    start = 0
    for phase in result.phases:
        name = phase.name if phase.iteration is None else f"{phase.name} {phase.iteration}"
        spans.append(
            (f"{phase.phase} {name}" if phase.phase != phase.name else name, start, start + phase.time)
        )
        start += phase.time
    return spans


def _track(run: Run, slices: Sequence[Slice]) -> list[dict[str, Any]]:
    """Slices of one processor, the enclosing ones first."""
    events = []
    open_ends: list[int] = []
    for processor, start, end, cause, label in sorted(slices, key=lambda entry: (entry[1], -entry[2])):
        if end <= start:
            continue
        while open_ends and open_ends[-1] <= start:
            open_ends.pop()
        if open_ends and end > open_ends[-1]:
            raise InternalError(
                f"{run.key}: on processor {processor}, '{label}' from {start:,} to {end:,} overlaps another"
            )
        open_ends.append(end)
        events.append(
            {
                "ph": "X",
                "pid": 0,
                "tid": processor,
                "ts": start,
                "dur": end - start,
                "name": label,
                "cat": cause,
            }
        )
    return events


def _named(name: str, arguments: dict[str, Any], thread: int = 0) -> dict[str, Any]:
    return {"ph": "M", "pid": 0, "tid": thread, "name": name, "args": arguments}


def flat(trace: Sequence[Slice]) -> list[Slice]:
    """Slices that do not overlap: where one holds another, the inner one stands. By processor and start."""
    segments: list[Slice] = []
    stack: list[Slice] = []

    def emit(entry: Slice, start: int, end: int) -> None:
        if end > start:
            segments.append((entry[0], start, end, entry[3], entry[4]))

    cursor = 0
    for entry in sorted(trace, key=lambda entry: (entry[0], entry[1], -entry[2])):
        while stack and (stack[-1][0] != entry[0] or stack[-1][2] <= entry[1]):
            top = stack.pop()
            emit(top, max(cursor, top[1]), top[2])
            cursor = max(cursor, top[2])
        if stack:
            emit(stack[-1], max(cursor, stack[-1][1]), entry[1])
        else:
            cursor = 0
        cursor = entry[1]
        stack.append(entry)
    while stack:
        top = stack.pop()
        emit(top, max(cursor, top[1]), top[2])
        cursor = max(cursor, top[2])
    return sorted(segments)
