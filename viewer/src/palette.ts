// Colours for numbers: palettes, scales from values to [0, 1], and round numbers for legends and contours.

import type { Bands } from "./data";

// 33 even steps of matplotlib's viridis and inferno (S. van der Walt, N. Smith; CC0), from dark to bright.
const STEPS = {
  viridis:
    "440154470d6048186a482374472d7b4537814240863e49893b528b375b8d33638d2f6b8e2c728e297a8e26828e23898e21918c1f988b1fa08822a78528ae8032b67a3fbc734ec36b5ec96270cf5784d44b98d83eaddc30c2df23d8e219ece51bfde725",
  inferno:
    "0000040403120b0724150b37210c4a2f0a5b3d09654a0c6b57106e64156e71196e7d1e6d8a226a972766a32c61b0315bbc3754c73e4cd24644db503be45a31eb6628f1731df68013f98e09fb9d07fcac11fbbc21f9cb35f5db4cf2ea69f3f68afcffa4",
};

export const PALETTES = ["viridis", "inferno", "grey"] as const;
export type Palette = (typeof PALETTES)[number];

/** 256 colours of a palette, RGBA. */
export function colours(palette: Palette): Uint8Array<ArrayBuffer> {
  const table = new Uint8Array(4 * 256);
  for (let k = 0; k < 256; k++) table.set([...colourAt(palette, k / 255), 255], 4 * k);
  return table;
}

/** The colour at a place in [0, 1], sRGB bytes. */
export function colourAt(palette: Palette, place: number): Bands {
  const along = Math.min(Math.max(place, 0), 1);
  if (palette === "grey") {
    const value = Math.round(255 * along);
    return [value, value, value];
  }
  const steps = STEPS[palette];
  const at = along * 32;
  const low = Math.min(Math.floor(at), 31);
  const step = (k: number, band: number): number =>
    Number.parseInt(steps.slice(6 * k + 2 * band, 6 * k + 2 * band + 2), 16);
  return [0, 1, 2].map((band) =>
    Math.round(step(low, band) + (step(low + 1, band) - step(low, band)) * (at - low)),
  ) as Bands;
}

export function css([red, green, blue]: Bands): string {
  return `rgb(${red} ${green} ${blue})`;
}

/** Values between two ends, evenly or by their logarithms. */
export interface Range {
  low: number;
  high: number;
  isLog: boolean;
}

/** Where a value lies in a range; 0 at its low end, 1 at its high end. */
export function placeOf(value: number, { low, high, isLog }: Range): number {
  if (!isLog) return (value - low) / (high - low);
  return value > 0 ? Math.log(value / low) / Math.log(high / low) : -Infinity;
}

/** Round numbers in a range: 1, 2, 5 times powers of ten where it is logarithmic, else even steps of such; not too many. */
export function ticks({ low, high, isLog }: Range): number[] {
  const found: number[] = [];
  if (isLog) {
    const decades = Math.log10(high / low);
    const digits = decades > 5 ? [1] : decades > 0.9 ? [1, 2, 5] : [1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9];
    for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power++) {
      for (const digit of digits) found.push(rounded(digit * 10 ** power));
    }
  } else {
    const rough = (high - low) / 8;
    const power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 2.5, 5, 10].map((digit) => digit * power).find((size) => size >= rough)!;
    for (let k = Math.ceil(low / step); k * step <= high * (1 + 1e-9); k++) found.push(rounded(k * step));
  }
  return found.filter((value) => value >= low * (1 - 1e-9) && value <= high * (1 + 1e-9));
}

function rounded(value: number): number {
  return Number(value.toPrecision(12));
}

/** A range with round ends that holds most of some values, each with its area: from the 1st to the 99th percentile of the area. */
export function fitting(values: Float64Array, areas: Float64Array, isLog: boolean): Range {
  const order = Array.from(values.keys()).filter((k) => values[k]! > 0 && areas[k]! > 0);
  if (order.length === 0) return { low: isLog ? 0.01 : 0, high: 1, isLog };
  order.sort((a, b) => values[a]! - values[b]!);
  const whole = order.reduce((sum, k) => sum + areas[k]!, 0);
  const at = (share: number): number => {
    let below = 0;
    return values[order.find((k) => (below += areas[k]!) >= share * whole) ?? order.at(-1)!]!;
  };
  const high = outwards(at(0.99), 1);
  if (!isLog) return { low: 0, high, isLog };
  const low = outwards(Math.max(at(0.01), high * 1e-4), -1);
  return { low: low < high ? low : high / 10, high, isLog };
}

/** The next 1, 2 or 5 times a power of ten, upwards or downwards. */
function outwards(value: number, direction: 1 | -1): number {
  const power = 10 ** Math.floor(Math.log10(value));
  const steps = [1, 2, 5, 10].map((digit) => digit * power);
  const next = direction > 0 ? steps.find((step) => step >= value * (1 - 1e-9)) : steps.findLast((step) => step <= value * (1 + 1e-9));
  return rounded(next ?? value);
}
