import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { Input, fit, initSync, simulate } from "nurbskin";

initSync({ module: readFileSync(createRequire(import.meta.url).resolve("nurbskin/nurbskin_bg.wasm")) });
const scan = new Input("saddle.ply", simulate("saddle", { points: 2500, noise: 0.01 }));
const result = fit(scan, { tolerance: "0.1mm" }, { stage: (name) => console.log(name) });
const { verdict, reason } = result.figures();
console.log(verdict, "-", reason);
writeFileSync("saddle.step", result.save("saddle.step"));
