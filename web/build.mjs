// Makes dist/report.js, the script of every page, and dist/LICENCES.txt: node build.mjs [FOLDER]
import { build } from "esbuild";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const out = process.argv[2] ?? join(here, "dist");
mkdirSync(out, { recursive: true });
await build({
  entryPoints: [join(here, "src", "main.js")],
  outfile: join(out, "report.js"),
  absWorkingDir: here,
  bundle: true,
  minify: true,
  format: "iife",
  charset: "ascii",
  target: "es2022",
  legalComments: "none",
});
const three = join(here, "node_modules", "three");
const { version } = JSON.parse(readFileSync(join(three, "package.json"), "utf8"));
writeFileSync(join(out, "LICENCES.txt"), `three.js ${version} <https://threejs.org>\n\n${readFileSync(join(three, "LICENSE"), "utf8")}`);
