// Bundle three.js into one classic script, since a page opened from a disk loads no modules.
// Usage: node build.mjs [FOLDER]; by default the package's own folder.
import { build } from "esbuild";
import { copyFile } from "node:fs/promises";
import { fileURLToPath } from "node:url";
import { join } from "node:path";

const here = fileURLToPath(new URL(".", import.meta.url));
const folder = process.argv[2] ?? join(here, "../../iriftrace/figures/static");
await build({
  absWorkingDir: here,
  entryPoints: ["entry.mjs"],
  outfile: join(folder, "three.iife.min.js"),
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "THREE",
  target: "es2022",
  legalComments: "inline",
});
await copyFile(join(here, "node_modules/three/LICENSE"), join(folder, "three.LICENSE"));
