// A solve that is watched: pictures come in as they are made, the newest is shown, and a slider leads back to those before.

import { count } from "./format";
import { any, element, input } from "./page";
import { load, state, type Loaded, type State } from "./load";
import type { Viewer } from "./viewer";

/** Milliseconds between two questions: pictures come twice a second at most. */
const INTERVAL = 250;

/** Bytes of pictures that are kept; the newest one is, however large. */
const MOST_BYTES = 256 * 1024 * 1024;

interface Picture {
  buffer: ArrayBuffer;
  isPicture: boolean;
  /** What is said of it. */
  text: string;
}

const wait = (): Promise<void> => new Promise((resolve) => setTimeout(resolve, INTERVAL));

/** Waits until there is something to see; says what is waited for. */
export async function first(): Promise<State> {
  for (;;) {
    const now = await state();
    if (now.number > 0) return now;
    const elements = now.elements > 0 ? ` · ${count(now.elements)} elements` : "";
    any("notice-text").textContent = `Solving: no picture yet${elements}`;
    element("notice-bar", HTMLProgressElement).value = now.done;
    await wait();
  }
}

export class Live {
  private kept: Picture[] = [];
  private at = 0;
  private isLive = true;
  private number: number;

  constructor(
    private readonly viewer: Viewer,
    loaded: Loaded,
  ) {
    this.number = loaded.number;
    input("stages").addEventListener("input", () => this.go(input("stages").valueAsNumber));
    any("live").hidden = false;
    this.add(loaded);
  }

  /** Asks for pictures until the solve has ended, or whoever serves them. */
  async follow(): Promise<void> {
    try {
      for (;;) {
        const now = await state();
        if (now.number !== this.number) {
          const loaded = await load(() => undefined);
          this.number = loaded.number;
          this.add(loaded);
        }
        // What came last may be newer than what was told of it.
        if (!now.live && now.number === this.number) {
          this.end("Solved");
          return;
        }
        const done = element("live-bar", HTMLProgressElement);
        done.value = now.done;
        done.title = `${count(now.elements)} elements so far`;
        await wait();
      }
    } catch (error) {
      // It was ended, by Ctrl-C or by an error that it tells of itself: what was shown stays.
      this.end(`No longer served (${error instanceof Error ? error.message : String(error)})`);
    }
  }

  private end(word: string): void {
    this.isLive = false;
    any("live-word").textContent = word;
    any("live-bar").hidden = true;
    this.tell();
  }

  /** Shows a picture, unless someone looks at an older one. */
  private add({ buffer, isPicture }: Loaded): void {
    const isNewest = this.at === this.kept.length - 1 || this.kept.length === 0;
    const shown = this.kept[this.at];
    const text = this.viewer.describeStage(buffer, isPicture);
    this.kept.push({ buffer, isPicture, text });
    let bytes = this.kept.reduce((sum, picture) => sum + picture.buffer.byteLength, 0);
    while (bytes > MOST_BYTES && this.kept.length > 1) bytes -= this.kept.shift()!.buffer.byteLength;
    const place = isNewest || shown === undefined ? -1 : this.kept.indexOf(shown);
    if (place < 0) {
      this.go(this.kept.length - 1);
    } else {
      this.at = place;
      this.tell();
    }
  }

  private go(at: number): void {
    const picture = this.kept[at];
    if (picture === undefined) return;
    this.at = at;
    // Exposed as the newest one is, so that they compare.
    const newest = this.kept[this.kept.length - 1]!;
    this.viewer.show(picture.buffer, { isPicture: picture.isPicture, exposedAs: newest.buffer });
    this.tell();
  }

  private tell(): void {
    const slider = input("stages");
    slider.max = String(this.kept.length - 1);
    slider.value = String(this.at);
    any("stages-row").hidden = this.kept.length < 2;
    any("stages-value").textContent = `${this.at + 1} of ${this.kept.length}`;
    const picture = this.kept[this.at]!;
    slider.setAttribute("aria-valuetext", picture.text);
    any("live-text").textContent = picture.text;
    if (this.isLive) any("live-word").textContent = "Solving";
  }
}
