// SPDX-License-Identifier: GPL-3.0-or-later
// The page on a screen, a tablet and a phone, light and dark: no text is clipped, no boxes overlap, and axe-core reports nothing.
//   node layout.mjs [--all] [NAME...]    --all: every scene of the gallery
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { busyText } from "../support/machine_load.mjs";
import { sleep, test } from "./browser.mjs";
import { MOMENTS_s, shown } from "./gallery_scene.mjs";

const SIZES = [[1600, 1000], [800, 600], [390, 844]];
const GROUPS = ["header > *", "nav > *", "#numbers > div", "#numbers > div, #legend, #viewpoints, #measure, #note", "#plot-controls > *",
  "figure", "main > section", "#player > *"];
// Their overflow is scrolled or, for the axis numbers of a plot, drawn.
const SCROLLED = "#contacts-list, #status";

const words = process.argv.slice(2);
const named = words.filter((word) => !word.startsWith("--"));
const names = words.includes("--all") ? Object.keys(MOMENTS_s) : named.length > 0 ? named : ["push_the_box", "peg_in_hole"];
const axe = readFileSync(join(process.env.WRENCHD_TEST_LIBRARIES, "node_modules/axe-core/axe.min.js"), "utf8");

/** Returns the defects of the layout as texts. Runs in the page. */
function defects({ groups, scrolled }) {
  const found = [];
  const name = (e) => (e.id ? `#${e.id}` : `${e.tagName.toLowerCase()}${e.className ? `.${e.className}` : ""} "${e.textContent.trim().slice(0, 20)}"`);
  const visible = (e) => e.checkVisibility({ opacityProperty: true, visibilityProperty: true }) && e.getBoundingClientRect().width > 0;
  const root = document.documentElement;
  if (root.scrollWidth > root.clientWidth) found.push(`the page is ${root.scrollWidth} px wide`);
  for (const e of document.body.querySelectorAll("*")) {
    const own = [...e.childNodes].some((node) => node.nodeType === Node.TEXT_NODE && node.data.trim() !== "");
    if (!own || !visible(e) || e.closest("svg, canvas") || e.closest(scrolled)) continue;
    if (e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 1) found.push(`${name(e)} is clipped: ${e.scrollWidth} > ${e.clientWidth} px`);
    const box = e.getBoundingClientRect(), frame = e.closest("figure, header, #world, #player")?.getBoundingClientRect();
    if (frame && (box.right > frame.right + 1 || box.left < frame.left - 1 || box.bottom > frame.bottom + 1 || box.top < frame.top - 1))
      found.push(`${name(e)} leaves its frame`);
  }
  for (const group of groups) {
    const boxes = [...document.querySelectorAll(group)].filter(visible).map((e) => [e, e.getBoundingClientRect()]);
    boxes.forEach(([e, a], i) => boxes.slice(i + 1).forEach(([other, b]) => {
      if (e.contains(other) || other.contains(e)) return;
      const width = Math.min(a.right, b.right) - Math.max(a.left, b.left), height = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (width > 1 && height > 1) found.push(`${name(e)} and ${name(other)} overlap by ${width.toFixed(0)} x ${height.toFixed(0)} px`);
    }));
  }
  return found;
}

/** Returns the arrows that begin inside the picture and end outside of it, and whether all arrows that are due are missing. Runs in
 * the page. */
function arrowsOutside() {
  const { left, right, top, bottom } = document.getElementById("canvas").getBoundingClientRect();
  const inside = ([x, y], margin = -1) => x >= left + margin && x <= right - margin && y >= top + margin && y <= bottom - margin;
  const arrows = window.view.arrows().filter(([from]) => inside(from, (right - left) / 50));
  const missing = arrows.length === 0 && window.view.world().contacts.length > 0;
  return { missing, outside: arrows.filter(([, to]) => !inside(to)).map(([, to]) => to.join()) };
}

/** Returns what `find` finds after the plots, the scale and the arrows have followed a new size. A machine that is too busy to draw in
 * time gets seven times as long. */
async function afterDrawing(find) {
  for (let i = 0; ; ++i) {
    await sleep(1200);
    const found = await find();
    if (found.length === 0 || i === 6 || await busyText() === null) return found;
  }
}

test(async () => {
  const found = [];
  for (const name of names) {
    const { page, server } = await shown(name, { width: SIZES[0][0], height: SIZES[0][1] });
    await page.evaluate(axe);
    for (const [width, height] of SIZES) {
      await page.setViewportSize({ width, height });
      for (const colorScheme of ["light", "dark"]) {
        await page.emulateMedia({ colorScheme });
        const defective = await afterDrawing(async () => {
          const violations = await page.evaluate(async () => (await axe.run()).violations.map(({ id, help, nodes }) =>
            `${id}: ${help}: ${nodes.map(({ target }) => target.join(" ")).join("; ")}`));
          const layout = await page.evaluate(defects, { groups: GROUPS, scrolled: SCROLLED });
          const { missing, outside } = await page.evaluate(arrowsOutside);
          if (missing) layout.push("no arrow is in the picture");
          return [...layout, ...violations, ...outside.map((at) => `an arrow ends outside of the picture, at ${at}`)];
        });
        found.push(...defective.map((text) => `${name}, ${width} x ${height}, ${colorScheme}: ${text}`));
      }
    }
    // Close to the tool the arrows are longer than the picture.
    await page.mouse.move(...await page.evaluate(() => window.view.toolOnScreen()));
    for (let i = 0; i < 8; ++i) await page.mouse.wheel(0, -400);
    const outside = await afterDrawing(async () => (await page.evaluate(arrowsOutside)).outside);
    found.push(...outside.map((at) => `${name}, close: an arrow ends at ${at}`));
    assert.deepEqual(page.complaints(), []);
    await page.close();
    server.child.kill("SIGTERM");
    await server.ended;
  }
  assert.deepEqual(found, []);
});
