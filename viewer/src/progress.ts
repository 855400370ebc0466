// Words for how far a solve was.

import { count, percent } from "./format";

/** One line about a picture. */
export function stageText(stage: number, isSteps: boolean, elements: number, error: string): string {
  return `${isSteps ? "Stage" : "Iteration"} ${count(stage)} · ${count(elements)} elements · ${error}`;
}

/** What is claimed of the error, in words. */
export function claimText(claimed: number | null, links: number | null): string {
  if (claimed !== null) return `claimed error ${percent(claimed)}`;
  return links === null ? "no error claimed" : `no error claimed yet (links say ${percent(links)})`;
}
