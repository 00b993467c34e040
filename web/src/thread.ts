// A worker that is one of the threads of the library: an instance of the module over the memory that all share. It says
// something only if it fails; the page ends it.

import { runThread } from "nurbskin";
import { failure, start } from "./library";
import type { Joining } from "./protocol";

self.onmessage = async ({ data: { module, memory } }: MessageEvent<Joining>) => {
  try {
    await start({ module_or_path: module, memory });
    runThread();
  } catch (error) {
    self.postMessage(failure(error));
  }
};
