import type { Plugin } from "vite";

/**
 * three.js without the shaders of its own materials. The viewer has shaders of its own, and those of three.js are a third of
 * it. Taken from its modules, as its built file has them together with the renderer.
 */
export function threeWithoutShaders(): Plugin {
  return {
    name: "three-without-shaders",
    apply: "build",
    enforce: "pre",
    config: () => ({ resolve: { alias: [{ find: /^three$/, replacement: "three/src/Three.js" }] } }),
    load(id) {
      const name = /three\/src\/renderers\/shaders\/(ShaderLib|ShaderChunk)\.js$/.exec(id)?.[1];
      return name === undefined ? null : `export const ${name} = {};`;
    },
  };
}
