// Where the data come from: from this very page, where it was exported, else from the command that serves it.

import { DataError } from "./data";

export type OnLoad = (done: number, total: number) => void;

/** The bytes of a solution. */
export async function load(onLoad: OnLoad): Promise<ArrayBuffer> {
  const embedded = document.getElementById("data");
  if (embedded !== null) {
    const text = embedded.textContent ?? "";
    // Nothing is kept twice.
    embedded.remove();
    return inflated(new Blob([decoded(text.trim())]).stream());
  }
  if (location.protocol === "file:") {
    throw new DataError("this page holds no solution: isolux view --export makes one that does");
  }
  const answer = await fetch("data", { cache: "no-store", credentials: "omit" });
  if (!answer.ok || answer.body === null) {
    throw new DataError(`isolux view answered ${answer.status}: is it still running?`);
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
  return new Response(answer.body.pipeThrough(counted)).arrayBuffer();
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
