"""Measures: where points lie, what they have, what is told of them; by Python, the command, and reports."""

from __future__ import annotations

import csv
import io
import json
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from conftest import CUBE, SIDES

import isolux
from isolux import grids
from isolux.exceptions import MeasureError
from isolux.io import measures_file
from isolux.measures import surfaces


def test_grids_are_those_of_the_standard():
    """Catches a wrong formula, side or rounding: p = 0.2 * 5^log10(d), d the longer side below 2 : 1."""
    # Round lengths of the standard's own table, whose cells are these, rounded.
    for length, cell in ((1.0, 0.2), (10.0, 1.0), (100.0, 5.0)):
        assert grids.largest_cell(length, length) == pytest.approx(cell, rel=1e-12)
    assert grids.largest_cell(5.0, 4.0) == pytest.approx(0.616, abs=5e-4)
    assert grids.largest_cell(10.0, 5.0) == grids.largest_cell(5.0, 5.0)
    assert grids.largest_cell(9.99, 5.0) == grids.largest_cell(9.99, 9.99)
    assert grids.largest_cell(1000.0, 1000.0) == 10.0
    # What others make of 5 x 4 m: 8 x 6 points (frudawski.de, egrid).
    assert grids.counts(5.0, 4.0) == (8, 6)
    assert grids.counts(4.0, 5.0) == (6, 8)
    assert grids.counts(20.0, 2.0) == (60, 6)
    assert grids.counts(3.0, 1.0, spacing=0.5) == (6, 2)
    assert grids.counts(3.0, 1.0, spacing=5.0) == (1, 1)


def test_a_plane_over_a_floor_keeps_its_border(hall):
    """Catches points in the border, at a wrong height, or in a wrong order."""
    found = hall.measure([isolux.Plane("desk", over="floor")], samples=8)["desk"]
    x, y, z = found.points.T
    assert set(y) == {0.75}
    assert found.grid is not None
    columns, rows = grids.counts(7.0, 5.0)
    assert (found.grid.columns, found.grid.rows, len(found.points)) == (columns, rows, columns * rows)
    assert x.min() == pytest.approx(0.5 + 3.5 / columns)
    assert z.max() == pytest.approx(5.5 - 2.5 / rows)
    assert (found.normals == [0.0, 1.0, 0.0]).all()
    assert found.area == pytest.approx(35.0)


def test_a_plane_has_the_outline_of_its_floor():
    """Catches a floor's rectangle taken for the floor, turned or not: an L keeps what is in it."""
    angle = np.radians(30.0)
    turn = np.array(
        [[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]]
    )
    plan = np.array([[0, 0], [4, 0], [4, 2], [2, 2], [2, 4], [0, 4]], float)
    corners = np.stack([plan[:, 0], np.full(6, 0.5), -plan[:, 1]], axis=1)
    faces = [[0, 1, 2, 3], [0, 3, 4, 5]]
    material = isolux.Material("light", 0.5, 1.0)
    for turned in (np.eye(3), turn):
        scene = isolux.Scene.from_arrays(corners @ turned.T, faces, [material], "L")
        for border in (0.0, 0.4):
            grid = grids.over_object(scene, "L", 1.0, border=border, spacing=0.1, name="L")
            points = grid.points[grid.kept] @ turned
            assert np.allclose(points[:, 1], 1.5)
            u, v = points[:, 0], -points[:, 2]
            # Around the inner corner the border is round; 64 directions miss a corner by 5 %.
            far = np.hypot(2 - u, 2 - v) > border * 0.945 - 1e-6
            inside = (np.minimum(u, v) < 2 - border + 1e-6) | far
            inside &= (np.minimum(u, v) > border - 1e-6) & (np.maximum(u, v) < 4 - border + 1e-6)
            inside &= np.minimum(u, v) < 2 + 1e-6
            assert inside.all()
            whole = {0.0: 12.0, 0.4: 12.0 - 0.4 * 16.0 + 0.4**2 * (5 - np.pi / 4)}[border]
            cell = grid.spacing[0] * grid.spacing[1]
            # Cells of 0.1 m along an outline of 16 m.
            assert len(points) * cell == pytest.approx(whole, abs=0.25)


def test_rectangles_look_where_they_should():
    """Catches a plane turned over, and one that is not where its corners are."""
    level = grids.rectangle([[1.0, 0.8, 3.0], [3.0, 0.8, 2.0]], name="desk")
    assert level.normal.tolist() == [0.0, 1.0, 0.0]
    low, high = level.points.min(axis=0), level.points.max(axis=0)
    assert (low > [1.0, 0.79, 2.0]).all()
    assert (high < [3.0, 0.81, 3.0]).all()
    wall = grids.rectangle([[0.0, 2.0, 0.0], [0.0, 0.0, 0.0], [4.0, 0.0, 0.0]], border=0.5, name="wall")
    assert wall.normal == pytest.approx([0.0, 0.0, 1.0])
    assert wall.points[:, 2].tolist() == [0.0] * len(wall.points)
    assert wall.points[:, :2].min() > 0.5


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        (isolux.Plane("a", over="roof"), "a: there is no object 'roof'; the scene has: left, right, floor"),
        (isolux.Plane("a", over="left"), "a: 'left' has no level side that faces up"),
        (isolux.Plane("a", over="floor", border=3.0), "a: a border of 3 m leaves nothing of 'floor'"),
        (isolux.Plane("a", over="floor", spacing=0.0), "a: spacing is 0.0"),
        (isolux.Plane("a", over="floor", spacing=1e-3), "points are more than 1,000,000"),
        (isolux.Plane("a"), "a: a plane is over an object, or has corners"),
        (isolux.Plane("a", corners=[[0, 0, 0], [1, 1, 1]]), "a: corners: 0 and 1 m are two heights"),
        (isolux.Plane("a", corners=[[0, 0, 0], [1, 0, 0], [2, 0, 0]]), "a: corners: the second one is not"),
        (isolux.Plane("a", corners=[[0, 0, 0], [1, 0, 0]]), "a: corners: they span no area"),
        (
            isolux.Plane("a", over="floor", quantities=["lux"]),
            "a: 'lux' is no quantity; there are: plane, horizontal",
        ),
        (isolux.Plane("a", over="floor", quantities=["vertical:up"]), "a: 'up' is no direction"),
        (isolux.Points("a", [[0.0, np.nan, 0.0]]), "a: point 0 is (0.0, nan, 0.0)"),
        (isolux.Points("a", [[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]]), "a: normal 0 is (0.0, 0.0, 0.0)"),
        (isolux.Points("a", [[0.0, 0.0]]), "a: points: expected shape (n, 3), got (1, 2)"),
        (isolux.Surface("roof"), "roof: there is no object 'roof'"),
    ],
)
def test_nonsense_is_refused_by_name(hall, spec, message):
    """Catches a measure that is taken silently, or refused without its name."""
    with pytest.raises(MeasureError, match=re.escape(message)):
        hall.measure([spec])


def test_names_are_unique_and_something_is_asked(hall):
    """Catches two measures of one name, and none."""
    with pytest.raises(MeasureError, match="floor: two measures have this name"):
        isolux.measure(hall, [isolux.Surface("floor"), isolux.Surface("floor")])
    with pytest.raises(MeasureError, match="nothing to measure"):
        hall.measure([])


def test_air_in_a_furnace(furnace):
    """Catches light that is lost or counted twice: 2 wherever a plane looks, in every quantity."""
    points = [[0.5, 0.5, 0.5], [0.1, 0.9, 0.3]]
    values, errors = furnace.irradiance_in_air(points, [[0.0, 3.0, 0.0], [1.0, -1.0, 0.5]])
    assert values.shape == errors.shape == (2, 3)
    # What the solve is off by, at the worst, and four standard errors.
    assert (np.abs(values - 2.0) < 0.02 + 4.0 * errors).all()
    assert (errors < 0.02).all()
    up, _ = furnace.irradiance_in_air(points)
    again, _ = furnace.irradiance_in_air(points[:1], [0.0, 1.0, 0.0], threads=1)
    assert up[0].tolist() == again[0].tolist()
    asked = ("plane", "horizontal", "cylindrical", "vertical:30", "semicylindrical:-x")
    found = furnace.measure([isolux.Points("two", points, quantities=asked)])["two"]
    assert list(found.quantities) == list(asked)
    for measured in found.quantities.values():
        assert measured.values == pytest.approx([2.0, 2.0], abs=0.06)
        assert measured.statistics.uniformity == pytest.approx(1.0, abs=0.03)
    with pytest.raises(MeasureError, match=re.escape("points[1] is [NaN")):
        furnace.irradiance_in_air([points[0], [np.nan, 0.0, 0.0]])
    with pytest.raises(MeasureError, match=re.escape("normals[0] is [NaN")):
        furnace.irradiance_in_air(points, [0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=re.escape("points: expected shape (n, 3)")):
        furnace.irradiance_in_air([1.0, 2.0, 3.0], [[0.0, 1.0, 0.0]] * 3)
    with pytest.raises(MeasureError, match="samples: 7 rays"):
        furnace.irradiance_in_air(points, samples=7)


def test_quantities_differ_as_they_should(hall):
    """Catches quantities mixed up: below one end of a ceiling, walls black, by factors of a rectangle."""
    asked = ("horizontal", "vertical:+x", "vertical:180", "vertical:+z", "vertical:90", "cylindrical")
    found = hall.measure([isolux.Points("end", [[0.001, 0.75, 3.0]], quantities=asked)], samples=4096)["end"]
    values = {name: float(measured.values[0]) for name, measured in found.quantities.items()}

    def across(a, b, c):
        """Plane across a rectangle's plane, at its corner's foot: Howell's catalogue, B-3."""
        x, y = a / b, c / b
        root = np.hypot(x, y)
        return (np.arctan(1.0 / y) - y / root * np.arctan(1.0 / root)) / (2.0 * np.pi)

    height = 3.0 - 0.75
    # Two halves of the ceiling, each 3 m wide along z and 8 m deep along x.
    assert values["vertical:+x"] == pytest.approx(200.0 * across(8.0, 3.0, height), rel=2e-3)
    assert values["vertical:180"] == pytest.approx(0.0, abs=0.1)
    assert values["vertical:+z"] == pytest.approx(values["vertical:90"], rel=1e-3)
    # The mean over planes all around: a few of them tell it to some percent.
    ring = [f"vertical:{angle}" for angle in range(0, 360, 10)]
    around = hall.measure([isolux.Points("ring", [[2.0, 1.2, 4.0]], quantities=[*ring, "cylindrical"])])[
        "ring"
    ]
    mean = np.mean([around.quantities[name].values[0] for name in ring])
    told = around.quantities["cylindrical"]
    assert told.errors is not None
    # The rule of 36 planes is right to 0.1 %.
    assert told.values[0] == pytest.approx(mean, abs=1e-3 * mean + 4.0 * told.errors[0])


def test_points_in_solid_things_are_left_out(hall):
    """Catches points inside furniture or outside that count, and statistics that are not of the rest."""
    spec = isolux.Plane("low", corners=[[0.0, 0.5, 0.0], [8.0, 0.5, 6.0]], spacing=0.5)
    found = hall.measure([spec], samples=64)["low"]
    x, _, z = found.points.T
    inside = (x > 1) & (x < 2) & (z > 1) & (z < 2)
    assert inside.sum() == 4
    assert (found.used == ~inside).all()
    assert found.left_out == 4
    kept = found.quantities["plane"].values[found.used]
    told = found.quantities["plane"].statistics
    assert (told.average, told.minimum, told.maximum) == (kept.mean(), kept.min(), kept.max())
    assert told.uniformity == kept.min() / kept.mean()
    assert told.diversity == kept.min() / kept.max()
    assert told.count == len(kept)
    assert told.minimum > 0.0
    outside = hall.measure([isolux.Points("out", [[-1.0, 1.0, 3.0], [4.0, 1.5, 3.0]])], samples=8)["out"]
    assert outside.used.tolist() == [False, True]
    gone = (
        hall.measure([isolux.Points("out", [[-1.0, 1.0, 3.0]])], samples=8)["out"]
        .quantities["plane"]
        .statistics
    )
    assert gone.count == 0
    assert gone.to_dict()["average"] is None


def test_surfaces_are_told_by_area(hall):
    """Catches means that are not by area, covered parts that count, and a table that misses objects."""
    found = hall.measure([isolux.Surface("floor"), isolux.Surface("block", name="box")])
    floor = found["floor"]
    # What the block stands on receives nothing, and has no area here, to a sixteenth of an element.
    assert floor.area == pytest.approx(8.0 * 6.0 - 1.0, abs=0.2)
    elements = hall.elements
    is_floor = hall._group("scene")["object"][elements["polygon"]] == hall.scene.objects.index("floor")
    leaves = is_floor & (elements["first_child"] == 2**32 - 1)
    power = (elements["irradiance"][leaves] * elements["area"][leaves, None]).sum(axis=0)
    weights = np.array([0.2126, 0.7152, 0.0722])
    assert floor.quantities["plane"].statistics.average == pytest.approx(power @ weights / floor.area)
    assert found["box"].kind == "surface"
    listed = surfaces(hall)
    assert [row.object for row in listed] == hall.scene.objects
    assert [row.object for row in listed if row.emits] == ["ceiling"]
    assert sum(row.area for row in listed) == pytest.approx(hall.scene.area)
    assert listed[0].reflectance == (0.0, 0.0, 0.0)


def test_watts_stay_watts():
    """Catches a unit that is not the scene's, and bands that are weighed as light."""
    solution = isolux.solve(
        isolux.Scene.from_arrays(
            CUBE, list(SIDES.values()), [isolux.Material("wall", 0.5, (3.0, 0.0, 0.0))], list(SIDES), unit="W"
        ),
        error=0.2,
    )
    found = solution.measure([isolux.Points("middle", [[0.5, 0.5, 0.5]])])["middle"]
    assert found.unit == "W/m²"
    assert found.quantities["plane"].values[0] == pytest.approx(2.0, abs=0.05)


def test_measures_are_read_from_files(measures, tmp_path):
    """Catches a table, a column or a value that does not come through, in TOML or in JSON."""
    plane, eyes, surface = measures_file.read(measures)
    assert plane == isolux.Plane(
        "working plane", over="floor", spacing=1.0, quantities=("plane", "cylindrical")
    )
    assert isinstance(eyes, isolux.Points)
    assert eyes.points == [[4.0, 1.2, 3.0], [1.5, 0.5, 1.5]]
    assert surface == isolux.Surface("left")
    plain = tmp_path / "plain.csv"
    plain.write_text("1,2,3,0,1,0\n4,5,6,1,0,0\n")
    read = measures_file.read_points(plain, "plain")
    assert read.normals == [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
    other = tmp_path / "hall.json"
    other.write_text(
        json.dumps({"points": [{"points": [[0, 1, 2]]}], "surface": [{"object": "left", "name": "l"}]})
    )
    assert measures_file.read(other) == [isolux.Points("points 1", [[0, 1, 2]]), isolux.Surface("left", "l")]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[plane]\n", "Expected"),
        ("[[plain]]\n", "'plain' is no measure; there are: plane, points, surface"),
        ("[plane]\n", "'plane' is no list of tables"),
        ("", "it names no measure"),
        ("[[plane]]\nhight = 1\n", "plane 1: 'hight' is not known"),
        ("[[plane]]\nover = 1\n", "plane 1: over is 1: expected a text"),
        ("[[plane]]\nheight = 'a'\n", "plane 1: height is 'a': expected a number"),
        ("[[plane]]\ncorners = [[0, 1]]\n", "plane 1: corners: expected a list of points"),
        ("[[surface]]\n", "surface 1: object is missing"),
        ("[[points]]\n", "points 1: give a file or points"),
        ("[[points]]\nfile = 'none.csv'\n", "none.csv: cannot be read: No such file"),
        ("[[points]]\nfile = 'bad.csv'\n", "bad.csv: line 2: expected x,y,z"),
    ],
)
def test_broken_files_are_refused_by_name(tmp_path, text, message):
    """Catches a file that is taken wrongly, or refused without file and place."""
    path = tmp_path / "bad.toml"
    path.write_text(text)
    (tmp_path / "bad.csv").write_text("1,2,3\n1,2\n")
    with pytest.raises(MeasureError, match=re.escape(message)) as raised:
        measures_file.read(path)
    assert str(tmp_path) in str(raised.value)


def test_measure_command(isolux_command, hall_file, measures, tmp_path):
    """Catches values that differ between table, CSV, JSON and Python, and files that are not written."""
    points, table = tmp_path / "points.csv", tmp_path / "table.csv"
    arguments = (
        "measure",
        hall_file,
        "--measures",
        measures,
        "--samples",
        64,
        "--plane",
        "block+0.5",
        "--border",
        "0.2",
    )
    done = isolux_command(*arguments, "-o", points, "--summary", table)
    assert done.returncode == 0, done.stderr
    assert "working plane" in done.stdout
    assert "\x1b" not in done.stdout
    assert "eyes: 1 of 2 points are left out" in done.stderr
    told = isolux_command(*arguments, "--json", "-", "--progress", "none")
    values = json.loads(told.stdout)
    assert values["scene_hash"] == isolux.open(hall_file).scene.hash
    assert [entry["name"] for entry in values["measurements"]] == [
        "working plane",
        "eyes",
        "left",
        "block+0.5",
    ]
    rows = list(csv.DictReader(io.StringIO(points.read_text())))
    own = [row for row in rows if (row["measure"], row["quantity"]) == ("working plane", "cylindrical")]
    plane = values["measurements"][0]
    assert [float(row["value"]) for row in own] == plane["values"]["cylindrical"]
    assert {row["unit"] for row in rows} == {"lx"}
    summary = list(csv.DictReader(io.StringIO(table.read_text())))
    assert float(summary[1]["average"]) == plane["quantities"]["cylindrical"]["average"]
    assert float(summary[1]["uniformity"]) == plane["quantities"]["cylindrical"]["uniformity"]
    assert summary[0]["version"] == isolux.__version__
    spec = isolux.Plane("working plane", over="floor", spacing=1.0, quantities=("plane", "cylindrical"))
    again = isolux.open(hall_file).measure([spec], samples=64, threads=1)["working plane"]
    assert again.quantities["cylindrical"].values.tolist() == plane["values"]["cylindrical"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "give --plane, --points, --surface or --measures"),
        (("--plane", "floor"), "'floor' is neither OBJECT+HEIGHT"),
        (("--plane", "roof+1"), "roof+1: there is no object 'roof'"),
        (("--plane", "0,0,0:1,0"), "is neither OBJECT+HEIGHT"),
        (("--surface", "roof"), "roof: there is no object 'roof'"),
        (("--points", "nowhere.csv"), "nowhere.csv: cannot be read"),
        (("--plane", "floor+1", "-o", "a.txt"), "a.txt should have a name that ends in .csv"),
        (("--plane", "floor+1", "--quantity", "glare"), "floor+1: 'glare' is no quantity"),
    ],
)
def test_measure_command_refuses_in_one_line(isolux_command, hall_file, arguments, message):
    """Catches a refusal without a name, a wrong exit code, and words on the wrong stream."""
    done = isolux_command("measure", hall_file, *arguments)
    assert (done.returncode, done.stdout) == (2, "")
    assert len(done.stderr.splitlines()) == 1
    assert message in done.stderr


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_ends_a_measurement_that_would_take_hours(hall_file, tmp_path):
    """Catches a measurement that does not hear Ctrl-C, or leaves a file behind."""
    target = tmp_path / "points.csv"
    command = [
        sys.executable,
        "-m",
        "isolux",
        "measure",
        hall_file,
        "--plane",
        "floor+0.75",
        "--spacing",
        "0.01",
    ]
    command += ["--samples", "4096", "-o", target, "--progress", "plain"]
    process = subprocess.Popen(
        list(map(str, command)), stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    assert "measuring" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    since = time.monotonic()
    _, error = process.communicate()
    assert process.returncode == 130, error
    assert time.monotonic() - since < 5.0
    assert error.splitlines()[-1] == "isolux: cancelled"
    assert not target.exists()


def test_what_is_not_there_is_a_dash(isolux_command, hall_file, tmp_path):
    """Catches "nan" in a table, in JSON or in CSV, where no point counts, and ratios of nothing."""
    points = tmp_path / "outside.csv"
    points.write_text("-5,1,3\n")
    arguments = ("measure", hall_file, "--points", points, "--samples", 8, "--progress", "none")
    done = isolux_command(*arguments, "--summary", tmp_path / "table.csv")
    assert (done.returncode, "nan" in done.stdout) == (0, False), done.stderr
    assert " - " in done.stdout
    assert "nan" not in (tmp_path / "table.csv").read_text()
    told = json.loads(isolux_command(*arguments, "--json", "-").stdout)
    statistics = told["measurements"][0]["quantities"]["plane"]
    assert (statistics["average"], statistics["count"]) == (None, 0)


def test_every_column_of_the_table_has_a_heading(isolux_command, hall_file):
    """Catches a column without a heading, beside which all others are read wrong."""
    done = isolux_command("measure", hall_file, "--plane", "floor+0.5", "--progress", "none")
    head, row = (re.split(r"\s{2,}", line) for line in done.stdout.splitlines())
    assert head[-3:] == ["unit", "noise", "points"]
    assert len(head) == len(row) == 9 + 1
    assert row[-3] == "lx"
    assert float(row[-2]) > 0.0
