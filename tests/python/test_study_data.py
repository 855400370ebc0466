"""What a study derives and writes: plans, accounting, limits, tables, traces, words; on made results."""

from __future__ import annotations

import csv
import dataclasses
import io
import itertools
import json
import math
import re

import pytest
import study_fake

from isolux.exceptions import InternalError, UsageError
from isolux.study import paper, size, tables, words
from isolux.study.claims import claims
from isolux.study.data import Curve, Data
from isolux.study.numbers import figure, percent
from isolux.study.plan import DASH, SB_PRAM, Machine, Wish, ordered, plan, weight
from isolux.study.runs import CAUSES, SCHEDULES, SWITCHES, Result, Run, accounting
from isolux.study.traces import flat, perfetto, phase_spans

MACHINES = {
    SB_PRAM: Machine(SB_PRAM, SB_PRAM, 16_384, uniform=True, figures=""),
    DASH: Machine(DASH, DASH, 64, uniform=False, figures=""),
}


def wish(**fields):
    return Wish(**{"level": size.FULL, "machines": MACHINES, **fields})


def result(run: Run, **changes) -> Result:
    values = study_fake.simulated(json.loads(run.request(run.machine)))
    values.update(changes)
    return Result.from_dict(values)


def data(runs, results=None, **fields) -> Data:
    made = results or {run: result(run) for run in runs}
    return Data(
        **{
            "scene": "room",
            "scene_hash": "0",
            "version": "1",
            "level": size.FULL,
            "problem": {},
            "results": made,
            "orders": [],
            "lines": {},
            **fields,
        }
    )


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


@pytest.fixture(scope="module")
def whole() -> Data:
    """A whole study, the fake's."""
    orders = [study_fake.Engine._order("random", seed, None) for seed in range(1, 101)]
    orders += [study_fake.Engine._order(name, None, None) for name in ("as-given", "fewest-cuts")]
    for roots in ("fragments", "polygons"):
        orders += [
            {**study_fake.Engine._order("random", seed, {"roots": roots}), "roots": roots} for seed in (1, 2)
        ]
    return data(plan(wish()), orders=[{"roots": None, **entry} for entry in orders])


def test_the_plan_has_every_point_of_the_paper_once():
    """Catches a missing curve or switch, a run that is made twice, and two runs that share a file."""
    runs = plan(wish())
    assert len(runs) == len(set(runs)) == len({run.key for run in runs})
    assert all(re.fullmatch(r"[\w.'-]+", run.key) for run in runs)
    plain = [run for run in runs if run.size == "1" and not run.trace and run.update != "jacobi"]

    def counts(machine, schedule, variant):
        return [
            run.processors
            for run in plain
            if (run.machine, run.schedule, run.variant) == (machine, schedule, variant)
        ]

    to_16384, to_64 = [2**power for power in range(15)], [2**power for power in range(7)]
    for schedule in ("splash", "sbpram"):
        assert sorted(counts(SB_PRAM, schedule, "default")) == to_16384
        assert sorted(counts(DASH, schedule, "default")) == to_64
    assert sorted(counts(SB_PRAM, "splash", "finest")) == to_16384[:12]
    assert sorted(counts(DASH, "splash", "finest")) == to_64
    assert sorted(counts(SB_PRAM, "sbpram", "without parallel_bsp")) == to_16384
    for switch in SWITCHES:
        assert {1, 64, 256, 1024} <= set(counts(SB_PRAM, "splash", f"with {switch}"))
        assert {1, 64, 256, 1024} <= set(counts(SB_PRAM, "sbpram", f"without {switch}"))
    wavefront = [run.processors for run in runs if run.schedule == "wavefront" and run.machine == SB_PRAM]
    assert set(wavefront) == set(to_16384)
    traced = {(run.schedule, run.processors) for run in runs if run.trace}
    assert traced == {("splash", 4), ("sbpram", 4)}
    sizes = {(run.schedule, run.size, run.processors) for run in runs if run.size != "1" and not run.trace}
    assert sizes == {(s, share, p) for s in SCHEDULES for share in ("1/4", "4") for p in (1, 1024)}


def test_every_curve_has_its_own_run_on_one_processor():
    """Catches a speedup against another variant's time, for want of the own one."""
    runs = plan(wish(processors=(16, 64)))
    keys = {dataclasses.replace(run, processors=1) for run in runs if not run.trace}
    assert keys <= set(runs)


def test_switches_are_named_by_what_they_change():
    """Catches an ablation that turns the wrong way or the wrong switch."""
    added = Run.of(SB_PRAM, "splash", 64, switch="fine_tasks")
    assert added.switches == ("fine_tasks",)
    removed = Run.of(SB_PRAM, "sbpram", 64, switch="fine_tasks")
    assert set(SWITCHES) - set(removed.switches) == {"fine_tasks"}
    asked = json.loads(removed.request("sb-pram"))
    assert asked["variant"] == {name: name != "fine_tasks" for name in SWITCHES}
    assert not any(json.loads(Run.of(SB_PRAM, "splash", 1).request("sb-pram"))["variant"].values())


def test_a_figure_alone_needs_fewer_runs():
    """Catches --figure that makes everything all the same."""
    everything = set(plan(wish()))
    for number in ("5", "6", "7"):
        some = set(plan(wish(figures=(number,))))
        assert some < everything
    assert len(plan(wish(figures=("7",)))) == 4


def test_a_quick_plan_keeps_the_figures_that_tables_stand_on():
    """Catches a quick study without 1,024 processors, or as long as the full one."""
    quick = plan(wish(level=size.QUICK))
    assert len(quick) < 0.8 * len(plan(wish()))
    assert {64, 256, 1024, 2048} <= {run.processors for run in quick if run.machine == SB_PRAM}


@pytest.mark.parametrize("count", [0, -1, 16_385, 10**6])
def test_processors_that_no_machine_has_are_named(count):
    """Catches p = 0 or a million that reaches the simulator."""
    with pytest.raises(UsageError, match=str(count)):
        plan(wish(processors=(4, count)))


def test_cheap_runs_come_before_dear_ones():
    """Catches a sweep that ends with one core waiting for the longest run of a machine."""
    runs = ordered(plan(wish()), MACHINES)
    ones = [run.processors == 1 for run in runs]
    assert ones == sorted(ones, reverse=True)
    several = [run for run in runs if run.processors > 1]
    machines = [run.machine for run in several]
    assert machines == sorted(machines, key=[SB_PRAM, DASH].index)
    weights = [weight(run, MACHINES[run.machine]) for run in several if run.machine == SB_PRAM]
    assert weights == sorted(weights, reverse=True)


def test_time_without_a_cause_is_refused():
    """Catches a result whose processor time is not accounted for to the unit, in any phase."""
    run = Run.of(SB_PRAM, "sbpram", 64)
    good = result(run)
    accounting(run, good)
    for index, phase in enumerate(good.phases):
        for cause in CAUSES:
            causes = {**phase.causes, cause: phase.causes[cause] + 1}
            phases = list(good.phases)
            phases[index] = dataclasses.replace(phase, causes=causes)
            with pytest.raises(InternalError, match=re.escape(run.key)):
                accounting(run, dataclasses.replace(good, phases=tuple(phases)))
    with pytest.raises(InternalError, match="64 processors"):
        accounting(Run.of(SB_PRAM, "sbpram", 32), good)


def test_an_unknown_cause_is_refused():
    """Catches a cause that the tables would drop without a word."""
    run = Run.of(SB_PRAM, "splash", 2)
    values = study_fake.simulated(json.loads(run.request(SB_PRAM)))
    values["phases"][0]["causes"]["coffee"] = 0
    with pytest.raises(ValueError, match="coffee"):
        Result.from_dict(values)


def two_phases(p: int, times: tuple[int, int], works: tuple[int, int], spans: tuple[int, int]) -> Result:
    phases = [
        {
            "phase": name,
            "name": name,
            "iteration": None,
            "time": time,
            "span": span,
            "causes": {"work": work, "idle": p * time - work},
        }
        for name, time, work, span in zip("ab", times, works, spans, strict=True)
    ]
    run = Run.of(SB_PRAM, "splash", p)
    return result(run, phases=phases)


def test_speedup_limit_and_extra_work_by_hand():
    """Catches a limit that takes work and span of the whole run together instead of phase by phase."""
    one = two_phases(1, (100, 50), (100, 50), (10, 40))
    four = two_phases(4, (30, 45), (104, 50), (10, 40))
    curve = Curve(SB_PRAM, "splash", "default", "in-place", "1", {1: one, 4: four})
    assert curve.speedup(4) == 150 / 75
    assert curve.speedup(4, "a") == 100 / 30
    assert curve.efficiency(4, without="b") == 100 / 30 / 4
    # 104 / 4 = 26 > 10 in the first phase, 50 / 4 = 12.5 < 40 in the second.
    assert curve.limit(4) == 150 / 66
    assert curve.limit(4, without="b") == 100 / 26
    assert curve.extra_work(4) == 4
    assert curve.largest_loss(4) == ("idle", (4 * 75 - 154) / 300)
    assert curve.lossy_phase(4) == ("b", 130 / 146)


def test_waits_for_memory_count_as_cost_in_the_limit():
    """Catches a limit beyond the ideal line on a machine with caches, whose time on one is mostly waits."""
    run = Run.of(DASH, "splash", 1)
    one, several = result(run), result(dataclasses.replace(run, processors=16))
    curve = Curve(DASH, "splash", "default", "in-place", "1", {1: one, 16: several})
    assert sum(phase.causes["stall"] for phase in one.phases) > 0.1 * one.time
    assert 1.0 <= curve.limit(1) < 1.02
    assert curve.speedup(16) <= curve.limit(16) < 16.5


def test_tables_hold_what_the_runs_say(whole):
    """Catches a table that drops a phase, a cause, a curve, or divides by another variant's time."""
    speedup, losses = rows(tables.speedup(whole)), rows(tables.losses(whole))
    keys = [
        tuple(row[k] for k in ("machine", "schedule", "variant", "update", "processors", "phase"))
        for row in speedup
    ]
    assert len(keys) == len(set(keys)) == len(losses)
    run = Run.of(SB_PRAM, "splash", 256, switch="pair_loop")
    one = dataclasses.replace(run, processors=1)
    (row,) = (
        row
        for row, key in zip(speedup, keys, strict=True)
        if key == (SB_PRAM, "splash", "with pair_loop", "in-place", "256", "total")
    )
    times = whole.results[one].time, whole.results[run].time
    assert float(row["speedup"]) == pytest.approx(times[0] / times[1], rel=1e-5)
    assert float(row["efficiency"]) == pytest.approx(times[0] / times[1] / 256, rel=1e-5)
    by_key = {key: (row, lost) for key, row, lost in zip(keys, speedup, losses, strict=True)}
    for key, (fast, lost) in by_key.items():
        spent = sum(int(lost[cause]) for cause in CAUSES)
        assert spent == int(key[4]) * int(fast["time"])
    totals = [row for row in losses if row["phase"] == "total"]
    assert {row["update"] for row in totals} == {"in-place", "jacobi"}
    assert any(int(row["extra work"]) < 0 for row in totals)


def test_smaller_tables(whole):
    """Catches an empty table, and one that mixes sizes."""
    ablation = rows(tables.ablation(whole))
    assert len(ablation) == 3 * (2 + 2 * len(SWITCHES))
    assert {row["size"] for row in rows(tables.size(whole))} == {"1/4", "1", "4"}
    misses = rows(tables.misses(whole))
    assert {row["machine"] for row in misses} == {DASH}
    convergence = rows(tables.convergence(whole))
    assert {row["residual"] for row in convergence if row["iteration"] == "1"} == {""}
    orders = rows(tables.order(whole))
    assert len(orders) == len(whole.orders)
    for table in tables.TABLES.values():
        assert "nan" not in table(whole)


def test_traces_are_strictly_nested_with_integer_ids():
    """Catches overlapping slices, which Perfetto draws wrongly, missing tracks, and an unnamed clock."""
    run = Run.of(SB_PRAM, "splash", 4, trace=True)
    values = json.loads(perfetto(run, result(run)))
    assert "instructions" in values["metadata"]["clock"]
    slices = [event for event in values["traceEvents"] if event["ph"] == "X"]
    assert {event["ph"] for event in values["traceEvents"]} == {"X", "M"}
    tracks = {
        event["tid"]: event["args"]["name"]
        for event in values["traceEvents"]
        if event["name"] == "thread_name"
    }
    assert {event["tid"] for event in slices} == set(tracks) == {0, 1, 2, 3, 4}
    assert tracks[4] == "phases"
    deepest = 0
    for track in tracks:
        stack: list[int] = []
        for event in (event for event in slices if event["tid"] == track):
            assert all(isinstance(event[key], int) for key in ("pid", "tid", "ts", "dur"))
            assert event["dur"] > 0
            while stack and stack[-1] <= event["ts"]:
                stack.pop()
            assert not stack or event["ts"] + event["dur"] <= stack[-1]
            stack.append(event["ts"] + event["dur"])
            deepest = max(deepest, len(stack))
    assert deepest == 2


def test_overlapping_slices_are_refused():
    """Catches a trace that would be drawn wrongly, written all the same."""
    run = Run.of(SB_PRAM, "splash", 4, trace=True)
    made = result(run)
    wrong = [(0, 10, 20, "work", "B"), (0, 15, 25, "work", "F")]
    with pytest.raises(InternalError, match="'F' from 15 to 25"):
        perfetto(run, dataclasses.replace(made, trace=wrong))


def test_flat_slices_cover_the_same_time_once():
    """Catches time of a task counted twice where another runs inside it, or lost between two of them."""
    trace = [
        (0, 0, 100, "work", "R"),
        (0, 10, 30, "work", "V"),
        (0, 12, 15, "queue", "push"),
        (0, 30, 40, "work", "V"),
        (0, 100, 110, "idle", "wait"),
        (1, 5, 50, "work", "B"),
        (1, 5, 50, "work", "F"),
    ]
    flattened = flat(trace)
    assert [(s, e, label) for p, s, e, _, label in flattened if p == 0] == [
        (0, 10, "R"),
        (10, 12, "V"),
        (12, 15, "push"),
        (15, 30, "V"),
        (30, 40, "V"),
        (40, 100, "R"),
        (100, 110, "wait"),
    ]
    assert [(s, e, label) for p, s, e, _, label in flattened if p == 1] == [(5, 50, "F")]


def test_phases_follow_each_other():
    """Catches phase slices with gaps, or iterations that share a name."""
    made = result(Run.of(SB_PRAM, "sbpram", 4))
    spans = phase_spans(made)
    assert spans[0][1] == 0
    assert all(one[2] == other[1] for one, other in itertools.pairwise(spans))
    assert spans[-1][2] == made.time
    assert len({name for name, _, _ in spans}) == len(spans)


def scaled(whole: Data, changed, factor: float) -> Data:
    """The same study with the times of some runs stretched: the rest of their time is idle."""
    results = {}
    for run, made in whole.results.items():
        if changed(run):
            phases = []
            for phase in made.phases:
                time = max(math.ceil(phase.time * factor), math.ceil(phase.work / run.processors))
                rest = run.processors * time - phase.work
                causes = dict.fromkeys(CAUSES, 0) | {"work": phase.work, "idle": rest}
                phases.append(dataclasses.replace(phase, time=time, causes=causes))
            made = dataclasses.replace(made, phases=tuple(phases))
            accounting(run, made)
        results[run] = made
    return dataclasses.replace(whole, results=results)


#: What must be told otherwise, and the runs that decide it.
SLOWER = [
    (words.figure_6_left, lambda run: run.machine == DASH and run.processors == 64),
    (words.figure_6_right, lambda run: run.machine == SB_PRAM and run.processors >= 1024),
    (words.figure_7, lambda run: run.schedule == "splash" and run.processors == 1024),
    (words.ablation, lambda run: run.variant == "with fine_tasks" and run.processors == 1024),
    (words.bsp, lambda run: run.variant == "without parallel_bsp" and run.processors > 64),
    (words.losses, lambda run: run.processors > 1),
    (words.wavefront, lambda run: run.schedule == "wavefront" and run.processors > 64),
    (words.size, lambda run: run.size == "4" and run.processors == 1024),
]


@pytest.mark.parametrize(("speak", "changed"), SLOWER, ids=[speak.__name__ for speak, _ in SLOWER])
def test_words_follow_the_data(whole, speak, changed):
    """Catches a canned interpretation: when its runs take five times as long, it must say something else."""
    before, after = speak(whole), speak(scaled(whole, changed, 5.0))
    assert before
    assert after
    assert before != after
    # Not the figures alone: the verdicts change, too.
    if speak in (words.ablation, words.size, words.bsp):
        assert re.sub(r"[\d.,]+", "#", before) != re.sub(r"[\d.,]+", "#", after)


def test_words_that_times_do_not_change(whole):
    """Catches convergence, orders and misses told without looking."""
    assert "3 to 4 over all p" in words.convergence(whole)
    place = {
        run: dataclasses.replace(made, iterations=made.iterations[:3]) for run, made in whole.results.items()
    }
    assert "as many on any other number" in words.convergence(dataclasses.replace(whole, results=place))
    assert "Over 100 random orders" in words.order(whole)
    equal = [{**entry, "root_links": 7} for entry in whole.orders]
    assert "a spread of 1" in words.order(dataclasses.replace(whole, orders=equal))
    assert "most often on locks" in words.misses(whole)
    assert words.misses(data([Run.of(SB_PRAM, "splash", 1)])) == ""


def test_claims_are_judged_by_the_data(whole):
    """Catches a verdict that does not follow from the runs, and one on runs that were not made."""
    found = {claim.what: claim for claim in claims(whole)}
    assert {claim.verdict for claim in found.values()} == {"holds", "does not hold"}
    keeps = next(claim for what, claim in found.items() if "0.70" in what)
    assert keeps.holds
    slow = scaled(whole, lambda run: run.schedule == "sbpram" and run.processors == 1024, 3.0)
    assert not next(claim for claim in claims(slow) if "0.70" in claim.what).holds
    nothing = claims(data([Run.of(SB_PRAM, "splash", 1)]))
    assert {claim.verdict for claim in nothing if claim.source != "check"} == {"not measured"}
    assert all(claim.figures for claim in found.values())


def test_a_run_that_beats_its_own_bound_is_told(whole):
    """Catches a simulation faster than its critical path that nobody notices."""
    run = Run.of(SB_PRAM, "splash", 64)
    phases = list(whole.results[run].phases)
    phases[0] = dataclasses.replace(phases[0], span=phases[0].time + 1)
    wrong = {**whole.results, run: dataclasses.replace(whole.results[run], phases=tuple(phases))}
    (check,) = (
        claim for claim in claims(dataclasses.replace(whole, results=wrong)) if claim.source == "check"
    )
    assert check.holds is False
    assert run.key in check.figures


def test_departures_from_the_paper_are_marked(whole):
    """Catches a departure of more than a quarter that is not marked, and marks where there is none."""
    for row in words.figure_7_rows(whole):
        theirs = row["paper_speedup"]
        assert row["speedup_departs"] == (abs(row["speedup"] / theirs - 1) > 0.25)
    exact = paper.FIGURE_7["splash"]
    assert exact[-1].time_1 == pytest.approx(sum(row.time_1 for row in exact[:-1]), rel=1e-4)
    for schedule_rows in paper.FIGURE_7.values():
        for row in schedule_rows[:3]:
            assert row.speedup == pytest.approx(row.time_1 / row.time_1024, rel=0.01)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1366.6, "1,370"),
        (0.04331, "0.0433"),
        (0, "0"),
        (99.96, "100"),
        (5, "5"),
        (float("nan"), "-"),
        (0.5, "0.5"),
    ],
)
def test_numbers_have_no_exponent(value, text):
    """Catches 1.37e+03 in a sentence."""
    assert figure(value) == text


def test_shares_near_the_whole_keep_their_digits():
    """Catches 99.7 % told as all of it."""
    assert percent(0.997) == "99.7\u00a0%"
    assert percent(0.9999) == "99.99\u00a0%"
    assert percent(0.071) == "7.1\u00a0%"
    assert percent(1.0) == "100\u00a0%"
