"""``isolux study`` as people run it, on a stand-in for the simulator: report, resume, errors, Ctrl-C."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time

import pytest
import study_fake
from conftest import ROOT, in_python

from isolux import _isolux
from isolux.cli.app import run
from isolux.study import figures, size

SECTIONS = {
    "figure-5": ("5",),
    "figure-6": ("6",),
    "figure-7": ("7",),
    "table-1": (),
    "order": (),
    "convergence": (),
    "losses": ("6",),
    "wavefront": (),
    "size": (),
    "misses": ("6",),
    "claims": ("5", "6", "7"),
    "files": ("5", "6", "7"),
}


@pytest.fixture
def fake(monkeypatch):
    """The stand-in: its problem counts the runs that are made, its engine the orders."""
    return study_fake.install(monkeypatch, _isolux)


@pytest.fixture
def threads():
    """How many there are before the test; a browser that other tests drive has one."""
    return threading.active_count()


@pytest.fixture
def study(fake, tmp_path, capsys, monkeypatch):
    """The command in its folder; gives exit code, standard output and standard error.

    Figures are made, but not drawn: that takes most of the time.
    """
    monkeypatch.setattr(figures, "svg", lambda _, name: f'<svg id="{name}"></svg>')
    monkeypatch.setattr(figures, "png", lambda _: b"")

    def command(*arguments, out="report"):
        code = run(["study", "-o", str(tmp_path / out), "--progress", "none", *map(str, arguments)])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return command


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """A whole quick study with a further machine, made once."""
    patch = pytest.MonkeyPatch()
    study_fake.install(patch, _isolux)
    out = tmp_path_factory.mktemp("study") / "report"
    arguments = ["study", "-o", str(out), "--quick", "--machine", "two-socket", "--progress", "none"]
    assert run(arguments) == 0
    patch.undo()
    return out


def one_line(err: str) -> str:
    """The only line on standard error."""
    lines = err.splitlines()
    assert len(lines) == 1, err
    assert lines[0].startswith("isolux: ")
    return lines[0]


def test_the_room_of_the_package_is_the_scene():
    """Catches a room that was changed in one place only: the study's constants are for this one."""
    own = ROOT / "python" / "isolux" / "study" / "room.glb"
    assert own.read_bytes() == (ROOT / "scenes" / "room.glb").read_bytes()


def test_a_report_holds_every_section_with_words_under_every_figure(report):
    """Catches a section that is left out, a figure without an interpretation or without its files."""
    page = (report / "index.html").read_text(encoding="utf-8")
    for section in (*SECTIONS, "further"):
        assert f'<section id="{section}">' in page
        assert f'<a href="#{section}">' in page
    figures = re.findall(r'<figure id="drawing-([\w-]+)">', page)
    assert len(figures) == len(set(figures)) >= 14
    parts = re.split(r"<figure id=", page)[1:]
    for name, part in zip(figures, parts, strict=True):
        assert re.match(r'\n<(?:p|ul) class="words">', part.split("</figure>")[1]), name
        for suffix in ("svg", "png"):
            assert (report / "figures" / f"{name}.{suffix}").stat().st_size > 1000
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL)
    tables = {"speedup", "losses", "ablation", "order", "convergence", "misses", "size"}
    assert {path.stem for path in report.glob("*.csv")} == tables
    assert {path.name for path in (report / "traces").iterdir()} == {"splash.json", "sbpram.json"}


def test_a_report_needs_no_network_and_its_names_are_unique(report):
    """Catches a script, a font or a figure from elsewhere, and figures that take each other's marks."""
    page = (report / "index.html").read_text(encoding="utf-8")
    assert set(re.findall(r"https?://[^/\"'< ]+", page)) <= {"http://www.w3.org"}
    assert "<script" not in page
    names = re.findall(r'\bid="([^"]+)"', page)
    assert len(names) == len(set(names))
    used = set(re.findall(r'(?:href="#|url\(#)([^")]+)', page))
    assert used <= set(names)
    assert "prefers-color-scheme: dark" in page
    assert "@media print" in page


@pytest.mark.parametrize("number", ["5", "6", "7"])
def test_a_figure_alone(study, fake, tmp_path, number):
    """Catches --figure that makes other sections, or runs for them."""
    problem, engine = fake
    code, _, _ = study("--quick", "--figure", number)
    assert code == 0
    page = (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    found = set(re.findall(r'<section id="([\w-]+)">', page))
    assert found == {name for name, figures in SECTIONS.items() if number in figures}
    assert engine.orders_asked == []
    # What is there is used by the next figure.
    made = len(problem.made)
    assert study("--quick", "--figure", "7", "--figure", number)[0] == 0
    again = problem.made[made:]
    assert all(asked["processors"] in (1, 1024) for asked in again)


def test_options_reach_the_runs(study, fake, tmp_path):
    """Catches --schedule, --processors, --machine or the epsilons parsed and forgotten."""
    problem, _ = fake
    spec = tmp_path / "mine.toml"
    spec.write_text('name = "mine"\nprocessors = 32\n')
    code, _, _ = study(
        "--figure", "6", "--schedule", "splash", "--processors", "8,32,64", "--machine", spec, "-j", "1"
    )
    assert code == 0
    assert {asked["schedule"] for asked in problem.made} == {"splash"}
    by_machine = {}
    for asked in problem.made:
        by_machine.setdefault(asked["machine"], set()).add(asked["processors"])
    assert by_machine == {"sb-pram": {1, 8, 32, 64}, "dash": {1, 8, 32, 64}, str(spec): {1, 8, 32}}
    common = json.loads((tmp_path / "report" / "study.json").read_text())
    assert common["settings"]["epsilons"]["1"] == size.FULL.epsilons["1"].to_dict()
    assert "mine" in common["machines"]


@pytest.mark.parametrize(
    "arguments",
    [
        "--processors 1",
        "--processors 3,5",
        "--schedule wavefront --processors 64",
        "--schedule sbpram --schedule wavefront --processors 2048",
        "--figure 6 --processors 16384",
        "--figure 5 --schedule wavefront",
    ],
)
def test_a_part_of_a_study_makes_a_report(study, tmp_path, arguments):
    """Catches a section that fails for want of runs that were not asked for."""
    code, _, err = study("--quick", *arguments.split())
    assert code == 0, err
    assert '<section id="claims">' in (tmp_path / "report" / "index.html").read_text(encoding="utf-8")


def test_json_tells_what_was_made(study, tmp_path):
    """Catches words mixed into JSON, and a summary without verdicts."""
    code, out, err = study("--quick", "--figure", "7", "--json", "-")
    assert (code, err) == (0, "")
    values = json.loads(out)
    assert values["output"] == str(tmp_path / "report" / "index.html")
    assert values["runs"] == {"planned": 4, "simulated": 4}
    assert {claim["verdict"] for claim in values["claims"]} <= {"holds", "does not hold", "not measured"}


def test_a_damaged_run_is_made_again(study, fake, tmp_path):
    """Catches half a file taken for a result, and a whole sweep thrown away for one of them."""
    problem, _ = fake
    study("--quick", "--figure", "7")
    runs = tmp_path / "report" / "runs"
    broken = sorted(runs.glob("sb-pram_*.json"))[0]
    broken.write_text(broken.read_text()[:100])
    before = len(problem.made)
    code, _, err = study("--quick", "--figure", "7")
    assert code == 0
    assert "(4 runs, 1 of them new)" in err
    assert len(problem.made) == before + 1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"settings": {**size.FULL.to_dict(), "level": "other"}},
            "with other settings (level is other there",
        ),
        ({"scene_hash": "0"}, "of another scene"),
        ({"version": "0.0.1"}, "made by version 0.0.1"),
        ({"machines": {"dash": "else"}}, "with other figures of the machine 'dash'"),
    ],
)
def test_another_study_is_never_mixed_in(study, tmp_path, change, message):
    """Catches runs of other settings, scenes, versions or machines drawn as if they were this study's."""
    assert study("--figure", "7")[0] == 0
    file = tmp_path / "report" / "study.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **change}))
    code, out, err = study("--figure", "7")
    assert (code, out) == (2, "")
    line = one_line(err)
    assert message in line
    assert "give another folder, or --overwrite" in line
    code, _, err = study("--figure", "7", "--overwrite")
    assert code == 0
    assert "4 of them new" in err


def test_quick_and_full_do_not_mix(study):
    """Catches the quick study's runs taken for the full one's: the message names what differs."""
    assert study("--figure", "7", "--quick")[0] == 0
    code, _, err = study("--figure", "7")
    assert code == 2
    assert "level is quick there, full here" in one_line(err)


def test_unaccounted_time_makes_no_report(study, fake, tmp_path):
    """Catches a report from runs in which processor time vanished."""
    problem, _ = fake
    problem.wrong_accounting = True
    code, _, err = study("--quick", "--figure", "7")
    assert code == 1
    assert "causes sum up to" in one_line(err)
    assert not (tmp_path / "report" / "index.html").exists()
    assert list((tmp_path / "report" / "runs").iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("--machine cray", "there is no machine 'cray': give ideal, sb-pram"),
        ("--machine threads", "'threads' runs for real"),
        ("--machine {tmp}/bad.toml", "bad.toml: 'processors' is missing"),
        ("--machine {tmp}/dash.toml", "calls itself 'dash'"),
        ("--processors 0", "0 is not from 1 to 16,384"),
        ("--processors 4,1000000", "1000000 is not from 1 to 16,384"),
        ("--processors many", "'many' is not P,P,..."),
        ("--figure 4", "'4' is not one of 5, 6, 7"),
        ("--schedule best", "'best' is not one of splash, sbpram, wavefront"),
        ("--orders 0", "0 is not from 1 to"),
        ("-o {tmp}/bad.toml", "bad.toml is a file"),
        ("--units cm", "the room that comes with isolux has its own"),
    ],
)
def test_wrong_usage_is_one_line(study, fake, tmp_path, arguments, message):
    """Catches a traceback, another exit code, a run made or a folder left for what cannot be."""
    (tmp_path / "bad.toml").write_text('name = "bad"\n')
    (tmp_path / "dash.toml").write_text('name = "dash"\nprocessors = 9\n')
    code, out, err = study(*(word.format(tmp=tmp_path) for word in arguments.split()))
    assert (code, out) == (2, "")
    assert message in one_line(err)
    assert fake[0].made == []
    assert not (tmp_path / "report").exists()


def test_a_bad_scene_is_three(study, tmp_path):
    """Catches a scene that cannot be read told as wrong usage."""
    (tmp_path / "broken.glb").write_text("not a GLB")
    code, _, err = study(tmp_path / "broken.glb")
    assert code == 3
    assert "broken.glb" in one_line(err)
    assert not (tmp_path / "report").exists()


def test_without_matplotlib_it_says_what_to_install(study, fake, monkeypatch, tmp_path):
    """Catches minutes of runs before it turns out that nothing can be drawn."""
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    code, _, err = study("--quick")
    assert code == 2
    assert "pip install 'isolux[study]'" in one_line(err)
    assert fake[0].made == []
    assert not (tmp_path / "report").exists()


def test_the_other_commands_do_without_matplotlib():
    """Catches half a second more for every command, and an extra that is none."""
    code = "import sys, isolux.cli.app; print('matplotlib' in sys.modules)"
    assert in_python(code).stdout == "False\n"


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_keeps_what_is_there(study, fake, tmp_path, monkeypatch, threads):
    """Catches lost runs, another exit code, a report of half a study, and a second start from nothing."""
    problem, _ = fake
    problem.endless_from = 6
    press = threading.Semaphore(1)

    def waiting():
        # Both cores are at it; one Ctrl-C.
        if press.acquire(blocking=False):
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(problem, "waiting", staticmethod(waiting))
    code, out, err = study("--quick", "--figure", "6", "-j", "2")
    assert (code, out) == (130, "")
    line = one_line(err)
    kept = list((tmp_path / "report" / "runs").glob("*.json"))
    assert 4 <= len(kept) <= 5
    assert re.search(rf"cancelled: {len(kept)} of \d+ are made; the same command goes on from there", line)
    assert not (tmp_path / "report" / "index.html").exists()
    assert threading.active_count() == threads
    problem.endless_from = None
    before = len(problem.made)
    code, _, err = study("--quick", "--figure", "6", "-j", "2")
    assert code == 0
    planned = int(re.search(r"\((\d+) runs", err)[1])
    assert len(problem.made) - before == planned - len(kept)


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize(
    ("moment", "code_of_page"),
    [("preparation 1", False), ("preparation 4", False), ("orders", False), ("page", True)],
)
def test_ctrl_c_is_heard_between_runs(study, fake, tmp_path, monkeypatch, moment, code_of_page, threads):
    """Catches a Ctrl-C that waits for a problem to be prepared, for orders to be counted, for a report."""
    problem, engine = fake
    press = threading.Semaphore(1)

    def waiting():
        time.sleep(0.001)
        if press.acquire(blocking=False):
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(problem, "waiting", staticmethod(waiting))
    if moment == "orders":
        monkeypatch.setattr(engine, "endless_orders", True)
        monkeypatch.setattr(engine, "waiting", staticmethod(waiting))
    elif moment == "page":
        monkeypatch.setattr(figures, "svg", lambda *_: waiting())
    else:
        epsilons = size.QUICK.epsilons[moment.split()[1]]
        monkeypatch.setattr(problem, "endless_preparation", epsilons.bf_epsilon)
    code, out, err = study("--quick", "-j", "2")
    assert (code, out) == (130, "")
    assert one_line(err).startswith("isolux: cancelled")
    assert ("are made" in err) != (code_of_page or moment == "preparation 1")
    assert not (tmp_path / "report" / "index.html").exists()
    assert threading.active_count() == threads


PREPARATIONS = """
import json, sys, time
import isolux
from isolux import _isolux
from isolux.study import size

scene = isolux.load(sys.argv[1])._inner
settings = json.dumps({**size.QUICK.epsilons["1"].to_dict(), "order": size.ORDER, "seed": 0})
request = json.dumps({"orders": [size.ORDER], "seeds": [], "coarse": None})
for work, asked in ((_isolux.StudyProblem, settings), (_isolux.study_orders, request)):
    answers = iter([False, False, True])
    began = time.monotonic()
    try:
        work(scene, asked, lambda: next(answers))
    except KeyboardInterrupt:
        print(f"{work.__name__} {time.monotonic() - began:.3f}")
"""


def test_preparations_end_when_they_are_told(tmp_path):
    """Catches a real preparation, or a real count of orders, that a thread without signals waits for."""
    path = tmp_path / "objects.glb"
    make = [sys.executable, str(ROOT / "scenes" / "large.py"), "objects", "20000", str(path)]
    subprocess.run(make, check=True, capture_output=True)
    # What is not waited for any more goes on until its process ends.
    done = in_python(PREPARATIONS, path)
    told = [line.split() for line in done.stdout.splitlines()]
    assert [name for name, _ in told] == ["StudyProblem", "study_orders"], done.stderr
    # They take 3 and 8 seconds, and ask every 20 ms.
    assert all(float(seconds) < 1.5 for _, seconds in told), told


def test_orders_are_a_step_of_their_own(study, fake, tmp_path):
    """Catches --orders that simulates runs, counts orders twice, or whose orders a later report forgets."""
    problem, engine = fake
    assert study("--quick", "--orders", 120)[0] == 0
    assert problem.made == []

    def seeds(coarse):
        return sorted(
            seed
            for asked in engine.orders_asked
            if bool(asked["coarse"]) == coarse
            for seed in asked["seeds"]
        )

    assert seeds(False) == list(range(1, 121))
    assert seeds(True) == sorted(2 * list(range(1, 31)))
    assert {asked["coarse"]["roots"] for asked in engine.orders_asked if asked["coarse"]} == {
        "fragments",
        "polygons",
    }
    asked = len(engine.orders_asked)
    assert study("--quick", "--orders", 120)[0] == 0
    assert len(engine.orders_asked) == asked
    page = (tmp_path / "report" / "index.html").read_text(encoding="utf-8")
    assert "Over 120 random orders" in page
    assert study("--quick", "--schedule", "sbpram", "--processors", "4")[0] == 0
    assert len(engine.orders_asked) == asked
    assert "Over 120 random orders" in (tmp_path / "report" / "index.html").read_text(encoding="utf-8")


def test_progress_shows_runs_and_time_left(fake, tmp_path, capsys):
    """Catches a sweep of minutes without a word on how far it is."""
    assert run(["study", "-o", str(tmp_path / "r"), "--quick", "--figure", "7", "--progress", "json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().err.splitlines() if line.startswith("{")]
    assert lines[0]["phase"] == "runs"
    assert "0 of 4" in lines[0]["detail"]
    assert all(0.0 <= line["done"] <= 1.0 for line in lines)
    assert "seconds_left" in lines[0]


def test_a_failure_of_a_run_ends_the_sweep(study, fake, monkeypatch, tmp_path, threads):
    """Catches an error in a thread that is swallowed, or leaves the other threads at work."""
    problem, _ = fake

    def fail(self, request, stop=None):
        raise RuntimeError("lost in simulated time")

    monkeypatch.setattr(problem, "simulate", fail)
    code, _, err = study("--quick", "--figure", "7")
    assert code == 1
    assert "lost in simulated time" in one_line(err)
    assert threading.active_count() == threads
    assert not (tmp_path / "report" / "index.html").exists()


def test_a_report_is_written_again_byte_for_byte(fake, tmp_path):
    """Catches a clock, a random number or an order of a set in what a report holds."""

    def contents():
        out = tmp_path / "report"
        return {path.relative_to(out): path.read_bytes() for path in sorted(out.rglob("*")) if path.is_file()}

    arguments = ["study", "-o", str(tmp_path / "report"), "--quick", "--figure", "5", "--progress", "none"]
    assert run(arguments) == 0
    first = contents()
    assert run(arguments) == 0
    assert len(fake[0].made) == 2
    assert contents() == first
