// Bundles the pages into ../static, with what lies in public/ and the licences of what is bundled:
// `node build.mjs`.
import { build } from "esbuild";
import { cp, readdir, readFile, rm, writeFile } from "node:fs/promises";
import { existsSync } from "node:fs";
import { join } from "node:path";

const STATIC = "../static";

/** What is made (`out`, with the ending's kind) of what; those that are there. */
const ENTRY_POINTS = [
  { in: "src/main.ts", out: "kiosk" },
  { in: "src/style.css", out: "kiosk" },
  { in: "src/operator.ts", out: "operator" },
  { in: "src/operator.css", out: "operator" },
  { in: "src/view.ts", out: "view" },
  { in: "src/view.css", out: "view" },
].filter((one) => existsSync(one.in));

/** The packages of which at least a byte is in the bundle, sorted. */
function bundledPackages(metafile) {
  const names = new Set();
  for (const output of Object.values(metafile.outputs)) {
    for (const [file, { bytesInOutput }] of Object.entries(output.inputs)) {
      const name = /(?:^|\/)node_modules\/((?:@[^/]+\/)?[^/]+)\//.exec(file)?.[1];
      if (name !== undefined && bytesInOutput > 0) names.add(name);
    }
  }
  return [...names].sort();
}

/** Name, version and licence text of a package; without a text nothing may be handed on. */
async function licence(name) {
  const folder = join("node_modules", name);
  const { version, license } = JSON.parse(await readFile(join(folder, "package.json"), "utf8"));
  const file = (await readdir(folder)).find((one) => /^licen[cs]e/i.test(one));
  if (file === undefined) throw new Error(`${name} has no licence text`);
  const text = await readFile(join(folder, file), "utf8");
  return `${name} ${version} (${license})\n\n${text.trim()}\n`;
}

/** Throws where there is no bundle, or none that may be handed on. */
async function bundle() {
  await rm(STATIC, { recursive: true, force: true });
  const { metafile } = await build({
    entryPoints: ENTRY_POINTS,
    outdir: STATIC,
    bundle: true,
    format: "esm",
    // The viewer is in two pages.
    splitting: true,
    chunkNames: "shared-[hash]",
    target: "es2022",
    minify: true,
    sourcemap: false,
    legalComments: "none",
    metafile: true,
    logLevel: "silent",
  });
  if (existsSync("public")) await cp("public", STATIC, { recursive: true });
  const licences = await Promise.all(bundledPackages(metafile).map(licence));
  await writeFile(
    join(STATIC, "LICENSES.txt"),
    `The scripts in this folder contain the following packages.\n\n${licences.join("\n---\n\n")}`,
  );
}

bundle().catch((error) => {
  console.error(error.message);
  process.exitCode = 1;
});
