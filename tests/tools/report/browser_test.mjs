// node browser_test.mjs MODULES CHROMIUM PROFILE SCHEME PAGE: opens a page from disk and prints, as JSON, what was seen.
import { createRequire } from "node:module";
import { pathToFileURL } from "node:url";

const [modules, program, profile, scheme, file] = process.argv.slice(2);
const require = createRequire(`${modules}/`);
const { chromium } = require("playwright-core");

const flags = ["no-sandbox", "disable-gpu", "disable-quic", "no-first-run", "disable-background-networking",
  "disable-component-update", "disable-sync", "use-angle=swiftshader", "enable-unsafe-swiftshader"];
const context = await chromium.launchPersistentContext(profile, {
  executablePath: program, headless: true, args: flags.map((flag) => `--${flag}`), colorScheme: scheme,
  viewport: { width: 1280, height: 900 },
});
const page = await context.newPage();
const seen = { errors: [], requests: [] };
page.on("pageerror", (error) => seen.errors.push(error.message));
page.on("console", (message) => message.type() === "error" && seen.errors.push(message.text()));
page.on("request", (request) => /^(file|data|blob):/.test(request.url()) || seen.requests.push(request.url()));
page.on("dialog", (dialog) => { seen.errors.push(`dialog: ${dialog.message()}`); return dialog.dismiss(); });
await page.goto(pathToFileURL(file).href);

// The table sorts by a number, down and up, and filters.
if (await page.locator("table.sortable").count() > 0) {
  const head = page.locator("table.sortable th", { hasText: /^Stress p99/ });
  const at = await head.evaluate((cell) => cell.cellIndex);
  const column = () => page.$$eval("table.sortable tbody tr:not([hidden])", (rows, i) => rows.map((row) => row.cells[i].dataset.value), at);
  seen.rows = await column();
  await head.getByRole("button").click();
  seen.ascending = [await head.getAttribute("aria-sort"), await column()];
  await head.getByRole("button").press("Enter");
  seen.descending = [await head.getAttribute("aria-sort"), await column()];
  await page.getByRole("searchbox").fill("organ-001");
  seen.filtered = [await column(), await page.locator(".tools output").textContent()];
  await page.getByRole("searchbox").fill("");
  const link = page.locator("table.sortable tbody tr", { hasText: "organ-001" }).getByRole("link");
  await link.click();
  seen.opened = await page.locator("details.case[open] > summary").allTextContents();
  await page.locator("details.case[open]").getByRole("button", { name: "Turn it in 3-D" }).click();
}

// The model turns by keys and by the pointer, and its controls change it. 
const canvas = page.locator("canvas");
await canvas.waitFor({ timeout: 20000 });
const look = () => canvas.evaluate((element) => element.toDataURL());
seen.middle = await canvas.evaluate((element) => {
  const flat = Object.assign(document.createElement("canvas"), { width: element.width, height: element.height });
  const context = flat.getContext("2d");
  context.drawImage(element, 0, 0);
  const { data } = context.getImageData(0, 0, flat.width, flat.height);
  const least = [flat.width, flat.height], most = [0, 0];
  for (let i = 0; i < flat.width * flat.height; ++i) {
    const at = [i % flat.width, Math.floor(i / flat.width)];
    for (const k of data[4 * i + 3] > 0 ? [0, 1] : []) {
      least[k] = Math.min(least[k], at[k]);
      most[k] = Math.max(most[k], at[k]);
    }
  }
  return [(least[0] + most[0]) / (2 * flat.width), (least[1] + most[1]) / (2 * flat.height)];
});
const changes = async (act) => {
  const before = await look();
  await act();
  await page.waitForTimeout(100);
  return before !== await look();
};
seen.changes = {
  key: await changes(() => canvas.press("ArrowLeft")),
  zoom: await changes(() => canvas.press("+")),
  pointer: await changes(async () => {
    await canvas.scrollIntoViewIfNeeded();
    const box = await canvas.boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 2 + 90, box.y + box.height / 2 + 30, { steps: 4 });
    await page.mouse.up();
  }),
  colour: await changes(() => page.getByRole("combobox", { name: "Colour" }).selectOption("displacement")),
  surface: await changes(() => page.getByRole("checkbox", { name: "segmented surface" }).check()),
  edges: await changes(() => page.getByRole("checkbox", { name: "edges of the shells" }).uncheck()),
  state: await changes(() => page.getByRole("slider", { name: "State" }).press("ArrowLeft")),
  reset: await changes(() => page.getByRole("button", { name: "Reset view" }).click()),
};
const solids = page.getByRole("checkbox", { name: "solids" });
if (await solids.count() > 0) {
  seen.changes.solids = await changes(() => solids.uncheck());
}
const slider = page.getByRole("slider", { name: "State" });
seen.states = [];
for (let i = Number(await slider.getAttribute("max")); i >= 0; --i) {
  await slider.fill(String(i));
  seen.states.unshift(await slider.getAttribute("aria-valuetext"));
}
seen.legend = (await page.locator(".legend").filter({ has: page.locator(":visible") }).allTextContents()).join(" ");

const scan = require("node:fs").readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
// The page's policy lets no other script in: axe comes through the debugger.
await page.evaluate(scan);
const { violations } = await page.evaluate(() => globalThis.axe.run());
seen.violations = violations.map(({ id, nodes }) => `${id}: ${nodes.slice(0, 3).map((node) => node.html.slice(0, 160)).join(" | ")}`);
await context.close();
console.log(JSON.stringify(seen));
