"""Every error variant of the Rust side has one exception class and one tested message."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from isolux import _isolux, exceptions

ROOT = Path(__file__).parents[2]

EXPECTED = {
    "SettingsError::Value": ("SettingsError", "setting 'error' is -1: expected a number above 0"),
    "SettingsError::Lamps": (
        "SettingsError",
        "setting 'schedule' is sequential: lamp 'sun' has no surface, "
        "which only schedule 'wavefront' can solve",
    ),
    "SettingsError::Sky": (
        "SettingsError",
        "setting 'schedule' is sequential: the scene has a sky, which only schedule 'wavefront' can solve",
    ),
    "SettingsError::Schedule": ("SettingsError", "setting 'rays' is 256: belongs to schedule 'sequential'"),
    "SceneError::Empty": (
        "SceneError",
        "the scene has no surfaces (2 faces without area and 1 without opacity or emission were dropped)",
    ),
    "SceneError::NotFinite": (
        "SceneError",
        "object 'lamp': face 3 has a coordinate that is not a finite number",
    ),
    "SceneError::CornerCount": ("SceneError", "object 'lamp': face 3 has 5 corners, expected 3 or 4"),
    "SceneError::OutOfRange": ("SceneError", "material 9 of 'lamp' is out of range (there are 4)"),
    "SceneError::MaterialNotFinite": ("SceneError", "material 'paint': reflectance is not a finite number"),
    "SceneError::MaskSize": (
        "SceneError",
        "material 'leaf': mask 0 has 3 texels, expected 2 x 2, at least 1",
    ),
    "SceneError::Lamp": ("SceneError", "lamp 'sun': it has no direction"),
    "SceneError::Sky": ("SceneError", "the sky: its zenith has no direction"),
    "SceneError::Unit": ("SceneError", "-1 metres per unit is not a positive length"),
    "SceneError::TooLarge": ("SceneError", "20 polygons are more than the 10 that element paths can name"),
    "SceneViolation": ("InternalError", "polygon 7: violated: unit normal"),
    "SolveError::Settings": ("SettingsError", "setting 'error' is -1: expected a number above 0"),
    "SolveError::Scene": (
        "SceneError",
        "the scene has no surfaces (0 faces without area and 0 without opacity or emission were dropped)",
    ),
    "SolveError::NoLight": (
        "NoLightError",
        "scene 'cave' has no light: no surface emits, and there is no lamp and no sky",
    ),
    "SolveError::Internal": ("InternalError", "link 3 has no receiver"),
    "RecordError::Missing": ("SolutionFileError", "'links/source' is missing"),
    "RecordError::Shape": ("SolutionFileError", "'links/source' has shape (3,), expected shape (4,)"),
    "RecordError::Inconsistent": ("SolutionFileError", "'links/source': names element 9 of 4"),
    "RecordError::Format": (
        "SolutionFileError",
        "file format 9 is not supported (this version reads up to 1)",
    ),
    "RelightError::Schedule": (
        "NotRelightableError",
        "a solution of schedule 'sequential' cannot be relit: solve with schedule 'wavefront'",
    ),
    "RelightError::Unprepared": (
        "NotRelightableError",
        "the solution cannot be relit: it was cancelled; solve the scene again",
    ),
    "RelightError::NoSuchGroup": (
        "RelightError",
        "there is no light group 'lmap'; the solution has: lamp",
    ),
    "RelightError::Weight": ("RelightError", "weight of 'lamp' is -1: expected a number of 0 or more"),
    "RelightError::NoSuchMaterial": ("RelightError", "there is no material 'oka'; the scene has: oak"),
    "RelightError::Reflectance": (
        "RelightError",
        "reflectance of 'oak' is 1.5: expected at least 0, below 1, and at most the opacity, 1",
    ),
    "RelightError::Settings": ("SettingsError", "setting 'error' is -1: expected a number above 0"),
    "RelightError::Cancelled": ("KeyboardInterrupt", "cancelled"),
    "RenderError::NoSuchCamera": ("RenderError", "there is no camera 'hall'; the scene has: attic"),
    "RenderError::View": ("RenderError", "view: eye and target coincide"),
    "RenderError::Gather": ("RenderError", "gather: 0 rays (1 to 65536)"),
    "RenderError::Threads": ("RenderError", "threads: 1000000, but the system grants fewer"),
    "RenderError::NoSuchSide": ("RenderError", "side 12 is out of range: the scene has 12"),
    "RenderError::Cancelled": ("KeyboardInterrupt", "cancelled"),
    "MeasureError::Point": ("MeasureError", "points[3] is [NaN, NaN, NaN]: expected finite coordinates"),
    "MeasureError::Direction": ("MeasureError", "normals[3] is [0, 0, 0]: expected a unit vector"),
    "MeasureError::Count": ("MeasureError", "2 receivers for 3 points"),
    "MeasureError::Rays": ("MeasureError", "samples: 0 rays (8 to 65536)"),
    "MeasureError::Threads": ("MeasureError", "threads: 1000000, but the system grants fewer"),
    "MeasureError::Cancelled": ("KeyboardInterrupt", "cancelled"),
    "ReadError::Io": ("ReadError", "room.glb: cannot be read: no such file"),
    "ReadError::UnknownFormat": (
        "ReadError",
        "room.glb: unknown format (.xyz): .glb, .gltf and .obj are read natively, other formats through the "
        'Python extra `meshes` (pip install "isolux[meshes]")',
    ),
    "ReadError::Malformed": ("ReadError", "room.glb: not a valid GLB file: wrong magic"),
    "ReadError::Unsupported": (
        "ReadError",
        "room.glb: requires glTF 1.0, which isolux does not read: export as 2.0",
    ),
    "ReadError::Buffer": ("ReadError", "room.glb: buffer 0: is missing"),
    "ReadError::Accessor": (
        "ReadError",
        "room.glb: object 'lamp': POSITION (accessor 3): ends beyond its buffer",
    ),
    "ReadError::Index": (
        "ReadError",
        "room.glb: object 'lamp': face 3: vertex 9 is out of range (there are 4)",
    ),
    "ReadError::Reference": ("ReadError", "room.glb: node 'lamp' names mesh 9, but there are 4"),
    "ReadError::Lamp": ("ReadError", "room.glb: lamp 'spot': a.ies: line 4: expected x"),
    "ReadError::Syntax": ("ReadError", "room.glb: line 12: no number"),
    "ReadError::TooLarge": (
        "ReadError",
        "room.glb: object 'lamp': 20 faces are more than the 10 that are read",
    ),
    "PhotometryError::Io": ("PhotometryError", "lamp.ies: cannot be read: no such file"),
    "PhotometryError::TooLarge": (
        "PhotometryError",
        "lamp.ies: has 20 bytes, more than the 10 that are read",
    ),
    "PhotometryError::UnknownFormat": (
        "PhotometryError",
        "lamp: line 1: expected an IES file (with a line 'TILT=') or an EULUMDAT file, found 'solid'",
    ),
    "PhotometryError::Malformed": (
        "PhotometryError",
        "lamp.ies: line 12: expected the input watts, found 'x'",
    ),
    "PhotometryError::Scale": ("PhotometryError", "lamp.ies: cannot be scaled to -1 lm: it has none"),
    "WriteError::Empty": ("WriteError", "scene 'cave' has no triangles to write"),
    "WriteError::Mismatch": (
        "InternalError",
        "the mesh does not belong to scene 'cave': number of vertices is 3, expected 4",
    ),
    "WriteError::OutOfRange": ("InternalError", "image 9 of 'paint' is out of range (there are 4)"),
    "WriteError::NotFinite": ("WriteError", "radiosity of 'lamp' is inf, which the file cannot hold"),
    "WriteError::Exposure": ("RenderError", "exposure -1 is not a positive finite number"),
    "WriteError::White": ("RenderError", "white point 0 is not a positive finite number"),
    "WriteError::ImageType": (
        "WriteError",
        "image 'wood' (image/gif) is neither PNG nor JPEG by its first bytes",
    ),
    "WriteError::TooLarge": ("WriteError", "vertices: 20 is more than the 10 that PLY can hold"),
    "WriteError::PictureSize": ("WriteError", "a picture of 4 x 3 has 11 pixels"),
    "WriteError::Pixel": ("WriteError", "pixel (2, 1) is [NaN, 0, 0], which no picture can hold"),
    "WriteError::Encode": ("WriteError", "EXR encoder: no pixels"),
    "WriteError::File": ("WriteError", 'cannot write "lit.glb": write: no storage space'),
}

SAMPLES = dict(_isolux._error_samples())

#: Where each enum is defined.
SOURCES = {
    "SceneError": "crates/core/src/scene/issue.rs",
    "SolveError": "crates/isolux/src/error.rs",
    "RecordError": "crates/isolux/src/error.rs",
    "RelightError": "crates/isolux/src/error.rs",
    "RenderError": "crates/isolux/src/error.rs",
    "ReadError": "crates/formats/src/read/error.rs",
    "WriteError": "crates/formats/src/write/error.rs",
    "PhotometryError": "crates/photometry/src/error.rs",
}


@pytest.mark.parametrize("variant", EXPECTED)
def test_variant_has_its_class_and_message(variant):
    """Catches a variant that changes its class, or loses the offender from its message."""
    name, message = EXPECTED[variant]
    error = SAMPLES[variant]
    assert type(error).__name__ == name
    assert str(error) == message


@pytest.mark.parametrize("enum", SOURCES)
def test_no_variant_is_left_out(enum):
    """Catches a new variant without a tested message."""
    source = (ROOT / SOURCES[enum]).read_text()
    body = re.search(rf"pub enum {enum} {{(.*?)^}}", source, re.DOTALL | re.MULTILINE)
    assert body is not None
    variants = re.findall(r"^    ([A-Z]\w+)[ ({,]", body[1], re.MULTILINE)
    assert {f"{enum}::{variant}" for variant in variants} == {
        variant for variant in EXPECTED if variant.startswith(f"{enum}::")
    }


def test_classes_are_what_people_catch():
    """Catches a class that leaves its family: `except ValueError` and `except IsoluxError` are promises."""
    for name in exceptions.__all__:
        kind = getattr(exceptions, name)
        assert issubclass(kind, KeyboardInterrupt if name == "Cancelled" else exceptions.IsoluxError)
        assert kind.__doc__
    for kind in (
        exceptions.SceneError,
        exceptions.SettingsError,
        exceptions.RenderError,
        exceptions.PhotometryError,
    ):
        assert issubclass(kind, ValueError)
    assert issubclass(exceptions.NoLightError, exceptions.SceneError)
    assert issubclass(exceptions.MissingExtraError, ImportError)
    assert not issubclass(exceptions.Cancelled, Exception)
