"""Models as people download them: from a file without light to a page, in one command."""

from __future__ import annotations

import gzip
import json
import re
import signal
import struct
import subprocess
import sys
from base64 import b64decode

import numpy as np
import pytest
from conftest import ROOT
from models import Model, block, flat, paint, table
from test_cli import one_line

import isolux
from isolux.studio import lights_itself, studio_lamps

#: A warning is one line, and names what it is about.
WARNING = re.compile(r"isolux: warning: ([^:]+): \S")


def page_header(path):
    """The header of the data in an exported page."""
    packed = re.search(r'id="data">([^<]+)<', path.read_text(encoding="utf-8"))
    data = gzip.decompress(b64decode(packed[1]))
    (length,) = struct.unpack_from("<I", data, 8)
    return json.loads(data[16 : 16 + length])


def names_of_warnings(done):
    """Objects that warnings name; every line is one of isolux."""
    lines = done.stderr.splitlines()
    assert all(line.startswith("isolux: ") for line in lines if "%" not in line), done.stderr
    warnings = [line for line in lines if " warning: " in line]
    assert all(WARNING.match(line) for line in warnings), done.stderr
    return {WARNING.match(line)[1] for line in warnings}


def test_a_model_without_light_becomes_a_page(isolux_command, tmp_path):
    """Catches a page with a black side, a second command that is needed, light that nobody is told of."""
    model, page = table().write(tmp_path / "table.glb"), tmp_path / "made" / "table.html"
    kept = tmp_path / "table.isolux"
    done = isolux_command(
        "view", model, "--export", page, "--quality", "draft", "-o", kept, "--progress", "none"
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert names_of_warnings(done) == set()
    (told,) = (line for line in done.stderr.splitlines() if "as in a studio" in line)
    assert f"no light in {model}" in told
    assert "--lamp" in told
    header = page_header(page)
    assert [group["name"] for group in header["groups"]] == [
        f"studio {n}" for n in ("key", "fill", "back", "floor")
    ]
    solution = isolux.open(kept)
    faces = np.arange(len(solution.scene.triangles))
    middle = np.full((len(faces), 3), 1.0 / 3.0)
    # Sides of single-sided boxes; what stands on something else is covered.
    covered = np.isclose(solution.scene.triangles[..., 1], 0.7).all(axis=1)
    lit = solution.irradiance_at(faces[~covered], middle[~covered])
    assert (lit.min(axis=1) > 5.0).all()
    # The half of the texture that the transform chooses is red; the other one is black.
    names = np.array(solution.scene.objects)[solution.scene.triangle_objects]
    shown = solution.radiosity_at(faces, middle)[(names == "right leg") & ~covered]
    assert (shown[:, 0] > 5.0).all()
    assert shown[:, 1:].max() == 0.0


def test_the_view_of_a_model_shows_all_of_it(isolux_command, tmp_path):
    """Catches an eye inside or too near a model in the open, and one too far away."""
    solution = isolux.solve(
        isolux.load(path := table().write(tmp_path / "table.glb"), lamps=studio_lamps(isolux.load(path))),
        error=0.2,
    )
    shown = solution.render(size=(96, 96)).sum(axis=2) > 0.0
    assert not shown[[0, -1]].any()
    assert not shown[:, [0, -1]].any()
    rows, columns = np.flatnonzero(shown.any(axis=1)), np.flatnonzero(shown.any(axis=0))
    # It fills most of the picture one way: the box around it touches the margin of a twentieth.
    assert max(np.ptp(rows), np.ptp(columns)) > 0.6 * 96


def test_every_room_gets_a_lamp(tmp_path):
    """Catches a lamp in a wall or in furniture, a room in the dark, a cupboard that counts as a room."""
    scene = isolux.load(flat().write(tmp_path / "flat.glb"))
    rooms = [lamp for lamp in studio_lamps(scene) if lamp.kind == "point"]
    assert len(rooms) == 2
    low, high = np.array([0.0, 0.0, 0.0]), np.array([5.0, 2.5, 4.0])
    hall, chamber = (np.array(lamp.position) for lamp in rooms)
    assert ((hall > low + 0.4) & (hall < high - 0.4)).all()
    assert not ((hall > [1.7, 0.0, 1.2]) & (hall < [3.3, 1.3, 2.8])).all()
    assert ((chamber > [5.6, 0.4, 0.4]) & (chamber < [7.6, 2.1, 3.6])).all()
    # A solid is no room, however thick; a body in the open has none.
    assert not [
        lamp for lamp in studio_lamps(isolux.load(table().write(tmp_path / "t.glb"))) if lamp.kind == "point"
    ]
    solution = isolux.solve(isolux.load(tmp_path / "flat.glb", lamps=studio_lamps(scene)), error=0.2)
    faces = np.arange(12 * 2)
    lit = solution.irradiance_at(faces, np.full((len(faces), 3), 1.0 / 3.0))
    # 500 lm/m² on a cube as large, and what the walls give back.
    assert lit.min() > 150.0
    assert lit.max() < 5000.0


@pytest.mark.parametrize(
    "name", ["room", "cornell", "corridor", "office", "lamps", "studio", "two_rooms", "gallery"]
)
def test_a_lit_room_stays_as_it_is(name):
    """Catches light added to what has its own."""
    assert lights_itself(isolux.load(ROOT / f"scenes/{name}.glb"))


def test_a_pilot_light_is_no_light(isolux_command, tmp_path):
    """Catches a model in the dark but for its own light-emitting diode."""
    model = table()
    glow = paint(0.0, emissiveFactor=[0.0, 1.0, 0.0])
    model.add("diode", block((0.1, 0.75, 0.39), (0.11, 0.76, 0.4)), glow)
    path, page = model.write(tmp_path / "radio.glb"), tmp_path / "radio.html"
    assert not lights_itself(isolux.load(path))
    done = isolux_command("view", path, "--export", page, "--quality", "draft", "--json", "-")
    assert done.returncode == 0, done.stderr
    assert "what 'diode' emits hardly meets a surface" in done.stderr
    assert json.loads(done.stdout)["report"]["status"] == "converged"
    assert "diode" in [group["name"] for group in page_header(page)["groups"]]


def test_a_model_that_reflects_nothing_is_told(isolux_command, tmp_path):
    """Catches a black page without a word why, and a word where a model shows."""
    model = table()
    model.add("stone", block((-3.0, 0.0, -3.0), (-1.0, 2.0, 3.0)), paint(0.0))
    done = isolux_command(
        "view", model.write(tmp_path / "a.glb"), "--export", tmp_path / "a.html", "--quality", "draft"
    )
    (line,) = (line for line in done.stderr.splitlines() if "black" in line)
    assert line.startswith("isolux: note: 'stone': mostly black in any light")
    # As dark as any paint, but of one darkness: the exposure shows it.
    dark = Model()
    dark.add("slate", block((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), paint(0.0005))
    for other in (table(), dark):
        done = isolux_command(
            "view", other.write(tmp_path / "b.glb"), "--export", tmp_path / "b.html", "--quality", "draft"
        )
        assert done.returncode == 0, done.stderr
        assert "black" not in done.stderr


def test_light_is_what_was_asked_for(isolux_command, tmp_path):
    """Catches --light without effect, and a scene in the dark that is not told how to get out of it."""
    path, page = table().write(tmp_path / "table.glb"), tmp_path / "table.html"

    def groups(*more):
        done = isolux_command("view", path, "--export", page, "--quality", "draft", *more)
        assert done.returncode == 0, done.stderr
        return [group["name"] for group in page_header(page)["groups"]], done.stderr

    dark = isolux_command("view", path, "--export", page, "--light", "file")
    assert dark.returncode == 3
    assert "no surface emits light" in dark.stderr
    assert "--light studio" in dark.stderr
    assert groups("--lamp", "1500lm@0,3,0")[0] == ["lamp"]
    both, said = groups("--lamp", "1500lm@0,3,0", "--lamp", "90lm@1,3,0", "--light", "studio")
    assert both == ["lamp", "lamp#2", *(f"studio {name}" for name in ("key", "fill", "back", "floor"))]
    assert "1590 lm" in said
    solved = isolux_command(
        "solve", path, "-o", tmp_path / "t.isolux", "--light", "auto", "--quality", "draft", "--json", "-"
    )
    assert solved.returncode == 0, solved.stderr
    assert json.loads(solved.stdout)["report"]["mean_irradiance"][1] > 10.0


def test_a_small_page_is_small(isolux_command, tmp_path):
    """Catches --small that leaves in what it should leave out."""
    path, page, small = flat().write(tmp_path / "flat.glb"), tmp_path / "flat.html", tmp_path / "small.html"
    for target, more in ((page, ()), (small, ("--small",))):
        assert isolux_command("view", path, "--export", target, "--quality", "draft", *more).returncode == 0
    full, header = page_header(page), page_header(small)
    assert len(full["groups"]) == 6
    assert "elements/field" in full["arrays"]
    assert len(header["groups"]) <= 1
    assert "elements/field" not in header["arrays"]
    assert header["arrays"].get("links/source", {"shape": [0]})["shape"] == [0]
    assert small.stat().st_size < page.stat().st_size


def test_warnings_name_what_they_are_about(isolux_command, tmp_path):
    """Catches a warning without a name, or of two lines, for what downloaded models do wrong."""
    model = table()
    points, triangles = block((2.0, 0.0, 0.0), (2.5, 0.5, 0.5))
    model.add(
        "chrome: ball",
        (points, triangles),
        {"name": "chrome", "pbrMetallicRoughness": {"metallicFactor": 1.0}},
    )
    model.add("no area", (points[:4], [[0, 1, 1], [0, 1, 2]]), paint(0.5))
    texture = {"baseColorTexture": {"index": model.texture(np.zeros((2, 2, 3)))}}
    model.add("no coordinates", block((3.0, 0.0, 0.0), (3.1, 0.5, 0.5)), {"pbrMetallicRoughness": texture})
    path = model.write(tmp_path / "found.glb")
    done = isolux_command("view", path, "--export", tmp_path / "found.html", "--quality", "draft")
    assert done.returncode == 0, done.stderr
    assert {"chrome", "no area"} <= names_of_warnings(done)
    assert any("no coordinates" in name or "material" in name for name in names_of_warnings(done))


def test_compressed_models_say_what_to_do(isolux_command, tmp_path):
    """Catches a compressed file that ends in an error without a way on."""
    for name in ("KHR_draco_mesh_compression", "EXT_meshopt_compression"):
        path = table(extensionsUsed=[name], extensionsRequired=[name]).write(tmp_path / "small.glb")
        done = isolux_command("view", path, "--export", tmp_path / "small.html")
        assert done.returncode == 3
        line = one_line(done)
        assert name in line
        assert "small.glb" in line
        assert "npx @gltf-transform/cli copy" in line


def test_a_bound_leaves_a_page(isolux_command, tmp_path):
    """Catches a solve that a bound ended without its page, or with exit code 0."""
    page = tmp_path / "room.html"
    done = isolux_command(
        "view",
        ROOT / "scenes/room.glb",
        "--export",
        page,
        "--error",
        "0.01",
        "--time",
        "0.05",
        "--progress",
        "none",
    )
    assert done.returncode == 4
    assert f"the result is in {page}" in done.stderr
    assert page_header(page)["groups"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("{solution} --export {tmp}/a.html --error 0.1", "is solved already"),
        ("{solution} --export {tmp}/a.html --lamp 100lm@0,0,0", "is solved already"),
        ("{solution} --export {tmp}/a.html --light studio", "is solved already"),
        ("{solution} --small", "a page that --export writes"),
        ("{scene} --export {tmp}/a.glb", "should have a name that ends in .html"),
        ("{scene} --export {tmp}/a.html --lamp 100W@0,0,0", "power is counted in lm"),
        ("{scene} --export {tmp}/a.html --lamp 100lm@0,0", "is not like 1500lm@X,Y,Z"),
        ("{scene} --export {tmp}/a.html --lamp -5lm@0,0,0", "is not like 1500lm@X,Y,Z"),
        ("{scene} --export {tmp}/a.html --error 0.1 --quality draft", "say the same thing twice"),
    ],
)
def test_wrong_usage_is_one_line(isolux_command, scene_file, solution_file, tmp_path, arguments, message):
    """Catches options that are ignored, and errors of more than a line."""
    words = arguments.format(scene=scene_file, solution=solution_file, tmp=tmp_path).split()
    done = isolux_command("view", *words)
    assert done.returncode == 2
    assert message in one_line(done)
    assert not (tmp_path / "a.html").exists()


def test_a_scene_can_be_watched(tmp_path):
    """Catches a scene that is not served, a solution that is not kept, an end that is not clean."""
    path, kept = table().write(tmp_path / "table.glb"), tmp_path / "table.isolux"
    command = [sys.executable, "-m", "isolux", "view", path, "-o", kept, "--no-browser", "--quality", "draft"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as running:
        lines = []
        for line in running.stderr:
            lines.append(line)
            if "the page stays open" in line:
                running.send_signal(signal.SIGINT)
        assert running.wait(60) == 0
    assert any("watch it at http://127.0.0.1:" in line for line in lines)
    assert isolux.open(kept).report.status == "converged"


MOMENTS = """
import signal, sys
from isolux.cli import view

for moment in range(1, 13):
    lines = 0

    def trace(frame, event, _):
        global lines
        if event == "line":
            lines += 1
            if lines == moment:
                signal.raise_signal(signal.SIGINT)
        return trace

    with view._ending() as ended:
        sys.settrace(trace)
        view._wait(ended)
        sys.settrace(None)
"""


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_is_heard_at_any_moment():
    """Catches a command that hangs for good if Ctrl-C comes while it begins to wait for it."""
    done = subprocess.run(
        [sys.executable, "-c", MOMENTS], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr


def test_models_need_no_name_for_their_format(isolux_command, solution_file, tmp_path):
    """Catches a solution of another name taken for a scene."""
    other = tmp_path / "solved.bin"
    other.write_bytes(solution_file.read_bytes())
    done = isolux_command("view", other, "--export", tmp_path / "a.html")
    assert done.returncode == 0, done.stderr
    done = isolux_command("view", tmp_path / "none", "--export", tmp_path / "b.html")
    assert done.returncode == 3
    assert "none" in one_line(done)


def test_an_empty_model_is_told(isolux_command, tmp_path):
    """Catches a grid over nothing."""
    path = Model().write(tmp_path / "empty.glb")
    done = isolux_command("view", path, "--export", tmp_path / "empty.html")
    assert done.returncode == 3
    assert "empty.glb" in one_line(done)
