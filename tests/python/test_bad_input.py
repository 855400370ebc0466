"""What is wrong with files, options and targets is one line that names it, told before any work is done."""

from __future__ import annotations

import json
import os
import shutil
import struct
from typing import TYPE_CHECKING

import h5py
import pytest
from conftest import ROOT, SIDES
from typer.main import get_command

import isolux
from isolux.cli import app

if TYPE_CHECKING:
    from pathlib import Path

CORNELL = ROOT / "scenes" / "cornell.glb"
DOWNLIGHT = ROOT / "scenes" / "downlight.ies"
LDT = ROOT / "crates" / "photometry" / "tests" / "files" / "absolute.ldt"
MTL = "newmtl paint\nKd 0.5 0.5 0.5\nnewmtl lamp\nKd 0 0 0\nKe 1 1 1\n"
OBJ = (
    "mtllib room.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
    "usemtl lamp\no lamp\nf 1 2 3\nusemtl paint\no shelf\n"
)
SUN = ("--sun", "48.1,11.6@2026-06-21T15:00+02:00")


@pytest.fixture
def told(capfd):
    """Run the command in this process; give its exit code and the one line that it says."""

    def run(*arguments: object) -> tuple[int, str]:
        capfd.readouterr()
        code = app.run([str(argument) for argument in arguments])
        out, err = capfd.readouterr()
        assert out == ""
        (line,) = err.splitlines()
        assert line.startswith("isolux: error: "), line
        return code, line.removeprefix("isolux: error: ")

    return run


def glb(path: Path, change) -> Path:
    """The Cornell box with something wrong in it."""
    data = CORNELL.read_bytes()
    end = 20 + struct.unpack_from("<I", data, 12)[0]
    document, rest = json.loads(data[20:end]), bytearray(data[end:])
    change(document, rest)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + rest
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
    return path


def no_number(document, rest):
    accessor = document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    place = 8 + document["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
    struct.pack_into("<f", rest, place + accessor.get("byteOffset", 0), float("nan"))


def punctual(**light):
    def change(document, _):
        name = "KHR_lights_punctual"
        document["extensionsUsed"] = [name]
        document["extensions"] = {name: {"lights": [light]}}
        document["nodes"].append({"name": "bulb", "extensions": {name: {"light": 0}}})
        document["scenes"][0]["nodes"].append(len(document["nodes"]) - 1)

    return change


def no_material(document, _):
    document["meshes"][0]["primitives"][0]["material"] = 99


def no_buffer(document, _):
    document["buffers"][0]["uri"] = "gone.bin"


BAD_SCENES = {
    "gone.glb": (None, "cannot be read: no such file"),
    "folder.glb": ("folder", "cannot be read: it is a directory"),
    "empty.glb": (b"", "not a valid glTF file"),
    "magic.glb": (bytes(200), "not a valid glTF file"),
    "cut.glb": (CORNELL.read_bytes()[:3000], "truncated: the header claims"),
    "cut.gltf": (b'{"asset": {"version": "2.0"}, "scen', "not a valid glTF file: JSON"),
    "old.gltf": (b'{"asset": {"version": "1.0"}}', "requires glTF 1.0"),
    "nothing.gltf": (b'{"asset": {"version": "2.0"}}', "the scene has no surfaces"),
    "picture.png": (b"\x89PNG", "trimesh cannot read it"),
    "nan.glb": (no_number, "object 'floor': face 0 has a coordinate that is not a finite number"),
    "material.glb": (no_material, "object 'floor' names material 99"),
    "buffer.glb": (no_buffer, "buffer 0 ('gone.bin'): no such file"),
    "spot.glb": (
        punctual(type="spot", spot={"innerConeAngle": 2, "outerConeAngle": 1}),
        "lamp 'bulb': its cone is none",
    ),
    "empty.obj": (b"", "the scene has no surfaces"),
    "flat.obj": (b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "1 faces without area"),
    "nan.obj": (f"{OBJ}v nan 0 0\nf 1 2 5\n".encode(), "object 'shelf': face 1 has a coordinate that is"),
    "huge.obj": (f"{OBJ}v 1e400 0 0\nf 1 2 5\n".encode(), "object 'shelf': face 1 has a coordinate that is"),
    "word.obj": (f"{OBJ}v a b c\nf 1 2 5\n".encode(), "line 11: a vertex needs three numbers"),
    "index.obj": (f"{OBJ}f 1 2 9\n".encode(), "object 'shelf': face 0: vertex 9 is out of range"),
}


def made(folder: Path, name: str, content) -> Path:
    """A file of that content, a folder, or nothing."""
    path = folder / name
    (folder / "room.mtl").write_text(MTL)
    if content == "folder":
        path.mkdir()
    elif callable(content):
        glb(path, content)
    elif content is not None:
        path.write_bytes(content)
    return path


@pytest.mark.parametrize(("name", "content", "message"), [(k, *v) for k, v in BAD_SCENES.items()])
def test_bad_scenes(told, solution_file, tmp_path, name, content, message):
    """Catches a command that meets a broken scene with a traceback, two lines, or without its name."""
    path = made(tmp_path, name, content)
    out = tmp_path / "out"
    for command in (
        ("inspect", path),
        ("solve", path, "-o", out / "a.isolux"),
        ("view", path, "--export", out / "a.html"),
        ("relight", solution_file, "--scene", path, "-o", out / "b.isolux"),
        ("study", path, "--quick", "-o", tmp_path / "report"),
    ):
        code, line = told(*command)
        assert (code, line.startswith(f"{path}: "), message in line) == (3, True, True), line
    assert not out.exists() or list(out.iterdir()) == []
    assert not (tmp_path / "report").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"Ke 1 1 1": "Ke -1 1 1"}, "warning: lamp: negative value"),
        ({"newmtl paint": "newmtl other"}, "warning: paint: "),
    ],
)
def test_what_is_mended_is_told_by_name(capfd, tmp_path, arguments, message):
    """Catches a negative emission or a material that is not there passed over in silence."""
    text = MTL
    for before, after in arguments.items():
        text = text.replace(before, after)
    (tmp_path / "room.mtl").write_text(text)
    (tmp_path / "room.obj").write_text(f"{OBJ}f 1 3 4\n")
    arguments = ["solve", str(tmp_path / "room.obj"), "-o", str(tmp_path / "a.isolux"), "--error", "0.5"]
    assert app.run(arguments) == 0
    assert message in capfd.readouterr().err


def changed(index: int, value: str) -> bytes:
    """The downlight's file with another number."""
    head, tilt, numbers = DOWNLIGHT.read_text().partition("TILT=NONE")
    words = numbers.split()
    words[index] = value
    return f"{head}{tilt}\n{' '.join(words)}\n".encode()


def ldt_changed(line: int, value: str) -> bytes:
    lines = LDT.read_text(encoding="latin-1").splitlines()
    lines[line - 1] = value
    return "\n".join(lines).encode("latin-1")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("gone.ies", None, "cannot be read: no such file"),
        ("folder.ies", "folder", "cannot be read: it is not a regular file"),
        ("empty.ies", b"", "line 1: expected a line 'TILT='"),
        ("empty.ldt", b"", "line 1: expected the company"),
        ("cut.ies", DOWNLIGHT.read_bytes()[:-30], "expected candela value"),
        (
            "cut.ldt",
            LDT.read_bytes()[: len(LDT.read_bytes()) // 2],
            "found 6 words up to the end of the file",
        ),
        ("lumens.ies", changed(1, "nan"), "expected the lumens per lamp"),
        ("factor.ies", changed(2, "-1"), "expected a candela multiplier above 0, found '-1'"),
        ("angles.ies", changed(3, "999999999"), "expected the number of vertical angles"),
        ("candela.ies", changed(-1, "nan"), "(vertical 90, horizontal 0), found 'nan'"),
        ("planes.ldt", ldt_changed(4, "-3"), "line 4: expected the number of C-planes"),
    ],
)
def test_bad_luminaires(told, tmp_path, name, content, message):
    """Catches a photometric file that is looked into, or hung, without a word on file and line."""
    path = made(tmp_path, name, content)
    for command in (("inspect", path), ("inspect", CORNELL, "--lamp", f"{path}@1,1,1")):
        code, line = told(*command)
        assert (code, line.startswith(f"{path}: "), message in line) == (3, True, True), line


def of_version(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file.attrs["format_version"] = 2


def without_links(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        del file["links/source"]


def cut_short(path: Path) -> None:
    os.truncate(path, path.stat().st_size // 2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda path: path.unlink(), "cannot be read: No such file"),
        (lambda path: path.write_bytes(b""), "not a solution file"),
        (lambda path: shutil.copy(CORNELL, path), "not a solution file"),
        (cut_short, "damaged: "),
        (of_version, "the attribute 'format_version' is 2; this version of isolux reads 1"),
        (without_links, "'links/source' is missing"),
    ],
)
def test_bad_solutions(told, solution_file, tmp_path, change, message):
    """Catches a command that takes a damaged solution, one of another version, or none, for a good one."""
    path = tmp_path / "room.isolux"
    shutil.copy(solution_file, path)
    change(path)
    out = tmp_path / "out"
    for command in (
        ("render", path, "-o", out / "a.png"),
        ("bake", path, "-o", out / "a.glb"),
        ("bake", path, "-o", out / "a.glb", "--to", "lightmap"),
        ("view", path, "--export", out / "a.html"),
        ("relight", path, "-o", out / "a.isolux"),
        ("measure", path, "--plane", "floor+0.5", "-o", out / "a.csv"),
        ("report", path, "--plane", "floor+0.5", "-o", out / "a.html"),
    ):
        code, line = told(*command)
        assert (code, line.startswith(f"{path}: "), message in line) == (3, True, True), line
    assert list(out.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        *(
            (("--lamp", f"{lamp}@{place}"), f"'{lamp}@{place}' is n")
            for lamp in (DOWNLIGHT, "1500lm")
            for place in ("1,2", "1,2,3,4,5,6", "a,b,c", "nan,0,0", "1e400,0,0", "")
        ),
        (("--lamp", "-5lm@1,1,1"), "'-5lm@1,1,1' is not like 1500lm@X,Y,Z"),
        (("--lamp", "5W@1,1,1"), "is in W, but power is counted in lm"),
        (("--light-units", "lux"), "'lux' is not one of 'spec', 'unitless', 'blender'"),
        (("--up", "x"), "--up': 'x' is not one of"),
        (("--units", "parsec"), "'parsec' is neither a length"),
        (("--units", "nan"), "'nan' is neither a length"),
        (("--light", "disco"), "'disco' is not one of"),
        (("--sun", "48,11@noon"), "'48,11@noon' is not LAT,LON@TIME"),
        (("--sun", "nan,11@2026-06-21T12:00Z"), "latitude is nan"),
        (("--sun", "48,11@2026-06-21T12:00Z=-5"), "is not LAT,LON@TIME[=LUX]"),
        (("--north", "20"), "--north: it belongs to --sun, which is not given"),
        ((*SUN, "--north", "nan"), "nan is no angle"),
        (("--sky", "uniform"), "needs --sky-illuminance"),
        (("--sky-illuminance", "9", "--sky", "cie:x"), "'cie:x' is neither cie:TYPE"),
        (("--sky-illuminance", "9", "--sky", "cie:1,2"), "'cie:1,2': "),
        (("--sky", "perez:700,120"), "perez needs a sun"),
        (("--ground", "0.3"), "--ground: it belongs to --sky"),
        (("--sky", "uniform", "--sky-illuminance", "nan"), "nan is not above 0"),
    ],
)
def test_bad_options_of_reading(told, arguments, message):
    """Catches an option of reading that is passed over, or refused without its name."""
    code, line = told("inspect", CORNELL, *arguments)
    assert (code, message in line, arguments[-2] in line) == (2, True, True), line


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("solve {scene} -o {tmp}/a.isolux -j 99999", "less than or equal to 4096"),
        ("solve {scene} -o {tmp}/a.isolux --error nan", "setting 'error' is nan"),
        ("solve {scene} -o {tmp}/a.isolux --time soon", "'soon' is neither a number of seconds"),
        ("solve {scene} -o {tmp}/a.isolux --memory -1G", "--memory: '-1G' is neither a number"),
        ("render {solution} -o {tmp}/a.png --exposure +nan", "--exposure: '+nan' is not a number of stops"),
        ("render {solution} -o {tmp}/a.png --exposure -1e9", "--exposure: '-1e9' is not a number of stops"),
        ("render {solution} -o {tmp}/a.png --exposure +inf", "--exposure: '+inf' is not a number of stops"),
        ("render {solution} -o {tmp}/a.png --eye nan,1,1 --at 0,0,0", "eye [NaN, 1, 1]"),
        ("bake {solution} -o {tmp}/a.glb --to lightmap --texels-per-metre nan", "texels per metre: nan"),
        ("measure {solution}", "give --plane, --points, --surface or --measures"),
        ("measure {solution} --plane floor+inf", "height is inf: expected a number that is finite"),
        ("measure {solution} --plane gone+1", "there is no object 'gone'"),
        ("measure {solution} --points {files}/nan.csv", "nan.csv: line 1: expected x,y,z or"),
        ("measure {solution} --points {files}", "cannot be read: "),
        ("measure {solution} --measures {files}/gone.toml", "gone.toml: cannot be read"),
        ("measure {solution} --measures {files}/none.json", "none.json: plane 1: give over or corners"),
        ("measure {solution} --measures {files}/both.json", "both.json: plane 1: give over or corners"),
        ("relight {solution} -o {tmp}/a.isolux --set gone=1", "there is no light group 'gone'"),
        ("relight {solution} -o {tmp}/a.isolux --reflectance paint=nan", "reflectance of 'paint' is NaN"),
    ],
)
def test_bad_options(told, scene_file, solution_file, tmp_path, tmp_path_factory, command, message):
    """Catches a value that makes no sense told without its option, its file or its object."""
    files = tmp_path_factory.mktemp("files")
    (files / "nan.csv").write_text("1,2,nan\n")
    (files / "none.json").write_text('{"plane": [{"name": "desk"}]}')
    corners = [[0, 0, 0], [1, 0, 1]]
    (files / "both.json").write_text(json.dumps({"plane": [{"over": "floor", "corners": corners}]}))
    places = {"scene": scene_file, "solution": solution_file, "tmp": tmp_path, "files": files}
    code, line = told(*(word.format(**places) for word in command.split()))
    assert (code, message in line) == (2, True), line
    assert list(tmp_path.iterdir()) == []


READING = {
    "--units": "cm",
    "--up": "z",
    "--light-units": "blender",
    "--lamp": "5lm@1,1,1",
    "--sun": SUN[1],
    "--north": "20",
    "--sky": "uniform",
    "--sky-illuminance": "100",
    "--ground": "0.3",
    "--light": "studio",
}


@pytest.mark.parametrize(("option", "value"), READING.items())
def test_options_of_reading_need_a_scene(told, solution_file, tmp_path, option, value):
    """Catches an option that is passed over where no scene is read: nobody would know that it did nothing."""
    for command, why in (
        (("inspect", DOWNLIGHT), f"it needs a scene, and {DOWNLIGHT} is a luminaire"),
        (
            ("relight", solution_file, "-o", tmp_path / "a.isolux"),
            "it belongs to --scene, which is not given",
        ),
        (
            ("view", solution_file, "--export", tmp_path / "a.html"),
            f"{solution_file} is solved already: a scene takes it",
        ),
    ):
        code, line = told(*command, option, value)
        assert (code, f"Invalid value for {option}: {why}" in line) == (2, True), line
    assert list(tmp_path.iterdir()) == []


def test_all_that_read_scenes_have_the_same_options():
    """Catches an option of reading that one command has not, or words otherwise."""
    commands = get_command(app.app).commands
    seen = {}
    for name in ("solve", "view", "inspect", "relight"):
        options = {option.opts[0]: option for option in commands[name].params}
        assert set(READING) <= set(options), name
        # In one piece, in one order.
        names = list(options)
        first = names.index("--units")
        assert names[first : first + len(READING)] == list(READING)
        seen[name] = [(options[one].help, options[one].metavar) for one in READING]
        assert options["--light"].default == ("auto" if name == "view" else "file")
    assert all(entry == seen["solve"] for entry in seen.values())


def test_relight_reads_a_scene_as_it_was_solved(tmp_path):
    """Catches a solution of a file with +Z up, or of one lit as in a studio, refused with its own file."""
    scene = tmp_path / "box.obj"
    corners = [(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 2.0)]
    lines = ["v {} {} {}".format(*corner) for corner in corners]
    lines += ["f " + " ".join(str(corner + 1) for corner in side) for side in SIDES.values()]
    scene.write_text("\n".join(lines) + "\n")
    solution = tmp_path / "box.isolux"
    given = ("--up", "z", "--light", "studio")
    assert app.run(["solve", str(scene), "-o", str(solution), "--error", "0.5", *given]) == 0
    again = ["relight", str(solution), "--scene", str(scene), "-o", str(tmp_path / "again.isolux")]
    assert app.run([*again, *given]) == 0
    for missing in (given[2:], given[:2]):
        assert app.run([*again, *missing]) == 3


WRITERS = [
    ("solve", "{scene}", "-o", ".isolux"),
    ("solve", "{scene}", "-o", "{tmp}/out/a.isolux", "--json", ".json"),
    ("view", "{scene}", "--export", ".html"),
    ("view", "{scene}", "--export", "{tmp}/out/a.html", "-o", ".isolux"),
    ("view", "{solution}", "--export", ".html"),
    ("view", "{solution}", "--export", "{tmp}/out/a.html", "--json", ".json"),
    ("render", "{solution}", "-o", ".png"),
    ("render", "{solution}", "-o", "{tmp}/out/a.png", "--json", ".json"),
    ("bake", "{solution}", "-o", ".ply"),
    ("bake", "{solution}", "-o", "{tmp}/out/a.glb", "--json", ".json"),
    ("bake", "{solution}", "--to", "lightmap", "-o", ".glb"),
    ("bake", "{solution}", "--to", "lightmap", "-o", "{tmp}/out/a.glb", "--json", ".json"),
    ("bake", "{solution}", "--to", "both", "-o", ".glb"),
    ("bake", "{solution}", "--to", "both", "-o", "{tmp}/out/a.glb", "--json", ".json"),
    ("report", "{solution}", "--plane", "floor+0.5", "-o", ".pdf"),
    ("report", "{solution}", "--plane", "floor+0.5", "-o", "{tmp}/out/a.pdf", "--json", ".json"),
    ("measure", "{solution}", "--plane", "floor+0.5", "-o", ".csv"),
    ("measure", "{solution}", "--plane", "floor+0.5", "--summary", ".csv"),
    ("measure", "{solution}", "--plane", "floor+0.5", "--json", ".json"),
    ("relight", "{solution}", "-o", ".isolux"),
    ("relight", "{solution}", "-o", "{tmp}/out/a.isolux", "--json", ".json"),
    ("inspect", "{scene}", "--json", ".json"),
    ("inspect", str(DOWNLIGHT), "--json", ".json"),
    ("study", "{scene}", "--quick", "-o", "{tmp}/out/report", "--json", ".json"),
]


@pytest.fixture
def no_work(monkeypatch):
    """Whatever begins to work fails."""

    def work(*_, **__):
        raise AssertionError("work began")

    for place in (
        "isolux.open",
        "isolux.solve",
        "isolux.scene.load",
        "isolux.cli.reading.load",
        "isolux.cli.inspect.read_photometry",
        "isolux.cli.study.Store",
    ):
        monkeypatch.setattr(place, work)


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize("command", WRITERS, ids=lambda words: f"{words[0]} {words[-2]}")
def test_targets_that_cannot_be_written(told, scene_file, solution_file, tmp_path, command):
    """Catches a target that is found to be no good after the work, and one that the check itself harms."""
    *words, option, suffix = (
        word.format(scene=scene_file, solution=solution_file, tmp=tmp_path) for word in command
    )
    fixed, folder, file = tmp_path / f"fixed{suffix}", tmp_path / f"folder{suffix}", tmp_path / "file"
    fixed.write_text("old")
    fixed.chmod(0o444)
    folder.mkdir()
    file.write_text("old")
    for target, why in (
        (f"/proc/isolux-nowhere{suffix}", "is in a folder that cannot be written to: "),
        (f"/proc/isolux-nowhere/x{suffix}", "needs a folder that cannot be made: "),
        (file / f"x{suffix}", "needs a folder that cannot be made: "),
        (fixed, "is read-only"),
        (folder, "is a folder"),
        (tmp_path / ("n" * 300 + suffix), "cannot be written: File name too long"),
    ):
        code, line = told(*words, option, target)
        assert (code, f"Invalid value for {option}: {target} {why}" in line) == (2, True), line
    assert (fixed.read_text(), file.read_text()) == ("old", "old")
    left = {path.name for path in tmp_path.rglob("*")} - {"out"}
    assert left == {fixed.name, folder.name, file.name}


def test_folders_of_studies_that_cannot_be_written(told, tmp_path):
    """Catches a study that is simulated before its folder is found to be no good."""
    (tmp_path / "file").write_text("old")
    for folder, why in (
        ("/proc/isolux-nowhere", "cannot be written to: "),
        (tmp_path / "file", "is a file: a report needs a folder"),
        (tmp_path / "file" / "report", "cannot be written to: Not a directory"),
    ):
        code, line = told("study", "--quick", "-o", folder)
        assert (code, f"{folder} {why}" in line) == (2, True), line


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(
    ("command", "why"),
    [
        ("inspect {tmp}/room.obj --json {tmp}/room.obj", "--json: {tmp}/room.obj is the input"),
        ("solve {tmp}/room.obj -o {tmp}/new --json {tmp}/room.obj", "--json: {tmp}/room.obj is the input"),
        ("measure {solution} --points {tmp}/p.csv -o {tmp}/p.csv", "-o: {tmp}/p.csv is the input"),
        (
            "measure {solution} --measures {tmp}/m.json --json {tmp}/m.json",
            "--json: {tmp}/m.json is the input",
        ),
        (
            "relight {solution} --scene {tmp}/room.obj -o {tmp}/a --json {tmp}/link",
            "--json: {tmp}/link is the input",
        ),
        (
            "measure {solution} --plane a+1 -o {tmp}/n.csv --summary {tmp}/n.csv",
            "{tmp}/n.csv is what -o writes",
        ),
        ("solve {tmp}/room.obj -o {tmp}/new --json {tmp}/./new", "{tmp}/new is what -o writes"),
        ("report {solution} --plane a+1 -o {tmp}/n.pdf -o {tmp}/n.pdf", "{tmp}/n.pdf is what -o writes"),
    ],
)
def test_inputs_and_other_results_are_never_replaced(told, solution_file, tmp_path, command, why):
    """Catches a result that takes the place of what was read, or of another result."""
    (tmp_path / "room.obj").write_text("v 0 0 0\n")
    (tmp_path / "p.csv").write_text("1,2,3\n")
    (tmp_path / "m.json").write_text('{"surface": [{"object": "floor"}]}')
    (tmp_path / "link").symlink_to(tmp_path / "room.obj")
    before = {path: path.read_text() for path in tmp_path.iterdir()}
    places = {"solution": solution_file, "tmp": tmp_path}
    code, line = told(*command.format(**places).split())
    assert (code, why.format(**places) in line) == (2, True), line
    assert {path: path.read_text() for path in tmp_path.iterdir()} == before


def test_what_goes_wrong_after_the_check_leaves_what_was_there(told, scene_file, solution_file, tmp_path):
    """Catches a check that empties a file, or leaves one of its own behind."""
    target = tmp_path / "a.png"
    target.write_text("old")
    assert told("render", solution_file, "-o", target, "--camera", "gone")[0] == 2
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]
    assert target.read_text() == "old"
    # Pipes and the like are written to, not replaced.
    assert app.run(["solve", str(scene_file), "-o", os.devnull, "--error", "0.5", "--json", os.devnull]) == 0
    assert isolux.open(solution_file).report.status == "converged"
