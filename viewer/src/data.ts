// The bytes that isolux packs for its viewer become typed arrays. crates/isolux/src/view.rs describes the layout.

export type Bands = [number, number, number];

export interface Group {
  name: string;
  /** Emitted power with weight 1, W or lm. */
  power: Bands;
  /** Weight that it has in the solution. */
  weight: Bands;
  /** Its part of the mean irradiance, with weight 1. */
  mean_irradiance: Bands;
}

export interface CameraPreset {
  name: string;
  eye: Bands;
  forward: Bands;
  up: Bands;
  /** Radians. */
  vertical_angle: number | null;
  /** Of a parallel projection, metres. */
  height: number | null;
}

interface ErrorEstimate {
  total: number;
  dark: number | null;
}

export interface Report {
  status: string;
  bound: string | null;
  schedule: string;
  settings: { error: number };
  error_estimate: ErrorEstimate | null;
  mean_irradiance: Bands;
  elements: number;
  leaves: number;
  polygons: number;
  elements_by_level: number[];
  clusters: number;
  links: { total: number };
  phases: { name: string; seconds: number }[];
  stages: { estimate: number }[];
  iterations: { residual: number }[];
  relit: { error_estimate: ErrorEstimate | null; mean_irradiance: Bands } | null;
}

export interface Header {
  version: string;
  name: string;
  scene_hash: string;
  unit: "lm" | "W";
  fronts: number;
  origin: Bands;
  bounds: [Bands, Bands];
  exposure: number;
  white: number;
  groups: Group[];
  cameras: CameraPreset[];
  objects: string[];
  materials: string[];
  leaves: number;
  left_out: Partial<Record<"links" | "fields", string>>;
  report: Report;
}

interface ArrayTypes {
  u8: Uint8Array<ArrayBuffer>;
  u32: Uint32Array<ArrayBuffer>;
  f32: Float32Array<ArrayBuffer>;
  f64: Float64Array<ArrayBuffer>;
}

/** An index that is not there. */
export const NONE = 0xffffffff;

const MAGIC = "isoluxvw";
const FORMAT = 1;

/** Why data could not be read, in words for people. */
export class DataError extends Error {}

export class ViewData {
  readonly header: Header;
  private readonly arrays: Record<string, { type: keyof ArrayTypes; shape: number[]; offset: number }>;
  private readonly body: number;

  constructor(private readonly buffer: ArrayBuffer) {
    const bytes = new DataView(buffer);
    if (buffer.byteLength < 16 || new TextDecoder().decode(new Uint8Array(buffer, 0, 8)) !== MAGIC) {
      throw new DataError("these are no data of an isolux solution");
    }
    const [length, format] = [bytes.getUint32(8, true), bytes.getUint32(12, true)];
    if (format !== FORMAT) {
      throw new DataError(`data of format ${format}; this page reads format ${FORMAT}`);
    }
    this.body = 16 + length;
    if (this.body > buffer.byteLength) {
      throw new DataError("the data are cut off");
    }
    const text = new TextDecoder().decode(new Uint8Array(buffer, 16, length));
    const { arrays, ...header } = JSON.parse(text) as Header & { arrays: ViewData["arrays"] };
    this.header = header;
    this.arrays = arrays;
  }

  get bytes(): number {
    return this.buffer.byteLength;
  }

  has(name: string): boolean {
    return name in this.arrays;
  }

  u8(name: string): ArrayTypes["u8"] {
    return new Uint8Array(this.buffer, ...this.range(name, "u8", 1));
  }

  u32(name: string): ArrayTypes["u32"] {
    return new Uint32Array(this.buffer, ...this.range(name, "u32", 4));
  }

  f32(name: string): ArrayTypes["f32"] {
    return new Float32Array(this.buffer, ...this.range(name, "f32", 4));
  }

  f64(name: string): ArrayTypes["f64"] {
    return new Float64Array(this.buffer, ...this.range(name, "f64", 8));
  }

  private range(name: string, type: keyof ArrayTypes, size: number): [number, number] {
    const array = this.arrays[name];
    if (array === undefined || array.type !== type) {
      throw new DataError(`the data lack '${name}'`);
    }
    const count = array.shape.reduce((product, length) => product * length, 1);
    const start = this.body + array.offset;
    if (start + count * size > this.buffer.byteLength) {
      throw new DataError("the data are cut off");
    }
    return [start, count];
  }
}

/** One number for three bands: lumens by luminance (Rec. 709), watts by their mean, as everywhere in isolux. */
export function scalarWeights(unit: Header["unit"]): Bands {
  return unit === "lm" ? [0.2126, 0.7152, 0.0722] : [1 / 3, 1 / 3, 1 / 3];
}

export function dot(a: ArrayLike<number>, b: ArrayLike<number>): number {
  return a[0]! * b[0]! + a[1]! * b[1]! + a[2]! * b[2]!;
}
