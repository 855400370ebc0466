"""Solving and asking: known answers, shapes, errors, progress, cancelling, and equal bits."""

from __future__ import annotations

import json
import math
import os
import signal

import numpy as np
import pytest
from conftest import box, in_python, lamp
from PIL import Image

import isolux
from isolux.exceptions import NoLightError, RenderError, SettingsError, WriteError

CENTRE = [[1 / 3, 1 / 3, 1 / 3]]


def test_furnace_has_its_exact_answer(furnace):
    """Catches bands, units or reflectances mixed up between arrays and answers: B = H = 1 / (1 - 1/2) = 2."""
    faces = np.arange(12)
    barycentric = np.repeat(CENTRE, 12, axis=0)
    for values in (furnace.radiosity_at(faces, barycentric), furnace.irradiance_at(faces, barycentric)):
        assert values.shape == (12, 3)
        assert values.dtype == np.float64
        # The asked error, 0.1, is what the solve promises.
        assert np.sqrt(np.mean((values / 2.0 - 1.0) ** 2)) <= 0.1
    assert furnace.report.status == "converged"
    assert furnace.report.mean_irradiance == pytest.approx([2.0] * 3, rel=0.1)


def test_radiosity_is_emission_and_reflected_irradiance(lit):
    """Catches the two answers swapped, or looked up at different faces."""
    faces = np.arange(12)
    barycentric = np.repeat([[0.2, 0.3, 0.5]], 12, axis=0)
    radiosity, irradiance = lit.radiosity_at(faces, barycentric), lit.irradiance_at(faces, barycentric)
    ceiling = np.isin(lit.scene.triangle_objects, [lit.scene.objects.index("ceiling")])
    np.testing.assert_allclose(radiosity[ceiling], [[3.0, 2.0, 1.0]] * 2)
    np.testing.assert_allclose(radiosity[~ceiling], irradiance[~ceiling] * [0.7, 0.5, 0.3])
    # The floor sees more of the lamp than the upper edges of the walls see of each other.
    assert irradiance[~ceiling].min() > 0.0


def test_answers_for_no_points(lit):
    """Catches a crash on empty input."""
    assert lit.radiosity_at([], np.zeros((0, 3))).shape == (0, 3)


@pytest.mark.parametrize(
    ("face", "barycentric", "kind", "message"),
    [
        ([12], CENTRE, IndexError, "face 12 is out of range: the scene has 12 triangles"),
        ([-1], CENTRE, IndexError, "face -1 is out of range"),
        ([2**40], CENTRE, IndexError, "face 1099511627776 is out of range"),
        ([[0]], CENTRE, ValueError, r"face: expected shape \(n,\), got \(1, 1\)"),
        ([0.5], CENTRE, ValueError, "face: expected an array of integers: got float64"),
        ([0], [0.2, 0.3, 0.5], ValueError, r"barycentric: expected shape \(n, 3\), got \(3,\)"),
        ([0, 1], CENTRE, ValueError, "barycentric has 1 rows, but face has 2"),
        (
            [0],
            [[0.2, 0.3, 0.4]],
            ValueError,
            r"barycentric\[0\] is \(0.2, 0.3, 0.4\), which does not sum to 1",
        ),
        ([0], [[math.nan, 0.5, 0.5]], ValueError, r"barycentric\[0\] is \(NaN, 0.5, 0.5\)"),
    ],
)
def test_wrong_points_are_named(lit, face, barycentric, kind, message):
    """Catches a point outside that is answered, or an error that does not say which."""
    for ask in (lit.radiosity_at, lit.irradiance_at):
        with pytest.raises(kind, match=message):
            ask(face, barycentric)


def test_dropped_faces_have_no_light():
    """Catches a face without area that borrows a neighbour's light."""
    vertices = [[0, 0, 0], [1, 0, 0], [0, 0, -1], [2, 0, 0]]
    scene = isolux.Scene.from_arrays(vertices, [[0, 1, 3], [0, 1, 2]], [{"emission": 1.0}])
    assert scene.polygons.dropped_triangles == 1
    assert scene.triangle_objects.tolist() == [-1, 0]
    values = isolux.solve(scene, error=1.0).radiosity_at([0, 1], CENTRE * 2)
    assert np.isnan(values[0]).all()
    np.testing.assert_allclose(values[1], 1.0)


def test_elements_and_links_are_read_only_and_fit_each_other(lit):
    """Catches arrays of different length, indices that name nothing, copies on access, and writable views."""
    elements, links, report = lit.elements, lit.links, lit.report
    assert {len(array) for array in elements.values()} == {report.elements}
    assert {len(array) for array in links.values()} == {report.links.total}
    assert elements["radiosity"].shape == (report.elements, 3)
    assert elements["corners"].shape == (report.elements, 4, 3)
    for name in ("receiver", "source"):
        assert links[name].max() < report.elements
    assert (links["form_factor"] > 0.0).all()
    assert ((links["visibility"] >= 0.0) & (links["visibility"] <= 1.0)).all()
    assert lit.elements is elements
    for array in (*elements.values(), *links.values(), *lit.mesh.values()):
        assert not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0
    with pytest.raises(TypeError):
        elements["area"] = None


def test_mesh_agrees_with_answers(lit):
    """Catches vertex values of another place or quantity than the answers between them."""
    mesh = lit.mesh
    count = len(mesh["positions"])
    assert mesh["irradiance"].shape == mesh["radiosity"].shape == (count, 3)
    assert mesh["triangles"].max() == count - 1
    corner = lit.scene.triangles[0, 0]
    here = np.flatnonzero((mesh["positions"] == corner).all(axis=1))
    at_corner = lit.irradiance_at([0], [[1.0, 0.0, 0.0]])[0]
    assert any(np.allclose(mesh["irradiance"][vertex], at_corner) for vertex in here)


def test_report_says_what_was_asked(lit):
    """Catches settings that do not reach the solver, and a report that belongs to another scene."""
    report = isolux.solve(
        lamp(),
        isolux.Settings(
            schedule="sequential", error=0.3, update="jacobi", rays=256, order="random:5", seed=9
        ),
    ).report
    assert report.settings == isolux.Settings(
        schedule="sequential", error=0.3, update="jacobi", rays=256, order="random:5", seed=9
    )
    assert report.scene == "lamp"
    assert report.scene_hash == lit.report.scene_hash == lit.scene.hash
    assert report.version == isolux.__version__
    assert report.energy is not None
    assert abs(report.energy.imbalance) < 0.3
    assert lit.report.energy is not None
    assert lit.report.row_sum is not None
    assert sum(report.elements_by_level) == report.elements
    assert report.seconds > 0.0
    assert lit.matches(lamp())
    assert not lit.matches(box())


def test_report_survives_json(lit):
    """Catches fields that are lost or change their type between report and JSON, infinities included."""
    values = json.loads(json.dumps(lit.report.to_dict(), allow_nan=False))
    again = isolux.Report.from_dict(values)
    assert again == lit.report
    assert again.to_dict() == values


def test_keywords_replace_settings():
    """Catches a keyword that is ignored, or one that resets what the settings said."""
    report = isolux.solve(
        lamp(),
        isolux.Settings(schedule="sequential", seed=3, error=0.5),
        quality="draft",
        max_iterations=1,
    ).report
    assert (report.settings.seed, report.settings.error, report.settings.max_iterations) == (3, 0.2, 1)
    assert report.status == "iteration-limit"
    assert len(report.iterations) == 1


def test_equal_input_gives_equal_bits(lit):
    """Catches threads, hash order, time or an observer that change a result."""
    attributes, arrays = lit._inner.to_record()
    heard = []
    for again in (
        isolux.solve(lamp(), error=0.2, threads=1),
        isolux.solve(lamp(), error=0.2, progress=heard.append),
    ):
        other_attributes, others = again._inner.to_record()
        assert list(arrays) == list(others)
        for name, array in arrays.items():
            assert array.tobytes() == others[name].tobytes(), name
            assert array.dtype == others[name].dtype
        assert _without_times(other_attributes) == _without_times(attributes)
    assert heard


def _without_times(attributes):
    values = json.loads(attributes)
    report = values["report"]
    del report["phases"], report["peak_memory"], report["settings"]["threads"]
    for iteration in report["iterations"]:
        del iteration["seconds"]
    for stage in report["stages"]:
        del stage["seconds"]
    return values


def test_progress_only_goes_forward():
    """Catches progress that jumps back, leaves [0, 1], or whose phases have no name."""
    states = []
    isolux.solve(lamp(), error=0.1, progress=states.append)
    done = [state.done for state in states]
    assert done == sorted(done)
    assert 0.0 <= done[0] <= done[-1] <= 1.0
    assert {state.phase for state in states} <= {
        "tree",
        "pilot",
        "root-links",
        "iteration",
        "interpolation",
        "balance",
    }
    assert max(state.links for state in states) > 0
    assert repr(states[0]).startswith("Progress(phase='")


@pytest.mark.parametrize("raised", [KeyboardInterrupt, isolux.Cancelled])
def test_a_callback_can_cancel(raised, tmp_path):
    """Catches a solve that goes on, or whose partial solution is lost or cannot be used."""

    def stop(state):
        if state.links:
            raise raised

    with pytest.raises(isolux.Cancelled) as caught:
        isolux.solve(lamp(), error=0.01, progress=stop)
    partial = caught.value.solution
    assert isinstance(caught.value, KeyboardInterrupt)
    assert partial.report.status == "cancelled"
    assert partial.radiosity_at([0], CENTRE).shape == (1, 3)
    partial.save(tmp_path / "partial.isolux")
    assert isolux.open(tmp_path / "partial.isolux").report == partial.report


def test_other_exceptions_of_a_callback_come_through():
    """Catches a defect in a caller's callback that is swallowed or taken for Ctrl-C."""

    def fail(_state):
        raise LookupError("in the callback")

    with pytest.raises(LookupError, match="in the callback"):
        isolux.solve(lamp(), error=0.01, progress=fail)


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_stops_a_solve_without_callback():
    """Catches a solve that is deaf to signals while Rust works."""
    before = signal.getsignal(signal.SIGALRM)
    signal.signal(signal.SIGALRM, lambda *_: os.kill(os.getpid(), signal.SIGINT))
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with pytest.raises(isolux.Cancelled) as caught:
            # Hours of work.
            isolux.solve(lamp(), error=1e-4)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert caught.value.solution.report.status == "cancelled"


def test_other_python_threads_run_meanwhile():
    """Catches a solve that holds the interpreter's lock."""
    code = """
import threading, isolux, sys
sys.path.insert(0, sys.argv[1])
from conftest import lamp
scene, ticks, over = lamp(), [], threading.Event()
def tick():
    while not over.wait(0.001):
        ticks.append(None)
threading.Thread(target=tick, daemon=True).start()
def stop(state):
    if len(ticks) > 50:
        raise KeyboardInterrupt
try:
    isolux.solve(scene, error=1e-4, progress=stop)
except isolux.Cancelled:
    print("counted")
over.set()
"""
    done = in_python(code, os.path.dirname(__file__))  # noqa: PTH120
    assert done.stdout == "counted\n", done.stderr


def test_scenes_that_cannot_be_solved():
    """Catches a black answer where an error is due."""
    with pytest.raises(NoLightError, match="scene 'furnace' has no light"):
        isolux.solve(box(emission=0.0))


def test_error_and_quality_exclude_each_other():
    """Catches one of two contradicting wishes silently ignored."""
    with pytest.raises(SettingsError, match="'quality' is \"draft\", but 'error' is 0.5"):
        isolux.solve(box(), quality="draft", error=0.5)


def test_render_gives_radiance(furnace):
    """Catches pictures of the wrong shape, row order or quantity: in the furnace every pixel is 2 / pi."""
    picture = furnace.render(eye=(0.5, 0.5, 0.9), at=(0.5, 0.5, 0.0), size=(16, 8), samples=1)
    assert picture.shape == (8, 16, 3)
    np.testing.assert_allclose(picture, 2.0 / math.pi, rtol=0.15)
    again = furnace.render(eye=(0.5, 0.5, 0.9), at=(0.5, 0.5, 0.0), size=(16, 8), samples=1, threads=1)
    assert picture.tobytes() == again.tobytes()


def test_render_looks_the_right_way_up(lit):
    """Catches a picture upside down: the lamp is the ceiling."""
    picture = lit.render(eye=(0.5, 0.5, 0.9), at=(0.5, 0.5, 0.0), vertical_angle=100.0, size=(9, 9))
    np.testing.assert_allclose(picture[0, 4], np.array([3.0, 2.0, 1.0]) / math.pi)
    assert picture[-1, 4, 0] < picture[0, 4, 0]


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        ({"camera": "hall"}, RenderError, "there is no camera 'hall'; the scene has: none"),
        ({"eye": (0, 0, 0), "at": (0, 0, 0)}, RenderError, "must be two points"),
        ({"eye": (0, 0, 0), "at": (0, 0, 1), "vertical_angle": 180.0}, RenderError, "180 degrees"),
        ({"size": (0, 4)}, RenderError, "0 x 4"),
        ({"samples": 0}, RenderError, "0 samples"),
        ({"eye": (0, 0, 0)}, ValueError, "both eye and at"),
        ({"eye": (0, 0), "at": (0, 0, 1)}, ValueError, r"eye: expected shape \(3,\), got \(2,\)"),
    ],
)
def test_views_that_make_no_sense(lit, arguments, kind, message):
    """Catches a picture of nothing where an error is due."""
    with pytest.raises(kind, match=message):
        lit.render(**arguments)


def test_gathers_find_the_light_of_a_closed_box(furnace, tmp_path):
    """Catches gathers of another quantity, and values that depend on threads."""
    view = {"eye": (0.5, 0.5, 0.9), "at": (0.5, 0.5, 0.0), "size": (12, 8), "gather": 64}
    picture = furnace.render(**view, threads=1)
    # Emission is found exactly; what was solved, another half, is off by 0.1 at most.
    np.testing.assert_allclose(picture, 2.0 / math.pi, rtol=0.05)
    np.testing.assert_array_equal(furnace.render(**view, threads=2), picture)
    for threads in (1, 2):
        furnace.bake(tmp_path / f"{threads}.ply", gather=16, threads=threads)
    assert (tmp_path / "1.ply").read_bytes() == (tmp_path / "2.ply").read_bytes()
    for rays in (0, -1, 65_537):
        with pytest.raises(RenderError, match=f"gather: {rays} rays"):
            furnace.render(gather=rays)
        with pytest.raises(RenderError, match=f"gather: {rays} rays"):
            furnace.bake(tmp_path / "a.ply", gather=rays)

    def stop(_progress):
        raise KeyError("enough")

    with pytest.raises(KeyError, match="enough"):
        furnace.bake(tmp_path / "a.ply", gather=16, progress=stop)
    assert not (tmp_path / "a.ply").exists()


def test_render_can_be_stopped(lit):
    """Catches a rendering that is deaf to its callback."""

    def stop(_state):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lit.render(size=(64, 64), progress=stop)


@pytest.mark.parametrize(("suffix", "magic"), [("glb", b"glTF"), ("ply", b"ply\n"), ("vtu", b"<?xml")])
def test_bake_writes_each_kind(lit, tmp_path, suffix, magic):
    """Catches a suffix that writes another kind, and files that do not say where they come from."""
    path = tmp_path / f"lit.{suffix.upper()}"
    lit.bake(path)
    content = path.read_bytes()
    assert content.startswith(magic)
    # VTK's text arrays hold the codes of their characters.
    codes = " ".join(str(byte) for byte in lit.scene.hash.encode())
    assert lit.scene.hash.encode() in content or codes.encode() in content
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]


def test_images_show_what_was_drawn(lit, tmp_path):
    """Catches rows or bands swapped, and exposure that is ignored."""
    picture = np.zeros((2, 3, 3))
    picture[0, 2] = [1.0, 0.0, 0.0]
    path = tmp_path / "picture.png"
    lit.write_image(path, picture, exposure=1.0)
    with Image.open(path) as opened:
        pixels = np.asarray(opened.convert("RGB"))
    assert pixels.shape == (2, 3, 3)
    assert pixels[0, 2, 0] > 100
    assert pixels[0, 2, 1] == 0
    assert pixels.sum() == pixels[0, 2, 0]
    lit.write_image(tmp_path / "picture.exr", picture)
    assert (tmp_path / "picture.exr").read_bytes().startswith(b"\x76\x2f\x31\x01")


def test_wrong_outputs_are_named(lit, tmp_path):
    """Catches files of a kind that nobody asked for, and nonsense written as a picture."""
    with pytest.raises(WriteError, match=r"lit.fbx: expected a name that ends in \.glb, \.ply or \.vtu"):
        lit.bake(tmp_path / "lit.fbx")
    with pytest.raises(WriteError, match=r"picture: expected a name that ends in \.png or \.exr"):
        lit.write_image(tmp_path / "picture", np.zeros((1, 1, 3)))
    with pytest.raises(ValueError, match=r"picture: expected shape \(height, width, 3\), got \(4, 4\)"):
        lit.write_image(tmp_path / "picture.png", np.zeros((4, 4)))
    with pytest.raises(WriteError, match=r"pixel \(0, 0\)"):
        lit.write_image(tmp_path / "picture.png", np.full((1, 1, 3), np.nan))
    with pytest.raises(RenderError, match="exposure -1"):
        lit.bake(tmp_path / "lit.glb", exposure=-1.0)
    assert list(tmp_path.iterdir()) == []


def test_links_of_the_fast_engine_close_the_furnace():
    """Catches means that weigh a receiver's points wrongly, and pairs that are linked twice or not at all.

    What a wall of a closed box sees adds up to 1; measured 0.9992 to 1.0005 here, up to 1.09 elsewhere with
    the points taken for corners.
    """
    solution = isolux.solve(box(), error=0.1, schedule="wavefront")
    links, elements = solution.links, solution.elements
    receiver = links["receiver"]
    assert (receiver < len(elements["area"])).all()
    flow = elements["area"][receiver] * links["form_factor"] * links["visibility"]
    sums = np.bincount(elements["polygon"][receiver], flow) / elements["area"][:6]
    assert sums == pytest.approx(np.ones(6), abs=2e-3)
