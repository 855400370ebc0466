// Where a point is in an element, and what a field has there: crates/wavefront/src/read.rs in the page's language, so that a
// value that is picked here is the one that the solution tells.

import { dot, type Bands } from "./data";
import { cross, subtract, type Corners } from "./tree";

const MIDDLE = 4;

/** (s, t) with (1-s)(1-t) a + s(1-t) b + s t c + (1-s) t d = point, by Newton's iteration. */
export function bilinearCoordinates(corners: Corners, normal: Bands, point: Bands): [number, number] {
  const [a, b, c, d] = corners as [Bands, Bands, Bands, Bands];
  const each = (f: (k: 0 | 1 | 2) => number): Bands => [f(0), f(1), f(2)];
  const twist = each((k) => a[k] - b[k] + c[k] - d[k]);
  let [s, t] = [0.5, 0.5];
  for (let step = 0; step < 8; step++) {
    const here = each((k) => a[k] + (b[k] - a[k]) * s + (d[k] - a[k]) * t + twist[k] * (s * t));
    const alongS = each((k) => b[k] - a[k] + twist[k] * t);
    const alongT = each((k) => d[k] - a[k] + twist[k] * s);
    const determinant = dot(normal, cross(alongS, alongT));
    const missing = subtract(point, here);
    const ds = dot(normal, cross(missing, alongT)) / determinant;
    const dt = dot(normal, cross(alongS, missing)) / determinant;
    s = clamp(s + ds);
    t = clamp(t + dt);
    if (Math.max(Math.abs(ds), Math.abs(dt)) < 1e-12) break;
  }
  return [s, t];
}

function clamp(value: number): number {
  return Math.min(Math.max(value, 0), 1);
}

/** A leaf's field, 5 places by 3 bands, at one of its points: linear along the sides, and the bulge in between. */
export function fieldAt(corners: Corners, normal: Bands, point: Bands, field: Float32Array): Bands {
  let weights: number[];
  let bulge: number;
  if (corners.length === 4) {
    const [s, t] = bilinearCoordinates(corners, normal, point);
    const [u, v] = [2 * s - 1, 2 * t - 1];
    weights = [(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t];
    bulge = 1 - 0.5 * (u * u + v * v);
  } else {
    const [a, b, c] = corners as [Bands, Bands, Bands];
    const whole = dot(normal, cross(subtract(b, a), subtract(c, a)));
    const first = clamp(dot(normal, cross(subtract(b, point), subtract(c, point))) / whole);
    const second = clamp(dot(normal, cross(subtract(c, point), subtract(a, point))) / whole);
    const third = Math.max(1 - first - second, 0);
    weights = [first, second, third];
    bulge = 3 * (first * second + second * third + third * first);
  }
  const count = corners.length;
  const value: Bands = [0, 0, 0];
  for (let band = 0; band < 3; band++) {
    let [plain, mean] = [0, 0];
    for (let k = 0; k < count; k++) {
      plain += weights[k]! * field[3 * k + band]!;
      mean += field[3 * k + band]!;
    }
    value[band] = Math.fround(Math.max(plain + bulge * (field[3 * MIDDLE + band]! - mean / count), 0));
  }
  return value;
}

/** Mean of a field over its leaf, not below 0. */
export function meanOfField(count: number, field: Float32Array): Bands {
  const middle = count === 4 ? 2 / 3 : 3 / 4;
  const value: Bands = [0, 0, 0];
  for (let band = 0; band < 3; band++) {
    let sum = 0;
    for (let k = 0; k < count; k++) sum += field[3 * k + band]!;
    value[band] = Math.max(sum / 12 + field[3 * MIDDLE + band]! * middle, 0);
  }
  return value;
}
