// Talks with whoever holds the page in a frame, a notebook's widget: what is picked and how lights are dimmed go out,
// weights come in. `python/isolux/viewer/widget.py` is the other side.

import type { Bands } from "./data";
import type { Reading } from "./pick";
import type { Viewer } from "./viewer";

/** What comes in: a greeting, without which nothing goes out, and weights of lights. */
interface Said {
  isolux: "hello" | "weights";
  weights: Record<string, Bands>;
}

const isWeight = (value: unknown): value is number => typeof value === "number" && value >= 0 && value < Infinity;
const isBands = (value: unknown): value is Bands =>
  Array.isArray(value) && value.length === 3 && value.every(isWeight);

function isSaid(value: unknown): value is Said {
  if (typeof value !== "object" || value === null) return false;
  const { isolux, weights } = value as Partial<Said>;
  return (
    (isolux === "hello" || isolux === "weights") &&
    typeof weights === "object" &&
    weights !== null &&
    Object.values(weights).every(isBands)
  );
}

/** What is told of a picked point. */
const told = (reading: Reading): Record<string, unknown> => ({
  object: reading.object,
  material: reading.material,
  faces: reading.faces,
  is_back: reading.isBack,
  position: reading.point,
  element: reading.element,
  level: reading.level,
  irradiance: reading.irradiance,
  radiosity: reading.radiosity,
  reflectance: reading.reflectance,
  emission: reading.emission,
});

/** Listens to the window around the frame; where there is none, does nothing. */
export function follow(viewer: Viewer): void {
  const host = window.parent;
  if (host === window) return;
  // Of another origin, its address is not to be known; what is told goes only to who holds the frame, and greets.
  const send = (message: object): void => host.postMessage(message, "*");
  addEventListener("message", ({ source, data }: MessageEvent<unknown>) => {
    if (source !== host || !isSaid(data)) return;
    if (data.isolux === "hello") {
      viewer.onTell = (reading) => send({ isolux: "pick", pick: reading === null ? null : told(reading) });
      viewer.onRelit = () => send({ isolux: "weights", weights: viewer.weights });
    }
    viewer.weights = data.weights;
  });
  send({ isolux: "ready" });
}
