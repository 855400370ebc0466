// Where the data come from: from this very page, where it was exported, else from the command that serves it.

import { DataError } from "./data";

export type OnLoad = (done: number, total: number) => void;

/** What a command that serves this page says of its data. */
export interface State {
  /** Which data it serves: 1 and up, 0 where there are none yet. */
  number: number;
  /** Does a solve go on? */
  live: boolean;
  /** Elements of that so far. */
  elements: number;
  /** Share of the estimated work that is done. */
  done: number;
}

/** The bytes of a solution. */
export interface Loaded {
  buffer: ArrayBuffer;
  /** The `number` of the state that goes with it. */
  number: number;
  /** Is it a picture of a solve that goes on? */
  isPicture: boolean;
}

/** Does a command serve this page? */
export function isServed(): boolean {
  return document.getElementById("data") === null && location.protocol !== "file:";
}

export async function state(): Promise<State> {
  const answer = await fetch("state", { cache: "no-store", credentials: "omit" });
  if (!answer.ok) throw new DataError(`isolux answered ${answer.status}: is it still running?`);
  return (await answer.json()) as State;
}

export async function load(onLoad: OnLoad): Promise<Loaded> {
  const embedded = document.getElementById("data");
  if (embedded !== null) {
    const text = embedded.textContent ?? "";
    // Nothing is kept twice.
    embedded.remove();
    const buffer = await inflated(new Blob([decoded(text.trim())]).stream());
    return { buffer, number: 1, isPicture: false };
  }
  if (location.protocol === "file:") {
    throw new DataError("this page holds no solution: isolux view --export makes one that does");
  }
  const answer = await fetch("data", { cache: "no-store", credentials: "omit" });
  if (!answer.ok || answer.body === null) {
    throw new DataError(`isolux answered ${answer.status}: is it still running?`);
  }
  const total = Number(answer.headers.get("Content-Length") ?? 0);
  let done = 0;
  const counted = new TransformStream<Uint8Array<ArrayBuffer>, Uint8Array<ArrayBuffer>>({
    transform(chunk, out) {
      done += chunk.byteLength;
      onLoad(done, total);
      out.enqueue(chunk);
    },
  });
  const { headers } = answer;
  return {
    buffer: await new Response(answer.body.pipeThrough(counted)).arrayBuffer(),
    number: Number(headers.get("X-Isolux-Number") ?? 1),
    isPicture: headers.get("X-Isolux-Picture") === "1",
  };
}

async function inflated(stream: ReadableStream<Uint8Array<ArrayBuffer>>): Promise<ArrayBuffer> {
  if (typeof DecompressionStream === "undefined") {
    throw new DataError("this browser is too old for this page: it cannot unpack gzip (browsers of 2023 and later can)");
  }
  try {
    return await new Response(stream.pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
  } catch {
    throw new DataError("the data in this page are damaged");
  }
}

function decoded(text: string): Uint8Array<ArrayBuffer> {
  const native = Uint8Array as unknown as { fromBase64?: (text: string) => Uint8Array<ArrayBuffer> };
  if (native.fromBase64 !== undefined) return native.fromBase64(text);
  const bytes = new Uint8Array(Math.floor((text.length / 4) * 3) - (text.endsWith("==") ? 2 : text.endsWith("=") ? 1 : 0));
  // By parts, a multiple of four letters each: a string of all bytes would take as much again.
  const part = 1 << 20;
  for (let start = 0, at = 0; start < text.length; start += part) {
    const piece = atob(text.slice(start, start + part));
    for (let k = 0; k < piece.length; k++) bytes[at++] = piece.charCodeAt(k);
  }
  return bytes;
}
