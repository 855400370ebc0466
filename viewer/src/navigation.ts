// Moving about: mouse, fingers and keys turn, shift and carry the eye, around what it looks at or through the scene.

import type { PerspectiveCamera } from "three";
import type { Bands, CameraPreset, Header } from "./data";

export type Way = "orbit" | "walk";

/** Just short of straight up and down, where left and right are lost. */
const STEEPEST = Math.PI / 2 - 1e-4;
/** Turned by a drag across the whole canvas, radians. */
const PER_DRAG = Math.PI;
/** A press that moves less than this, in pixels, and lasts less long, in milliseconds, picks. */
const STILL = 5;
const BRIEF = 600;
/** Walking, metres per second; with Shift three times as fast. */
const PACE = 1.4;

export class Navigation {
  eye: Bands = [0, 0, 0];
  way: Way = "orbit";
  /** Angle from -z towards +x, and up, radians. */
  yaw = 0;
  pitch = 0;
  /** To what is looked at, metres. */
  distance = 1;
  angle = Math.PI / 3;
  onChange: () => void = () => undefined;
  onPick: (x: number, y: number) => void = () => undefined;
  private readonly held = new Set<string>();
  private readonly pointers = new Map<number, { x: number; y: number }>();
  private press: { x: number; y: number; time: number; button: number; moved: boolean } | null = null;
  private stick: [number, number] = [0, 0];
  private frame = 0;
  private last = 0;
  private size = 1;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly camera: PerspectiveCamera,
  ) {
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const kind of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(kind, (event) => this.up(event, kind === "pointerup"));
    }
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => this.wheel(event), { passive: false });
    canvas.addEventListener("keydown", (event) => this.key(event, true));
    addEventListener("keyup", (event) => this.key(event, false));
    addEventListener("blur", () => this.held.clear());
  }

  /** Fits to a scene. */
  begin(header: Header): void {
    const [low, high] = header.bounds;
    this.size = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  }

  /** Looks through a camera of the scene. */
  preset(preset: CameraPreset, header: Header): void {
    const { forward, up } = preset;
    this.pitch = Math.asin(Math.min(Math.max(forward[1], -1), 1));
    const isSteep = Math.abs(this.pitch) > STEEPEST;
    // Looking straight up or down, what is up in the picture says where ahead is.
    const sign = isSteep ? -Math.sign(forward[1]) : 1;
    const [x, z] = isSteep ? [up[0] * sign, up[2] * sign] : [forward[0], forward[2]];
    this.yaw = Math.atan2(x, -z);
    this.pitch = Math.min(Math.max(this.pitch, -STEEPEST), STEEPEST);
    const [low, high] = header.bounds;
    const centre = [0, 1, 2].map((k) => (low[k]! + high[k]!) / 2);
    const ahead = [0, 1, 2].reduce((sum, k) => sum + forward[k]! * (centre[k]! - preset.eye[k]!), 0);
    this.distance = Math.min(Math.max(ahead, 0.1 * this.size), 3 * this.size);
    this.eye = [...preset.eye];
    this.angle = preset.vertical_angle ?? Math.PI / 3;
    if (preset.height !== null) {
      // A parallel projection, nearly: from far away through a narrow opening.
      this.angle = (2 * Math.PI) / 180;
      const back = preset.height / 2 / Math.tan(this.angle / 2);
      this.eye = [0, 1, 2].map((k) => preset.eye[k]! + forward[k]! * (ahead - back)) as Bands;
      this.distance = back;
    }
    this.changed();
  }

  forward(): Bands {
    const level = Math.cos(this.pitch);
    return [level * Math.sin(this.yaw), Math.sin(this.pitch), -level * Math.cos(this.yaw)];
  }

  /** Where the stick is held, to the right and ahead, each in [-1, 1]. */
  push(right: number, ahead: number): void {
    this.stick = [right, ahead];
    this.run();
  }

  /** Puts the camera where the eye is. */
  place(origin: Bands): void {
    const { camera } = this;
    const [x, y, z] = this.forward();
    camera.position.set(this.eye[0] - origin[0], this.eye[1] - origin[1], this.eye[2] - origin[2]);
    camera.lookAt(camera.position.x + x, camera.position.y + y, camera.position.z + z);
    camera.fov = (this.angle * 180) / Math.PI;
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
  }

  private changed(): void {
    this.onChange();
  }

  private turn(right: number, up: number): void {
    const target = this.target();
    this.yaw += right;
    this.pitch = Math.min(Math.max(this.pitch + up, -STEEPEST), STEEPEST);
    if (this.way === "orbit") this.stand(target);
    this.changed();
  }

  private target(): Bands {
    const forward = this.forward();
    return [0, 1, 2].map((k) => this.eye[k]! + forward[k]! * this.distance) as Bands;
  }

  private stand(target: Bands): void {
    const forward = this.forward();
    this.eye = [0, 1, 2].map((k) => target[k]! - forward[k]! * this.distance) as Bands;
  }

  private shift(right: number, up: number, ahead: number): void {
    const [sin, cos] = [Math.sin(this.yaw), Math.cos(this.yaw)];
    this.eye = [
      this.eye[0] + cos * right + sin * ahead,
      this.eye[1] + up,
      this.eye[2] + sin * right - cos * ahead,
    ];
    this.changed();
  }

  /** Shifts in the picture's plane, by parts of its height at the distance of what is looked at. */
  private pan(right: number, up: number): void {
    const scale = 2 * this.distance * Math.tan(this.angle / 2);
    const [sin, cos] = [Math.sin(this.yaw), Math.cos(this.yaw)];
    const [rise, level] = [Math.sin(this.pitch), Math.cos(this.pitch)];
    const [r, u] = [right * scale, up * scale];
    this.eye = [
      this.eye[0] + cos * r - rise * sin * u,
      this.eye[1] + level * u,
      this.eye[2] + sin * r + rise * cos * u,
    ];
    this.changed();
  }

  private zoom(factor: number): void {
    if (this.way === "walk") {
      const forward = this.forward();
      const step = -Math.log(factor) * 0.15 * this.size;
      this.eye = [0, 1, 2].map((k) => this.eye[k]! + forward[k]! * step) as Bands;
    } else {
      const target = this.target();
      this.distance = Math.min(Math.max(this.distance * factor, 1e-3 * this.size), 10 * this.size);
      this.stand(target);
    }
    this.changed();
  }

  private down(event: PointerEvent): void {
    this.canvas.focus({ preventScroll: true });
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const isFirst = this.pointers.size === 1;
    this.press = isFirst
      ? { x: event.clientX, y: event.clientY, time: event.timeStamp, button: event.button, moved: false }
      : null;
  }

  private move(event: PointerEvent): void {
    const before = this.pointers.get(event.pointerId);
    if (before === undefined) return;
    const { width, height } = this.canvas.getBoundingClientRect();
    const [dx, dy] = [event.clientX - before.x, event.clientY - before.y];
    const spread = this.spread();
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (this.pointers.size > 1) {
      this.pan(-dx / height / this.pointers.size, dy / height / this.pointers.size);
      const now = this.spread();
      if (spread > 0 && now > 0) this.zoom(spread / now);
      return;
    }
    if (this.press !== null && !this.press.moved) {
      if (Math.hypot(event.clientX - this.press.x, event.clientY - this.press.y) < STILL) return;
      this.press.moved = true;
    }
    const isPan = this.press !== null && (this.press.button === 2 || this.press.button === 1 || event.shiftKey);
    if (isPan) {
      this.pan(-dx / height, dy / height);
    } else if (this.way === "orbit") {
      // The scene follows the hand.
      this.turn((dx / width) * PER_DRAG, (-dy / height) * PER_DRAG);
    } else {
      const scale = this.angle / height;
      this.turn(-dx * scale * 1.6, dy * scale * 1.6);
    }
  }

  private up(event: PointerEvent, isOver: boolean): void {
    this.pointers.delete(event.pointerId);
    const { press } = this;
    this.press = null;
    if (press === null || press.moved || press.button !== 0 || !isOver) return;
    if (event.timeStamp - press.time > BRIEF) return;
    const { left, top } = this.canvas.getBoundingClientRect();
    this.onPick(event.clientX - left, event.clientY - top);
  }

  /** Distance between two fingers, pixels. */
  private spread(): number {
    const [one, other] = [...this.pointers.values()];
    return one && other ? Math.hypot(one.x - other.x, one.y - other.y) : 0;
  }

  private wheel(event: WheelEvent): void {
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === 1 ? 16 : 1);
    this.zoom(Math.exp(Math.min(Math.max(pixels, -240), 240) * 0.0012));
  }

  private key(event: KeyboardEvent, isDown: boolean): void {
    const name = event.code;
    if (!isDown) {
      this.held.delete(name);
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (!(name in WALKING) && !(name in TURNING)) return;
    event.preventDefault();
    // Letters walk, whatever way is on; arrows turn around the scene, or look.
    this.held.add(name);
    if (event.shiftKey) this.held.add("Shift");
    else this.held.delete("Shift");
    this.run();
  }

  /** Goes on for as long as keys or the stick are held. */
  private run(): void {
    if (this.frame !== 0) return;
    this.last = performance.now();
    const step = (now: number): void => {
      const time = Math.min((now - this.last) / 1000, 0.1);
      this.last = now;
      this.frame = 0;
      let [right, up, ahead, yaw, pitch] = [this.stick[0], 0, this.stick[1], 0, 0];
      for (const name of this.held) {
        const [r, u, a] = WALKING[name] ?? [0, 0, 0];
        const [y, p] = TURNING[name] ?? [0, 0];
        [right, up, ahead, yaw, pitch] = [right + r, up + u, ahead + a, yaw + y, pitch + p];
      }
      const isMoving = right !== 0 || up !== 0 || ahead !== 0;
      const isTurning = yaw !== 0 || pitch !== 0;
      if (!isMoving && !isTurning) return;
      const pace = PACE * Math.max(1, this.size / 12) * (this.held.has("Shift") ? 3 : 1) * time;
      if (isMoving) this.shift(right * pace, up * pace, ahead * pace);
      const sign = this.way === "orbit" ? -1 : 1;
      if (isTurning) this.turn(sign * yaw * time * 1.2, sign * pitch * time * 1.2);
      this.frame = requestAnimationFrame(step);
    };
    this.frame = requestAnimationFrame(step);
  }
}

/** To the right, up, ahead. */
const WALKING: Record<string, [number, number, number]> = {
  KeyW: [0, 0, 1],
  KeyS: [0, 0, -1],
  KeyA: [-1, 0, 0],
  KeyD: [1, 0, 0],
  KeyE: [0, 1, 0],
  KeyQ: [0, -1, 0],
};

/** To the right, up. */
const TURNING: Record<string, [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, 1],
  ArrowDown: [0, -1],
};
