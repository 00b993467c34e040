import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { defineConfig, type Plugin } from "vite";
import { threeWithoutShaders } from "./scripts/three.ts";

/** Writes the service worker, with the list of all files of the build and a version that is their hash. */
function offline(): Plugin {
  return {
    name: "offline",
    apply: "build",
    enforce: "post",
    generateBundle(_, bundle) {
      const files = Object.keys(bundle).filter((name) => name !== "sw.js").sort();
      const hash = createHash("sha256");
      for (const name of files) {
        const part = bundle[name];
        if (part) hash.update(name).update(part.type === "chunk" ? part.code : part.source);
      }
      const version = hash.digest("hex").slice(0, 16);
      const source = WORKER.replace("VERSION", JSON.stringify(version)).replace("FILES", JSON.stringify(["./", "./icon.svg", ...files.map((f) => `./${f}`)]));
      this.emitFile({ type: "asset", fileName: "sw.js", source });
    },
  };
}

/** Keeps all files at the first visit, and answers from them: after that the page needs no network. */
const WORKER = `// Made by vite.config.ts.
const version = VERSION, files = FILES;
self.addEventListener("install", (event) => {
  event.waitUntil(caches.open(version).then((cache) => cache.addAll(files)).then(() => self.skipWaiting()));
});
self.addEventListener("activate", (event) => {
  const old = caches.keys().then((keys) => Promise.all(keys.filter((key) => key !== version).map((key) => caches.delete(key))));
  event.waitUntil(old.then(() => self.clients.claim()));
});
self.addEventListener("fetch", (event) => {
  if (event.request.method !== "GET" || new URL(event.request.url).origin !== self.location.origin) return;
  event.respondWith(caches.match(event.request, { ignoreSearch: true }).then((kept) => kept ?? fetch(event.request)));
});
`;

const { version } = JSON.parse(readFileSync(new URL("./package.json", import.meta.url), "utf8")) as { version: string };

export default defineConfig({
  // A folder at any path of any host.
  base: "./",
  // Chrome 91, Firefox 89 and Safari 16.4 have the vectors of the module.
  build: { target: ["chrome91", "firefox89", "safari16.4"], chunkSizeWarningLimit: 800 },
  worker: { format: "es" },
  // Isolated, as `nurbskin app` serves it.
  server: { headers: { "cross-origin-opener-policy": "same-origin", "cross-origin-embedder-policy": "require-corp" } },
  define: { __VERSION__: JSON.stringify(version) },
  plugins: [threeWithoutShaders(), offline()],
});
