// Quadtrees of elements: roots and first children come in; corners, levels and the leaf at a point come out.

import { dot, NONE, type Bands, type ViewData } from "./data";

/** Corners of an element, three or four, metres. */
export type Corners = Bands[];

export class Trees {
  readonly firstChild: Uint32Array;
  /** How children cut each element. */
  readonly cut: Uint8Array;
  readonly rootPolygon: Uint32Array;
  readonly roots: number;
  /** Row of each leaf among the leaves; NONE for inner elements. */
  readonly leafRow: Uint32Array;
  readonly parent: Uint32Array;
  readonly level: Uint8Array;
  private readonly rootCorners: Float64Array;
  private readonly rootCount: Uint8Array;

  constructor(data: ViewData) {
    this.firstChild = data.u32("elements/first_child");
    this.cut = data.u8("elements/cut");
    this.rootPolygon = data.u32("roots/polygon");
    this.rootCorners = data.f64("roots/corners");
    this.rootCount = data.u8("roots/corner_count");
    this.roots = this.rootCount.length;
    const count = this.firstChild.length;
    this.parent = new Uint32Array(count).fill(NONE);
    this.level = new Uint8Array(count);
    this.leafRow = new Uint32Array(count).fill(NONE);
    let leaves = 0;
    for (let id = 0; id < count; id++) {
      const first = this.firstChild[id]!;
      if (first === NONE) {
        this.leafRow[id] = leaves++;
        continue;
      }
      for (let child = first; child < first + 4; child++) {
        this.parent[child] = id;
      }
    }
    // Parents come before their children.
    for (let id = this.roots; id < count; id++) {
      this.level[id] = this.level[this.parent[id]!]! + 1;
    }
  }

  root(id: number): number {
    let at = id;
    while (this.parent[at] !== NONE) at = this.parent[at]!;
    return at;
  }

  polygon(id: number): number {
    return this.rootPolygon[this.root(id)]!;
  }

  cornerCount(id: number): number {
    return this.rootCount[this.root(id)]!;
  }

  cornersOfRoot(root: number): Corners {
    const corners: Corners = [];
    for (let k = 0; k < this.rootCount[root]!; k++) {
      const at = 12 * root + 3 * k;
      corners.push([this.rootCorners[at]!, this.rootCorners[at + 1]!, this.rootCorners[at + 2]!]);
    }
    return corners;
  }

  corners(id: number): Corners {
    const parent = this.parent[id]!;
    if (parent === NONE) return this.cornersOfRoot(id);
    return partOf(this.corners(parent), this.cut[parent]!, id - this.firstChild[parent]!);
  }

  /** Quadrants from the root down. */
  path(id: number): number[] {
    const quadrants: number[] = [];
    for (let at = id; this.parent[at] !== NONE; at = this.parent[at]!) {
      quadrants.unshift(at - this.firstChild[this.parent[at]!]!);
    }
    return quadrants;
  }

  /** The leaf below `root` that holds a point of its plane. */
  locate(root: number, normal: Bands, point: Bands): { leaf: number; corners: Corners } {
    let id = root;
    let corners = this.cornersOfRoot(root);
    while (this.firstChild[id] !== NONE) {
      const cut = this.cut[id]!;
      const part = partAt(corners, cut, normal, point);
      corners = partOf(corners, cut, part);
      id = this.firstChild[id]! + part;
    }
    return { leaf: id, corners };
  }

  /** Calls `visit` with every leaf below `root`. */
  leaves(root: number, visit: (leaf: number, corners: Corners, level: number) => void): void {
    const below = (id: number, corners: Corners, level: number): void => {
      const first = this.firstChild[id]!;
      if (first === NONE) {
        visit(id, corners, level);
        return;
      }
      for (let k = 0; k < 4; k++) below(first + k, partOf(corners, this.cut[id]!, k), level + 1);
    };
    below(root, this.cornersOfRoot(root), 0);
  }
}

function middle(a: Bands, b: Bands): Bands {
  return [(a[0] + b[0]) * 0.5, (a[1] + b[1]) * 0.5, (a[2] + b[2]) * 0.5];
}

/** Cuts into strips along the first side, and along the second; what is neither is cut into quarters. */
const ALONG = 1;
const ACROSS = 2;

/** Ends of the cut between strips k - 1 and k of a quadrilateral. */
function stripEnds(corners: Corners, cut: number, k: number): [Bands, Bands] {
  const [a, b, c, d] = corners as [Bands, Bands, Bands, Bands];
  const at = (from: Bands, to: Bands): Bands => {
    const half = middle(from, to);
    return [from, middle(from, half), half, middle(half, to), to][k]!;
  };
  return cut === ALONG ? [at(a, b), at(d, c)] : [at(b, c), at(a, d)];
}

/** Part k of a patch. */
export function partOf(corners: Corners, cut: number, k: number): Corners {
  if (cut !== ALONG && cut !== ACROSS) return quarter(corners, k);
  const [first, second] = [stripEnds(corners, cut, k), stripEnds(corners, cut, k + 1)];
  return cut === ALONG
    ? [first[0], second[0], second[1], first[1]]
    : [first[1], first[0], second[0], second[1]];
}

/** Which part of a patch holds a point of its plane. */
function partAt(corners: Corners, cut: number, normal: Bands, point: Bands): number {
  if (cut !== ALONG && cut !== ACROSS) return quadrantOf(corners, normal, point);
  for (let k = 1; k < 4; k++) {
    const [near, far] = stripEnds(corners, cut, k);
    if (dot(normal, cross(subtract(far, near), subtract(point, near))) > 0) return k - 1;
  }
  return 3;
}

/** Quarter k of a patch; quadrant k < n touches corner k, the fourth of a triangle is its middle. */
function quarter(corners: Corners, k: number): Corners {
  const [a, b, c] = corners as [Bands, Bands, Bands];
  if (corners.length === 3) {
    const [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
    return [[a, ab, ca], [ab, b, bc], [ca, bc, c], [bc, ca, ab]][k]!;
  }
  const d = corners[3]!;
  const [ab, bc, cd, da] = [middle(a, b), middle(b, c), middle(c, d), middle(d, a)];
  const centre = middle(middle(a, c), middle(b, d));
  return [[a, ab, centre, da], [ab, b, bc, centre], [centre, bc, c, cd], [da, centre, cd, d]][k]!;
}

export function subtract(a: Bands, b: Bands): Bands {
  return [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
}

export function cross(a: Bands, b: Bands): Bands {
  return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
}

function quadrantOf(corners: Corners, normal: Bands, point: Bands): number {
  const left = (from: Bands, to: Bands): boolean =>
    dot(normal, cross(subtract(to, from), subtract(point, from))) > 0;
  const [a, b, c] = corners as [Bands, Bands, Bands];
  const [ab, bc] = [middle(a, b), middle(b, c)];
  if (corners.length === 3) {
    const ca = middle(c, a);
    if (left(ab, ca)) return 0;
    if (left(bc, ab)) return 1;
    return left(ca, bc) ? 2 : 3;
  }
  const d = corners[3]!;
  const [cd, da] = [middle(c, d), middle(d, a)];
  const [first, second] = [left(ab, cd), left(da, bc)];
  if (first) return second ? 3 : 0;
  return second ? 2 : 1;
}

export function meanOf(corners: Corners): Bands {
  const sum: Bands = [0, 0, 0];
  for (const corner of corners) for (let k = 0; k < 3; k++) sum[k]! += corner[k]!;
  return [sum[0] / corners.length, sum[1] / corners.length, sum[2] / corners.length];
}

export function areaOf(corners: Corners): number {
  const [a, b, c] = corners as [Bands, Bands, Bands];
  const twice =
    corners.length === 3
      ? cross(subtract(b, a), subtract(c, a))
      : cross(subtract(c, a), subtract(corners[3]!, b));
  return 0.5 * Math.hypot(...twice);
}
