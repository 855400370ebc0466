"""Solution files: what was saved comes back bit for bit; what is wrong is named; nothing half-written."""

from __future__ import annotations

import os
import random
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from conftest import box, in_python

import isolux
from isolux.exceptions import SolutionFileError, WriteError
from isolux.io import solution_file as module


@pytest.fixture
def copy(solution_file, tmp_path):
    """A solution file that a test may damage."""
    return Path(shutil.copy(solution_file, tmp_path / "lamp.isolux"))


def test_everything_comes_back(lit, solution_file):
    """Catches numbers, settings or findings that a file loses or rounds."""
    again = isolux.open(solution_file)
    assert again.report == lit.report
    assert again.scene.hash == lit.scene.hash
    attributes, arrays = lit._inner.to_record()
    other_attributes, others = again._inner.to_record()
    assert other_attributes == attributes
    assert list(others) == list(arrays)
    for name, array in arrays.items():
        assert array.tobytes() == others[name].tobytes(), name
    faces, centre = np.arange(12), np.full((12, 3), 1 / 3)
    assert again.radiosity_at(faces, centre).tobytes() == lit.radiosity_at(faces, centre).tobytes()
    assert again.mesh["radiosity"].tobytes() == lit.mesh["radiosity"].tobytes()


def test_equal_solutions_are_equal_files(lit, solution_file, tmp_path):
    """Catches times or addresses that get into a file."""
    lit.save(tmp_path / "again.isolux")
    assert (tmp_path / "again.isolux").read_bytes() == solution_file.read_bytes()


def test_other_programs_can_read_it(lit, solution_file):
    """Catches a layout that only isolux understands."""
    with h5py.File(solution_file) as file:
        assert file.attrs["format"] == "isolux solution"
        assert file.attrs["scene_hash"] == lit.scene.hash
        assert file.attrs["version"] == isolux.__version__
        np.testing.assert_array_equal(file["links/source"], lit.links["source"])
        np.testing.assert_array_equal(file["elements/radiosity"], lit.elements["radiosity"])


def test_missing_files_and_folders_are_named(tmp_path):
    """Catches an error without the name of the file."""
    with pytest.raises(SolutionFileError, match=r"none.isolux: cannot be read: No such file"):
        isolux.open(tmp_path / "none.isolux")
    with pytest.raises(SolutionFileError, match=r"cannot be read: Is a directory"):
        isolux.open(tmp_path)


@pytest.mark.parametrize("content", [b"", b"glTF\x02\0\0\0", b"\x89HDF\r\n"])
def test_other_files_are_not_solutions(tmp_path, content):
    """Catches a scene given where a solution is due."""
    path = tmp_path / "room.glb"
    path.write_bytes(content)
    with pytest.raises(SolutionFileError, match=r"room.glb: not a solution file"):
        isolux.open(path)


def test_other_hdf5_files_are_not_solutions(tmp_path):
    """Catches any HDF5 file taken for a solution."""
    path = tmp_path / "weather.h5"
    with h5py.File(path, "w") as file:
        file["temperature"] = [1.0, 2.0]
    with pytest.raises(
        SolutionFileError, match=r"weather.h5: an HDF5 file, but not a solution: .*'format' is missing"
    ):
        isolux.open(path)
    with h5py.File(path, "a") as file:
        file.attrs["format"] = "weather"
    with pytest.raises(SolutionFileError, match="the attribute 'format' is 'weather'"):
        isolux.open(path)


@pytest.mark.parametrize("keep", [0.1, 0.5, 0.9, 0.999])
def test_truncated_files_are_damaged(copy, keep):
    """Catches an interrupted copy that opens as if it were whole."""
    content = copy.read_bytes()
    copy.write_bytes(content[: int(len(content) * keep)])
    with pytest.raises(SolutionFileError, match=r"lamp.isolux: damaged: .*truncated"):
        isolux.open(copy)


def test_future_versions_are_named(copy):
    """Catches a file of a later layout read as if it were of this one."""
    with h5py.File(copy, "a") as file:
        file.attrs["format_version"] = 99
        file.attrs["version"] = "9.0"
    with pytest.raises(
        SolutionFileError, match=r"'format_version' is 99; this .* reads 1 \(.*written by isolux 9.0\)"
    ):
        isolux.open(copy)


def names_of(path):
    names = []
    with h5py.File(path) as file:
        file.visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
    return names


def replace(path, name, array):
    """Another array under the name of one, with a right checksum."""
    with h5py.File(path, "a") as file:
        del file[name]
        file[name] = array
        file[name].attrs["crc32"] = module._checksum(np.asarray(array))


def test_every_dataset_is_needed_and_checked(solution_file, tmp_path):
    """Catches a dataset whose absence, type, shape or damage goes unnoticed, or is not named."""
    for name in names_of(solution_file):
        with h5py.File(solution_file) as file:
            original = file[name][...]
        wrong_shape = (
            np.concatenate([original.reshape(-1), original.reshape(-1)[:1]]) if original.size else np.zeros(3)
        )
        flipped = original.copy()
        if flipped.size:
            flipped.reshape(-1).view(np.uint8)[0] ^= 1
        for change in ("missing", "type", "shape", "damage"):
            if change == "damage" and not original.size:
                continue
            path = Path(shutil.copy(solution_file, tmp_path / "changed.isolux"))
            if change == "missing":
                with h5py.File(path, "a") as file:
                    del file[name]
            elif change == "type":
                replace(path, name, np.zeros(original.shape, np.float16))
            elif change == "shape":
                replace(path, name, wrong_shape.astype(original.dtype))
            else:
                with h5py.File(path, "a") as file:
                    file[name][...] = flipped
            with pytest.raises(SolutionFileError) as raised:
                isolux.open(path)
            message = str(raised.value)
            assert message.startswith(f"{path}: "), (name, change, message)
            assert "\n" not in message
            # Of two lengths that disagree, the other one may be named.
            assert f"'{name}'" in message or (change == "shape" and "'" in message), (name, change, message)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("links/source", lambda a: np.full_like(a, 2**31), "links/source"),
        ("links/receiver", lambda a: np.full_like(a, 2**31), "links/receiver"),
        ("elements/parent", lambda a: np.roll(a, 1), "elements"),
        ("elements/first_child", lambda a: np.full_like(a, 2**31), "elements"),
        ("elements/polygon", lambda a: np.full_like(a, 2**31), "elements"),
        ("elements/irradiance", lambda a: np.full_like(a, np.nan), "elements"),
        ("links/factors", lambda a: np.full_like(a, np.nan), "links/factors"),
        ("links/visibility", lambda a: np.full_like(a, 7.0), "links"),
        ("links/visibility", lambda a: np.full_like(a, np.nan), "links"),
        ("links/visibility", lambda a: np.full_like(a, -0.5), "links"),
        ("links/factors", lambda a: np.full_like(a, -1.5), "links/factors"),
        ("links/centre", lambda a: np.full_like(a, 2.0), "links/centre"),
        ("links/proven", lambda a: np.full_like(a, 2), "links/proven"),
    ],
)
def test_contradictions_are_named(copy, name, change, message):
    """Catches arrays that fit each other in shape but not in meaning: a crash or nonsense later."""
    with h5py.File(copy) as file:
        changed = change(file[name][...])
    replace(copy, name, changed)
    with pytest.raises(SolutionFileError, match=rf"lamp.isolux: .*{message}"):
        isolux.open(copy)


def test_scene_hash_is_checked(copy):
    """Catches geometry or materials swapped under a solution."""
    with h5py.File(copy, "a") as file:
        file.attrs["scene_hash"] = "0" * 64
    with pytest.raises(SolutionFileError, match="'scene_hash' is 0000"):
        isolux.open(copy)


def test_flipped_bytes_are_noticed(solution_file, lit, tmp_path):
    """Catches damage anywhere in the file that opens as other numbers, and what HDF5 raises of itself."""
    content = solution_file.read_bytes()
    chance = random.Random(1)  # noqa: S311
    path = tmp_path / "flipped.isolux"
    _, arrays = lit._inner.to_record()
    noticed = 0
    for _ in range(120):
        flipped = bytearray(content)
        flipped[chance.randrange(len(flipped))] ^= 1 << chance.randrange(8)
        path.write_bytes(flipped)
        try:
            opened = isolux.open(path)
        except SolutionFileError as error:
            assert str(path) in str(error)  # noqa: PT017
            noticed += 1
        else:
            # Padding between the parts of a file means nothing.
            _, others = opened._inner.to_record()
            assert all(array.tobytes() == others[name].tobytes() for name, array in arrays.items())
    assert noticed > 60


def test_a_folder_is_no_target(lit, tmp_path):
    """Catches a folder replaced by a file, and an error without its name."""
    (tmp_path / "room.isolux").mkdir()
    with pytest.raises(WriteError, match=r"room.isolux.*folder"):
        lit.save(tmp_path / "room.isolux")
    with pytest.raises(WriteError, match=r"absent.*lamp.isolux"):
        lit.save(tmp_path / "absent" / "lamp.isolux")
    assert [entry.name for entry in tmp_path.iterdir()] == ["room.isolux"]


FULL_DISK = """
import resource, sys, isolux
sys.path.insert(0, sys.argv[1])
from isolux.exceptions import WriteError
solution = isolux.open(sys.argv[2])
picture = solution.render(size=(64, 48))
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
for write in (lambda: solution.save(sys.argv[3]), lambda: solution.bake(sys.argv[3] + ".glb"),
              lambda: solution.write_image(sys.argv[3] + ".png", picture)):
    try:
        write()
    except WriteError as error:
        print(error)
"""


def test_a_full_disk_leaves_the_old_file(solution_file, tmp_path):
    """Catches half a file under the asked name, a lost old one, or leftovers, when the disk fills up."""
    target = tmp_path / "lamp.isolux"
    box_solution = isolux.solve(box(), error=0.5)
    box_solution.save(target)
    done = in_python(FULL_DISK, Path(__file__).parent, solution_file, target)
    lines = done.stdout.splitlines()
    assert len(lines) == 3, done.stderr
    assert all("cannot write" in line and "lamp.isolux" in line for line in lines)
    assert isolux.open(target).scene.name == "furnace"
    assert [entry.name for entry in tmp_path.iterdir()] == ["lamp.isolux"]


READ_ONLY = """
import os, sys, isolux
from isolux.exceptions import WriteError
solution = isolux.open(sys.argv[1])
if os.geteuid() == 0:
    os.seteuid(65534)
try:
    solution.save(sys.argv[2])
except WriteError as error:
    print(error)
"""


def test_a_read_only_folder_is_named(solution_file, tmp_path):
    """Catches a traceback, or an error that does not say where, for want of permission."""
    folder = tmp_path / "locked"
    folder.mkdir()
    folder.chmod(0o555)
    done = in_python(READ_ONLY, solution_file, folder / "lamp.isolux")
    assert "locked/lamp.isolux" in done.stdout, done.stderr
    assert "ermission denied" in done.stdout
    assert os.listdir(folder) == []  # noqa: PTH208


def test_a_replaced_file_keeps_its_permissions(lit, tmp_path):
    """Catches a shared result that becomes private, or a private one that becomes shared, by saving again."""
    path = tmp_path / "lamp.isolux"
    lit.save(path)
    path.chmod(0o640)
    lit.save(path)
    assert path.stat().st_mode & 0o777 == 0o640


def test_a_cancelled_solve_is_saved_as_it_stands(tmp_path):
    """Catches a partial file that takes long to write, loses numbers, or does not open."""

    def stop(state):
        if state.phase == "iteration":
            raise KeyboardInterrupt

    with pytest.raises(isolux.Cancelled) as raised:
        isolux.solve(box(), error=0.05, schedule="sequential", progress=stop)
    partial = raised.value.solution
    partial.save(tmp_path / "partial.isolux")
    with h5py.File(tmp_path / "partial.isolux") as file:
        assert all(file[name].compression is None for name in names_of(tmp_path / "partial.isolux"))
        assert file["mesh/irradiance"].shape == (0, 3)
    again = isolux.open(tmp_path / "partial.isolux")
    assert again.report == partial.report
    np.testing.assert_array_equal(again.mesh["irradiance"], partial.mesh["irradiance"])


def test_the_command_refuses_an_altered_file_in_one_line(isolux_command, copy, tmp_path):
    """Catches an altered file that is drawn all the same, or answered by a traceback."""
    with h5py.File(copy) as file:
        changed = file["links/source"][...]
    changed[0] = len(changed) + 2**20
    replace(copy, "links/source", changed)
    done = isolux_command("bake", copy, "-o", tmp_path / "lit.glb")
    assert done.returncode == 3
    assert "'links/source'" in done.stderr
    assert len(done.stderr.splitlines()) == 1
