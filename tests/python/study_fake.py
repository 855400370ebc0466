"""A stand-in for the extension's simulator: small, deterministic, with losses of a plausible shape."""

from __future__ import annotations

import json
import math
import threading
import time
import zlib

from isolux.exceptions import UsageError
from isolux.study.runs import CAUSES, SWITCHES

#: Work of the phases on one processor, by schedule: (phase, name, work, span, iterations).
PHASES = {
    "splash": [("1", "BSP and form factors", 700_000, 9_000), ("3", "interpolation", 4_000, 300)],
    "sbpram": [
        ("1'", "BSP", 900, 500),
        ("1''", "initial pairs", 640_000, 60),
        ("3'", "interpolation", 3_000, 4),
    ],
    "wavefront": [("tree", "tree", 900, 300), ("pairs", "pairs", 640_000, 40)],
}
#: Work and span of the iterations, first to last.
ITERATIONS = [(7_000_000, 5_000), (1_200_000, 3_000), (500_000, 2_500), (200_000, 2_000)]
SIZES = {0.08: 0.25, 0.02: 1.0, 0.005: 4.0}
STRUCTURES = ("elements", "links", "BSP tree", "queues", "locks")


class Problem:
    """Counts its runs; may be told to fail its accounting, or to wait until it is stopped.

    `endless_preparation` is the bf epsilon at which it is not ready before it is stopped.
    """

    made: list[dict[str, object]] = []  # noqa: RUF012
    wrong_accounting = False
    endless_from: int | None = None
    endless_preparation: float | None = None
    lock = threading.Lock()

    def __init__(self, _scene, settings, stop=None):
        self.settings = json.loads(settings)
        while self.settings["bf_epsilon"] == self.endless_preparation:
            self.waiting()
            if stop is not None and stop():
                raise KeyboardInterrupt
        self.factor = SIZES.get(self.settings["bf_epsilon"], self.settings["bf_epsilon"])

    @staticmethod
    def waiting():
        time.sleep(0.001)

    def describe(self):
        return json.dumps({"polygons": 346, "roots": 420, "root_pairs": 87_990, "order": "fewest-cuts"})

    def simulate(self, request, stop=None):
        run = json.loads(request)
        with self.lock:
            self.made.append(run)
            endless = self.endless_from is not None and len(self.made) >= self.endless_from
        while endless:
            self.waiting()
            if stop is not None and stop():
                raise KeyboardInterrupt
        result = simulated(run, self.factor)
        if self.wrong_accounting:
            result["phases"][-1]["causes"]["idle"] += 1
        return json.dumps(result)


def simulated(run, factor=1.0):
    p, schedule, on = run["processors"], run["schedule"], run["variant"]
    dash = run["machine"] not in ("sb-pram", "ideal")
    fine = run["grain"] == 1 or on["fine_tasks"]
    switched = sum(on.values())
    if schedule == "wavefront":
        phases = PHASES["wavefront"]
    else:
        head, tail = PHASES["splash"]
        pairs = PHASES["sbpram"]
        phases = pairs[:2] if on["pair_loop"] else [head]
        if on["pair_loop"] and not on["parallel_bsp"]:
            phases = [("1", "BSP", 900, 880), pairs[1]]
        phases = [*phases, pairs[2] if on["interpolation_loop"] else tail]
    updates = run["update"] == "in-place"
    saved = updates and p >= 32
    steps = ITERATIONS[: 3 if saved else 4] if updates else [*ITERATIONS, (90_000, 1_500)]
    shrink = 4 if fine else 1
    rows = [(*phase, None) for phase in phases]
    word = "iteration" if schedule == "wavefront" else "2'" if switched == 5 else "2"
    middle = [(word, "iteration", work, span, k) for k, (work, span) in enumerate(steps, 1)]
    if schedule == "wavefront":
        middle = [(a, b, work, 40, k) for a, b, work, _, k in middle]
    rows = rows[:-1] + middle + rows[-1:] if schedule != "wavefront" else rows + middle
    made = []
    for phase, name, work, span, iteration in rows:
        grain = shrink if iteration is not None else 1
        work = int(work * factor * (1.0 + 0.004 * math.log2(p) * (1 if dash else 0.2)))
        span = max(1, int(span / grain * factor**0.3))
        made.append(_phase(phase, name, iteration, work, span, p, dash, bool(on["parallel_queue"]), fine))
    residuals = [0.4 * 0.12**k * (0.8 if updates else 1.6) for k in range(len(steps))]
    stolen = 0 if on["parallel_queue"] or schedule == "wavefront" or p == 1 else 900 * int(math.log2(p) + 1)
    result = {
        "machine": run["machine"],
        "schedule": schedule,
        "variant": schedule,
        "update": run["update"],
        "processors": p,
        "unit": "instructions" if not dash else "cycles",
        "phases": made,
        "iterations": [
            {
                "iteration": k,
                "residual": None if k == 1 else residual,
                "total": [1.0, 1.0, 1.0],
                "reads": 100_000,
                "updated_reads": int(50_000 / (1 + p / 300)) if updates else 0,
                "links": 40_000 * k,
                "elements": 5_000 * k,
            }
            for k, residual in enumerate(residuals, 1)
        ],
        "steals": {"successes": stolen, "failures": stolen * p // 40, "probes": stolen * p // 6},
        "misses": {
            name: {
                "cold": 4_000 + 100 * number,
                "replacement": 900 * number,
                "true sharing": 300 * p * (number + 1) * (2 if fine else 1),
                "false sharing": 40 * p,
                "upgrades": 10 * p,
                "accesses": 4_000_000,
            }
            for number, name in enumerate(STRUCTURES)
        }
        if dash
        else {},
        "counts": {"visibilities": 1},
        "links": int(160_000 * factor),
        "elements": int(17_000 * factor),
        "events": 1_000_000,
        "seconds": 0.01,
    }
    if run["trace"]:
        result["trace"] = _trace(result)
    return result


def _phase(phase, name, iteration, work, span, p, dash, queue, fine):
    overhead = work // 60 if fine else work // 150
    stall = (work // 4 if dash else 0) * (2 if fine and dash else 1)
    barrier = (3 if queue else 11) * int(math.log2(p) + 1)
    spent = max((work + overhead + stall) // p, span) + span // 2 + barrier
    total = p * spent
    rest = total - work - overhead - stall
    steal = 0 if queue else rest // 3
    barrier = rest // 4
    locks = rest // 10
    values = (work, overhead, steal, stall, locks, barrier, rest - steal - barrier - locks)
    return {
        "phase": phase,
        "name": name,
        "iteration": iteration,
        "time": spent,
        "span": span,
        "causes": dict(zip(CAUSES, values, strict=True)),
        "events": 999,
    }


def _trace(result):
    """Tasks that fill each phase; a visibility within every refinement."""
    slices = []
    start = 0
    letters = {"BSP and form factors": "BF", "BSP": "B", "initial pairs": "F", "interpolation": "A"}
    for phase in result["phases"]:
        end = start + phase["time"]
        for processor in range(result["processors"]):
            at, step = start, max(1, phase["time"] // 60)
            letter = letters.get(phase["name"], "RV")
            number = 0
            while at < end:
                number += 1
                stop = min(end, at + step + zlib.crc32(f"{processor}{at}".encode()) % step)
                label = letter[(number + processor) % len(letter)]
                if number % 9 == 8:
                    slices.append([processor, at, stop, "steal", "steal"])
                elif number % 9 == 5:
                    slices.append([processor, at, stop, "queue", "enqueue"])
                elif stop == end:
                    slices.append([processor, at, stop, "barrier wait", "wait"])
                else:
                    slices.append([processor, at, stop, "work", label])
                    if label == "R" and stop - at > 4:
                        slices.append([processor, at + 1, stop - 1, "work", "V"])
                at = stop
        start = end
    return slices


class Engine:
    """What is put in place of the extension's functions."""

    names = ("ideal", "sb-pram", "dash", "two-socket", "sequential", "threads")
    orders_asked: list[dict[str, object]] = []  # noqa: RUF012
    endless_orders = False
    waiting = staticmethod(Problem.waiting)

    @classmethod
    def machine_names(cls):
        return list(cls.names)

    @classmethod
    def check_machine(cls, source):
        most = {"dash": 64, "two-socket": 128}.get(source, 16_384)
        if source.endswith(".toml"):
            with open(source, encoding="utf-8") as file:  # noqa: PTH123
                text = file.read()
            if "processors" not in text:
                raise UsageError(f"{source}: 'processors' is missing")
            name = text.split('name = "')[1].split('"')[0]
            return json.dumps({"name": name, "processors_max": 32, "uniform": False})
        return json.dumps({"name": source, "processors_max": most, "uniform": source in ("sb-pram", "ideal")})

    @classmethod
    def study_orders(cls, _scene, request, stop=None):
        asked = json.loads(request)
        while cls.endless_orders:
            cls.waiting()
            if stop is not None and stop():
                raise KeyboardInterrupt
        cls.orders_asked.append(asked)
        counted = [cls._order(name, None, asked["coarse"]) for name in asked["orders"]]
        return json.dumps(counted + [cls._order("random", seed, asked["coarse"]) for seed in asked["seeds"]])

    @staticmethod
    def _order(name, seed, coarse):
        fragments = {"as-given": 620, "largest-first": 1200, "fewest-cuts": 420}.get(name)
        if fragments is None:
            draw = sum(zlib.crc32(f"{seed}-{part}".encode()) % 1000 for part in range(6)) / 6000
            fragments = int(1500 + 2200 * draw)
        work = None
        if coarse is not None:
            work = 40 * fragments**2 if coarse["roots"] == "fragments" else 40 * 346**2 + 500 * fragments
        return {
            "order": name,
            "seed": seed,
            "fragments": fragments,
            "nodes": fragments,
            "root_links": fragments * (fragments - 1) // 2,
            "work": work,
            "links": None if work is None else work // 50,
            "seconds": 0.01,
        }

    @staticmethod
    def schedule_lines():
        return json.dumps({"splash": 640, "sbpram": 310, "wavefront": 280})


assert set(SWITCHES) == {"parallel_bsp", "pair_loop", "fine_tasks", "interpolation_loop", "parallel_queue"}


def install(monkeypatch, extension):
    """Put the fake in place of the extension's functions, with a memory of its own."""
    problem = type("Problem", (Problem,), {"made": []})
    engine = type("Engine", (Engine,), {"orders_asked": []})
    monkeypatch.setattr(extension, "StudyProblem", problem, raising=False)
    for name in ("machine_names", "check_machine", "study_orders", "schedule_lines"):
        monkeypatch.setattr(extension, name, getattr(engine, name), raising=False)
    return problem, engine
