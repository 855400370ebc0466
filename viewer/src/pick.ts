// What a ray meets: a point of a surface, and everything that is known of it.

import { dot, NONE, type Bands, type ViewData } from "./data";
import type { Light } from "./light";
import { cross, subtract, type Corners, type Trees } from "./tree";

export interface Ray {
  origin: Bands;
  direction: Bands;
}

export interface Hit {
  root: number;
  distance: number;
  point: Bands;
}

/** Everything about a point. Light is in lm/m² or W/m², per band; `irradiance` is what arrives, `radiosity` what leaves. */
export interface Reading {
  root: number;
  polygon: number;
  /** The input triangles that it is made of, one or two. */
  faces: number[];
  isBack: boolean;
  point: Bands;
  object: string;
  material: string;
  reflectance: Bands;
  opacity: number;
  emission: Bands;
  irradiance: Bands;
  radiosity: Bands;
  /** One number for irradiance, and for luminance or radiance. */
  illuminance: number;
  luminance: number;
  element: number;
  level: number;
  path: number[];
  corners: Corners;
}

export class Picker {
  private readonly planes: Float64Array;
  private readonly twin: Uint32Array;
  private readonly faces: Uint32Array;
  private readonly object: Uint32Array;
  private readonly material: Uint32Array;

  constructor(
    private readonly data: ViewData,
    private readonly trees: Trees,
    private readonly light: Light,
  ) {
    this.twin = data.u32("polygons/twin");
    this.faces = data.u32("polygons/faces");
    this.object = data.u32("polygons/object");
    this.material = data.u32("polygons/material");
    this.planes = new Float64Array(4 * trees.roots);
    for (let root = 0; root < trees.roots; root++) {
      const normal = light.normal(trees.rootPolygon[root]!);
      this.planes.set([...normal, dot(normal, trees.cornersOfRoot(root)[0]!)], 4 * root);
    }
  }

  /** The first lit side that a ray meets. Single-sided surfaces are not there from behind, or stop it where `backs` are solid. */
  hit(ray: Ray, backs: boolean): Hit | null {
    const { planes, trees } = this;
    const [ox, oy, oz] = ray.origin;
    const [dx, dy, dz] = ray.direction;
    let best: Hit | null = null;
    let nearest = Infinity;
    let isBlocked = false;
    for (let root = 0; root < trees.roots; root++) {
      const at = 4 * root;
      const [nx, ny, nz] = [planes[at]!, planes[at + 1]!, planes[at + 2]!];
      const towards = nx * dx + ny * dy + nz * dz;
      const isFront = towards < 0;
      if (towards === 0 || (!isFront && (!backs || this.twin[trees.rootPolygon[root]!] !== NONE))) continue;
      const distance = (planes[at + 3]! - (nx * ox + ny * oy + nz * oz)) / towards;
      // Of faces in one place the later one lies on top.
      if (!(distance > 0 && distance <= nearest)) continue;
      const point: Bands = [ox + dx * distance, oy + dy * distance, oz + dz * distance];
      if (!isInside(trees.cornersOfRoot(root), [nx, ny, nz], point)) continue;
      nearest = distance;
      isBlocked = !isFront;
      best = { root, distance, point };
    }
    return isBlocked ? null : best;
  }

  /** What is known of a point on a root. */
  read(root: number, point: Bands): Reading {
    const { header } = this.data;
    const polygon = this.trees.rootPolygon[root]!;
    const { irradiance, leaf, corners } = this.light.at(root, point);
    const radiosity = this.light.radiosity(polygon, irradiance);
    return {
      root,
      polygon,
      faces: [this.faces[2 * polygon]!, this.faces[2 * polygon + 1]!].filter((face) => face !== NONE),
      isBack: polygon >= header.fronts,
      point,
      object: header.objects[this.object[polygon]!] ?? "",
      material: header.materials[this.material[polygon]!] ?? "",
      reflectance: this.light.reflectanceOf(polygon),
      opacity: this.light.opacity[polygon]!,
      emission: this.light.emissionOf(polygon),
      irradiance,
      radiosity,
      illuminance: this.light.scalarOf(irradiance),
      luminance: this.light.scalarOf(radiosity) / Math.PI,
      element: leaf,
      level: this.trees.level[leaf]!,
      path: this.trees.path(leaf),
      corners,
    };
  }
}

function isInside(corners: Corners, normal: Bands, point: Bands): boolean {
  // Along shared edges both neighbours are met: a gap would let rays through.
  const slack = -1e-9;
  for (let k = 0; k < corners.length; k++) {
    const [a, b] = [corners[k]!, corners[(k + 1) % corners.length]!];
    const along = subtract(b, a);
    if (dot(normal, cross(along, subtract(point, a))) < slack * dot(along, along)) return false;
  }
  return true;
}
