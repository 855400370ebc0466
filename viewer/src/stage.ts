// What is drawn: surfaces, wires, links and the picked point, with three.js. Drawn when something changed, not all the time.

import * as THREE from "three";
import { LineMaterial } from "three/examples/jsm/lines/LineMaterial.js";
import { LineSegments2 } from "three/examples/jsm/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/examples/jsm/lines/LineSegmentsGeometry.js";
import { NONE, scalarWeights, type Bands, type ViewData } from "./data";
import type { Light } from "./light";
import type { LinkView } from "./links";
import { colourAt, colours, ticks, type Palette, type Range } from "./palette";
import {
  BACK_FRAGMENT,
  BACK_VERTEX,
  LEAF_FRAGMENT,
  LEAF_VERTEX,
  MOST_CONTOURS,
  SURFACE_FRAGMENT,
  SURFACE_VERTEX,
  TABLE_WIDTH,
} from "./shaders";
import { meanOf, type Corners, type Trees } from "./tree";

export type Mode = "light" | "false-colour" | "levels";

/** How things are shown. */
export interface Look {
  mode: Mode;
  /** Stops above the automatic exposure. */
  stops: number;
  palette: Palette;
  range: Range;
  /** Show luminance (radiance), not irradiance, in false colour. */
  luminances: boolean;
  contours: boolean;
  wires: boolean;
  /** Black backs of single-sided surfaces; otherwise they are not there. */
  backs: boolean;
}

/** A share of the strongest link at which its colour is that of nothing. */
const FAINTEST = 1e-3;

/** Most links that are drawn for one element. */
export const MOST_DRAWN = 400;

/** What of the stage belongs to one solution. */
interface Shown {
  data: ViewData;
  light: Light;
  trees: Trees;
  surfaces: (THREE.Mesh | THREE.LineSegments)[];
  backs: THREE.Mesh;
  leaves: THREE.Mesh | null;
  table: THREE.DataTexture;
  irradiance: THREE.BufferAttribute;
  deepest: number;
}

export class Stage {
  readonly renderer: THREE.WebGLRenderer;
  readonly camera = new THREE.PerspectiveCamera(60, 1, 0.01, 100);
  /** Called before each frame. */
  onFrame: () => void = () => undefined;
  private readonly scene = new THREE.Scene();
  private readonly overlay = new THREE.Group();
  private shown: Shown | null = null;
  private look: Look | null = null;
  private requested = 0;
  private readonly surface: THREE.RawShaderMaterial;
  private readonly edges: THREE.RawShaderMaterial;
  private readonly panes: THREE.RawShaderMaterial;
  private readonly back: THREE.RawShaderMaterial;
  private readonly leaf: THREE.RawShaderMaterial;
  private readonly palette = paletteTexture("viridis");
  private readonly levelPalette = paletteTexture("viridis");
  private palettes: Palette = "viridis";

  constructor(readonly canvas: HTMLCanvasElement) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.scene.add(this.overlay);
    const uniforms = {
      surfaces: { value: null },
      eye: { value: new THREE.Vector3() },
      mode: { value: 0 },
      exposure: { value: 1 },
      white: { value: 4 },
      scalar: { value: new THREE.Vector3() },
      luminances: { value: false },
      range: { value: new THREE.Vector2(0, 1) },
      logarithmic: { value: false },
      palette: { value: this.palette },
      contours: { value: 0 },
      levels: { value: new Array<number>(MOST_CONTOURS).fill(0) },
    };
    const surface = {
      glslVersion: THREE.GLSL3,
      vertexShader: SURFACE_VERTEX,
      fragmentShader: SURFACE_FRAGMENT,
      uniforms,
    };
    this.surface = new THREE.RawShaderMaterial(surface);
    this.edges = new THREE.RawShaderMaterial({ ...surface, defines: { EDGES: 1 } });
    this.edges.uniforms = this.surface.uniforms;
    this.panes = new THREE.RawShaderMaterial({
      ...surface,
      transparent: true,
      depthWrite: false,
      premultipliedAlpha: true,
      blending: THREE.CustomBlending,
      blendSrc: THREE.OneFactor,
      blendDst: THREE.OneMinusSrcAlphaFactor,
    });
    // Both look at the same numbers.
    this.panes.uniforms = this.surface.uniforms;
    this.back = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: BACK_VERTEX,
      fragmentShader: BACK_FRAGMENT,
      side: THREE.BackSide,
    });
    this.leaf = new THREE.RawShaderMaterial({
      glslVersion: THREE.GLSL3,
      vertexShader: LEAF_VERTEX,
      fragmentShader: LEAF_FRAGMENT,
      uniforms: {
        filled: { value: false },
        deepest: { value: 0 },
        palette: { value: this.levelPalette },
        wire: { value: new THREE.Vector4(0, 0, 0, 0.6) },
      },
      transparent: true,
      premultipliedAlpha: true,
      blending: THREE.CustomBlending,
      blendSrc: THREE.OneFactor,
      blendDst: THREE.OneMinusSrcAlphaFactor,
      polygonOffset: true,
      polygonOffsetFactor: -1,
      polygonOffsetUnits: -2,
    });
  }

  /** Takes a solution in place of the one that is shown. */
  show(data: ViewData, trees: Trees, light: Light): void {
    this.clear();
    const positions = new THREE.BufferAttribute(data.f32("mesh/positions"), 3);
    const irradiance = new THREE.BufferAttribute(light.vertices, 3).setUsage(THREE.DynamicDrawUsage);
    const vertexStart = data.u32("mesh/vertex_start");
    const triangleStart = data.u32("mesh/triangle_start");
    const triangles = data.u32("mesh/triangles");
    const twin = data.u32("polygons/twin");
    const owners = new Uint32Array(positions.count);
    const count = twin.length;
    for (let polygon = 0; polygon < count; polygon++) {
      owners.fill(polygon, vertexStart[polygon], vertexStart[polygon + 1]);
    }
    const polygon = new THREE.BufferAttribute(owners, 1);
    const table = new THREE.DataTexture(
      new Float32Array(16 * TABLE_WIDTH * Math.max(1, Math.ceil(count / TABLE_WIDTH))),
      4 * TABLE_WIDTH,
      Math.max(1, Math.ceil(count / TABLE_WIDTH)),
      THREE.RGBAFormat,
      THREE.FloatType,
    );
    const texels = table.image.data as Float32Array;
    for (let polygon = 0; polygon < count; polygon++) texels.set(light.normal(polygon), 16 * polygon + 8);
    const indexed = (index: Uint32Array<ArrayBuffer>): THREE.BufferGeometry => {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", positions);
      geometry.setAttribute("irradiance", irradiance);
      geometry.setAttribute("polygon", polygon);
      return geometry.setIndex(new THREE.BufferAttribute(index, 1));
    };
    const part = (takes: (polygon: number) => boolean, material: THREE.Material): THREE.Mesh => {
      const mesh = new THREE.Mesh(indexed(chosen(triangles, triangleStart, count, takes)), material);
      // One mesh is the whole scene: there is nothing to cull.
      mesh.frustumCulled = false;
      this.scene.add(mesh);
      return mesh;
    };
    const isPane = (polygon: number): boolean => light.opacity[polygon]! < 1;
    const surfaces: Shown["surfaces"] = [part((polygon) => !isPane(polygon), this.surface)];
    const borders = chosen(triangles, triangleStart, count, (polygon) => !isPane(polygon));
    const edges = new THREE.LineSegments(indexed(outlines(borders, owners, positions.array, data, trees)), this.edges);
    edges.frustumCulled = false;
    this.scene.add(edges);
    surfaces.push(edges);
    if (light.opacity.some((opacity) => opacity < 1)) surfaces.push(part(isPane, this.panes));
    const backs = part((polygon) => twin[polygon] === NONE, this.back);
    const deepest = trees.level.reduce((most, level) => Math.max(most, level), 0);
    this.shown = { data, light, trees, surfaces, backs, leaves: null, table, irradiance, deepest };
    const { uniforms } = this.surface;
    uniforms["surfaces"]!.value = table;
    uniforms["white"]!.value = data.header.white;
    uniforms["scalar"]!.value.set(...scalarWeights(data.header.unit));
    this.leaf.uniforms["deepest"]!.value = deepest;
    const [low, high] = data.header.bounds;
    const diagonal = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
    this.camera.near = diagonal * 1e-3;
    this.camera.far = diagonal * 20;
    this.relit();
    if (this.look !== null) this.setLook(this.look);
  }

  /** After the light has changed. */
  relit(): void {
    if (this.shown === null) return;
    const { light, table, irradiance } = this.shown;
    irradiance.needsUpdate = true;
    const texels = table.image.data as Float32Array;
    for (let polygon = 0; polygon < light.opacity.length; polygon++) {
      texels.set(light.reflectanceOf(polygon), 16 * polygon);
      texels[16 * polygon + 3] = light.opacity[polygon]!;
      texels.set(light.emissionOf(polygon), 16 * polygon + 4);
    }
    table.needsUpdate = true;
    this.invalidate();
  }

  setLook(look: Look): void {
    this.look = { ...look };
    if (this.shown === null) return;
    const { data, surfaces, backs, deepest } = this.shown;
    const { uniforms } = this.surface;
    uniforms["mode"]!.value = look.mode === "light" ? 0 : 1;
    uniforms["exposure"]!.value = data.header.exposure * 2 ** look.stops;
    uniforms["luminances"]!.value = look.luminances;
    const { low, high, isLog } = look.range;
    const placed = (value: number): number => (isLog ? Math.log(value) : value);
    uniforms["range"]!.value.set(placed(low), placed(high));
    uniforms["logarithmic"]!.value = isLog;
    const levels = look.contours ? ticks(look.range).slice(0, MOST_CONTOURS) : [];
    uniforms["contours"]!.value = levels.length;
    levels.forEach((level, k) => (uniforms["levels"]!.value[k] = placed(level)));
    if (look.palette !== this.palettes) {
      this.palettes = look.palette;
      (this.palette.image.data as Uint8Array).set(colours(look.palette));
      this.palette.needsUpdate = true;
    }
    const isLevels = look.mode === "levels";
    surfaces.forEach((mesh) => (mesh.visible = !isLevels));
    backs.visible = look.backs;
    if ((isLevels || look.wires) && this.shown.leaves === null) this.shown.leaves = this.makeLeaves();
    if (this.shown.leaves !== null) this.shown.leaves.visible = isLevels || look.wires;
    this.leaf.uniforms["filled"]!.value = isLevels;
    this.leaf.depthWrite = isLevels;
    this.leaf.transparent = !isLevels;
    this.leaf.uniforms["deepest"]!.value = deepest;
    const ink = look.mode === "light" ? [1, 1, 1, 0.4] : [0, 0, 0, look.mode === "levels" ? 0.38 : 0.5];
    this.leaf.uniforms["wire"]!.value.set(...ink);
    this.leaf.needsUpdate = true;
    this.invalidate();
  }

  /** Every leaf on its own, with coordinates within it: made when it is first wanted. */
  private makeLeaves(): THREE.Mesh {
    const { data, trees } = this.shown!;
    const count = data.header.leaves;
    const { origin } = data.header;
    const positions = new Float32Array(12 * count);
    const inside = new Uint8Array(16 * count);
    const index = new Uint32Array(6 * count);
    let leaf = 0;
    for (let root = 0; root < trees.roots; root++) {
      trees.leaves(root, (_, corners, level) => {
        const isTriangle = corners.length === 3;
        for (let k = 0; k < 4; k++) {
          const corner = corners[k] ?? corners[2]!;
          for (let axis = 0; axis < 3; axis++) positions[12 * leaf + 3 * k + axis] = corner[axis]! - origin[axis]!;
          const [s, t] = (isTriangle ? TRIANGLE : SQUARE)[k]!;
          inside.set([s, t, isTriangle ? 1 : 0, level], 16 * leaf + 4 * k);
        }
        const first = 4 * leaf;
        index.set([first, first + 1, first + 2, first, first + 2, first + 3], 6 * leaf);
        leaf++;
      });
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
    geometry.setAttribute("inside", new THREE.BufferAttribute(inside, 4));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    const mesh = new THREE.Mesh(geometry, this.leaf);
    mesh.frustumCulled = false;
    mesh.renderOrder = 1;
    this.scene.add(mesh);
    return mesh;
  }

  /** Marks a picked point and its element, and draws links to it; nothing takes all away. */
  mark(picked: { point: Bands; corners: Corners } | null, links: LinkView[]): void {
    for (const child of [...this.overlay.children]) {
      this.overlay.remove(child);
      dispose(child);
    }
    if (picked !== null && this.shown !== null) {
      const near = this.near();
      const corners = picked.corners.map(near);
      const outline = corners.flatMap((corner, k) => [...corner, ...corners[(k + 1) % corners.length]!]);
      this.overlay.add(fat(outline, null, 2.5, 0xffb020));
      const drawn = links.slice(0, MOST_DRAWN);
      if (drawn.length > 0) this.drawLinks(meanOf(picked.corners), drawn);
      const dot = new THREE.Points(
        new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(near(picked.point), 3)),
        new THREE.PointsMaterial({
          color: 0xffb020,
          size: 9 * this.renderer.getPixelRatio(),
          sizeAttenuation: false,
          depthTest: false,
          transparent: true,
          map: disc(),
        }),
      );
      dot.renderOrder = 4;
      this.overlay.add(dot);
    }
    this.invalidate();
  }

  private drawLinks(to: Bands, links: LinkView[]): void {
    const near = this.near();
    const strongest = links[0]!.carried;
    const ends: number[] = [];
    const tints: number[] = [];
    const rings: number[] = [];
    const ringTints: number[] = [];
    // The weak first: the strong lie on top.
    for (const link of [...links].reverse()) {
      const tint = linkColour(link.carried / strongest);
      const colour = new THREE.Color().setRGB(tint[0] / 255, tint[1] / 255, tint[2] / 255, THREE.SRGBColorSpace);
      const rgb = [colour.r, colour.g, colour.b];
      ends.push(...near(link.from), ...near(to));
      tints.push(...rgb, ...rgb);
      if (link.radius === null) continue;
      for (const [u, v] of [[0, 1], [1, 2], [2, 0]] as const) {
        for (let k = 0; k < 48; k++) {
          for (const at of [k, k + 1]) {
            const point = near(link.from);
            point[u]! += link.radius * Math.cos((2 * Math.PI * at) / 48);
            point[v]! += link.radius * Math.sin((2 * Math.PI * at) / 48);
            rings.push(...point);
            ringTints.push(...rgb);
          }
        }
      }
    }
    this.overlay.add(fat(ends, tints, 1.6, 0xffffff));
    if (rings.length === 0) return;
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.Float32BufferAttribute(rings, 3));
    geometry.setAttribute("color", new THREE.Float32BufferAttribute(ringTints, 3));
    const material = new THREE.LineBasicMaterial({ vertexColors: true, transparent: true, opacity: 0.5 });
    this.overlay.add(new THREE.LineSegments(geometry, material));
  }

  /** Coordinates relative to the origin, as everything that is drawn has them. */
  near(): (point: Bands) => Bands {
    const origin = this.shown?.data.header.origin ?? [0, 0, 0];
    return (point) => [point[0] - origin[0]!, point[1] - origin[1]!, point[2] - origin[2]!];
  }

  background(colour: string): void {
    this.renderer.setClearColor(new THREE.Color(colour), 1);
    this.invalidate();
  }

  resize(width: number, height: number): void {
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  /** Draws soon. */
  invalidate(): void {
    if (this.requested !== 0) return;
    this.requested = requestAnimationFrame(() => {
      this.requested = 0;
      this.draw();
    });
  }

  draw(): void {
    this.onFrame();
    this.surface.uniforms["eye"]!.value.copy(this.camera.position);
    this.renderer.render(this.scene, this.camera);
  }

  /** The scene alone, without overlays, in so many pixels; black where nothing is. */
  async picture(width: number, height: number): Promise<Blob> {
    const size = this.renderer.getSize(new THREE.Vector2());
    const ratio = this.renderer.getPixelRatio();
    const clear = this.renderer.getClearColor(new THREE.Color());
    this.renderer.setPixelRatio(1);
    this.renderer.setClearColor(0x000000, 1);
    this.overlay.visible = false;
    this.resize(width, height);
    this.draw();
    const made = new Promise<Blob | null>((resolve) => this.canvas.toBlob(resolve, "image/png"));
    this.overlay.visible = true;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setClearColor(clear, 1);
    this.resize(size.x, size.y);
    this.draw();
    const blob = await made;
    if (blob === null) throw new Error("the browser made no picture");
    return blob;
  }

  /** Draws so many frames, each to its end, and returns frames per second. */
  benchmark(frames: number): number {
    const gl = this.renderer.getContext();
    const pixel = new Uint8Array(4);
    const finish = (): void => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    this.draw();
    finish();
    const start = performance.now();
    for (let frame = 0; frame < frames; frame++) {
      this.draw();
      finish();
    }
    return (1000 * frames) / (performance.now() - start);
  }

  private clear(): void {
    if (this.shown === null) return;
    const { surfaces, backs, leaves, table } = this.shown;
    for (const mesh of [...surfaces, backs, leaves]) {
      if (mesh === null) continue;
      this.scene.remove(mesh);
      mesh.geometry.dispose();
    }
    table.dispose();
    this.mark(null, []);
    this.shown = null;
  }
}

const SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]] as const;
const TRIANGLE = [[1, 0], [0, 1], [0, 0], [0, 0]] as const;

/** The colour of a link that carries such a share of what the strongest does, sRGB bytes. */
export function linkColour(share: number): Bands {
  return colourAt("inferno", 0.25 + 0.7 * Math.max(0, 1 - Math.log(share) / Math.log(FAINTEST)));
}

/** Triangles of the polygons that are taken. */
function chosen(
  triangles: Uint32Array,
  start: Uint32Array,
  count: number,
  takes: (polygon: number) => boolean,
): Uint32Array<ArrayBuffer> {
  let length = 0;
  for (let polygon = 0; polygon < count; polygon++) {
    if (takes(polygon)) length += 3 * (start[polygon + 1]! - start[polygon]!);
  }
  const index = new Uint32Array(length);
  let at = 0;
  for (let polygon = 0; polygon < count; polygon++) {
    if (!takes(polygon)) continue;
    const own = triangles.subarray(3 * start[polygon]!, 3 * start[polygon + 1]!);
    index.set(own, at);
    at += own.length;
  }
  return index;
}

/** Edges of triangles that lie on the outlines of roots, as pairs of vertices. */
function outlines(
  triangles: Uint32Array,
  owners: Uint32Array,
  positions: ArrayLike<number>,
  data: ViewData,
  trees: Trees,
): Uint32Array<ArrayBuffer> {
  const { origin } = data.header;
  const rootsOf: number[][] = Array.from({ length: (owners.at(-1) ?? -1) + 1 }, () => []);
  for (let root = 0; root < trees.roots; root++) rootsOf[trees.rootPolygon[root]!]?.push(root);
  // By vertex: a bit for each side of the roots that it lies on; 32 are enough for all but rare fragments.
  const sides = new Uint32Array(owners.length);
  let first = 0;
  rootsOf.forEach((roots, polygon) => {
    let last = first;
    while (last < owners.length && owners[last] === polygon) last++;
    let bit = 0;
    for (const root of roots) {
      const corners = trees.cornersOfRoot(root);
      corners.forEach((corner, k) => {
        const next = corners[(k + 1) % corners.length]!;
        const [ax, ay, az] = [0, 1, 2].map((axis) => corner[axis]! - origin[axis]!) as Bands;
        const [ux, uy, uz] = [0, 1, 2].map((axis) => next[axis]! - corner[axis]!) as Bands;
        const square = ux * ux + uy * uy + uz * uz;
        const slack = 1e-5 * Math.sqrt(square) + 1e-6 * Math.hypot(ax, ay, az);
        for (let vertex = first; vertex < last; vertex++) {
          const x = positions[3 * vertex]! - ax;
          const y = positions[3 * vertex + 1]! - ay;
          const z = positions[3 * vertex + 2]! - az;
          const part = (x * ux + y * uy + z * uz) / square;
          const [dx, dy, dz] = [x - part * ux, y - part * uy, z - part * uz];
          if (dx * dx + dy * dy + dz * dz < slack * slack) sides[vertex]! |= 1 << bit % 32;
        }
        bit++;
      });
    }
    first = last;
  });
  const found: number[] = [];
  for (let at = 0; at < triangles.length; at += 3) {
    for (let k = 0; k < 3; k++) {
      const [one, other] = [triangles[at + k]!, triangles[at + ((k + 1) % 3)]!];
      if ((sides[one]! & sides[other]!) !== 0) found.push(one, other);
    }
  }
  return unmatched(found, positions);
}

/** Of edges, pairs of vertices, those that no other one joins from end to end: there alone cracks can be. */
function unmatched(edges: number[], positions: ArrayLike<number>): Uint32Array<ArrayBuffer> {
  const bits = new Uint32Array(Float32Array.from(positions).buffer);
  const hash = (vertex: number): number => {
    let mixed = 0;
    for (let axis = 0; axis < 3; axis++) {
      // Both zeros are one.
      const own = bits[3 * vertex + axis]!;
      mixed = Math.imul(mixed ^ (own === 0x80000000 ? 0 : own), 0x9e3779b1);
      mixed ^= mixed >>> 15;
    }
    return mixed;
  };
  const slots = 2 ** Math.ceil(Math.log2(edges.length + 2));
  const [tags, counts] = [new Float64Array(slots), new Uint8Array(slots)];
  const slotOf = (one: number, other: number): number => {
    // The same in both directions; two edges that share a tag by chance, one in 10^15 pairs, keep a crack at worst.
    const [a, b] = [hash(one), hash(other)];
    const tag = ((a + b) >>> 0) * 0x200000 + ((Math.imul(a, b) ^ (a ^ b)) & 0x1fffff) + 1;
    let slot = (Math.imul((a + b) ^ Math.imul(a, b), 0x85ebca6b) >>> 0) % slots;
    while (tags[slot] !== 0 && tags[slot] !== tag) slot = (slot + 1) % slots;
    tags[slot] = tag;
    return slot;
  };
  const places = new Uint32Array(edges.length / 2);
  for (let k = 0; k < places.length; k++) {
    const slot = slotOf(edges[2 * k]!, edges[2 * k + 1]!);
    places[k] = slot;
    counts[slot] = Math.min(counts[slot]! + 1, 2);
  }
  return new Uint32Array(edges.filter((_, at) => counts[places[at >> 1]!] === 1));
}

function fat(positions: number[], tints: number[] | null, width: number, colour: number): LineSegments2 {
  const geometry = new LineSegmentsGeometry();
  geometry.setPositions(positions);
  if (tints !== null) geometry.setColors(tints);
  const material = new LineMaterial({ color: colour, linewidth: width, vertexColors: tints !== null, depthTest: tints !== null });
  const lines = new LineSegments2(geometry, material);
  lines.renderOrder = tints === null ? 3 : 2;
  lines.frustumCulled = false;
  return lines;
}

function disc(): THREE.Texture {
  const size = 32;
  const pixels = new Uint8Array(4 * size * size).fill(255);
  for (let k = 0; k < size * size; k++) {
    const distance = Math.hypot((k % size) + 0.5 - size / 2, Math.floor(k / size) + 0.5 - size / 2);
    pixels[4 * k + 3] = 255 * Math.min(Math.max(size / 2 - distance, 0), 1);
  }
  const texture = new THREE.DataTexture(pixels, size, size);
  texture.needsUpdate = true;
  return texture;
}

function paletteTexture(palette: Palette): THREE.DataTexture {
  const texture = new THREE.DataTexture(colours(palette), 256, 1);
  texture.magFilter = THREE.LinearFilter;
  texture.minFilter = THREE.LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

function dispose(object: THREE.Object3D): void {
  if (!(object instanceof THREE.Mesh || object instanceof THREE.LineSegments || object instanceof THREE.Points)) return;
  object.geometry.dispose();
  const material = object.material as THREE.Material & { map?: THREE.Texture | null };
  material.map?.dispose();
  material.dispose();
}
