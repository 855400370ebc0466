// Numbers at contours: places on the lines are found in the scene, and shown where they are seen and have room.

import * as THREE from "three";
import { dot, type Bands, type ViewData } from "./data";
import { short } from "./format";
import type { Light } from "./light";
import { make } from "./page";
import { ticks, type Range } from "./palette";
import { subtract } from "./tree";

/** Places that are looked for along the longest side of the scene, and of all of them so many at most. */
const PLACES = 10;
const MOST = 400;
/** Triangles that are looked at; of more, some. */
const MOST_TRIANGLES = 400_000;
/** After so long without a change, milliseconds, numbers appear; until then they only go. */
const REST = 150;
/** Time that is spent at a stretch on finding out what hides them, milliseconds: the page stays quick. */
const STRETCH = 12;
/** Surfaces are not written on that are seen from the side: least cosine. */
const FLATTEST = 0.2;
/** Numbers of one value are at least so far apart, CSS pixels: one says it of a stretch of line. */
const APART = 120;
/** Height of a number, width of a digit and room around it, CSS pixels. */
const [HEIGHT, DIGIT, ROOM] = [15, 7, 10];

interface Place {
  text: string;
  point: Bands;
  normal: Bands;
  /** Was it seen when the eye last stood still? */
  seen: boolean;
}

/** What is drawn: a number, and the middle of where it stands, CSS pixels. */
export interface Label {
  text: string;
  x: number;
  y: number;
}

export interface Sight {
  camera: THREE.PerspectiveCamera;
  eye: Bands;
  width: number;
  height: number;
  near: (point: Bands) => Bands;
  /** Is a point the first that is met from the eye? */
  sees: (point: Bands) => boolean;
}

export class Labels {
  /** What is shown. */
  shown: Label[] = [];
  private places: Place[] = [];
  private isStale = true;
  private timer = 0;

  constructor(
    private readonly layer: HTMLElement,
    /** Finds the places anew. */
    private readonly find: () => Place[],
    private readonly sight: () => Sight,
  ) {}

  /** Lines lie elsewhere now. */
  drop(): void {
    this.isStale = true;
    this.places = [];
    this.frame();
  }

  /** The scene is drawn: numbers go along, and what is hidden now is looked up once nothing moves. */
  frame(): void {
    this.write();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.rest(), REST);
  }

  /** Looks up what is hidden, from a place on; those before have their room already. */
  private rest(from = 0): void {
    if (this.isStale) {
      this.places = this.find();
      this.isStale = false;
    }
    if (this.places.length === 0) return;
    const sight = this.sight();
    const end = performance.now() + STRETCH;
    let next = from;
    // One at least, however slow.
    do {
      const place = this.places[next]!;
      place.seen = spot(place, sight) !== null && sight.sees(place.point);
    } while (++next < this.places.length && performance.now() < end);
    this.write();
    if (next < this.places.length) this.timer = setTimeout(() => this.rest(next), 0);
  }

  private write(): void {
    this.shown = [];
    const seen = this.places.filter((place) => place.seen);
    if (seen.length > 0) {
      const sight = this.sight();
      for (const place of seen) {
        const at = spot(place, sight);
        if (at === null) continue;
        const [x, y] = at;
        const half = widthOf(place.text) / 2;
        const isFree = this.shown.every((other) => {
          const [across, down] = [Math.abs(x - other.x), Math.abs(y - other.y)];
          if (other.text === place.text && Math.hypot(across, down) < APART) return false;
          return across > half + widthOf(other.text) / 2 + ROOM || down > HEIGHT + ROOM;
        });
        if (isFree) this.shown.push({ text: place.text, x, y });
        // What gave way while the eye moved comes back when it rests.
        else place.seen = false;
      }
    }
    while (this.layer.childElementCount > this.shown.length) this.layer.lastElementChild!.remove();
    while (this.layer.childElementCount < this.shown.length) this.layer.append(make("span"));
    this.shown.forEach(({ text, x, y }, row) => {
      const span = this.layer.children[row] as HTMLElement;
      if (span.textContent !== text) span.textContent = text;
      span.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px) translate(-50%, -50%)`;
    });
  }
}

const widthOf = (text: string): number => DIGIT * text.length + 6;

/** Where a place is on the canvas; null where it is outside, or seen from behind or nearly from the side. */
function spot(place: Place, { camera, eye, width, height, near }: Sight): [number, number] | null {
  const towards = subtract(eye, place.point);
  if (dot(place.normal, towards) < FLATTEST * Math.hypot(...towards)) return null;
  const at = new THREE.Vector3(...near(place.point)).project(camera);
  const half = widthOf(place.text) / 2;
  const [x, y] = [((at.x + 1) / 2) * width, ((1 - at.y) / 2) * height];
  const isInside = at.z < 1 && x > half && x < width - half && y > HEIGHT / 2 && y < height - HEIGHT / 2;
  return isInside ? [x, y] : null;
}

/** Places on the lines of equal value, level by level in turn, at most one of a level in each cell of a coarse grid. */
export function placesOf(data: ViewData, light: Light, range: Range, luminances: boolean): Place[] {
  const levels = ticks(range);
  const [triangles, positions] = [data.u32("mesh/triangles"), data.f32("mesh/positions")];
  const [starts, normals] = [data.u32("mesh/triangle_start"), data.f64("polygons/normal")];
  const { bounds, origin } = data.header;
  const cell = Math.max(...[0, 1, 2].map((k) => bounds[1][k]! - bounds[0][k]!)) / PLACES;
  const found = levels.map(() => new Map<string, Place>());
  const step = Math.max(1, Math.ceil(triangles.length / 3 / MOST_TRIANGLES));
  for (let polygon = 0; polygon + 1 < starts.length; polygon++) {
    const [first, end] = [starts[polygon]!, starts[polygon + 1]!];
    for (let triangle = first; triangle < end; triangle += step) {
      const corners = [0, 1, 2].map((k) => triangles[3 * triangle + k]!);
      const values = corners.map((vertex) => {
        const arriving = [0, 1, 2].map((band) => light.vertices[3 * vertex + band]!) as Bands;
        const value = luminances ? light.radiosity(polygon, arriving) : arriving;
        return light.scalarOf(value) / (luminances ? Math.PI : 1);
      });
      const [least, most] = [Math.min(...values), Math.max(...values)];
      levels.forEach((level, row) => {
        if (!(least < level && level < most)) return;
        // The middle of the line through the triangle.
        const sum: Bands = [0, 0, 0];
        let crossed = 0;
        for (let k = 0; k < 3; k++) {
          const [a, b] = [values[k]!, values[(k + 1) % 3]!];
          if (a < level === b < level) continue;
          const share = (level - a) / (b - a);
          crossed++;
          for (let axis = 0; axis < 3; axis++) {
            const [from, to] = [positions[3 * corners[k]! + axis]!, positions[3 * corners[(k + 1) % 3]! + axis]!];
            sum[axis]! += from + share * (to - from);
          }
        }
        const point = sum.map((value, axis) => value / crossed + origin[axis]!) as Bands;
        const key = point.map((value) => Math.floor(value / cell)).join();
        if (found[row]!.has(key)) return;
        const normal = [0, 1, 2].map((axis) => normals[3 * polygon + axis]!) as Bands;
        found[row]!.set(key, { text: short(level), point, normal, seen: false });
      });
    }
  }
  // Every level has its turn.
  const lists = found.map((places) => [...places.values()]);
  const places: Place[] = [];
  for (let turn = 0; places.length < MOST && lists.some((list) => turn < list.length); turn++) {
    for (const list of lists) if (turn < list.length) places.push(list[turn]!);
  }
  return places.slice(0, MOST);
}
