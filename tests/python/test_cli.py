"""The command as people run it: exit codes, one-line errors, streams, JSON, Ctrl-C, no file half-written."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import ROOT, in_python
from PIL import Image

import isolux
from isolux.cli.progress import showing

TRACEBACK = re.compile(r"Traceback|File \"")
COLOUR = re.compile(r"\x1b\[[0-9;]*(3[0-9]|4[0-9]|9[0-7])[0-9;]*m")


def one_line(done: subprocess.CompletedProcess[str]) -> str:
    """The only line on standard error; nothing on standard output."""
    assert done.stdout == ""
    lines = done.stderr.splitlines()
    assert len(lines) == 1, done.stderr
    assert lines[0].startswith("isolux: ")
    return lines[0]


def test_help_has_examples(isolux_command):
    """Catches a command without examples, and help on the wrong stream."""
    top = isolux_command("--help")
    assert top.returncode == 0
    assert "Exit codes" in top.stdout
    for command in ("inspect", "solve", "bake", "render", "view", "relight", "measure", "report", "study"):
        done = isolux_command(command, "--help")
        assert done.returncode == 0
        assert "For example:" in done.stdout
        assert f"isolux {command} " in done.stdout.split("For example:")[1]
        assert done.stderr == ""


def test_version_and_script():
    """Catches an entry point that is not installed, or a version of its own."""
    script = Path(sys.executable).with_name("isolux")
    done = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"isolux {isolux.__version__}\n"


def test_solve_bake_render(isolux_command, scene_file, tmp_path):
    """Catches any break in the way from a scene to its results, and words on the wrong stream."""
    folder = tmp_path / "made" / "for this"
    target = folder / "box.isolux"
    solved = isolux_command("solve", scene_file, "-o", target, "--error", "0.5", "--progress", "plain")
    assert solved.returncode == 0, solved.stderr
    assert "converged" in solved.stdout
    assert "links" in solved.stdout
    assert not re.search(r" +$", solved.stdout, re.MULTILINE)
    assert re.search(r"^ *\d+ %", solved.stderr, re.MULTILINE)
    baked = isolux_command(
        "bake", folder / "box.isolux", "-o", folder / "lit.glb", "--to", "vertex", "--exposure", "+1"
    )
    assert (baked.returncode, baked.stdout) == (0, "")
    for name in ("box.png", "box.exr"):
        drawn = isolux_command("render", folder / "box.isolux", "-o", folder / name, "--size", "32x24")
        assert (drawn.returncode, drawn.stdout) == (0, "")
    assert sorted(entry.name for entry in folder.iterdir()) == ["box.exr", "box.isolux", "box.png", "lit.glb"]
    assert isolux.open(folder / "box.isolux").report.settings.error == 0.5
    assert isolux.load(folder / "lit.glb").polygons.fronts > 0


def test_render_takes_views(isolux_command, solution_file, tmp_path):
    """Catches a view, a size or an exposure that does not reach the picture."""

    def mean(*arguments):
        path = tmp_path / "view.png"
        done = isolux_command(
            "render", solution_file, "-o", path, "--size", "20x10", "--samples", 1, *arguments
        )
        assert done.returncode == 0, done.stderr
        with Image.open(path) as opened:
            assert opened.size == (20, 10)
            return np.asarray(opened.convert("RGB")).mean()

    up, down = (mean("--eye", "0.5,0.5,0.5", "--at", f"0.5,{y},0.5") for y in (1, 0))
    assert up > down
    look = ("--eye", "0.5,0.5,0.9", "--at", "0.5,0.5,0")
    assert mean(*look, "--exposure", "-2") < mean(*look) < mean(*look, "--exposure", "+2")
    assert mean(*look, "--exposure", "1e-6") < 2
    assert mean(*look, "--angle", "5") != mean(*look, "--angle", "120")


def test_gathers_take_a_number_or_none(isolux_command, solution_file, tmp_path):
    """Catches a gather that is not made, a bare option that swallows what follows it, and wrong numbers."""
    pictures = []
    for name, *options in (["plain.exr"], ["some.exr", "--gather", 64], ["default.exr", "--gather"]):
        path = tmp_path / name
        view = ("--size", "8x6", "--eye", "0.5,0.5,0.9", "--at", "0.5,0.2,0")
        # A bare option stands before an argument, too.
        drawn = isolux_command("render", *options, solution_file, "-o", path, *view)
        assert drawn.returncode == 0, drawn.stderr
        pictures.append(path.read_bytes())
    assert len(set(pictures)) == 3
    lit = [tmp_path / "plain.ply", tmp_path / "gathered.ply"]
    for path, options in zip(lit, ((), ("--gather", "-j", 1)), strict=True):
        baked = isolux_command("bake", solution_file, *options, "-o", path)
        assert baked.returncode == 0, baked.stderr
    assert lit[0].read_bytes() != lit[1].read_bytes()
    for wrong in ("0", "-3", "65537"):
        refused = isolux_command("bake", solution_file, "-o", tmp_path / "a.ply", "--gather", wrong)
        assert (refused.returncode, "--gather" in refused.stderr) == (2, True), refused.stderr


def test_inspect_tells_what_is_there(isolux_command, scene_file):
    """Catches lights without their power, and tables that cut names."""
    done = isolux_command("inspect", scene_file)
    assert done.returncode == 0
    assert done.stderr == ""
    values = json.loads(isolux_command("inspect", scene_file, "--json", "-").stdout)
    scene = isolux.load(scene_file)
    assert values["hash"] == scene.hash
    assert values["lights"][0]["object"] == "ceiling"
    assert values["lights"][0]["power"] == pytest.approx(list(scene.lights[0].power))
    assert values["polygons"]["fronts"] == 6
    assert values["issues"] == [
        {"severity": i.severity, "kind": i.kind, "object": i.object, "message": i.message}
        for i in scene.issues + scene.audit()
    ]
    for word in ("ceiling", "lamp", scene.hash, f"{scene.lights[0].total:.6g}"):
        assert word in done.stdout
    for issue in scene.issues:
        assert issue.message[:40] in done.stdout


def test_lamps_are_told_with_their_power(isolux_command, tmp_path):
    """Catches lamps that inspect leaves out, and units that nobody can tell from what is printed."""
    studio = ROOT / "scenes" / "studio.glb"
    done = isolux_command("inspect", studio)
    assert done.returncode == 0
    for word in ("table spot", "872.056", "266.086", "1 of them suns", "cd", "lm/m²"):
        assert word in done.stdout
    values = json.loads(isolux_command("inspect", studio, "--light-units", "blender", "--json", "-").stdout)
    assert values["lamps"][1]["intensity"][0] == pytest.approx(600 * 683 / (4 * np.pi))
    solved = isolux_command("solve", studio, "-o", tmp_path / "studio.isolux", "--error", "0.5")
    assert solved.returncode == 0
    assert "light: 0 lm from surfaces, lamps: 3, 1138.14 lm in all" in solved.stderr
    refused = isolux_command("solve", studio, "-o", tmp_path / "no.isolux", "--schedule", "sequential")
    assert refused.returncode != 0
    assert "lamp 'bulb' has no surface" in refused.stderr


def test_luminaires_are_hung_and_told_with_their_lumens(isolux_command, tmp_path):
    """Catches --lamp that hangs nothing, or something else, and lumens that are kept back."""
    lamps = (
        "--lamp",
        f"{ROOT}/scenes/downlight.ies@5,2.7,3",
        "--lamp",
        f"{ROOT}/scenes/wall-washer.ies@3,2.7,2,90,30",
    )
    office, out = ROOT / "scenes" / "office.glb", tmp_path / "office.isolux"
    solved = isolux_command("solve", office, *lamps, "-o", out, "--error", "0.5")
    assert solved.returncode == 0, solved.stderr
    told = re.search(r"lamps: 7, ([\d.]+) lm in all", solved.stderr)
    assert float(told[1]) == pytest.approx(13_000, rel=1e-3)
    values = json.loads(isolux_command("inspect", office, *lamps, "--json", "-").stdout)
    (down, wash) = values["lamps"][5:]
    assert (down["name"], down["position"], down["direction"]) == ("downlight", [5, 2.7, 3], [0, -1, 0])
    assert wash["direction"] == pytest.approx([0, -np.cos(np.pi / 6), -0.5], abs=1e-12)
    relit = tmp_path / "relit.isolux"
    checked = ("relight", out, "--scene", office, "--set", "downlight=0", "-o", relit)
    assert isolux_command(*checked, *lamps).returncode == 0
    # Without the lamps it is another scene.
    assert isolux_command(*checked).returncode == 3


def test_luminaires_that_cannot_be_hung_are_one_line(isolux_command, tmp_path):
    """Catches a place that is none, another exit code, and errors without file, line or lamp."""
    office, out = ROOT / "scenes" / "office.glb", tmp_path / "never.isolux"
    downlight = ROOT / "scenes" / "downlight.ies"
    for wrong in (
        "downlight.ies",
        "a.ies@1,2",
        "a.ies@1,2,x",
        "a.ies@1,2,3,4,5,6",
        "@1,2,3",
        "a.ies@1,2,nan",
    ):
        refused = isolux_command("solve", office, "--lamp", wrong, "-o", out)
        assert refused.returncode == 2
        assert "is neither FILE@X,Y,Z[,ROTATION[,TILT]] nor like 1500lm@X,Y,Z" in one_line(refused)
    missing = isolux_command("solve", office, "--lamp", "gone.ies@1,2,3", "-o", out)
    assert (missing.returncode, "gone.ies: cannot be read: no such file" in one_line(missing)) == (3, True)
    assert isolux_command("inspect", downlight, "--lamp", f"{downlight}@1,2,3").returncode == 2
    broken = tmp_path / "broken.glb"
    broken.write_bytes(office.read_bytes().replace(b"\n1 1 20\n", b"\n1 x 20\n", 1))
    refused = isolux_command("solve", broken, "-o", out)
    assert refused.returncode == 3
    assert re.search(
        r"broken\.glb: lamp 'downlight 1': light profile 'downlight': line 7: expected .*'x'",
        one_line(refused),
    )
    assert not out.exists()


def test_faults_of_geometry_are_told_by_object(isolux_command, tmp_path):
    """Catches a fault that inspect or solve keeps to itself, in words or as JSON, or without its object."""
    inputs = Path(__file__).parents[2] / "scenes" / "test-inputs"
    records = json.loads((inputs / "expected.json").read_text(encoding="utf-8"))
    (record,) = (record for record in records if record["file"] == "flawed-room.glb")
    expected = sorted((kind, name) for kind, names in record["expect"]["findings"].items() for name in names)
    assert len(expected) == 3
    file = inputs / record["file"]
    issues = json.loads(isolux_command("inspect", file, "--json", "-").stdout)["issues"]
    assert sorted((i["kind"], i["object"]) for i in issues if i["severity"] == "warning") == expected
    told = isolux_command("inspect", file, COLUMNS="400").stdout
    for kind, name in expected:
        assert re.search(rf"warning +{kind} +{name} ", told), (kind, name)
    solved = isolux_command("solve", file, "-o", tmp_path / "room.isolux", "--error", "0.5")
    assert solved.returncode == 0
    for _, name in expected:
        assert f"warning: {name}: 1 " in solved.stderr


def test_units_reach_the_scene(isolux_command, scene_file):
    """Catches --units that is parsed and forgotten."""

    def look(*arguments):
        return json.loads(isolux_command("inspect", scene_file, "--json", "-", *arguments).stdout)

    plain, scaled, radiosity = look(), look("--units", "cm"), look("--units", "0.5,lm/m2")
    assert scaled["area"] == pytest.approx(plain["area"] * 1e-4)
    assert radiosity["area"] == pytest.approx(plain["area"] / 4)
    assert radiosity["emitted_power"] == pytest.approx(
        [power / 4 / np.pi for power in plain["emitted_power"]]
    )


@pytest.mark.parametrize(
    ("units", "power", "radiance"),
    [
        (None, "lm", "cd/m2"),
        ("cm", "lm", "cd/m2"),
        ("cd/m2", "lm", "cd/m2"),
        ("lm/m2", "lm", "cd/m2"),
        ("lx", "lm", "cd/m2"),
        ("W/m2", "W", "W/(m2 sr)"),
        ("cm,W/m2/sr", "W", "W/(m2 sr)"),
    ],
)
def test_the_unit_of_power_reaches_every_result(isolux_command, scene_file, tmp_path, units, power, radiance):
    """Catches watts told or written as lumens, or the other way round, anywhere on the way to a result."""
    given = () if units is None else ("--units", units)
    other = {"lm": "W", "W": "lm"}[power]
    for done in (
        isolux_command("inspect", scene_file, *given),
        isolux_command("solve", scene_file, "-o", tmp_path / "a.isolux", "--error", "0.5", *given),
    ):
        assert done.returncode == 0, done.stderr
        assert f"{power}/m²" in done.stdout
        assert not re.search(rf"\b{other}\b", done.stdout)
    assert json.loads(isolux_command("inspect", scene_file, "--json", "-", *given).stdout)["units"] == {
        "length": "m",
        "area": "m2",
        "power": power,
    }
    solution = isolux.open(tmp_path / "a.isolux")
    assert solution.report.unit == solution.scene.unit == solution.report.to_dict()["unit"] == power
    solution.bake(tmp_path / "a.ply")
    header = (tmp_path / "a.ply").read_bytes().split(b"end_header")[0].decode()
    assert f"unit {power}/m2\n" in header
    assert f"radianceUnit {radiance}\n" in header
    solution.bake(tmp_path / "a.glb")
    assert f'"unit":"{power}/m2"'.encode() in (tmp_path / "a.glb").read_bytes()
    solution.write_image(tmp_path / "a.exr", np.zeros((2, 2, 3)))
    assert radiance.encode() in (tmp_path / "a.exr").read_bytes()


def test_every_setting_reaches_the_solver(isolux_command, scene_file, tmp_path):
    """Catches an option that is accepted and forgotten."""
    options = {
        "--schedule": "sequential",
        "--bf-eps": 0.4,
        "--partial-visibility": 0.75,
        "--partial-form-factor": 0.3,
        "--emission-weight": 0.5,
        "--area-eps": 0.1,
        "--energy-eps": 0.2,
        "--update": "jacobi",
        "--form-factor": "disks",
        "--rays": 256,
        "--weighting": "equal",
        "--covered": "counted",
        "--interpolation": "averaged",
        "--order": "random:6",
        "--roots": "fragments",
        "--seed": 5,
        "--max-iterations": 30,
        "-j": 1,
        "--quality": "draft",
        "--json": tmp_path / "report.json",
        "--progress": "none",
    }
    arguments = [word for pair in options.items() for word in pair]
    done = isolux_command("solve", scene_file, "-o", tmp_path / "box.isolux", *arguments)
    assert done.returncode == 0, done.stderr
    report = isolux.open(tmp_path / "box.isolux").report
    assert report.settings.to_dict() == {
        "schedule": "sequential",
        "error": 0.2,
        "dark": None,
        "max_elements": None,
        "min_area": None,
        "memory": None,
        "time": None,
        "bf_epsilon": 0.4,
        "partial_visibility": 0.75,
        "emission_weight": 0.5,
        "partial_form_factor": 0.3,
        "area_epsilon": 0.1,
        "energy_epsilon": 0.2,
        "update": "jacobi",
        "form_factor": "disks",
        "rays": 256,
        "weighting": "equal",
        "covered": "counted",
        "interpolation": "averaged",
        "order": {"random": 6},
        "roots": "fragments",
        "seed": 5,
        "max_iterations": 30,
        "threads": 1,
    }
    written = json.loads((tmp_path / "report.json").read_text())
    assert written == {"output": str(tmp_path / "box.isolux"), "report": report.to_dict()}


def test_every_setting_reaches_the_fast_engine(isolux_command, scene_file, tmp_path):
    """Catches an option that is accepted and forgotten, and a result without the error that was found."""
    options = {
        "--schedule": "wavefront",
        "--error": 0.1,
        "--dark": 0.4,
        "--max-elements": 20000,
        "--min-area": 1e-6,
        "--memory": "500M",
        "--time": "2m",
        "-j": 1,
        "--progress": "none",
    }
    arguments = [word for pair in options.items() for word in pair]
    done = isolux_command("solve", scene_file, "-o", tmp_path / "box.isolux", *arguments)
    assert done.returncode == 0, done.stderr
    report = isolux.open(tmp_path / "box.isolux").report
    settings = report.settings
    assert (settings.schedule, settings.error, settings.dark) == ("wavefront", 0.1, 0.4)
    assert (settings.max_elements, settings.min_area, settings.time) == (20000, 1e-6, 120.0)
    assert settings.memory == 500 * 2**20
    assert report.to_dict()["error_estimate"]["total"] <= 0.1


def test_a_bound_ends_a_solve_and_keeps_the_result(isolux_command, scene_file, tmp_path):
    """Catches a bound that is not heard, not told, or loses what there is."""
    target = tmp_path / "box.isolux"
    done = isolux_command(
        "solve", scene_file, "-o", target, "--schedule", "wavefront", "--error", 0.001, "--max-elements", 50
    )
    assert done.returncode == 4, done.stderr
    assert "stopped by the bound --max-elements" in done.stderr
    assert isolux.open(target).report.status == "bounded"


def test_settings_of_the_other_schedule_are_refused(isolux_command, scene_file, tmp_path):
    """Catches an option that is taken without a word and means nothing."""
    target = tmp_path / "box.isolux"
    for own, name, schedule in (("--dark", "dark", "sequential"), ("--bf-eps", "bf_epsilon", "wavefront")):
        done = isolux_command("solve", scene_file, "-o", target, own, 0.1, "--schedule", schedule)
        assert done.returncode == 2
        assert f"'{name}'" in done.stderr
        assert ("wavefront" if schedule == "sequential" else "sequential") in done.stderr


@pytest.mark.parametrize("command", ["solve", "bake", "render"])
def test_json_on_standard_output_is_alone(isolux_command, scene_file, solution_file, tmp_path, command):
    """Catches tables mixed into JSON, and JSON with NaN or Infinity."""
    arguments = {
        "solve": (scene_file, "-o", tmp_path / "box.isolux", "--error", "0.5"),
        "bake": (solution_file, "-o", tmp_path / "lit.ply"),
        "render": (solution_file, "-o", tmp_path / "a.png", "--size", "8x8"),
    }[command]
    done = isolux_command(command, *arguments, "--json", "-")

    def refuse(word):
        raise ValueError(word)

    values = json.loads(done.stdout, parse_constant=refuse)
    assert values["output"] == str(arguments[2])


def test_short_runs_say_nothing_of_progress(capsys, monkeypatch):
    """Catches lines in the log of a command that took no time, and a long one that tells no time left."""
    clock = [0.0]
    monkeypatch.setattr("isolux.cli.progress.time", SimpleNamespace(monotonic=lambda: clock[0]))

    def state(done):
        return SimpleNamespace(phase="iteration", done=done, iteration=2, residual=0.1, elements=9, links=8)

    for mode, short, long in (
        ("auto", "", " 50 %  refining, iteration 2, 8 links, 2 s left\n"),
        ("plain", " 25 %  refining, iteration 2, 8 links, 3 s left\n", ""),
        ("none", "", ""),
    ):
        clock[0] = 0.0
        with showing(mode) as show:
            for clock[0], done in ((0.9, 0.25), (1.9, 0.5)):
                if show is not None:
                    show(state(done))
                assert capsys.readouterr().err == (short if done == 0.25 else long)


def test_a_phase_that_tells_nothing_is_told_once(capsys, monkeypatch):
    """Catches seconds without a line, since the only state came before lines begin; and a line told twice."""
    monkeypatch.setattr("isolux.cli.progress._QUIET", 0.3)
    state = SimpleNamespace(phase="charts", done=0.0, detail="")
    with showing("auto") as show:
        show(state)
        assert capsys.readouterr().err == ""
        time.sleep(0.6)
        assert capsys.readouterr().err == "  0 %  laying out charts\n"
        show(state)
        time.sleep(0.4)
    with showing("auto") as show:
        show(state)
    time.sleep(0.4)
    assert capsys.readouterr().err == ""


def test_json_progress_is_json(isolux_command, scene_file, tmp_path):
    """Catches progress lines that programs cannot read."""
    done = isolux_command(
        "solve", scene_file, "-o", tmp_path / "a.isolux", "--error", "0.3", "--progress", "json"
    )
    lines = [json.loads(line) for line in done.stderr.splitlines() if line.startswith("{")]
    assert lines
    assert all(0.0 <= line["done"] <= 1.0 and line["phase"] for line in lines)


def test_an_iteration_limit_keeps_the_result(isolux_command, scene_file, tmp_path):
    """Catches an unfinished result told as good, or thrown away."""
    done = isolux_command(
        "solve",
        scene_file,
        "-o",
        tmp_path / "a.isolux",
        "--schedule",
        "sequential",
        "--error",
        "0.3",
        "--max-iterations",
        1,
    )
    assert done.returncode == 4
    assert "not converged in 1 iterations" in done.stderr
    assert isolux.open(tmp_path / "a.isolux").report.status == "iteration-limit"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("foo", "No such command 'foo'"),
        ("solve", "Missing argument 'SCENE'"),
        ("solve {scene}", "Missing option '-o'"),
        ("solve {scene} -o {tmp}/a.isolux --quality best", "'best' is not one of"),
        ("solve {scene} -o {tmp}/a.isolux --quality draft --error 0.1", "say the same thing twice"),
        ("solve {scene} -o {tmp}/a.isolux --error 2", "setting 'error' is 2"),
        ("solve {scene} -o {tmp}/a.isolux --error much", "'--error': Input should be a valid number"),
        ("solve {scene} -o {tmp}/a.isolux --rays 3", "setting 'rays' is 3"),
        ("solve {scene} -o {tmp}/a.isolux --units parsec", "'parsec' is neither a length"),
        ("solve {scene} -o {tmp}/a.isolux --progress loud", "'loud' is not one of"),
        ("solve {scene} -o {tmp}", "is a folder"),
        ("solve {scene} -o {scene}x/a.isolux/b", "needs a folder that cannot be made"),
        ("solve {scene} -o {tmp}/lit.glb", "isolux bake, render and view write such files"),
        ("bake {solution} -o {solution}", "should have a name that ends in .glb or .ply or .vtu"),
        (
            "bake {solution} -o {tmp}/a.glb --exposure bright",
            "'bright' is neither a positive factor nor stops",
        ),
        ("bake {solution} -o {tmp}/a.glb --exposure 0", "'0' is neither a positive factor nor stops"),
        ("bake {solution} -o {tmp}/a.glb --exposure +x", "'+x' is not a number of stops"),
        ("render {solution} -o {tmp}/a.jpg", "should have a name that ends in .png or .exr"),
        ("render {solution} -o {tmp}/a.png --camera hall", "there is no camera 'hall'"),
        ("render {solution} -o {tmp}/a.png --eye 1,2,3", "belong together"),
        ("render {solution} -o {tmp}/a.png --camera a --eye 1,2,3 --at 0,0,0", "say the same thing twice"),
        ("render {solution} -o {tmp}/a.png --eye 1,2 --at 0,0,0", "'1,2' is not x,y,z"),
        ("render {solution} -o {tmp}/a.png --eye 1,2,3 --at 1,2,3", "must be two points"),
        ("render {solution} -o {tmp}/a.png --size big", "'big' is not WIDTHxHEIGHT"),
        ("render {solution} -o {tmp}/a.png --size 0x5", "'0x5' is not WIDTHxHEIGHT"),
    ],
)
def test_wrong_usage_is_one_line(isolux_command, scene_file, solution_file, tmp_path, arguments, message):
    """Catches usage errors with another exit code, a traceback, or without the word that is wrong."""
    shutil.copy(scene_file, str(scene_file) + "x")
    places = {"scene": scene_file, "solution": solution_file, "tmp": tmp_path}
    done = isolux_command(*(word.format(**places) for word in arguments.split()))
    assert done.returncode == 2, done.stderr
    assert message in done.stderr.splitlines()[-1]
    assert not TRACEBACK.search(done.stderr)
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_the_input_is_never_overwritten(isolux_command, solution_file, tmp_path):
    """Catches `isolux solve room -o room`, which would replace the scene by its solution."""
    scene = tmp_path / "room"
    scene.write_text("v 0 0 0\n")
    done = isolux_command("solve", scene, "-o", scene)
    assert done.returncode == 2
    assert "is the input" in one_line(done)
    assert scene.read_text() == "v 0 0 0\n"


def test_bad_scenes_are_named_with_file_and_object(isolux_command, tmp_path):
    """Catches an unusable scene without exit code 3, or an error that does not lead to the place."""
    material = "mtllib m.mtl\nusemtl m\n"
    (tmp_path / "m.mtl").write_text("newmtl m\nKd 0.5 0.5 0.5\n")
    cases = {
        "broken.glb": ("not a GLB", "broken.glb"),
        "index.obj": (material + "o shelf\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "object 'shelf'"),
        "empty.obj": ("v 0 0 0\n", "empty.obj"),
        "dark.obj": (material + "o shelf\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "scene 'dark' has no light"),
    }
    for name, (content, message) in cases.items():
        (tmp_path / name).write_text(content)
        done = isolux_command("solve", tmp_path / name, "-o", tmp_path / "a.isolux")
        assert done.returncode == 3, (name, done.stderr)
        line = done.stderr.splitlines()[-1]
        assert message in line
        assert not TRACEBACK.search(done.stderr)
        assert not (tmp_path / "a.isolux").exists()
    assert isolux_command("inspect", tmp_path / "dark.obj").returncode == 0
    assert isolux_command("inspect", tmp_path / "index.obj").returncode == 3


def test_bad_inputs_are_one_line(isolux_command, scene_file, solution_file, tmp_path):
    """Catches the wrong kind of file answered by a traceback, or without its name."""
    for command, path, message in [
        ("inspect", tmp_path / "none.glb", "none.glb: cannot be read"),
        ("inspect", solution_file, "lamp.isolux: this is a solution"),
        ("bake", scene_file, "box.obj: not a solution file"),
        ("bake", tmp_path / "none.isolux", "none.isolux: cannot be read"),
    ]:
        target = () if command == "inspect" else ("-o", tmp_path / "a.glb")
        done = isolux_command(command, path, *target)
        assert done.returncode == 3
        assert message in one_line(done)


def test_a_full_disk_is_one_line(solution_file, tmp_path):
    """Catches a full disk told as success or as a defect, and half a file."""
    code = (
        "import resource, sys; from isolux.cli.app import run;"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000)); sys.exit(run(sys.argv[1:]))"
    )
    done = in_python(code, "bake", solution_file, "-o", tmp_path / "lit.glb")
    assert done.returncode == 1
    assert "cannot write" in one_line(done)
    assert "lit.glb" in one_line(done)
    assert list(tmp_path.iterdir()) == []


def test_internal_errors_are_one_line_with_a_hint():
    """Catches a traceback that nobody asked for, and one that was asked for and does not come."""
    code = (
        "import sys, isolux.cli.solve as s; from isolux.cli.app import run;"
        "s.load_scene = lambda *_, **__: 1 / 0; sys.exit(run(['solve', 'a.glb', '-o', sys.argv[1]]))"
    )
    target = Path(os.devnull).parent / "null"
    done = in_python(code, target)
    assert done.returncode == 1
    assert "ZeroDivisionError" in one_line(done)
    assert "ISOLUX_TRACEBACK=1" in one_line(done)
    environment = {**os.environ, "ISOLUX_TRACEBACK": "1"}
    command = [sys.executable, "-c", code, str(target)]
    traced = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert "Traceback" in traced.stderr


def test_a_closed_pipe_is_quiet(scene_file):
    """Catches a complaint when `head` has seen enough."""
    with subprocess.Popen(
        [sys.executable, "-m", "isolux", "inspect", str(scene_file)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


def on_terminal(*arguments: object, **environment: str) -> str:
    """What a terminal shows."""
    main, other = pty.openpty()
    clean = {k: v for k, v in os.environ.items() if k not in ("NO_COLOR", "FORCE_COLOR")}
    clean |= {"TERM": "xterm-256color", "COLUMNS": "100", **environment}
    command = [sys.executable, "-m", "isolux", *map(str, arguments)]
    shown = b""
    with subprocess.Popen(command, stdout=other, stderr=other, env=clean):
        os.close(other)
        # The end of a terminal is an error on Linux.
        with contextlib.suppress(OSError):
            while chunk := os.read(main, 65536):
                shown += chunk
    os.close(main)
    return shown.decode()


def test_no_color_means_none(scene_file, tmp_path):
    """Catches colours where NO_COLOR asks for none, and a terminal that gets none at all."""
    arguments = ("solve", scene_file, "-o", tmp_path / "a.isolux", "--error", "0.3")
    assert COLOUR.search(on_terminal(*arguments))
    assert not COLOUR.search(on_terminal(*arguments, NO_COLOR="1"))
    assert not COLOUR.search(on_terminal("--help", NO_COLOR="1"))


def start_long_solve(scene_file: Path, target: Path) -> subprocess.Popen[str]:
    """A solve that would take hours, once it is at work."""
    command = [sys.executable, "-m", "isolux", "solve", str(scene_file), "-o", str(target)]
    process = subprocess.Popen(
        [*command, "--error", "1e-4", "--progress", "json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    for line in process.stderr:
        if line.startswith("{") and json.loads(line)["phase"] == "iteration":
            return process
    raise AssertionError("the solve ended by itself")


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_keeps_the_partial_solution(scene_file, tmp_path, isolux_command):
    """Catches a lost result, a corrupt one, a traceback, or a wrong exit code after Ctrl-C."""
    target = tmp_path / "partial.isolux"
    process = start_long_solve(scene_file, target)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    assert process.returncode == 130, err
    assert "cancelled; what was computed is in" in err.splitlines()[-1]
    assert not TRACEBACK.search(err)
    assert "cancelled" in out
    solution = isolux.open(target)
    assert solution.report.status == "cancelled"
    assert solution.report.links.total > 0
    assert isolux_command("bake", target, "-o", tmp_path / "lit.glb").returncode == 0


@pytest.mark.usefixtures("interruptible")
def test_impatient_ctrl_c_corrupts_nothing(scene_file, tmp_path):
    """Catches a half-written file, or one left over, after a second, third, ... Ctrl-C at any moment."""
    target = tmp_path / "partial.isolux"
    process = start_long_solve(scene_file, target)
    while process.poll() is None:
        process.send_signal(signal.SIGINT)
        time.sleep(0.002)
    _, err = process.communicate()
    assert process.returncode == 130, err
    assert not TRACEBACK.search(err)
    # The second one gives the result up, unless it was in place by then.
    found = [entry.name for entry in tmp_path.iterdir()]
    assert found in ([], ["partial.isolux"])
    if found:
        assert isolux.open(target).report.status == "cancelled"


AT_A_MOMENT = """
import os, signal, sys
import isolux.io.solution_file as module
from isolux.cli.app import run

def press(*arguments, **options):
    for _ in range(int(sys.argv[1])):
        os.kill(os.getpid(), signal.SIGINT)
    return write(*arguments, **options)

write, module.write = module.write, press
sys.exit(run(sys.argv[2:]))
"""


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_while_saving(scene_file, tmp_path):
    """Catches a finished result thrown away by one Ctrl-C while it is saved, and saved in spite of two."""
    target = tmp_path / "box.isolux"
    arguments = ("solve", scene_file, "-o", target, "--error", "0.5", "--progress", "none")
    target.write_text("old")
    twice = in_python(AT_A_MOMENT, 2, *arguments)
    assert twice.returncode == 130, twice.stderr
    assert twice.stderr.splitlines()[-1] == "isolux: cancelled"
    assert target.read_text() == "old"
    assert [entry.name for entry in tmp_path.iterdir()] == ["box.isolux"]
    once = in_python(AT_A_MOMENT, 1, *arguments)
    assert once.returncode == 0, once.stderr
    assert isolux.open(target).report.status == "converged"


def test_ctrl_c_stays_ignored_where_it_was(scene_file, tmp_path):
    """Catches a command in the background (nohup, &) that a Ctrl-C meant for another one ends."""
    target = tmp_path / "box.isolux"
    ignoring = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)" + AT_A_MOMENT
    arguments = ("solve", scene_file, "-o", target, "--error", "0.5", "--progress", "none")
    done = in_python(ignoring, 2, *arguments)
    assert done.returncode == 0, done.stderr
    assert isolux.open(target).report.status == "converged"


IN_PHASE = """
import os, signal, sys
import isolux, isolux.cli.terminal as terminal
from isolux.cli.app import run

class Hand(terminal.Interrupts):
    def hearing(self, show):
        hear = super().hearing(show)
        def press(state):
            if state.phase == sys.argv[1]:
                os.kill(os.getpid(), signal.SIGINT)
            hear(state)
        return press

terminal.Interrupts = Hand
sys.exit(run(sys.argv[2:]))
"""


PHASES = {
    "wavefront": ["tree", "iteration"],
    "sequential": ["tree", "pilot", "root-links", "iteration", "interpolation", "balance"],
}


@pytest.mark.usefixtures("interruptible")
@pytest.mark.parametrize(
    ("schedule", "phase"), [(name, phase) for name, phases in PHASES.items() for phase in phases]
)
def test_ctrl_c_in_any_phase_leaves_a_partial_solution(tmp_path, isolux_command, schedule, phase):
    """Catches a phase that does not hear Ctrl-C, and a partial solution that cannot be opened or shown."""
    target = tmp_path / "partial.isolux"
    room = ROOT / "scenes" / "room.glb"
    arguments = ("solve", room, "-o", target, "--schedule", schedule, "--error", "0.1", "--progress", "none")
    done = in_python(IN_PHASE, phase, *arguments)
    assert done.returncode == 130, done.stderr
    assert "cancelled; what was computed is in" in done.stderr.splitlines()[-1]
    assert isolux.open(target).report.status == "cancelled"
    assert isolux_command("bake", target, "-o", tmp_path / "lit.ply").returncode == 0
    assert isolux_command("render", target, "-o", tmp_path / "a.png", "--size", "16x12").returncode == 0


ENDLESS = """
import os, signal, sys, threading
import isolux.cli.render as command
from isolux.cli.app import run

press = lambda: os.kill(os.getpid(), signal.SIGINT)

def opened(path):
    solution = open_solution(path)
    threading.Timer(0.2, press).start()
    return solution

open_solution, command.isolux.open = command.isolux.open, opened
sys.exit(run(sys.argv[1:]))
"""


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_ends_a_picture_that_would_take_days(solution_file, tmp_path):
    """Catches a picture that is asked for row by row: a row of this one takes hours."""
    arguments = ("render", solution_file, "-o", tmp_path / "a.png", "--size", "32768x8192", "--samples", "64")
    command = [sys.executable, "-c", ENDLESS, *map(str, arguments), "--progress", "none"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 130, done.stderr
    assert one_line(done) == "isolux: cancelled"
    assert list(tmp_path.iterdir()) == []


def test_readme_commands_exist(isolux_command):
    """Catches options in the README that the command does not have."""
    readme = (ROOT / "README.md").read_text()
    blocks = re.findall(r"^```sh\n(.*?)^```", readme, re.DOTALL | re.MULTILINE)
    assert len(blocks) >= 2
    for command in re.findall(r"bin/isolux (\w+)", blocks[0]):
        assert isolux_command(command, "--help").returncode == 0
