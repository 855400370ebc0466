// The light of a mix: columns and the weights of their lamps come in; irradiance at vertices, points and elements comes out.

import { NONE, scalarWeights, dot, type Bands, type ViewData } from "./data";
import { MixError } from "./mixerror";
import { bilinearCoordinates, fieldAt, meanOfField } from "./place";
import { areaOf, cross, partOf, subtract, type Corners, type Trees } from "./tree";

/** Radiosity and area by element, for what links carry. */
interface ByElement {
  radiosity: Float32Array;
  irradiance: Float32Array;
}

export class Light {
  /** By group: linear factor per band on what it emits. */
  readonly weights: Bands[];
  readonly emission: Float32Array;
  readonly reflectance: Float32Array;
  readonly opacity: Float32Array;
  readonly group: Uint32Array;
  readonly normals: Float64Array;
  /** Irradiance of the mix by vertex. */
  readonly vertices: Float32Array<ArrayBuffer>;
  /** Grows whenever the mix changes. */
  version = 0;
  private readonly columns: Float32Array;
  private readonly fields: Float32Array | null;
  private readonly means: Float32Array | null;
  private readonly open: Float32Array;
  private elements: (ByElement & { version: number }) | null = null;
  private readonly positions: Float32Array;
  private readonly triangles: Uint32Array;
  private readonly triangleStart: Uint32Array;
  private readonly scalar: Bands;
  private readonly mixError: MixError;

  constructor(
    private readonly data: ViewData,
    private readonly trees: Trees,
  ) {
    this.columns = data.f32("mesh/irradiance");
    this.emission = data.f32("polygons/emission");
    this.reflectance = data.f32("polygons/reflectance");
    this.opacity = data.f32("polygons/opacity");
    this.group = data.u32("polygons/group");
    this.normals = data.f64("polygons/normal");
    this.open = data.f32("elements/open");
    this.fields = data.has("elements/field") ? data.f32("elements/field") : null;
    this.means = this.fields === null ? data.f32("elements/mean") : null;
    this.positions = data.f32("mesh/positions");
    this.triangles = data.u32("mesh/triangles");
    this.triangleStart = data.u32("mesh/triangle_start");
    this.vertices = new Float32Array(this.positions.length);
    this.weights = data.header.groups.map((group) => [...group.weight] as Bands);
    this.scalar = scalarWeights(data.header.unit);
    this.mixError = new MixError(data, data.header.groups.length);
    this.mix();
  }

  /** Sums the columns up: one pass over the vertices. */
  mix(): void {
    const { vertices, columns, weights } = this;
    const length = vertices.length;
    vertices.fill(0);
    weights.forEach(([red, green, blue], row) => {
      const start = row * length;
      if (red === 0 && green === 0 && blue === 0) return;
      for (let at = 0; at < length; at += 3) {
        vertices[at]! += red * columns[start + at]!;
        vertices[at + 1]! += green * columns[start + at + 1]!;
        vertices[at + 2]! += blue * columns[start + at + 2]!;
      }
    });
    // Columns may be below 0 at places, sums of them may not.
    for (let at = 0; at < length; at++) if (vertices[at]! < 0) vertices[at] = 0;
    this.version++;
  }

  normal(polygon: number): Bands {
    return [this.normals[3 * polygon]!, this.normals[3 * polygon + 1]!, this.normals[3 * polygon + 2]!];
  }

  reflectanceOf(polygon: number): Bands {
    return [0, 1, 2].map((band) => this.reflectance[3 * polygon + band]!) as Bands;
  }

  /** What a polygon emits in the mix. */
  emissionOf(polygon: number): Bands {
    const group = this.group[polygon]!;
    const weight = group === NONE ? undefined : this.weights[group];
    return [0, 1, 2].map((band) => this.emission[3 * polygon + band]! * (weight?.[band] ?? 1)) as Bands;
  }

  /** Mean irradiance over all fronts. */
  mean(weights: Bands[] = this.weights): Bands {
    const sum: Bands = [0, 0, 0];
    this.data.header.groups.forEach((group, row) => {
      for (let band = 0; band < 3; band++) sum[band]! += weights[row]![band]! * group.mean_irradiance[band]!;
    });
    return sum;
  }

  /** Are lights as the solution has them? */
  get isAsSolved(): boolean {
    return this.data.header.groups.every((group, row) => group.weight.every((w, k) => w === this.weights[row]![k]));
  }

  /** The error that is claimed of this mix, relative to its own mean; null where nothing is known. */
  claimedError(): number | null {
    const { report } = this.data.header;
    if (this.isAsSolved) return report.error_estimate?.total ?? null;
    // What docs/how-to/relight.md says of a mix: without points of a check a bound.
    const known = (report.relit ?? report).error_estimate?.total;
    const all = this.weights.flat();
    const most = Math.max(...all);
    if (known === undefined) return null;
    if (most === 0) return 0;
    if (all.every((weight) => weight === most)) return known;
    const measured = this.mixError.claim(this.weights);
    if (measured !== null) return measured;
    const before = report.relit?.mean_irradiance ?? this.mean(this.weights.map(() => [1, 1, 1]));
    const average = (bands: Bands): number => (bands[0] + bands[1] + bands[2]) / 3;
    const now = average(this.mean());
    return now > 0 ? (known * most * average(before)) / now : null;
  }

  /** Irradiance at a point of a root's plane, and the leaf that holds it. */
  at(root: number, point: Bands): { irradiance: Bands; leaf: number; corners: Corners } {
    const polygon = this.trees.rootPolygon[root]!;
    const normal = this.normal(polygon);
    if (this.fields === null) return this.onMesh(polygon, normal, point);
    const { leaf, corners } = this.trees.locate(root, normal, point);
    return { irradiance: fieldAt(corners, normal, point, this.field(this.trees.leafRow[leaf]!)), leaf, corners };
  }

  /** The mixed field of a leaf. */
  private field(row: number): Float32Array {
    const mixed = new Float32Array(15);
    const { leaves } = this.data.header;
    for (let k = 0; k < 15; k++) {
      let sum = 0;
      for (let g = 0; g < this.weights.length; g++) {
        sum += this.weights[g]![k % 3]! * this.fields![(g * leaves + row) * 15 + k]!;
      }
      mixed[k] = sum;
    }
    return mixed;
  }

  /** Without fields: what the smooth surfaces have, as crates/core/src/solution/interpolate.rs reads them. */
  private onMesh(polygon: number, normal: Bands, point: Bands): { irradiance: Bands; leaf: number; corners: Corners } {
    const { origin } = this.data.header;
    const place = (vertex: number): Bands =>
      [0, 1, 2].map((k) => this.positions[3 * vertex + k]! + origin[k]!) as Bands;
    const ends = (triangle: number): number[] => [0, 1, 2].map((k) => this.triangles[3 * triangle + k]!);
    let [best, least, weights] = [this.triangleStart[polygon]!, -Infinity, [1, 0, 0]];
    for (let triangle = best; triangle < this.triangleStart[polygon + 1]!; triangle++) {
      const [a, b, c] = ends(triangle).map(place) as [Bands, Bands, Bands];
      const twice = (p: Bands, q: Bands, r: Bands): number => dot(normal, cross(subtract(q, p), subtract(r, p)));
      const whole = twice(a, b, c);
      const [wa, wb] = [twice(point, b, c) / whole, twice(a, point, c) / whole];
      const inside = Math.min(wa, wb, 1 - wa - wb);
      if (inside > least) [best, least, weights] = [triangle, inside, [wa, wb, 1 - wa - wb]];
    }
    const leaf = this.data.u32("mesh/leaf")[best]!;
    const half = this.data.u8("mesh/bilinear")[best]!;
    let vertices = ends(best);
    if (half > 0) {
      const first = best - half + 1;
      vertices = [...ends(first), ends(first + 1)[2]!];
      const [s, t] = bilinearCoordinates(vertices.map(place), normal, point);
      weights = [(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t];
    } else {
      weights = weights.map((weight) => Math.min(Math.max(weight, 0), 1));
      const sum = weights.reduce((a, b) => a + b, 0);
      weights = weights.map((weight) => weight / sum);
    }
    const irradiance = [0, 1, 2].map((band) =>
      vertices.reduce((sum, vertex, k) => sum + weights[k]! * this.vertices[3 * vertex + band]!, 0),
    ) as Bands;
    return { irradiance, leaf, corners: this.trees.corners(leaf) };
  }

  radiosity(polygon: number, irradiance: Bands): Bands {
    const [emission, reflectance] = [this.emissionOf(polygon), this.reflectanceOf(polygon)];
    return [0, 1, 2].map((k) => emission[k]! + reflectance[k]! * irradiance[k]!) as Bands;
  }

  scalarOf(bands: Bands): number {
    return dot(this.scalar, bands);
  }

  /** Means by element, pulled up from the leaves; made when they are first asked for. */
  byElement(): ByElement {
    if (this.elements?.version === this.version) return this.elements;
    const { trees } = this;
    const count = trees.firstChild.length;
    const radiosity = new Float32Array(3 * count);
    const irradiance = new Float32Array(3 * count);
    const areas = new Float64Array(count);
    const openAreas = new Float64Array(count);
    const below = (id: number, corners: Corners, polygon: number): void => {
      const first = trees.firstChild[id]!;
      if (first === NONE) {
        const [area, open] = [areaOf(corners), this.open[id]!];
        areas[id] = area;
        openAreas[id] = area * open;
        const mean = this.leafMean(trees.leafRow[id]!, corners.length);
        const sent = this.radiosity(polygon, mean);
        for (let k = 0; k < 3; k++) {
          irradiance[3 * id + k] = mean[k]! * open;
          radiosity[3 * id + k] = sent[k]!;
        }
        return;
      }
      const sums = new Float64Array(6);
      for (let k = 0; k < 4; k++) {
        const child = first + k;
        below(child, partOf(corners, trees.cut[id]!, k), polygon);
        areas[id]! += areas[child]!;
        openAreas[id]! += openAreas[child]!;
        for (let band = 0; band < 3; band++) {
          sums[band]! += areas[child]! * irradiance[3 * child + band]!;
          sums[3 + band]! += openAreas[child]! * radiosity[3 * child + band]!;
        }
      }
      for (let band = 0; band < 3; band++) {
        irradiance[3 * id + band] = sums[band]! / areas[id]!;
        radiosity[3 * id + band] = openAreas[id]! > 0 ? sums[3 + band]! / openAreas[id]! : 0;
      }
    };
    for (let root = 0; root < trees.roots; root++) {
      below(root, trees.cornersOfRoot(root), trees.rootPolygon[root]!);
    }
    this.elements = { radiosity, irradiance, version: this.version };
    return this.elements;
  }

  /** Mean irradiance of the open part of a leaf. */
  private leafMean(row: number, corners: number): Bands {
    if (this.fields !== null) return meanOfField(corners, this.field(row));
    const { leaves } = this.data.header;
    return [0, 1, 2].map((k) =>
      this.weights.reduce((sum, weight, g) => sum + weight[k]! * this.means![(g * leaves + row) * 3 + k]!, 0),
    ) as Bands;
  }
}
