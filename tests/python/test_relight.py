"""Relighting as people do it: mixes add up, files keep them, the command names what does not exist."""

from __future__ import annotations

import json
import os
import re
import signal
import time

import numpy as np
import pytest
from conftest import CUBE, ROOT, SIDES, lamp

import isolux
from isolux.exceptions import NotRelightableError, RelightError

ERROR = 0.1


def two_lamps(floor: object = 0.5) -> isolux.Scene:
    """A closed box whose ceiling and left side emit."""
    materials = [
        isolux.Material("paint", 0.5),
        isolux.Material("glow", 0.0, 2.0),
        isolux.Material("glass", 0.2, (3.0, 1.0, 0.5)),
        isolux.Material("oak floor", floor),
    ]
    return isolux.Scene.from_arrays(
        CUBE,
        list(SIDES.values()),
        materials,
        list(SIDES),
        face_materials=[2, 0, 3, 1, 0, 0],
        name="two lamps",
    )


@pytest.fixture(scope="module")
def both() -> isolux.Solution:
    return isolux.solve(two_lamps(), error=ERROR, schedule="wavefront")


@pytest.fixture(scope="module")
def saved(both, tmp_path_factory):
    path = tmp_path_factory.mktemp("relight") / "both.isolux"
    both.save(path)
    return path


@pytest.fixture(scope="module")
def sequential() -> isolux.Solution:
    return isolux.solve(lamp(), error=0.3, schedule="sequential")


def light(solution: isolux.Solution) -> np.ndarray:
    faces = np.repeat(np.arange(12), 3)
    inner = np.tile([[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]], (12, 1))
    return solution.irradiance_at(faces, inner)


def test_lamps_add_up(both):
    """Catches a mix that is no sum, weights that are not told of, and colours that go to the wrong band."""
    groups = both.light_groups
    assert [group.name for group in groups] == ["left", "ceiling"]
    assert groups[0].power == pytest.approx((3.0, 1.0, 0.5))
    assert groups[1].total == pytest.approx(2.0)
    one, other = both.relight({"left": 0.0}), both.relight({"ceiling": 0})
    np.testing.assert_allclose(light(one) + light(other), light(both), rtol=1e-5)
    half = both.relight({"left": 0.5, "ceiling": 0.5})
    np.testing.assert_allclose(2 * light(half), light(both), rtol=1e-5)
    assert half.report.error_estimate == both.report.error_estimate
    assert [group.weight for group in one.light_groups] == [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0)]
    assert one.report.relit.weights[0].group == "left"
    assert one.report.relit.measured
    assert not one.report.relit.carried_over
    claimed = one.report.error_estimate
    assert claimed != both.report.error_estimate
    assert 0 < claimed.total < 2 * ERROR
    assert claimed.dark > 0
    red = both.relight({"left": 0.0, "ceiling": (1.0, 0.0, 0.0)})
    np.testing.assert_allclose(light(red)[:, 0], light(one)[:, 0], rtol=1e-6)
    assert not light(red)[:, 1:].any()


def test_a_relit_solution_is_a_solution(both, tmp_path):
    """Catches a relit solution that cannot be saved, opened, drawn, baked or relit, and a wrong way back."""
    evening = both.relight({"ceiling": 0.2})
    evening.save(tmp_path / "evening.isolux")
    again = isolux.open(tmp_path / "evening.isolux")
    assert again.report == evening.report
    assert again.matches(both.scene)
    assert again.scene.hash != both.scene.hash
    np.testing.assert_array_equal(light(again), light(evening))
    again.bake(tmp_path / "evening.glb")
    assert again.render(eye=(0.5, 0.5, 0.9), at=(0.5, 0.5, 0), size=(8, 6), samples=1).max() > 0
    back = again.relight()
    np.testing.assert_array_equal(light(back), light(both))
    assert back.report.relit is None
    assert back.scene.hash == both.scene.hash
    dark = again.relight({"left": 0, "ceiling": 0})
    assert not light(dark).any()
    dark.save(tmp_path / "dark.isolux")
    reopened = isolux.open(tmp_path / "dark.isolux")
    reopened.bake(tmp_path / "dark.glb")
    np.testing.assert_array_equal(light(reopened.relight()), light(both))


def test_other_reflectances_are_those_of_another_scene(both):
    """Catches a gather with the old reflectances, and an estimate of what it was before."""
    dark = both.relight({"left": 0.5}, reflectance={"oak floor": (0.1, 0.2, 0.05)})
    report = dark.report
    assert report.relit.measured
    assert not report.relit.carried_over
    assert report.error_estimate != report.relit.error_estimate
    assert report.relit.reflectance[0].reflectance == (0.1, 0.2, 0.05)
    scene = two_lamps((0.1, 0.2, 0.05))
    anew = isolux.solve(scene, error=ERROR, schedule="wavefront").relight({"left": 0.5})
    off = np.sqrt(np.mean((light(dark) - light(anew)) ** 2)) / light(anew).mean()
    assert off < 2 * ERROR
    assert not dark.matches(scene)
    assert dark.matches(both.scene)


def test_what_makes_no_sense_is_named(both, sequential):
    """Catches errors that do not say what exists."""
    with pytest.raises(RelightError, match=r"no light group 'lmap'; the solution has: left, ceiling"):
        both.relight({"lmap": 1.0})
    with pytest.raises(RelightError, match=r"weight of 'left' is -1"):
        both.relight({"left": -1})
    with pytest.raises(RelightError, match=r"weight of 'left' is \(1, 2\): expected one number or three"):
        both.relight({"left": (1, 2)})
    with pytest.raises(
        RelightError, match=r"no material 'oak'; the scene has: paint, glow, glass, oak floor"
    ):
        both.relight(reflectance={"oak": 0.5})
    with pytest.raises(RelightError, match=r"reflectance of 'paint' is 1"):
        both.relight(reflectance={"paint": 1.0})
    with pytest.raises(NotRelightableError, match=r"schedule 'sequential' cannot be relit"):
        sequential.relight({"ceiling": 0.5})


@pytest.mark.usefixtures("interruptible")
def test_ctrl_c_ends_the_work():
    """Catches Ctrl-C that is heard while the work goes on in the background, for nobody."""
    solution = isolux.solve(two_lamps(), error=0.01, threads=1)
    start = time.process_time()
    solution.relight(reflectance={"paint": 0.4}, threads=1)
    whole = time.process_time() - start
    before = signal.getsignal(signal.SIGALRM)
    signal.signal(signal.SIGALRM, lambda *_: os.kill(os.getpid(), signal.SIGINT))
    signal.setitimer(signal.ITIMER_REAL, 0.05 * whole)
    try:
        with pytest.raises(KeyboardInterrupt):
            solution.relight(reflectance={"paint": 0.3}, threads=1)
        start = time.process_time()
        time.sleep(3 * whole)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert time.process_time() - start < 0.5 * whole
    solution.relight(reflectance={"paint": 0.3})


def test_one_lamp_keeps_nothing_twice(tmp_path):
    """Catches columns that are stored where there is one lamp, whose light is all of it."""
    one = isolux.solve(lamp(), error=ERROR, schedule="wavefront")
    assert not [name for name in one._inner.to_record()[1] if name.startswith("groups/")]
    off = one.relight({"ceiling": 0.0})
    off.save(tmp_path / "off.isolux")
    np.testing.assert_array_equal(light(isolux.open(tmp_path / "off.isolux").relight()), light(one))


def test_the_command_relights(isolux_command, both, saved, tmp_path):
    """Catches an option that does not reach the solution, and a table or JSON without weights."""
    out = tmp_path / "evening.isolux"
    done = isolux_command("relight", saved, "--set", "ceiling=0.25", "--set", "left=1,0.5,0", "-o", out)
    assert done.returncode == 0, done.stderr
    assert "0.25" in done.stdout
    assert "1 0.5 0" in done.stdout
    wanted = both.relight({"ceiling": 0.25, "left": (1, 0.5, 0)})
    np.testing.assert_array_equal(light(isolux.open(out)), light(wanted))
    painted = isolux_command(
        "relight", out, "--reflectance", "oak floor=0.1", "-o", tmp_path / "p.isolux", "--json", "-"
    )
    relit = json.loads(painted.stdout)["report"]["relit"]
    assert relit["reflectance"] == [{"material": "oak floor", "reflectance": [0.1, 0.1, 0.1]}]
    assert relit["weights"][0] == {"group": "left", "weight": [1.0, 1.0, 1.0]}
    table = isolux_command("relight", out, "--reflectance", "oak floor=0.1", "-o", tmp_path / "p.isolux")
    assert "oak floor 0.1" in table.stdout
    assert "by the largest weight" not in done.stdout


def test_the_command_refuses(isolux_command, sequential, scene_file, saved, tmp_path):
    """Catches codes and messages that do not say whose fault it is; nothing is written."""
    out = tmp_path / "none.isolux"
    sequential.save(tmp_path / "sequential.isolux")

    def refused(code, *arguments):
        done = isolux_command("relight", *arguments, "-o", out)
        assert done.returncode == code, done.stderr
        assert len(done.stderr.splitlines()) == 1
        assert not out.exists()
        return done.stderr

    assert "no light group 'sun'; the solution has: left, ceiling" in refused(2, saved, "--set", "sun=0")
    for text in ("left", "left=", "=1", "left=1,2", "left=red"):
        assert f"'{text}' is neither" in refused(2, saved, "--set", text)
    assert "given twice" in refused(2, saved, "--set", "left=1", "--set", "left=0")
    assert "weight of 'left' is -1" in refused(2, saved, "--set", "left=-1")
    assert "schedule 'sequential' cannot be relit" in refused(
        3, tmp_path / "sequential.isolux", "--set", "ceiling=0"
    )
    assert "solved for another scene than" in refused(3, saved, "--scene", scene_file)


def test_the_command_knows_its_scene(isolux_command, scene_file, tmp_path):
    """Catches a check that refuses the very scene; and groups that inspect does not list."""
    solved = isolux_command(
        "solve", scene_file, "--schedule", "wavefront", "--error", "0.3", "-o", tmp_path / "box.isolux"
    )
    assert solved.returncode == 0, solved.stderr
    assert "1, by object" in solved.stdout
    for source, target in (("box", "half"), ("half", "dark")):
        done = isolux_command(
            "relight",
            tmp_path / f"{source}.isolux",
            "--scene",
            scene_file,
            "--set",
            "ceiling=0.5",
            "-o",
            tmp_path / f"{target}.isolux",
        )
        assert done.returncode == 0, done.stderr
    seen = json.loads(isolux_command("inspect", scene_file, "--json", "-").stdout)["light_groups"]
    assert seen["by"] == "object"
    assert [group["name"] for group in seen["groups"]] == ["ceiling"]
    assert seen["groups"][0]["total"] == pytest.approx(isolux.load(scene_file).lights[0].total)
    assert "light group" in isolux_command("inspect", scene_file).stdout


def test_lights_named_in_the_documents_exist():
    """Catches a page whose commands are refused, since the room that comes along has no such lamp."""
    groups = {group.name for group in isolux.load(ROOT / "scenes" / "room.glb").light_groups}
    for page in ("relight", "lighting-report"):
        text = (ROOT / "docs" / "how-to" / f"{page}.md").read_text(encoding="utf-8")
        named = set(re.findall(r'--set "([^"=]+)=', text))
        named.update(*(re.findall(r'"([^"]+)": [\d(]', line) for line in text.splitlines() if "{" in line))
        assert len(named) >= 2
        # Other reflectances stand in the same words.
        assert named - {"oak floor"} <= groups, page
