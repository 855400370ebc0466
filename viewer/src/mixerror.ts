// How wrong a mix is: errors of each group at the points of its check come in, with weights; what is claimed comes out.

import type { Bands, ViewData } from "./data";

/** Times that an error's square must be above its standard error for rays to tell it from their own noise. */
const KNOWN = 2;

/** What rays found of each group; nothing where they were not asked. */
export class MixError {
  private readonly irradiance: Float32Array | null;
  private readonly errors: Float32Array;
  private readonly points: number;

  constructor(data: ViewData, groups: number) {
    this.irradiance = data.has("points/irradiance") ? data.f32("points/irradiance") : null;
    this.errors = this.irradiance === null ? new Float32Array() : data.f32("points/error");
    this.points = (this.irradiance?.length ?? 0) / (3 * groups);
  }

  /**
   * RMS error over points and bands, relative to the mix's mean, a standard error of its square added, two where rays cannot
   * tell it from their noise: the rule of isolux relight. Null without points.
   */
  claim(weights: readonly Bands[]): number | null {
    const { irradiance, errors, points } = this;
    if (irradiance === null || points === 0) return null;
    const squares = new Float64Array(points);
    let brightness = 0;
    for (let point = 0; point < points; point++) {
      for (let band = 0; band < 3; band++) {
        let [value, one, other] = [0, 0, 0];
        weights.forEach((weight, row) => {
          const at = row * points + point;
          value += weight[band]! * irradiance[3 * at + band]!;
          one += weight[band]! * errors[6 * at + band]!;
          other += weight[band]! * errors[6 * at + 3 + band]!;
        });
        // What is read there is not below nothing.
        const raised = Math.min(value, 0);
        squares[point]! += ((one + raised) * (other + raised)) / 3;
        brightness += Math.max(value, 0) / 3;
      }
    }
    const scale = brightness > 0 ? brightness / points : 1;
    const mean = squares.reduce((sum, square) => sum + square, 0) / points;
    const spread = squares.reduce((sum, square) => sum + (square - mean) * (square - mean), 0) / points;
    const square = Math.max(mean, 0) / (scale * scale);
    const doubt = Math.sqrt(spread / points) / (scale * scale);
    return Math.sqrt(square + (square > KNOWN * doubt ? 1 : 2) * doubt);
  }
}
