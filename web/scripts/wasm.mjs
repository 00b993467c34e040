// Builds the library for browsers into packages/nurbskin/pkg.
//
//   node scripts/wasm.mjs [--profile PROFILE] [--one-thread]
//
// Needs Rust with the target wasm32-unknown-unknown. The module of the page can run on several threads: its memory is shared,
// and the standard library is compiled for that from the component rust-src. Where it is missing, and with --one-thread, as the
// npm package has it, the module runs on one thread.

import { execFileSync } from "node:child_process";
import { existsSync, readFileSync, statSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";
import { gzipSync } from "node:zlib";

const TARGET = "wasm32-unknown-unknown";
/** Bytes that the memory can have at most: all that 32 bits address. Shared memory has to say it. */
const MOST_MEMORY = 2 ** 32;
/** What the linker has to be told for threads; wasm-bindgen uses the exports to give each thread its stack and its variables. */
const THREADS = [
  "--shared-memory", "--import-memory", `--max-memory=${MOST_MEMORY}`,
  ...["__heap_base", "__wasm_init_tls", "__tls_size", "__tls_align", "__tls_base"].map((name) => `--export=${name}`),
];

const root = join(dirname(fileURLToPath(import.meta.url)), "../..");
const { values } = parseArgs({ options: { profile: { type: "string", default: "browser" }, "one-thread": { type: "boolean", default: false } } });
const run = (command, args, env = {}) => execFileSync(command, args, { cwd: root, stdio: "inherit", env: { ...process.env, ...env } });
const ask = (command, ...args) => execFileSync(command, args, { cwd: root, encoding: "utf8", maxBuffer: 1 << 28 }).trim();

/** Whether the module can have threads. */
function threads() {
  if (values["one-thread"]) return false;
  if (existsSync(join(ask("rustc", "--print", "sysroot"), "lib/rustlib/src/rust/library/Cargo.lock"))) return true;
  console.log("the module runs on one thread: Rust has no component rust-src (`rustup component add rust-src`)");
  return false;
}

// A folder of its own for each: what cargo builds for this machine differs, too, and would be built again at each change.
const { target_directory } = JSON.parse(ask("cargo", "metadata", "--format-version", "1", "--no-deps"));
const build = ["build", "--profile", values.profile, "-p", "nurbskin-wasm", "--target", TARGET];
let target = target_directory;
if (threads()) {
  target = join(target_directory, "threads");
  // The standard library is compiled with options that stable Rust allows itself only.
  run("cargo", [...build, "--target-dir", target, "-Z", "build-std=std,panic_abort"], {
    RUSTC_BOOTSTRAP: "1",
    RUSTFLAGS: ["target-feature=+simd128,+atomics,+bulk-memory,+mutable-globals", ...THREADS.map((option) => `link-arg=${option}`)].map((option) => `-C${option}`).join(" "),
  });
} else {
  run("cargo", build);
}
const folder = values.profile === "dev" ? "debug" : values.profile;
const built = join(target, TARGET, folder, "nurbskin_wasm.wasm");
const out = join(root, "web/packages/nurbskin/pkg");
run("cargo", ["run", "--quiet", "--manifest-path", "web/bindgen/Cargo.toml", "--", built, out]);
const wasm = join(out, "nurbskin_bg.wasm");
const size = statSync(wasm).size, packed = gzipSync(readFileSync(wasm), { level: 9 }).length;
console.log(`${wasm}: ${(size / 1e6).toFixed(2)} MB, ${(packed / 1e6).toFixed(2)} MB with gzip`);
