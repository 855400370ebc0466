"""Scenes from arrays and files: what comes out is what went in, and what is wrong is named."""

from __future__ import annotations

import base64
import dataclasses
import io
import json
from pathlib import Path

import numpy as np
import pytest
from conftest import CUBE, ROOT, SIDES, box, lamp
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

import isolux
from isolux.exceptions import MissingExtraError, ReadError, SceneError

TRIANGLE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]


def test_quadrilaterals_become_two_rows_of_triangles():
    """Catches rows out of order: face indices would address other places than the caller means."""
    scene = lamp()
    cube = np.array(CUBE)
    expected = [cube[[q[0], q[k], q[k + 1]]] for q in SIDES.values() for k in (1, 2)]
    np.testing.assert_array_equal(scene.triangles, expected)
    assert scene.triangles.dtype == np.float64
    assert [scene.objects[row] for row in scene.triangle_objects] == [n for n in SIDES for _ in range(2)]


def test_triangles_are_made_once_and_cannot_be_written():
    """Catches a copy on every access, and a view that lets a caller change a scene."""
    scene = lamp()
    assert scene.triangles is scene.triangles
    for array in (scene.triangles, scene.triangles.base):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_mixed_faces_and_units():
    """Catches a -1 taken for a vertex, and lengths or areas left in the caller's unit."""
    vertices = [[0, 0, 0], [100, 0, 0], [100, 0, -100], [0, 0, -100], [0, 50, 0]]
    scene = isolux.Scene.from_arrays(vertices, [[0, 1, 2, 3], [0, 1, 4, -1]], metres_per_unit=0.01)
    assert scene.triangles.shape == (3, 3, 3)
    assert dataclasses.astuple(scene.polygons) == (2, 0, 1, 1, 0, 0)
    assert scene.area == pytest.approx(1.25)
    np.testing.assert_allclose(scene.bounds, [[0, 0, -1], [1, 0.5, 0]])


def test_lights_tell_their_power():
    """Catches power per area told as power, lights without their name, and materials lost on the way."""
    scene = lamp()
    (light,) = scene.lights
    assert (light.object, light.material, light.polygons) == ("ceiling", "lamp", 1)
    assert light.power == pytest.approx((3.0, 2.0, 1.0))
    assert light.total == pytest.approx(0.2126 * 3 + 0.7152 * 2 + 0.0722 * 1)
    assert scene.emitted_power == pytest.approx((3.0, 2.0, 1.0))
    assert scene.materials[1] == isolux.Material("lamp", (0.0, 0.0, 0.0), (3.0, 2.0, 1.0))
    assert scene.cameras == []


def test_equal_names_are_one_object():
    """Catches one object per face where the caller named faces."""
    names = ["shell", "shell", "shell", "lamp", "shell", "shell"]
    scene = isolux.Scene.from_arrays(CUBE, list(SIDES.values()), names=names)
    assert scene.objects == ["shell", "lamp"]
    assert [scene.objects[row] for row in scene.triangle_objects[::2]] == names


def test_hash_follows_geometry_and_materials():
    """Catches a hash that misses a change, so that a stale solution would pass for a fresh one."""
    hashes = {
        box().hash,
        box(reflectance=0.4).hash,
        box(emission=2.0).hash,
        box(two_sided=True).hash,
        lamp().hash,
    }
    assert len(hashes) == 5
    assert box().hash == box().hash
    assert all(len(value) == 64 for value in hashes)


def test_joined_triangles_are_told_apart():
    """Catches quadrilaterals of the caller counted as joined, and the other way round."""
    pair = [[0, 1, 2, -1], [0, 2, 3, -1]]
    square = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    for faces, joined in ((pair, 1), ([[0, 1, 2, 3]], 0)):
        polygons = isolux.Scene.from_arrays(square, faces).polygons
        assert (polygons.quadrilaterals, polygons.joined) == (1, joined)


def test_audit_names_the_object_of_every_fault():
    """Catches findings without their object, left out of `check`, or made up in a sound scene."""
    assert lamp().audit() == []
    sides = dict(SIDES)
    sides["floor"] = sides["floor"][::-1]
    scene = isolux.Scene.from_arrays(
        CUBE,
        list(sides.values()),
        [isolux.Material("paint"), isolux.Material("lamp", 0.0, 1.0)],
        list(sides),
        face_materials=[int(name == "ceiling") for name in sides],
    )
    assert scene.issues == []
    (issue,) = scene.audit()
    assert (issue.severity, issue.kind, issue.object) == ("warning", "flipped-face", "floor")
    assert issue.message.startswith("1 of 1 polygons")
    assert scene.check() == [issue]
    assert scene.audit() == [issue]


def test_check_returns_warnings_only():
    """Catches notes passed off as warnings, and invariants that building breaks."""
    scene = box(reflectance=1.5)
    assert [issue.kind for issue in scene.issues] == ["reflectance-clamped"]
    assert all(issue.severity == "warning" for issue in scene.check())
    assert scene.issues[0].object == "wall"


@pytest.mark.parametrize(
    ("changes", "kind", "message"),
    [
        ({"vertices": [[0.0, 0.0]]}, ValueError, r"vertices: expected shape \(n, 3\), got \(1, 2\)"),
        ({"vertices": [0.0, 1.0, 2.0]}, ValueError, r"vertices: expected shape \(n, 3\), got \(3,\)"),
        ({"vertices": [["a", "b", "c"]]}, ValueError, r"vertices: expected an array of real numbers"),
        ({"faces": [[0, 1]]}, ValueError, r"faces: expected shape \(m, 3\) or \(m, 4\), got \(1, 2\)"),
        ({"faces": [[0.0, 1.0, 2.0]]}, ValueError, r"faces: expected an array of integers: got float64"),
        (
            {"faces": [[0, 1, 9]]},
            SceneError,
            r"object 'object': face 0 names vertex 9, .*out of range \(there are 3\)",
        ),
        ({"faces": [[0, 1, -1]]}, SceneError, r"face 0 names vertex -1"),
        ({"face_materials": [0, 0]}, ValueError, r"face_materials has 2 rows, but faces has 1"),
        (
            {"face_materials": [7]},
            ValueError,
            r"face_materials\[0\] is 7, which is out of range \(there are 1\)",
        ),
        ({"face_objects": [-1]}, ValueError, r"face_objects\[0\] is -1, which is out of range"),
        ({"names": ["a", "b"]}, ValueError, r"names has 2 names for 1 faces"),
        ({"materials": [{}, {}]}, ValueError, r"face_materials is needed, because there are 2 materials"),
        ({"materials": [{"colour": 1}]}, ValueError, r"materials\[0\] has unknown fields: colour"),
        (
            {"materials": [{"reflectance": [1, 2]}]},
            ValueError,
            r"materials\[0\].reflectance: expected one number or",
        ),
        (
            {"materials": [{"emission": float("nan")}]},
            SceneError,
            r"material 'material 0': emission is not a finite",
        ),
        (
            {"vertices": [[0, 0, 0], [1, 0, 0], [0, float("inf"), 0]]},
            SceneError,
            r"face 0 has a coordinate that is",
        ),
        ({"metres_per_unit": 0.0}, SceneError, r"0 metres per unit is not a positive length"),
        ({"faces": np.zeros((0, 3), int)}, SceneError, r"no surfaces"),
        ({"vertices": [[0, 0, 0], [1, 0, 0], [2, 0, 0]]}, SceneError, r"no surfaces \(1 faces without area"),
    ],
)
def test_wrong_arrays_are_named(changes, kind, message):
    """Catches an argument that is wrong and taken, or blamed on another."""
    with pytest.raises(kind, match=message) as raised:
        isolux.Scene.from_arrays(**{"vertices": TRIANGLE, "faces": [[0, 1, 2]], **changes})
    assert "\n" not in str(raised.value)


finite = st.floats(-1e3, 1e3, allow_nan=False, width=32)


@settings(max_examples=60, deadline=None)
@given(
    vertices=st.lists(st.tuples(finite, finite, finite), min_size=3, max_size=12),
    data=st.data(),
)
def test_any_arrays_make_a_scene_or_an_error(vertices, data):
    """Catches a panic, a wrong row order or a broken invariant for slivers and crossing quads."""
    corner = st.integers(0, len(vertices) - 1)
    faces = data.draw(st.lists(st.tuples(corner, corner, corner, corner), min_size=1, max_size=8))
    try:
        scene = isolux.Scene.from_arrays(vertices, faces)
    except SceneError as error:
        assert "no surfaces" in str(error)  # noqa: PT017
        return
    scene.check()
    assert scene.triangles.shape == (2 * len(faces), 3, 3)
    expected = [
        [vertices[face[0]], vertices[face[k]], vertices[face[k + 1]]] for face in faces for k in (1, 2)
    ]
    np.testing.assert_array_equal(scene.triangles, expected)
    assert scene.triangle_objects.shape == (2 * len(faces),)


def test_load_reads_units_and_emission(scene_file):
    """Catches units or emission scale that do not reach the reader."""
    scene = isolux.load(scene_file)
    half = isolux.load(scene_file, metres_per_unit=0.5, emission_scale=2.0)
    assert scene.area == pytest.approx(6.0)
    assert half.area == pytest.approx(1.5)
    # A quarter of the area, twice the emission.
    assert half.emitted_power == pytest.approx([value / 2 for value in scene.emitted_power])
    assert scene.objects == list(SIDES)


def test_shipped_scenes_are_sound():
    """Catches a scene of ours that a change of the reader or of the checks makes unusable."""
    paths = sorted((Path(__file__).parents[2] / "scenes").glob("*.glb"))
    assert len(paths) >= 6
    for path in paths:
        scene = isolux.load(path)
        assert scene.check() == [], path.name
        assert scene.lights or scene.lamps, path.name


@pytest.mark.parametrize("name", ["missing.glb", "missing.obj", "missing.stl", "missing"])
def test_missing_files_are_named(tmp_path, name):
    """Catches a missing file told as another error, or without its name."""
    with pytest.raises(ReadError, match=rf"{name}: cannot be read"):
        isolux.load(tmp_path / name)


def test_other_kinds_go_through_trimesh(tmp_path):
    """Catches names, units or faces lost between trimesh and the scene."""
    path = tmp_path / "tetrahedron.off"
    path.write_text("OFF\n4 4 0\n0 0 0\n2 0 0\n0 2 0\n0 0 2\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n")
    bulb = isolux.Lamp("bulb", position=(0.25, 0.5, 2.0))
    scene = isolux.load(path, metres_per_unit=0.5, lamps=[bulb])
    assert scene.polygons.fronts == 4
    assert scene.lamps[0].position == (0.25, 0.5, 2.0)
    np.testing.assert_allclose(scene.bounds, [[0, 0, 0], [1, 1, 1]])


def test_unknown_and_broken_kinds_are_named(tmp_path):
    """Catches whatever trimesh raises coming through as it is."""
    for name in ("notes.txt", "broken.stl", "solved.isolux"):
        (tmp_path / name).write_text("nothing of the kind")
        with pytest.raises((ReadError, SceneError), match=name):
            isolux.load(tmp_path / name)


def test_missing_trimesh_names_the_extra(tmp_path, monkeypatch):
    """Catches an ImportError that leaves people guessing what to install."""
    monkeypatch.setitem(__import__("sys").modules, "trimesh", None)
    path = tmp_path / "part.stl"
    path.write_text("solid part\nendsolid part\n")
    with pytest.raises(MissingExtraError, match=r"part.stl: .*pip install 'isolux\[meshes\]'"):
        isolux.load(path)


def test_scenes_are_only_made_by_their_makers():
    """Catches a half-made object that crashes later."""
    with pytest.raises(TypeError, match="from_arrays"):
        isolux.Scene()
    with pytest.raises(TypeError, match=r"isolux\.solve"):
        isolux.Solution()


def test_watts_are_not_weighted_by_the_eye():
    """Catches a lamp in watts summed up by luminance, and a unit that nobody knows or looks at."""
    glow = [isolux.Material("glow", 0.5, (3.0, 0.0, 0.0))]
    by_unit = {
        unit: isolux.Scene.from_arrays(CUBE, list(SIDES.values()), glow, unit=unit) for unit in ("lm", "W")
    }
    assert [scene.unit for scene in by_unit.values()] == ["lm", "W"]
    assert by_unit["lm"].hash != by_unit["W"].hash
    assert by_unit["lm"].lights[0].total == pytest.approx(0.2126 * 18)
    assert by_unit["W"].lights[0].total == pytest.approx(6)
    with pytest.raises(ValueError, match="unit is 'lux': expected 'lm' or 'W'"):
        isolux.Scene.from_arrays(CUBE, list(SIDES.values()), glow, unit="lux")


def under_lamps(*lamps: isolux.Lamp) -> isolux.Scene:
    """A square of 4 m that faces up, in centimetres."""
    corners = [[-200, 0, -200], [-200, 0, 200], [200, 0, 200], [200, 0, -200]]
    return isolux.Scene.from_arrays(corners, [[0, 1, 2, 3]], lamps=lamps, metres_per_unit=0.01)


def test_lamps_from_arrays_light_the_scene():
    """Catches lamps that lose a value on the way, places in the caller's unit, degrees taken for radians."""
    bulb = isolux.Lamp("bulb", "point", position=(0, 100, 0), intensity=(100, 50, 25))
    spot = isolux.Lamp("spot", "spot", (0, 200, 0), (0, -3, 0), 10.0, inner_angle=20.0, outer_angle=60.0)
    sun = isolux.Lamp("sun", "sun", direction=(0, -1, 1), intensity=8.0)
    scene = under_lamps(bulb, spot, sun)
    read = scene.lamps
    assert [(lamp.name, lamp.kind) for lamp in read] == [("bulb", "point"), ("spot", "spot"), ("sun", "sun")]
    assert read[0].position == (0.0, 1.0, 0.0)
    assert read[0].intensity == (100.0, 50.0, 25.0)
    assert read[0].power == pytest.approx([400 * np.pi, 200 * np.pi, 100 * np.pi])
    assert (read[1].inner_angle, read[1].outer_angle) == pytest.approx((20.0, 60.0))
    inner, outer = np.cos(np.radians([20.0, 60.0]))
    assert read[1].power == pytest.approx([20 * np.pi * ((inner - outer) / 3 + 1 - inner)] * 3)
    assert read[2].power is None
    np.testing.assert_allclose(read[2].direction, np.array([0, -1, 1]) / np.sqrt(2))
    assert scene.lamp_power[0] == pytest.approx(read[0].power[0] + read[1].power[0])
    assert [(group.name, group.lamps) for group in scene.light_groups] == [
        ("bulb", 1),
        ("spot", 1),
        ("sun", 1),
    ]
    solution = isolux.solve(under_lamps(sun), error=0.05)
    np.testing.assert_allclose(solution.report.mean_irradiance, 8.0 / np.sqrt(2), rtol=1e-5)


def test_lamps_that_make_no_sense_are_named():
    """Catches a lamp of another type, kind, shape or cone that is taken, or refused without its name."""
    with pytest.raises(TypeError, match=r"lamps\[0\] is a dict: expected isolux.Lamp"):
        under_lamps({"name": "bulb"})
    with pytest.raises(ValueError, match="lamp 'odd': kind is 'laser': expected 'point', 'spot', 'sun'"):
        under_lamps(isolux.Lamp("odd", "laser"))
    with pytest.raises(ValueError, match=r"lamps\[0\].position: expected three numbers"):
        under_lamps(isolux.Lamp("odd", position=(1, 2)))
    with pytest.raises(SceneError, match="lamp 'odd': its cone is none"):
        under_lamps(isolux.Lamp("odd", "spot", inner_angle=50.0, outer_angle=40.0))
    with pytest.raises(isolux.exceptions.SettingsError, match="lamp 'bulb' has no surface"):
        isolux.solve(under_lamps(isolux.Lamp("bulb", position=(0, 1, 0))), schedule="sequential")


DOWNLIGHT, WASHER = (ROOT / "scenes" / f"{name}.ies" for name in ("downlight", "wall-washer"))


def test_luminaires_hang_as_they_are_turned():
    """Catches a luminaire that points or is turned another way than asked, whatever its flux."""
    for rotation, tilt, aim, plane in (
        (0, 0, (0, -1, 0), (1, 0, 0)),
        (90, 0, (0, -1, 0), (0, 0, -1)),
        (-90, 0, (0, -1, 0), (0, 0, 1)),
        (0, 90, (1, 0, 0), (0, 1, 0)),
        (90, 30, (0, -np.cos(np.pi / 6), -0.5), (0, 0.5, -np.cos(np.pi / 6))),
        (37, 180, (0, 1, 0), (-np.cos(np.radians(37)), 0, np.sin(np.radians(37)))),
    ):
        hung = isolux.Lamp.from_file(WASHER, (0, 100, 0), rotation=rotation, tilt=tilt)
        (lamp,) = under_lamps(hung).lamps
        np.testing.assert_allclose(lamp.direction, aim, atol=1e-12)
        np.testing.assert_allclose(lamp.side, plane, atol=1e-12)
        assert (lamp.name, lamp.kind, lamp.position) == ("wall-washer", "web", (0.0, 1.0, 0.0))


def test_luminaires_have_the_flux_of_their_files():
    """Catches flux that changes on the way into a scene, lost dimming, and a flux asked for that is not."""
    flux = isolux.read_photometry(WASHER).flux
    assert flux == pytest.approx(1500, rel=1e-3)
    hung = [
        isolux.Lamp.from_file(WASHER, (0, 100, 0)),
        isolux.Lamp.from_file(WASHER, (0, 100, 0), flux=800, name="new", rotation=20, tilt=70),
        isolux.Lamp.from_file(WASHER, (0, 100, 0), intensity=(1, 0.5, 0.25)),
    ]
    scene = under_lamps(*hung)
    assert [lamp.name for lamp in scene.lamps] == ["wall-washer", "new", "wall-washer#2"]
    assert [lamp.power for lamp in scene.lamps] == [
        pytest.approx([flux] * 3),
        pytest.approx([800] * 3),
        pytest.approx([flux, flux / 2, flux / 4]),
    ]


def test_luminaires_light_the_side_that_their_plane_points_to():
    """Catches a plane C0 that light does not follow, and another intensity than the file's under the lamp."""
    for rotation, bright in ((0, (1, 0, 0)), (90, (0, 0, -1)), (180, (-1, 0, 0)), (270, (0, 0, 1))):
        scene = under_lamps(isolux.Lamp.from_file(WASHER, (0, 100, 0), rotation=rotation))
        solution = isolux.solve(scene, error=0.02)
        places = np.array([np.array(bright) * 0.8, -np.array(bright) * 0.8, (0, 0, 0)])
        # The square has corners at -2 and 2: by its first triangle or its second.
        found = []
        for x, _, z in places:
            face, point = (0, (x, 0, z)) if z >= x else (1, (x, 0, z))
            corners = scene.triangles[face]
            weights = np.linalg.lstsq(np.vstack([corners.T, np.ones(3)]), [*point, 1], rcond=None)[0]
            found.append(solution.irradiance_at([face], [weights])[0, 0])
        luminaire = isolux.read_photometry(WASHER)
        slant = np.hypot(1, 0.8)
        wanted = [
            luminaire.intensity([0.8, 0, -1]) / slant**3,
            luminaire.intensity([-0.8, 0, -1]) / slant**3,
            luminaire.intensity([0, 0, -1]),
        ]
        np.testing.assert_allclose(found, wanted, rtol=0.04)
        assert found[0] > 2 * found[1]


def test_luminaires_that_cannot_be_hung_are_named(tmp_path):
    """Catches a broken file, a lamp without its photometry and watts of candela that pass in silence."""
    broken = tmp_path / "broken.ies"
    broken.write_text(WASHER.read_text().replace("1 1 20", "1 one 20"))
    with pytest.raises(isolux.exceptions.PhotometryError, match=r"broken\.ies: line \d+: expected "):
        isolux.Lamp.from_file(broken, (0, 0, 0))
    with pytest.raises(ValueError, match="lamp 'odd': kind is 'web': it needs a photometry"):
        under_lamps(isolux.Lamp("odd", "web"))
    hung = isolux.Lamp.from_file(DOWNLIGHT, (0, 100, 0))
    with pytest.raises(
        ValueError, match="lamp 'downlight': kind is 'spot': only kind 'web' takes a photometry"
    ):
        under_lamps(dataclasses.replace(hung, kind="spot"))
    assert under_lamps(hung).issues == []
    watts = isolux.Scene.from_arrays(TRIANGLE, [[0, 1, 2]], lamps=[hung], unit="W")
    assert [(issue.severity, issue.object) for issue in watts.issues] == [("warning", "downlight")]
    assert "candela count as W/sr" in watts.issues[0].message


def test_an_office_has_what_its_luminaires_throw(tmp_path):
    """Catches any break between a file with light profiles and its light: flux, inverse square, dimming."""
    path = ROOT / "scenes" / "office.glb"
    answers = json.loads(path.with_suffix(".json").read_text())["known_answers"]
    more = isolux.Lamp.from_file(DOWNLIGHT, (5.0, 2.7, 3.0), flux=500)
    scene = isolux.load(path, lamps=[more])
    # An angle every 2.5 degrees, linear in between.
    assert scene.lamp_power[0] == pytest.approx(answers[0]["value"] + 500, rel=1e-3)
    assert [lamp.kind for lamp in scene.lamps] == ["web"] * 6
    isolux.solve(scene, error=0.03).save(tmp_path / "office.isolux")
    opened = isolux.open(tmp_path / "office.isolux")
    assert opened.matches(scene)
    # Light of one lamp alone, and none that comes by way of other surfaces, at its foot on either triangle.
    alone = opened.relight(
        {lamp.name: float(lamp.name == "downlight 3") for lamp in scene.lamps},
        reflectance={material.name: 0.0 for material in scene.materials},
    )
    for face in (0, 1):
        corners = np.vstack([scene.triangles[face].T, np.ones(3)])
        weights = np.linalg.lstsq(corners, [3.5, 0, 1.2, 1], rcond=None)[0]
        if weights.min() >= 0:
            found = alone.irradiance_at([face], [weights])[0, 0]
            break
    # The asked error is that of all surfaces together; next to the peak light is smooth.
    assert found == pytest.approx(answers[1]["value"], rel=0.01)


def screen(path: Path, picture: list[list[int]]) -> Path:
    """A glTF file of a floor of 2 m and, upright at its end, a screen of 2 m x 1 m, of 100 cd/m2 at most."""
    rows = np.repeat(np.array(picture, np.uint8)[:, :, None], 3, axis=2)
    png = io.BytesIO()
    Image.fromarray(rows).save(png, "png")
    floor = [(-1, 0, 0), (-1, 0, 2), (1, 0, 2), (1, 0, 0)]
    upright = [(-1, 0, 0), (1, 0, 0), (1, 1, 0), (-1, 1, 0)]
    corners = np.array([*floor, *upright], "<f4").tobytes()
    uv = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], "<f4").tobytes()
    indices = np.array([0, 1, 2, 0, 2, 3], "<u2").tobytes()
    data = corners + uv + indices
    views = [(0, 48), (48, 48), (96, 32), (128, 12)]

    def uri(mime: str, content: bytes) -> str:
        return f"data:{mime};base64,{base64.b64encode(content).decode()}"

    def mesh(material: int, **attributes: int) -> dict[str, object]:
        return {"primitives": [{"attributes": attributes, "indices": 3, "material": material}]}

    vectors = [{"bufferView": view, "componentType": 5126, "count": 4, "type": "VEC3"} for view in (0, 1)]
    document = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"name": "floor", "mesh": 0}, {"name": "screen", "mesh": 1}],
        "meshes": [mesh(0, POSITION=0), mesh(1, POSITION=1, TEXCOORD_0=2)],
        "materials": [
            {
                "name": "grey",
                "pbrMetallicRoughness": {"baseColorFactor": [0.5] * 3 + [1], "metallicFactor": 0},
            },
            {
                "name": "glow",
                "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0},
                "emissiveFactor": [1, 1, 1],
                "emissiveTexture": {"index": 0},
                "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 100}},
            },
        ],
        "textures": [{"source": 0}],
        "images": [{"uri": uri("image/png", png.getvalue())}],
        "accessors": [
            *vectors,
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 3, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteOffset": at, "byteLength": size} for at, size in views],
        "buffers": [{"byteLength": len(data), "uri": uri("application/octet-stream", data)}],
        "extensionsUsed": ["KHR_materials_emissive_strength"],
    }
    path.write_text(json.dumps(document))
    return path


def test_a_screen_lights_like_polygons_of_its_pictures_parts(tmp_path):
    """Catches a screen that lights the floor by its mean: it is as four polygons of one value each."""
    picture = [[0, 255], [188, 64]]
    read = isolux.load(screen(tmp_path / "screen.gltf", picture))
    assert read.check() == []
    codes = np.array(picture) / 255
    linear = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)
    materials, faces = [isolux.Material("grey", 0.5)], [[0, 1, 2, 3]]
    corners = [[-1, 0, 0], [-1, 0, 2], [1, 0, 2], [1, 0, 0]]
    for row in (0, 1):
        for column in (0, 1):
            x, y, first = column - 1, 0.5 * (1 - row), len(corners)
            corners += [[x, y, 0], [x + 1, y, 0], [x + 1, y + 0.5, 0], [x, y + 0.5, 0]]
            faces.append([first, first + 1, first + 2, first + 3])
            materials.append(isolux.Material(f"{row}{column}", 0.0, 100 * np.pi * linear[row, column]))
    split = isolux.Scene.from_arrays(corners, faces, materials, face_materials=range(5))
    # Means of a texture are taken to 1e-3 or better.
    np.testing.assert_allclose(read.emitted_power, split.emitted_power, rtol=1e-3)
    mean = np.pi * 100 * linear.mean()
    even = [materials[0], *(isolux.Material(entry.name, 0.0, mean) for entry in materials[1:])]
    flat = isolux.Scene.from_arrays(corners, faces, even, face_materials=range(5))
    solved = [isolux.solve(scene, error=0.01) for scene in (read, split, flat)]
    weights = np.random.default_rng(1).dirichlet([1, 1, 1], 500)
    found, wanted, by_mean = (
        np.concatenate([solution.irradiance_at([face] * 500, weights)[:, 0] for face in (0, 1)])
        for solution in solved
    )
    # Each is within 1 % of the truth, of their mean.
    assert np.sqrt(np.mean((found - wanted) ** 2)) < 0.02 * wanted.mean()
    assert np.sqrt(np.mean((by_mean - wanted) ** 2)) > 0.2 * wanted.mean()


def test_light_units_are_told_by_name():
    """Catches units that do not reach the reader, or a name that is none."""
    path = ROOT / "scenes" / "studio.glb"
    spec, blender = isolux.load(path), isolux.load(path, light_units="blender")
    assert blender.lamp_power[1] / spec.lamp_power[1] == pytest.approx(683 / (4 * np.pi))
    assert blender.lamps[2].intensity[0] == pytest.approx(683 * 2000)
    with pytest.raises(ValueError, match="light_units is 'lumen'"):
        isolux.load(path, light_units="lumen")


def test_a_studio_is_solved_relit_and_drawn(tmp_path):
    """Catches any break between a file with lamps and its picture: sun on the floor by day, none by night."""
    scene = isolux.load(ROOT / "scenes" / "studio.glb")
    solution = isolux.solve(scene, error=0.1)
    solution.save(tmp_path / "studio.isolux")
    opened = isolux.open(tmp_path / "studio.isolux")
    assert [lamp.name for lamp in opened.scene.lamps] == ["bulb", "table spot", "sun"]
    night = opened.relight({"sun": 0.0})
    assert night.scene.lamps[2].intensity == (0.0, 0.0, 0.0)
    # Down on the patch of the sun: 2,000 lux from 40 degrees, reflected by 0.45.
    view = {"eye": (1.3, 1.0, 2.0), "at": (1.3, 0.0, 2.001), "size": (8, 8)}
    day, dark = solution.render(**view), night.render(**view)
    direct = 2000 * np.cos(np.radians(40)) * 0.45 / np.pi
    assert direct < day[4, 4, 0] < 1.3 * direct
    assert dark[4, 4, 0] < 0.3 * direct
