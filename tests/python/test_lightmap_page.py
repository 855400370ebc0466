"""A file with lightmaps in three.js, by the very lines that the documentation gives, in Chromium.

Runs where playwright, Debian's chromium and three.js (`npm ci --prefix viewer`) are; where ISOLUX_BROWSER is
set, as in CI, it is an error that they are not.
"""

from __future__ import annotations

import functools
import http.server
import re
import threading

import numpy as np
import pytest
from conftest import MISSING, MUST, ROOT

import isolux

THREE = ROOT / "viewer/node_modules/three"
LACKING = MISSING if THREE.exists() else [*MISSING, "three.js"]
pytestmark = pytest.mark.skipif(bool(LACKING) and not MUST, reason=f"not installed: {', '.join(LACKING)}")

WIDTH, HEIGHT = 320, 240
PAGE = """<script type="importmap">
{"imports": {"three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/"}}
</script>
<script type="module">
import * as THREE from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
window.shown = (async () => {
%s
    return { gltf, manifest };
})();
window.drawn = async (kind, source) => {
    const { gltf, manifest } = await window.shown;
    const png = source === 'png';
    const inside = png && await gltf.parser.getDependency('texture', 0);
    gltf.scene.traverse((object) => {
        if (!object.material) return;
        const own = object.userData.own ??= object.material;
        const made = kind === 'standard' ? own.clone() : new THREE.MeshLambertMaterial({
            color: own.color, map: own.map, side: own.side, lightMap: own.lightMap,
            lightMapIntensity: own.lightMapIntensity,
        });
        made.emissive?.set(0);
        if (png) {
            const index = own.userData.gltfExtensions.MOZ_lightmap;
            made.lightMap = inside; inside.channel = index.texCoord; made.lightMapIntensity = index.intensity;
        }
        object.material = made;
    });
    const renderer = new THREE.WebGLRenderer({ antialias: false });
    renderer.toneMapping = THREE.NoToneMapping;
    const [width, height] = [%d, %d];
    const target = new THREE.WebGLRenderTarget(width, height, { type: THREE.FloatType });
    const camera = gltf.cameras[0];
    camera.aspect = width / height;
    camera.updateProjectionMatrix();
    const scene = new THREE.Scene();
    scene.add(gltf.scene);
    renderer.setRenderTarget(target);
    renderer.render(scene, camera);
    const pixels = new Float32Array(4 * width * height);
    renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
    renderer.dispose();
    return Array.from(pixels);
};
</script>"""


class Pages(http.server.SimpleHTTPRequestHandler):
    """Serves one page, three.js, and a folder."""

    def __init__(self, *arguments, folder, page, **options):
        self.folder, self.page = folder, page
        super().__init__(*arguments, **options)

    def translate_path(self, path):
        own = path.removeprefix("/three/")
        return str(THREE / own if own != path else self.folder / path.lstrip("/"))

    def do_GET(self):
        if self.path in ("/", "/favicon.ico"):
            body = self.page.encode()
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)
            return
        super().do_GET()

    def log_message(self, *_):
        pass


@pytest.fixture(scope="module")
def solution():
    return isolux.solve(isolux.load(ROOT / "scenes/cornell.glb"), error=0.1)


@pytest.fixture(scope="module")
def drawn(solution, browser, tmp_path_factory):
    """What three.js draws, linear, (height, width, 3) from the top; and the manifest."""
    assert not LACKING, f"ISOLUX_BROWSER is set, but these are not installed: {LACKING}"
    folder = tmp_path_factory.mktemp("page")
    manifest = solution.bake_lightmap(folder / "cornell.glb", size=512, scene=ROOT / "scenes/cornell.glb")
    text = (ROOT / "docs/how-to/lightmaps.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```js\n(.*?)```", text, re.DOTALL)
    page = PAGE % (code.replace("room-lit", "cornell"), WIDTH, HEIGHT)
    handler = functools.partial(Pages, folder=folder, page=page)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    tab = browser.new_page()
    complaints = []
    tab.on("console", lambda said: complaints.append(said.text) if said.type == "error" else None)
    tab.on("pageerror", lambda error: complaints.append(str(error)))
    tab.goto(f"http://127.0.0.1:{server.server_port}/")

    def draw(kind, source):
        pixels = tab.evaluate("async ([kind, source]) => await window.drawn(kind, source)", [kind, source])
        return np.array(pixels).reshape(HEIGHT, WIDTH, 4)[::-1, :, :3]

    yield draw, manifest
    assert not complaints, complaints
    tab.close()
    server.shutdown()
    server.server_close()


def reflected(solution):
    """What isolux draws without what is emitted, (height, width, 3), and where nothing emits or ends."""
    picture = solution.render(size=(WIDTH, HEIGHT), samples=4)
    # Within a surface the four samples of a pixel's corner do not differ much from its neighbours'.
    inside = np.ones((HEIGHT, WIDTH), bool)
    luminance = picture.mean(axis=2)
    for axis in (0, 1):
        for step in (-1, 1):
            other = np.roll(luminance, step, axis=axis)
            inside &= np.abs(other - luminance) < 0.05 * luminance
    return picture, inside & (luminance > 0.0)


@pytest.mark.parametrize("source", ["exr", "png"])
def test_three_js_shows_what_isolux_draws(drawn, solution, source):
    """Catches maps that are upside down, on other coordinates, converted, or off by a factor of pi."""
    draw, manifest = drawn
    picture, inside = reflected(solution)
    found = draw("lambert", source)
    want = picture * manifest["exposure"]
    # The PNG is cut at `scale`; the loader's lines give the exposure to both.
    inside &= (found.max(axis=2) > 0.0) & (want.max(axis=2) < 1.0)
    assert inside.mean() > 0.5
    off = np.abs(found - want)[inside]
    # Measured with the EXR: 0.2 % of the mean at most pixels. Of the PNG browsers keep 8 bits, cut off.
    step = manifest["intensity"]["png"] / np.pi / 255 if source == "png" else 0.0
    assert np.median(off) < 0.005 * want[inside].mean() + step
    assert np.quantile(off, 0.95) < 0.02 * want[inside].mean() + step


def test_standard_materials_lose_what_their_gloss_takes(drawn):
    """Catches a page that says more or less of it than three.js does."""
    draw, _ = drawn
    full, standard = draw("lambert", "exr"), draw("standard", "exr")
    lit = full.min(axis=2) > 0.01
    share = (standard / np.maximum(full, 1e-9))[lit]
    # 4 % of what comes straight on, and what gloss of all roughness scatters more than once.
    assert 0.90 < np.median(share) < 0.97
    assert share.min() > 0.5
    assert share.max() <= 1.001
