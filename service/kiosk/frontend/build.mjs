// Bundles the page into ../static: `node build.mjs`.
import { build } from "esbuild";

await build({
  entryPoints: { kiosk: "src/main.ts" },
  outdir: "../static",
  bundle: true,
  format: "esm",
  target: "es2022",
  minify: true,
  sourcemap: false,
  logLevel: "warning",
});
