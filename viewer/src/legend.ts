// What colours mean: a ramp with round numbers, or the levels of the quadtrees.

import { count, short } from "./format";
import { any, make } from "./page";
import { colourAt, css, placeOf, ticks, type Palette, type Range } from "./palette";

/** Least distance between two labels, as a share of the ramp. */
const APART = 0.068;

export function ramp(palette: Palette, turn: string): string {
  const stops = Array.from({ length: 17 }, (_, k) => css(colourAt(palette, k / 16)));
  return `linear-gradient(${turn}, ${stops.join(", ")})`;
}

/** A ramp with ticks, or an empty one where lines alone are drawn; `lined`: contours are drawn at the ticks. */
export function showScale(title: string, palette: Palette | null, range: Range, lined: boolean, isFlat: boolean): void {
  any("legend").hidden = false;
  any("legend-title").textContent = title;
  const bar = make("div", "", { class: palette === null ? "ramp bare" : "ramp" });
  if (palette !== null) bar.style.background = ramp(palette, isFlat ? "to right" : "to top");
  const labels = make("div", [], { class: lined ? "ticks lined" : "ticks" });
  let last = -Infinity;
  // On a narrow screen labels stand side by side, and need more room.
  const apart = isFlat ? 0.16 : APART;
  for (const value of ticks(range)) {
    const place = placeOf(value, range);
    const label = make("span", short(value));
    if (place - last < apart) label.className = "edge";
    else last = place;
    if (label.className === "edge" && !isFlat) continue;
    label.style.bottom = `${100 * place}%`;
    label.style.setProperty("--at", `${100 * place}%`);
    // At its ends it stays within the legend.
    if (isFlat && label.className === "") label.className = place > 0.93 ? "last" : place < 0.07 ? "first" : "";
    labels.append(label);
  }
  any("legend-body").replaceChildren(make("div", [bar, labels], { class: "scale" }));
}

/** Colour of a level, as the shader has it. */
export function levelColour(level: number, deepest: number): string {
  return css(colourAt("viridis", deepest > 0 ? 0.12 + (0.83 * level) / deepest : 0.5));
}

export function showLevels(leaves: number[]): void {
  any("legend").hidden = false;
  any("legend-title").textContent = "Leaves by level";
  const rows = leaves.map((number, level) => {
    const swatch = make("i");
    swatch.style.background = levelColour(level, leaves.length - 1);
    return make("li", [swatch, make("span", String(level)), make("span", count(number))]);
  });
  any("legend-body").replaceChildren(make("ul", rows));
}

export function hide(): void {
  any("legend").hidden = true;
}
