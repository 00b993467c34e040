// Builds the library for browsers into packages/nurbskin/pkg.
//
//   node scripts/wasm.mjs [--profile PROFILE]
//
// Needs Rust with the target wasm32-unknown-unknown, nothing else.

import { execFileSync } from "node:child_process";
import { readFileSync, statSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";
import { gzipSync } from "node:zlib";

const root = join(dirname(fileURLToPath(import.meta.url)), "../..");
const { values } = parseArgs({ options: { profile: { type: "string", default: "browser" } } });
const run = (command, ...args) => execFileSync(command, args, { cwd: root, stdio: "inherit" });

run("cargo", "build", "--profile", values.profile, "-p", "nurbskin-wasm", "--target", "wasm32-unknown-unknown");
const target = JSON.parse(execFileSync("cargo", ["metadata", "--format-version", "1", "--no-deps"], { cwd: root, encoding: "utf8", maxBuffer: 1 << 28 })).target_directory;
const folder = values.profile === "dev" ? "debug" : values.profile;
const built = join(target, "wasm32-unknown-unknown", folder, "nurbskin_wasm.wasm");
const out = join(root, "web/packages/nurbskin/pkg");
run("cargo", "run", "--quiet", "--manifest-path", "web/bindgen/Cargo.toml", "--", built, out);
const wasm = join(out, "nurbskin_bg.wasm");
const size = statSync(wasm).size, packed = gzipSync(readFileSync(wasm), { level: 9 }).length;
console.log(`${wasm}: ${(size / 1e6).toFixed(2)} MB, ${(packed / 1e6).toFixed(2)} MB with gzip`);
