// Loads a solution and shows it; says in words what is in the way.

import "./style.css";
import { DataError } from "./data";
import { bytes } from "./format";
import { follow } from "./host";
import { first, Live } from "./live";
import { isServed, load } from "./load";
import { any, element } from "./page";
import { Viewer } from "./viewer";

declare global {
  interface Window {
    /** The page, for scripts; settled when there is something to see. */
    isolux: Promise<Viewer>;
  }
}

async function begin(): Promise<Viewer> {
  const bar = element("notice-bar", HTMLProgressElement);
  try {
    const begun = isServed() ? await first() : null;
    const loaded = await load((done, total) => {
      if (total > 0) bar.value = done / total;
      any("notice-text").textContent = `Loading ${bytes(done)}${total > 0 ? ` of ${bytes(total)}` : ""}`;
    });
    let viewer: Viewer;
    try {
      viewer = new Viewer();
    } catch (error) {
      throw new DataError(`this browser draws no WebGL 2 (${error instanceof Error ? error.message : String(error)})`);
    }
    if (begun?.live === true) void new Live(viewer, loaded).follow();
    else viewer.show(loaded.buffer);
    if (begun === null) follow(viewer);
    return viewer;
  } catch (error) {
    bar.hidden = true;
    any("notice").classList.add("wrong");
    const isKnown = error instanceof DataError || error instanceof TypeError;
    any("notice-text").textContent = `Nothing to show: ${isKnown ? error.message : String(error)}`;
    throw error;
  }
}

window.isolux = begin();
