import { readFileSync } from "node:fs";
import { fileURLToPath } from "node:url";
import { defineConfig, type Plugin } from "vite";
import { threeWithoutShaders } from "../../scripts/three.ts";

const path = (from: string): string => fileURLToPath(new URL(from, import.meta.url));

/** What the licence of three.js asks for, at the start of the script. */
function notice(): Plugin {
  const text = readFileSync(path("../../node_modules/three/LICENSE"), "utf8").trim();
  return {
    name: "notice",
    enforce: "post",
    generateBundle(_, bundle) {
      for (const part of Object.values(bundle)) if (part.type === "chunk") part.code = `/*! Contains three.js.\n\n${text}\n*/\n${part.code}`;
    },
  };
}

/** One script, next to the template of the page; its name does not depend on its content. */
export default defineConfig({
  root: path("."),
  publicDir: false,
  plugins: [threeWithoutShaders(), notice()],
  build: {
    // The first of each that unpack the page.
    target: ["chrome103", "firefox113", "safari16.4"],
    outDir: process.env.REPORT_OUT ?? path("../../../crates/nurbskin/src/report/page"),
    emptyOutDir: false,
    chunkSizeWarningLimit: 800,
    rolldownOptions: { input: path("src/main.ts"), output: { format: "iife", entryFileNames: "page.js" } },
  },
});
