#!/usr/bin/env python3
"""What path tracers need for the same error at the same points: scenes and errors in, seconds out.

    python benches/peers.py [--scene room ...] [--error 0.1 0.05 ...] [--threads 2] [--yardstick DIR]
                            [--mitsuba PYTHON] [--cycles PYTHON] [--csv FILE] [--json FILE]

Mitsuba 3 (`pip install mitsuba`, and LLVM) and Blender's Cycles (`pip install bpy`) run at the reference's
points and nowhere else, each level of samples in a process of its own, until the least error or the time-out
is reached; seconds are that whole process's. PYTHON is the interpreter that has the peer; one that is not
installed is left out, and said so. Mitsuba sees what points reflect: those that reflect less than `LEAST` are
left out there. Points that something covers do not count, as in accuracy.py. Needs NumPy.

Mitsuba 3.9 finds LLVM by DRJIT_LIBLLVM_PATH, a path of libLLVM.so: 19 works (Debian's libllvm19), but 15
cannot compile its programs for AVX-512 and aborts. What was compiled stays in ~/.drjit: a second run of the
same scene starts faster.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
from pathlib import Path
from typing import Any

import harness
import numpy as np
from solve_once import peak_megabytes

TIMEOUT = 120.0
#: Module whose presence says that a peer is installed.
MODULES = {"mitsuba": "mitsuba", "cycles": "bpy"}
#: Samples per point of the first run, by how much each next one has more, and of the last one at most.
FIRST, FACTOR, MOST = 4, 4, 4**9
#: Reflectance below which irradiance is not read from reflected light (the yardstick's, too).
LEAST = 0.02
#: Distance before a surface from which a point is looked at, metres: more than rounding, less than what fits
#: between things in a room.
BEFORE = 1e-3
#: Shift that tells triangles apart which lie back to back: 20 roundings of 32-bit floats (2^-23 each).
APART = 2.5e-6
#: Most paths that Mitsuba holds at a time.
LANES = 2**20
COLUMNS: dict[str, harness.Shown] = {
    "scene": str,
    "peer": str,
    "samples": harness.number,
    "points": harness.number,
    "rms": harness.share,
    "dark": harness.share,
    "bias": harness.share,
    "seconds": harness.number,
    "megabytes": harness.number,
    "note": lambda note: note or "",
}


def mitsuba(surfaces: harness.Surfaces, face: Any, bary: Any, samples: int, threads: int) -> Any:  # noqa: ANN401
    """Irradiance (n, 3) by Mitsuba's path integrator, looking at each point from just before it."""
    import drjit as dr  # noqa: PLC0415 (each peer is a package of its own)
    import mitsuba as mi  # noqa: PLC0415

    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(threads)
    scene: dict[str, Any] = {"type": "scene"}
    paints = np.concatenate([surfaces.reflectance, surfaces.emission / math.pi], axis=1)
    kinds, paint = np.unique(paints, axis=0, return_inverse=True)
    with tempfile.TemporaryDirectory() as folder:
        for number, kind in enumerate(kinds.tolist()):
            corners = surfaces.apart(APART)[paint.ravel() == number].reshape(-1, 3)
            mesh = mi.Mesh(f"part {number}", len(corners), len(corners) // 3)
            parameters = mi.traverse(mesh)
            parameters["vertex_positions"] = mi.Float(corners.astype(np.float32).ravel())
            parameters["faces"] = mi.UInt32(np.arange(len(corners), dtype=np.uint32))
            parameters.update()
            path = f"{folder}/{number}.ply"
            mesh.write_ply(path)
            reflectance = {"type": "rgb", "value": kind[:3]}
            part = {
                "type": "ply",
                "filename": path,
                "face_normals": True,
                "bsdf": {"type": "diffuse", "reflectance": reflectance},
            }
            if max(kind[3:]) > 0:
                part["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": kind[3:]}}
            scene[f"part{number}"] = part
        loaded = mi.load_dict(scene)
    integrator = mi.load_dict({"type": "path", "max_depth": -1})
    count = len(face)
    place, normal = surfaces.at(face, bary), surfaces.normals[face]
    total, done = np.zeros((count, 3)), 0
    while done < samples:
        some = min(samples - done, max(1, LANES // count))
        eyes, views = (
            [mi.Float(np.repeat(values[:, k], some).astype(np.float32)) for k in range(3)]
            for values in (place + BEFORE * normal, -normal)
        )
        sampler = mi.load_dict({"type": "independent"})
        sampler.seed(done + 1, count * some)
        ray = mi.RayDifferential3f(mi.Point3f(*eyes), mi.Vector3f(*views))
        light = integrator.sample(loaded, sampler, ray)[0]
        sums = [dr.block_sum(channel, some) for channel in (light.x, light.y, light.z)]
        total += np.stack([np.array(channel, float) for channel in sums], axis=1)
        done += some
    reflectance, emission = surfaces.reflectance[face], surfaces.emission[face]
    values = (math.pi * total / samples - emission) / np.maximum(reflectance, LEAST)
    return np.where(reflectance >= LEAST, values, math.nan)


def cycles(surfaces: harness.Surfaces, face: Any, bary: Any, samples: int, threads: int) -> Any:  # noqa: ANN401
    """Irradiance (n, 3) by Cycles, baked to the corners of a speck that floats before each point, unseen."""
    import bpy  # noqa: PLC0415

    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", threads
    scene.cycles.device, scene.cycles.samples = "CPU", max(1, round(samples / 3))  # a speck has three corners
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = (
        scene.cycles.light_sampling_threshold
    ) = 0
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = 128
    scene.world = None

    def add(name: str, triangles: Any, materials: list[Any], paint: Any) -> Any:  # noqa: ANN401
        mesh = bpy.data.meshes.new(name)
        corners = np.asarray(triangles, np.float32).reshape(-1, 3)
        mesh.from_pydata(corners, [], np.arange(len(corners)).reshape(-1, 3))
        for material in materials:
            mesh.materials.append(material)
        mesh.polygons.foreach_set("material_index", np.asarray(paint, np.int32).ravel())
        mesh.update()
        thing = bpy.data.objects.new(name, mesh)
        scene.collection.objects.link(thing)
        return thing

    def material(reflectance: list[float], radiance: list[float]) -> Any:  # noqa: ANN401
        made = bpy.data.materials.new("paint")
        made.use_nodes = True
        made.cycles.emission_sampling = "FRONT"
        nodes, join = made.node_tree.nodes, made.node_tree.links.new
        nodes.clear()
        front, back, glow, both, side, mix, out = (
            nodes.new(f"ShaderNode{kind}")
            for kind in (
                "BsdfDiffuse", "BsdfDiffuse", "Emission", "AddShader", "NewGeometry", "MixShader",
                "OutputMaterial",
            )
        )  # fmt: skip
        front.inputs["Color"].default_value = (*reflectance, 1)
        back.inputs["Color"].default_value = (0, 0, 0, 1)
        peak = max(radiance)
        glow.inputs["Color"].default_value = (*(value / peak if peak else 0 for value in radiance), 1)
        glow.inputs["Strength"].default_value = peak
        join(front.outputs[0], both.inputs[0])
        join(glow.outputs[0], both.inputs[1])
        join(side.outputs["Backfacing"], mix.inputs[0])
        join((both if peak else front).outputs[0], mix.inputs[1])
        join(back.outputs[0], mix.inputs[2])
        join(mix.outputs[0], out.inputs["Surface"])
        return made

    paints = np.concatenate([surfaces.reflectance, surfaces.emission / math.pi], axis=1)
    kinds, paint = np.unique(paints, axis=0, return_inverse=True)
    add("scene", surfaces.apart(APART), [material(kind[:3], kind[3:]) for kind in kinds.tolist()], paint)
    # Specks: triangles of a tenth of `BEFORE`, a tenth of it before the surface, facing as it does.
    a, b = surfaces.triangles[face, :2].transpose(1, 0, 2)
    along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    normal = surfaces.normals[face]
    centre, across = surfaces.at(face, bary) + BEFORE / 10 * normal, np.cross(normal, along)
    specks = np.stack([centre - along - across, centre + along - across, centre + across], axis=1)
    specks = centre[:, None] + (specks - centre[:, None]) * BEFORE / 10
    white = material([1.0, 1.0, 1.0], [0.0, 0.0, 0.0])
    target = add("specks", specks, [white], np.zeros(len(face), np.int32))
    for rays in ("diffuse", "glossy", "transmission", "shadow", "volume_scatter"):
        setattr(target, f"visible_{rays}", False)
    layer = target.data.color_attributes.new("light", "FLOAT_COLOR", "CORNER")
    target.data.color_attributes.active_color = layer
    bpy.context.view_layer.objects.active = target
    target.select_set(True)
    scene.render.bake.target = "VERTEX_COLORS"
    scene.render.bake.use_pass_direct = scene.render.bake.use_pass_indirect = True
    scene.render.bake.use_pass_color = False
    bpy.ops.object.bake(type="DIFFUSE")
    values = np.empty(4 * len(layer.data), np.float32)
    target.data.color_attributes["light"].data.foreach_get("color", values)
    return math.pi * values.reshape(-1, 3, 4)[:, :, :3].mean(axis=1).astype(float)


def work(peer: str, scene: str, points: str, samples: str, threads: str, out: str) -> None:
    """One run, in a process of its own."""
    surfaces = harness.read_glb(Path(scene))
    with np.load(points) as at:
        face, bary = at["face"].astype(np.int64), at["bary"].astype(float)
    run = {"mitsuba": mitsuba, "cycles": cycles}[peer]
    np.save(out, run(surfaces, face, bary, int(samples), int(threads)))
    print("\n" + json.dumps({"megabytes": peak_megabytes()}), flush=True)


def measure(
    peer: str, python: str, case: harness.Case, scene: Path, samples: int, threads: int, timeout: float
) -> dict[str, Any]:
    """One line of the table."""
    row: dict[str, Any] = {"scene": case.name, "peer": peer, "samples": samples}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "irradiance.npy"
        command: list[str | Path] = [python, __file__, "--child", peer, scene, case.points]
        command += [str(samples), str(threads), out]
        run = harness.child(command, timeout, threads)
        row["seconds"] = run.seconds
        if run.result is None:
            return {**row, "note": run.failure}
        values, reference = np.load(out), case.load()
    found = np.isfinite(values).all(axis=1) & case.counted(reference)
    return {
        **row,
        **harness.scores(reference.only(found), values[found]),
        "points": int(found.sum()),
        **run.result,
    }


def seconds_to(error: float, rows: list[dict[str, Any]]) -> str:
    """Seconds to an error, log-log between the runs around it; what bounds them where there are none."""
    ended = sorted((row["rms"], row["seconds"]) for row in rows if row.get("rms", 0) > 0)
    if not ended or ended[0][0] > error:
        return "not reached"
    if ended[-1][0] <= error:
        return f"< {ended[-1][1]:.1f}"
    errors, seconds = np.log(ended).T
    return f"{math.exp(np.interp(math.log(error), errors, seconds)):.1f}"


def main() -> None:
    """Print a table, line by line, and seconds per error."""
    if sys.argv[1:2] == ["--child"]:
        work(*sys.argv[2:])
        return
    parser = harness.parser(__doc__, TIMEOUT)
    harness.add_cases(parser)
    parser.add_argument("--error", nargs="*", type=float, default=(0.1, 0.05, 0.02, 0.01))
    for peer in MODULES:
        parser.add_argument(f"--{peer}", default=sys.executable, help=f"the interpreter that has {peer}")
    arguments = parser.parse_args()
    present = []
    for peer, module in MODULES.items():
        look = f"import importlib.util as u; print(int(u.find_spec('{module}') is not None))"
        python = getattr(arguments, peer)
        if harness.child([python, "-c", look], arguments.timeout, arguments.threads).result:
            present.append(peer)
        else:
            print(f"{peer}: left out, {python} has no module {module} (pip install {module})")
    rows: list[dict[str, Any]] = []
    summary = []
    print(harness.markdown([], COLUMNS))
    for case in harness.chosen(arguments.scene, arguments.yardstick):
        with case.file() as scene:
            for peer in present:
                own: list[dict[str, Any]] = []
                samples = FIRST
                while samples <= MOST and (not own or own[-1].get("rms", 0) > min(arguments.error)):
                    python, threads = getattr(arguments, peer), arguments.threads
                    own.append(measure(peer, python, case, scene, samples, threads, arguments.timeout))
                    print(harness.line(own[-1], COLUMNS), flush=True)
                    samples *= FACTOR
                reached = ", ".join(
                    f"{harness.share(error)}: {seconds_to(error, own)}"
                    for error in sorted(arguments.error, reverse=True)
                )
                summary.append(f"{case.name}, {peer}, seconds to {reached}")
                rows += own
    print("\n" + "\n".join(summary))
    harness.store(rows, arguments.csv, arguments.json)


if __name__ == "__main__":
    main()
