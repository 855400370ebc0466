// The page: a solution, how it is shown, what is picked in it, and the controls for all of that.

import * as THREE from "three";
import { NONE, ViewData, type Bands } from "./data";
import { bytes, count, number, percent, seconds } from "./format";
import { Labels, placesOf, type Label, type Sight } from "./labels";
import { hide, showLevels, showScale } from "./legend";
import { Light } from "./light";
import { Links, type LinkView } from "./links";
import { Navigation } from "./navigation";
import { any, button, element, fill, input, make, select } from "./page";
import { fitting, PALETTES, type Palette } from "./palette";
import { Picker, type Ray, type Reading } from "./pick";
import { claimText, stageText } from "./progress";
import { linkColour, MOST_DRAWN, Stage, type Look, type Mode } from "./stage";
import { areaOf, subtract, Trees } from "./tree";

/** Triangles that a range of values is found from. */
const MOST_SAMPLES = 50_000;

/** A solution in all its parts. */
interface Solved {
  data: ViewData;
  trees: Trees;
  light: Light;
  picker: Picker;
  links: Links | null;
  /** Is it a picture of a solve that goes on? */
  isPicture: boolean;
}

const UNITS = {
  lm: {
    irradiance: "lx",
    irradianceName: "Irradiance",
    luminance: "cd/m²",
    luminanceName: "Luminance",
    radiosity: "lm/m²",
    power: "lm",
  },
  W: {
    irradiance: "W/m²",
    irradianceName: "Irradiance",
    luminance: "W/(m² sr)",
    luminanceName: "Radiance",
    radiosity: "W/m²",
    power: "W",
  },
} as const;

export class Viewer {
  private readonly stage: Stage;
  private readonly navigation: Navigation;
  private solved: Solved | null = null;
  private look: Look = {
    mode: "light",
    stops: 0,
    palette: "viridis",
    range: { low: 0.1, high: 1, isLog: true },
    luminances: false,
    contours: false,
    wires: false,
    backs: false,
  };
  /** Hears of the picked point each time it is read, also in other light; null where none is. */
  onTell: (reading: Reading | null) => void = () => undefined;
  /** Hears that lights were dimmed, or are those of another solution. */
  onRelit: () => void = () => undefined;
  private picked: Reading | null = null;
  private drawn: LinkView[] = [];
  private readonly numbers: Labels;

  constructor() {
    const canvas = element("canvas", HTMLCanvasElement);
    this.stage = new Stage(canvas);
    this.navigation = new Navigation(canvas, this.stage.camera);
    this.navigation.onChange = () => this.stage.invalidate();
    this.navigation.onPick = (x, y) => this.pick(x, y);
    this.numbers = new Labels(
      any("numbers"),
      () => this.places(),
      () => this.sight(),
    );
    this.stage.onFrame = () => this.frame();
    new ResizeObserver(() => this.resize()).observe(any("stage"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.ground());
    this.ground();
    this.resize();
    this.wire();
  }

  /**
   * Shows a solution, or a picture of a solve that goes on. Of the one before, the view, the look and the weights of lights with
   * the same names stay, and the picked point, if the scene is the same. `exposedAs`: data whose exposure is used.
   */
  show(buffer: ArrayBuffer, { isPicture = false, exposedAs = buffer } = {}): void {
    const data = new ViewData(buffer);
    if (exposedAs !== buffer) data.header.exposure = new ViewData(exposedAs).header.exposure;
    const trees = new Trees(data);
    const light = new Light(data, trees);
    const before = this.solved;
    before?.data.header.groups.forEach((group, row) => {
      const now = data.header.groups.findIndex(({ name }) => name === group.name);
      if (now >= 0 && !before.light.isAsSolved) light.weights[now] = before.light.weights[row]!;
    });
    light.mix();
    const picker = new Picker(data, trees, light);
    this.solved = { data, trees, light, picker, links: Links.of(data, trees, light), isPicture };
    const { picked } = this;
    this.drop();
    this.stage.show(data, trees, light);
    this.navigation.begin(data.header);
    this.describe();
    if (before === null) {
      this.fit();
      this.navigation.preset(data.header.cameras[0]!, data.header);
    }
    if (picked !== null && before?.data.header.scene_hash === data.header.scene_hash) {
      // Elements have other numbers now: it is looked up again.
      const root = trees.rootPolygon.indexOf(picked.polygon);
      if (root >= 0) this.picked = picker.read(root, picked.point);
    }
    this.apply();
    this.relit();
    any("notice").hidden = true;
  }

  /** One line about data: how far the solve was. */
  describeStage(buffer: ArrayBuffer, isPicture: boolean): string {
    const { report } = new ViewData(buffer).header;
    const { stages, iterations, error_estimate } = report;
    const steps = stages.length > 0 ? stages.length : iterations.length;
    const last = stages[stages.length - 1];
    const claim = claimText(error_estimate?.total ?? null, last?.estimate ?? null);
    return `${isPicture ? "" : "Result: "}${stageText(steps, iterations.length === 0, report.elements, claim)}`;
  }

  // What is asked from outside, by tests and by people who script the page.

  /** What is seen at a place of the canvas, CSS pixels from its upper left corner; it is marked and told of. */
  pick(x: number, y: number): Reading | null {
    const solved = this.solved;
    if (solved === null) return null;
    const hit = solved.picker.hit(this.ray(x, y), this.look.backs);
    if (hit === null) {
      this.drop();
      return null;
    }
    return this.choose(solved.picker.read(hit.root, hit.point));
  }

  /** What is known of a point of a polygon. */
  at(polygon: number, point: Bands): Reading {
    const { trees, picker } = this.known();
    const root = trees.rootPolygon.indexOf(polygon);
    if (root < 0) throw new RangeError(`there is no polygon ${polygon}`);
    return picker.read(root, point);
  }

  /** Dims lights by name. */
  dim(weights: Record<string, number>): void {
    const { data, light } = this.known();
    for (const [name, weight] of Object.entries(weights)) {
      const row = data.header.groups.findIndex((group) => group.name === name);
      if (row < 0) throw new RangeError(`there is no light '${name}'`);
      this.setWeight(row, weight);
    }
    light.mix();
    this.relit();
  }

  /** Factors on what the lights emit, by their names and bands. */
  get weights(): Record<string, Bands> {
    const { data, light } = this.known();
    return Object.fromEntries(data.header.groups.map(({ name }, row) => [name, [...light.weights[row]!] as Bands]));
  }

  /** Sets them; names that there are not are left out. */
  set weights(weights: Record<string, Bands>) {
    const { data, light } = this.known();
    data.header.groups.forEach(({ name }, row) => {
      if (Object.hasOwn(weights, name)) light.weights[row] = [...weights[name]!];
    });
    light.mix();
    this.relit();
  }

  setLook(look: Partial<Look>): void {
    Object.assign(this.look, look);
    this.apply();
  }

  /** Where the eye is, metres, and where it looks, radians. */
  get view(): { eye: Bands; yaw: number; pitch: number; way: string } {
    const { eye, yaw, pitch, way } = this.navigation;
    return { eye: [...eye], yaw, pitch, way };
  }

  /** Looks through a camera, by name. */
  see(name: string): void {
    const { header } = this.known().data;
    const camera = header.cameras.find((camera) => camera.name === name);
    if (camera === undefined) throw new RangeError(`there is no camera '${name}'`);
    this.navigation.preset(camera, header);
  }

  /** Looks from a point to a point. */
  stand(eye: Bands, at: Bands, angle = 60): void {
    const { header } = this.known().data;
    const away = [0, 1, 2].map((k) => at[k]! - eye[k]!) as Bands;
    const length = Math.hypot(...away);
    const forward = away.map((x) => x / length) as Bands;
    const vertical_angle = (angle * Math.PI) / 180;
    this.navigation.preset({ name: "", eye, forward, up: [0, 0, -1], vertical_angle, height: null }, header);
  }

  /** Where a point is on the canvas, CSS pixels. */
  project(point: Bands): [number, number] {
    this.navigation.place(this.known().data.header.origin);
    const { clientWidth, clientHeight } = this.stage.canvas;
    const at = new THREE.Vector3(...this.stage.near()(point)).project(this.stage.camera);
    return [((at.x + 1) / 2) * clientWidth, ((1 - at.y) / 2) * clientHeight];
  }

  get mean(): Bands {
    return this.known().light.mean();
  }

  /** The numbers at contours that are shown. */
  get labels(): Label[] {
    return this.numbers.shown;
  }

  get links(): LinkView[] {
    return this.drawn;
  }

  get header(): ViewData["header"] {
    return this.known().data.header;
  }

  picture(width: number, height: number): Promise<Blob> {
    return this.stage.picture(width, height);
  }

  benchmark(frames: number): number {
    return this.stage.benchmark(frames);
  }

  private known(): Solved {
    if (this.solved === null) throw new Error("nothing is loaded yet");
    return this.solved;
  }

  private ray(x: number, y: number): Ray {
    const { origin } = this.known().data.header;
    this.navigation.place(origin);
    const { clientWidth, clientHeight } = this.stage.canvas;
    const forward = this.navigation.forward();
    const { elements } = this.stage.camera.matrixWorld;
    const tall = Math.tan(this.navigation.angle / 2);
    const across = ((2 * x) / clientWidth - 1) * tall * (clientWidth / clientHeight);
    const up = (1 - (2 * y) / clientHeight) * tall;
    const direction = [0, 1, 2].map((k) => forward[k]! + elements[k]! * across + elements[4 + k]! * up) as Bands;
    return { origin: this.navigation.eye, direction };
  }

  private frame(): void {
    if (this.solved === null) return;
    this.navigation.place(this.solved.data.header.origin);
    this.numbers.frame();
    const tag = any("tag");
    tag.hidden = this.picked === null;
    if (this.picked === null) return;
    const at = new THREE.Vector3(...this.stage.near()(this.picked.point)).project(this.stage.camera);
    const { clientWidth, clientHeight } = this.stage.canvas;
    tag.hidden = at.z > 1 || Math.abs(at.x) > 1 || Math.abs(at.y) > 1;
    const [x, y] = [((at.x + 1) / 2) * clientWidth, ((1 - at.y) / 2) * clientHeight];
    tag.style.transform = `translate(${x.toFixed(1)}px, ${y.toFixed(1)}px)`;
  }

  /** Where numbers may stand at contours. */
  private places(): ReturnType<typeof placesOf> {
    const { look, solved } = this;
    if (solved === null || !look.contours || look.mode === "levels") return [];
    return placesOf(solved.data, solved.light, look.range, look.luminances);
  }

  private sight(): Sight {
    const { header } = this.known().data;
    this.navigation.place(header.origin);
    const { clientWidth: width, clientHeight: height } = this.stage.canvas;
    const eye: Bands = [...this.navigation.eye];
    const { picker } = this.known();
    const sees = (point: Bands): boolean => {
      const direction = subtract(point, eye);
      const hit = picker.hit({ origin: eye, direction }, this.look.backs);
      // A hit at distance 1 is the point itself.
      return hit !== null && Math.abs(hit.distance - 1) < 1e-3;
    };
    return { camera: this.stage.camera, eye, width, height, near: this.stage.near(), sees };
  }

  private resize(): void {
    const { clientWidth, clientHeight } = any("stage");
    this.stage.resize(Math.max(clientWidth, 1), Math.max(clientHeight, 1));
    if (this.solved !== null) this.legend();
  }

  private ground(): void {
    this.stage.background(getComputedStyle(document.documentElement).getPropertyValue("--ground").trim());
  }

  // The picked point.

  private choose(reading: Reading): Reading {
    this.picked = reading;
    element("point", HTMLDetailsElement).open = true;
    this.tell();
    any("point").scrollIntoView({ block: "nearest" });
    return reading;
  }

  private drop(): void {
    this.picked = null;
    this.drawn = [];
    this.tell();
  }

  /** Reads the picked point again, in the present light, and tells of it. */
  private tell(): void {
    const { picked, solved } = this;
    any("point-none").hidden = picked !== null;
    any("point-values").hidden = picked === null;
    if (picked === null || solved === null) {
      this.stage.mark(null, []);
      this.onTell(null);
      return;
    }
    const reading = solved.picker.read(picked.root, picked.point);
    this.picked = reading;
    this.onTell(reading);
    const units = UNITS[solved.data.header.unit];
    const main = number(reading.illuminance);
    any("point-main").textContent = main;
    any("point-unit").textContent = units.irradiance;
    any("tag-value").textContent = `${main} ${units.irradiance}`;
    any("point-where").textContent = `${reading.object} · ${reading.material}${reading.isBack ? " · back" : ""}`;
    fill(any("point-list"), [
      [units.luminanceName, `${number(reading.luminance)} ${units.luminance}`],
      ["Position", `${reading.point.map((x) => x.toFixed(3)).join(", ")} m`],
      ["Element", `${count(reading.element)} · level ${reading.level}`],
      ["Polygon", `${count(reading.polygon)} · ${reading.faces.length > 1 ? "triangles" : "triangle"} ${reading.faces.join(", ")}`],
      ...(reading.opacity < 1 ? [["Opacity", number(reading.opacity, 3)] as [string, string]] : []),
    ]);
    const rows: [string, Bands, number][] = [
      [`Irradiance, ${units.irradiance}`, reading.irradiance, 4],
      [`Radiosity, ${units.radiosity}`, reading.radiosity, 4],
      ["Reflectance", reading.reflectance, 3],
    ];
    if (reading.emission.some((band) => band > 0)) rows.push([`Emission, ${units.radiosity}`, reading.emission, 4]);
    any("point-bands").querySelector("tbody")!.replaceChildren(
      ...rows.map(([name, bands, digits]) =>
        make("tr", [
          make("th", name, { scope: "row" }),
          ...bands.map((band) => make("td", number(band, digits))),
        ]),
      ),
    );
    this.tellLinks(reading);
  }

  private tellLinks(reading: Reading): void {
    const { links, data } = this.known();
    const box = input("links");
    box.disabled = links === null;
    this.drawn = links !== null && box.checked ? links.to(reading.element) : [];
    any("links-info").hidden = !(box.checked || links === null);
    const text = any("links-text");
    const scale = any("links-scale");
    scale.hidden = this.drawn.length === 0;
    if (links === null) {
      text.textContent = `Links are left out of these data: ${data.header.left_out.links ?? "none"}.`;
    } else if (this.drawn.length === 0) {
      text.textContent = "No link brings light here.";
    } else {
      const unit = UNITS[data.header.unit].irradiance;
      const sum = this.drawn.reduce((total, link) => total + link.carried, 0);
      const elements = this.known().trees.firstChild.length;
      const clusters = this.drawn.filter((link) => link.source >= elements).length;
      const kinds = clusters > 0 ? `, ${count(clusters)} from clusters (rings)` : "";
      const most = this.drawn.length > MOST_DRAWN ? ` The strongest ${MOST_DRAWN} are drawn.` : "";
      text.textContent = `${count(this.drawn.length)} links bring ${number(sum, 3)} ${unit}${kinds}.${most}`;
      const strongest = this.drawn[0]!.carried;
      const [low, bar, high] = scale.children as unknown as [HTMLElement, HTMLElement, HTMLElement];
      low.textContent = `≤ ${number(strongest / 1000, 2)}`;
      high.textContent = `${number(strongest, 2)} ${unit}`;
      const stops = Array.from({ length: 9 }, (_, k) => linkColour(10 ** (-3 + (3 * k) / 8)));
      bar.style.background = `linear-gradient(to right, ${stops.map((c) => `rgb(${c.join(" ")})`).join(", ")})`;
    }
    this.stage.mark(reading, this.drawn);
  }

  // The light.

  /** Sets a group's weight, keeping its colour. */
  private setWeight(row: number, weight: number): void {
    const { data, light } = this.known();
    const { tint } = tinted(data.header.groups[row]!.weight);
    light.weights[row] = tint.map((band) => band * weight) as Bands;
  }

  /** After the weights have changed. */
  private relit(): void {
    const { data, light } = this.known();
    this.stage.relit();
    this.numbers.drop();
    const units = UNITS[data.header.unit];
    const mean = number(light.scalarOf(light.mean()));
    any("mean").textContent = `${mean} ${units.irradiance}`;
    const claimed = light.claimedError();
    any("mix-error").textContent = claimed === null ? "not known" : percent(claimed);
    button("reset").disabled = light.isAsSolved;
    data.header.groups.forEach((group, row) => {
      const { weight } = tinted(light.weights[row]!);
      const slider = input(`group-${row}`);
      const box = input(`weight-${row}`);
      slider.value = String(weight);
      if (document.activeElement !== box) box.value = String(Number(weight.toFixed(3)));
      const power = group.power.map((band, k) => band * light.weights[row]![k]!) as Bands;
      // Of a sun no power is counted.
      const isSun = group.power.every((band) => band === 0);
      any(`power-${row}`).textContent = isSun ? "" : `${number(light.scalarOf(power), 3)} ${units.power}`;
    });
    if (this.picked !== null) this.tell();
    this.onRelit();
  }

  private reset(): void {
    const { data, light } = this.known();
    data.header.groups.forEach((group, row) => (light.weights[row] = [...group.weight]));
    light.mix();
    this.relit();
  }

  /** A range that fits what is there. */
  private fit(): void {
    const { light, data } = this.known();
    const [triangles, positions] = [data.u32("mesh/triangles"), data.f32("mesh/positions")];
    const owners = this.look.luminances ? owner(data) : null;
    // Some are enough.
    const step = Math.max(1, Math.floor(triangles.length / 3 / MOST_SAMPLES));
    const length = Math.ceil(triangles.length / 3 / step);
    const [values, areas] = [new Float64Array(length), new Float64Array(length)];
    for (let k = 0; k < length; k++) {
      const corners = [0, 1, 2].map((corner) => triangles[3 * k * step + corner]!);
      areas[k] = areaOf(corners.map((vertex) => row(positions, vertex)));
      const each = corners.map((vertex) => row(light.vertices, vertex));
      const arriving = [0, 1, 2].map((band) => (each[0]![band]! + each[1]![band]! + each[2]![band]!) / 3) as Bands;
      const shown = owners === null ? arriving : light.radiosity(owners[corners[0]!]!, arriving);
      values[k] = light.scalarOf(shown) / (owners === null ? 1 : Math.PI);
    }
    this.look.range = fitting(values, areas, this.look.range.isLog);
  }

  // The look.

  private apply(): void {
    const { look } = this;
    element("panel", HTMLElement)
      .querySelectorAll<HTMLInputElement>("input[name=mode]")
      .forEach((radio) => (radio.checked = radio.value === look.mode));
    for (const part of document.querySelectorAll<HTMLElement>("[data-for], [data-not]")) {
      part.hidden = (part.dataset["for"] ?? look.mode) !== look.mode || part.dataset["not"] === look.mode;
    }
    input("stops").value = String(look.stops);
    const sign = look.stops > 0 ? "+" : look.stops < 0 ? "−" : "";
    any("stops-value").textContent = `${sign}${Math.abs(look.stops).toFixed(1)} EV`;
    input("low").value = String(look.range.low);
    input("high").value = String(look.range.high);
    input("log").checked = look.range.isLog;
    input("contours").checked = look.contours;
    input("wires").checked = look.wires;
    input("backs").checked = look.backs;
    select("palette").value = look.palette;
    select("quantity").value = look.luminances ? "luminance" : "irradiance";
    this.stage.setLook(look);
    this.numbers.drop();
    if (this.solved !== null) this.legend();
  }

  private legend(): void {
    const { look } = this;
    const { data } = this.known();
    const units = UNITS[data.header.unit];
    const isFlat = matchMedia("(max-width: 720px), (orientation: portrait) and (max-width: 900px)").matches;
    if (look.mode === "levels") {
      showLevels(this.leavesByLevel());
    } else if (look.mode === "false-colour" || look.contours) {
      const title = look.luminances
        ? `${units.luminanceName}, ${units.luminance}`
        : `${units.irradianceName}, ${units.irradiance}`;
      showScale(title, look.mode === "light" ? null : look.palette, look.range, look.contours, isFlat);
    } else {
      hide();
    }
  }

  private leavesByLevel(): number[] {
    const { trees } = this.known();
    const leaves: number[] = [];
    trees.level.forEach((level, id) => {
      if (trees.firstChild[id] !== NONE) return;
      while (leaves.length <= level) leaves.push(0);
      leaves[level]!++;
    });
    return leaves;
  }

  /** Takes the range from its fields, where it makes sense. */
  private takeRange(): void {
    const [low, high] = [input("low").valueAsNumber, input("high").valueAsNumber];
    const { isLog } = this.look.range;
    const isSound = Number.isFinite(low) && Number.isFinite(high) && low < high && (!isLog || low > 0);
    for (const field of [input("low"), input("high")]) {
      field.setCustomValidity(isSound ? "" : isLog ? "Two numbers above 0, the lower one first" : "The lower one first");
      field.setAttribute("aria-invalid", String(!isSound));
    }
    if (isSound) this.setLook({ range: { low, high, isLog } });
    else input("low").reportValidity();
  }

  // The page.

  private describe(): void {
    const { data, trees, light, isPicture } = this.known();
    const { header } = data;
    const { report } = header;
    const units = UNITS[header.unit];
    document.title = `${header.name} – isolux`;
    any("name").textContent = header.name;
    any("summary").textContent = `${count(header.leaves)} leaves · ${count(report.links.total)} links`;
    select("quantity").replaceChildren(
      make("option", `${units.irradianceName}, ${units.irradiance}`, { value: "irradiance" }),
      make("option", `${units.luminanceName}, ${units.luminance}`, { value: "luminance" }),
    );
    const title = (name: string): string => (name === "overview" ? "Overview" : name);
    const camera = select("cameras").value;
    select("cameras").replaceChildren(
      ...header.cameras.map((camera, row) => make("option", title(camera.name), { value: String(row) })),
    );
    if (header.cameras[Number(camera)] !== undefined) select("cameras").value = String(Number(camera));
    any("cameras-row").hidden = header.cameras.length < 2;
    any("groups").replaceChildren(...header.groups.map((group, row) => this.groupRow(group.name, row)));
    const time = report.phases.reduce((sum, phase) => sum + phase.seconds, 0);
    const estimate = report.error_estimate;
    const rows: [string, string][] = [
      ["Status", isPicture ? "not finished" : report.bound === null ? report.status : `${report.status} (${report.bound})`],
      ["Asked error", percent(report.settings.error)],
      ["Claimed error", estimate === null ? "not known" : percent(estimate.total)],
    ];
    if (estimate !== null && estimate.dark !== null) rows.push(["… of the darker half", percent(estimate.dark)]);
    rows.push(
      ["Mean irradiance", `${number(light.scalarOf(report.mean_irradiance))} ${units.irradiance}`],
      ["Polygons", count(report.polygons)],
      ["Elements", count(report.elements)],
      ["Schedule", report.schedule],
      ["Leaves", `${count(report.leaves)} in ${trees.level.reduce((a, b) => Math.max(a, b), 0) + 1} levels`],
      ["Links", count(report.links.total)],
    );
    if (report.clusters > 0) rows.push(["Clusters", count(report.clusters)]);
    rows.push(
      ["Time", seconds(time)],
      ["Scene", header.scene_hash.slice(0, 12)],
      ["Version", header.version],
      ["Data", bytes(data.bytes)],
    );
    fill(any("report-list"), rows);
    const notes = { links: "Links", fields: "Exact values within elements" } as const;
    for (const [what, why] of Object.entries(header.left_out)) {
      any("report-list").append(
        make("dd", `${notes[what as keyof typeof notes]} are left out here: ${why}.`, { class: "long" }),
      );
    }
    if (Object.keys(header.left_out).length > 0) element("report", HTMLDetailsElement).open = true;
    any("about").textContent = `isolux ${header.version}`;
  }

  private groupRow(name: string, row: number): HTMLElement {
    const slider = make("input", [], {
      type: "range", min: "0", max: String(Math.max(2, tinted(this.known().light.weights[row]!).weight)), step: "0.01",
      id: `group-${row}`,
    });
    const box = make("input", [], {
      type: "number", min: "0", step: "any", inputmode: "decimal", id: `weight-${row}`, "aria-label": `Weight of ${name}`,
    });
    const set = (weight: number): void => {
      if (!(weight >= 0 && weight <= 1e6)) return;
      this.setWeight(row, weight);
      this.known().light.mix();
      this.relit();
    };
    slider.addEventListener("input", () => set(slider.valueAsNumber));
    box.addEventListener("change", () => {
      set(box.valueAsNumber);
      box.value = String(Number(tinted(this.known().light.weights[row]!).weight.toFixed(3)));
    });
    const label = make("label", name, { for: slider.id });
    const power = make("span", "", { id: `power-${row}` });
    return make(
      "div",
      [make("div", [label, power], { class: "head" }), make("div", [slider, box], { class: "set" })],
      { class: "group" },
    );
  }

  private wire(): void {
    for (const radio of document.querySelectorAll<HTMLInputElement>("input[name=mode]")) {
      radio.addEventListener("change", () => this.setLook({ mode: radio.value as Mode }));
    }
    input("stops").addEventListener("input", () => this.setLook({ stops: input("stops").valueAsNumber }));
    input("stops").addEventListener("dblclick", () => this.setLook({ stops: 0 }));
    select("quantity").addEventListener("change", () => {
      this.look.luminances = select("quantity").value === "luminance";
      this.fit();
      this.apply();
    });
    select("palette").addEventListener("change", () => {
      const palette = PALETTES.find((name) => name === select("palette").value);
      this.setLook({ palette: palette ?? ("viridis" satisfies Palette) });
    });
    for (const id of ["low", "high"]) input(id).addEventListener("change", () => this.takeRange());
    button("fit").addEventListener("click", () => {
      this.fit();
      this.apply();
    });
    input("log").addEventListener("change", () => {
      this.look.range.isLog = input("log").checked;
      this.fit();
      this.apply();
    });
    for (const name of ["contours", "wires", "backs"] as const) {
      input(name).addEventListener("change", () => this.setLook({ [name]: input(name).checked }));
    }
    select("cameras").addEventListener("change", () => this.camera(Number(select("cameras").value)));
    button("home").addEventListener("click", () => this.camera(0));
    button("way").addEventListener("click", () => this.toggleWay());
    button("help").addEventListener("click", () => element("keys", HTMLDialogElement).showModal());
    button("open").addEventListener("click", () => this.fold());
    button("reset").addEventListener("click", () => this.reset());
    button("clear").addEventListener("click", () => this.drop());
    input("links").addEventListener("change", () => this.tell());
    button("picture").addEventListener("click", () => void this.save());
    addEventListener("keydown", (event) => this.key(event));
    this.stick();
  }

  private camera(row: number): void {
    const { header } = this.known().data;
    select("cameras").value = String(row);
    this.navigation.preset(header.cameras[row]!, header);
  }

  private toggleWay(): void {
    const isWalk = this.navigation.way === "orbit";
    this.navigation.way = isWalk ? "walk" : "orbit";
    button("way").setAttribute("aria-pressed", String(isWalk));
    any("stick").hidden = !(isWalk && matchMedia("(any-pointer: coarse)").matches);
  }

  private fold(): void {
    const isFolded = document.body.classList.toggle("folded");
    button("open").setAttribute("aria-expanded", String(!isFolded));
    button("open").setAttribute("aria-label", isFolded ? "Show the panel" : "Hide the panel");
  }

  private async save(): Promise<void> {
    const { clientWidth, clientHeight } = this.stage.canvas;
    const ratio = Math.min(devicePixelRatio, 2);
    const link = make("a", "", { download: `${this.header.name}.png` });
    link.href = URL.createObjectURL(await this.picture(clientWidth * ratio, clientHeight * ratio));
    link.click();
    URL.revokeObjectURL(link.href);
  }

  private key(event: KeyboardEvent): void {
    const target = event.target;
    const isTyping =
      (target instanceof HTMLInputElement && target.type === "number") || target instanceof HTMLSelectElement;
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping || this.solved === null) return;
    if (element("keys", HTMLDialogElement).open) return;
    const { look } = this;
    const stops = (by: number): void => this.setLook({ stops: Math.min(Math.max(look.stops + by, -6), 6) });
    const actions: Record<string, () => void> = {
      "1": () => this.setLook({ mode: "light" }),
      "2": () => this.setLook({ mode: "false-colour" }),
      "3": () => this.setLook({ mode: "levels" }),
      "[": () => stops(-0.5),
      "]": () => stops(0.5),
      c: () => this.setLook({ contours: !look.contours }),
      g: () => this.setLook({ wires: !look.wires }),
      b: () => this.setLook({ backs: !look.backs }),
      l: () => {
        input("links").checked = !input("links").checked;
        this.tell();
      },
      m: () => this.toggleWay(),
      h: () => this.camera(0),
      v: () => this.camera((Number(select("cameras").value) + 1) % this.header.cameras.length),
      p: () => this.fold(),
      Escape: () => this.drop(),
      "?": () => element("keys", HTMLDialogElement).showModal(),
    };
    if (event.key === "Enter" && target === this.stage.canvas) {
      const { clientWidth, clientHeight } = this.stage.canvas;
      this.pick(clientWidth / 2, clientHeight / 2);
      return;
    }
    actions[event.key.length === 1 ? event.key.toLowerCase() : event.key]?.();
  }

  /** The stick that walks, for thumbs. */
  private stick(): void {
    const [stick, knob] = [any("stick"), any("stick").querySelector("i")!];
    const set = (x: number, y: number): void => {
      knob.style.transform = `translate(${x * 34}px, ${y * 34}px)`;
      this.navigation.push(x, -y);
    };
    const follow = (event: PointerEvent): void => {
      const { left, top, width, height } = stick.getBoundingClientRect();
      const [x, y] = [(event.clientX - left) / (width / 2) - 1, (event.clientY - top) / (height / 2) - 1];
      const length = Math.max(1, Math.hypot(x, y));
      set(x / length, y / length);
    };
    stick.addEventListener("pointerdown", (event) => {
      stick.setPointerCapture(event.pointerId);
      follow(event);
    });
    stick.addEventListener("pointermove", (event) => {
      if (stick.hasPointerCapture(event.pointerId)) follow(event);
    });
    for (const end of ["pointerup", "pointercancel"] as const) stick.addEventListener(end, () => set(0, 0));
  }
}

/** A weight as one number and a colour, whose largest band is 1. */
function tinted(weights: Bands): { weight: number; tint: Bands } {
  const weight = Math.max(...weights);
  return { weight, tint: weight > 0 ? (weights.map((band) => band / weight) as Bands) : [1, 1, 1] };
}

function row(values: Float32Array, at: number): Bands {
  return [values[3 * at]!, values[3 * at + 1]!, values[3 * at + 2]!];
}

/** The polygon of each vertex. */
function owner(data: ViewData): Uint32Array {
  const start = data.u32("mesh/vertex_start");
  const owners = new Uint32Array(start[start.length - 1]!);
  for (let polygon = 0; polygon + 1 < start.length; polygon++) owners.fill(polygon, start[polygon], start[polygon + 1]);
  return owners;
}
