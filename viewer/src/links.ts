// The links of an element: its own, those of the elements above it and those of the clusters that its polygon is in, with
// what each carries in the present light.

import { dot, NONE, type Bands, type ViewData } from "./data";
import type { Light } from "./light";
import { areaOf, meanOf, subtract, type Trees } from "./tree";

export interface LinkView {
  /** Node numbers: elements first, then clusters. */
  receiver: number;
  source: number;
  /** Mean of form factor times visibility; steradian per square metre where the source is a cluster. */
  factor: number;
  visibility: number;
  /** Irradiance that it brings, one number. */
  carried: number;
  /** Where its source is, and the ball of a cluster. */
  from: Bands;
  radius: number | null;
}

export class Links {
  private readonly start: Uint32Array;
  private readonly source: Uint32Array;
  private readonly factor: Float32Array;
  private readonly visibility: Uint8Array;
  private readonly clusters: {
    ball: Float32Array;
    parent: Uint32Array;
    first: Uint32Array;
    count: Uint32Array;
    members: Uint32Array;
    home: Uint32Array;
  } | null = null;

  private constructor(
    private readonly data: ViewData,
    private readonly trees: Trees,
    private readonly light: Light,
  ) {
    this.start = data.u32("links/start");
    this.source = data.u32("links/source");
    this.factor = data.f32("links/factor");
    this.visibility = data.u8("links/visibility");
    if (!data.has("clusters/ball")) return;
    const parent = data.u32("clusters/parent");
    const [first, count, members] = [
      data.u32("clusters/first"),
      data.u32("clusters/count"),
      data.u32("clusters/members"),
    ];
    // Clusters come after those above them: the last one that holds a polygon is the smallest.
    const home = new Uint32Array(trees.roots).fill(NONE);
    for (let cluster = 0; cluster < parent.length; cluster++) {
      for (let k = first[cluster]!; k < first[cluster]! + count[cluster]!; k++) home[members[k]!] = cluster;
    }
    this.clusters = { ball: data.f32("clusters/ball"), parent, first, count, members, home };
  }

  static of(data: ViewData, trees: Trees, light: Light): Links | null {
    return data.has("links/start") ? new Links(data, trees, light) : null;
  }

  /** Links that bring light to an element, the strongest first. */
  to(element: number): LinkView[] {
    const { trees } = this;
    const elements = trees.firstChild.length;
    const found: LinkView[] = [];
    const corners = trees.corners(element);
    const polygon = trees.polygon(element);
    const receiver = { middle: meanOf(corners), normal: this.light.normal(polygon) };
    for (let at = element; at !== NONE; at = trees.parent[at]!) this.collect(at, receiver, found);
    if (this.clusters !== null) {
      const home = this.clusters.home[trees.root(element)]!;
      for (let at = home; at !== NONE; at = this.clusters.parent[at]!) this.collect(elements + at, receiver, found);
    }
    return found.sort((a, b) => b.carried - a.carried);
  }

  private collect(node: number, receiver: { middle: Bands; normal: Bands }, found: LinkView[]): void {
    const { trees, light } = this;
    const elements = trees.firstChild.length;
    const { radiosity } = light.byElement();
    for (let link = this.start[node]!; link < this.start[node + 1]!; link++) {
      const source = this.source[link]!;
      const [factor, visibility] = [this.factor[link]!, this.visibility[link]! / 255];
      let from: Bands;
      let radius: number | null = null;
      let sent: Bands;
      if (source < elements) {
        from = meanOf(trees.corners(source));
        sent = [0, 1, 2].map((k) => radiosity[3 * source + k]!) as Bands;
      } else {
        const cluster = source - elements;
        ({ from, radius } = this.ball(cluster));
        sent = this.intensity(cluster, subtract(node < elements ? receiver.middle : this.ball(node - elements).from, from));
      }
      let carried = factor * light.scalarOf(sent);
      if (node >= elements) {
        // The factor of a cluster is that of a surface that faces the source.
        const towards = subtract(from, this.ball(node - elements).from);
        carried *= Math.max(0, dot(receiver.normal, towards) / Math.hypot(...towards));
      }
      if (carried > 0) found.push({ receiver: node, source, factor, visibility, carried, from, radius });
    }
  }

  private ball(cluster: number): { from: Bands; radius: number } {
    const { ball } = this.clusters!;
    const { origin } = this.data.header;
    const from = [0, 1, 2].map((k) => ball[4 * cluster + k]! + origin[k]!) as Bands;
    return { from, radius: ball[4 * cluster + 3]! };
  }

  /** Intensity of a cluster in a direction, W/sr or lm/sr: what its members send that face it. */
  private intensity(cluster: number, direction: Bands): Bands {
    const { first, count, members } = this.clusters!;
    const { radiosity } = this.light.byElement();
    const length = Math.hypot(...direction) || 1;
    const sum: Bands = [0, 0, 0];
    for (let k = first[cluster]!; k < first[cluster]! + count[cluster]!; k++) {
      const root = members[k]!;
      const facing = dot(this.light.normal(this.trees.rootPolygon[root]!), direction) / length;
      if (facing <= 0) continue;
      const share = (facing * areaOf(this.trees.cornersOfRoot(root))) / Math.PI;
      for (let band = 0; band < 3; band++) sum[band]! += share * radiosity[3 * root + band]!;
    }
    return sum;
  }
}
