// SPDX-License-Identifier: GPL-3.0-or-later
// Compares every scene of the gallery, at its most characteristic moment, with tests/data/gallery/NAME.png.
//   node gallery.mjs [--renew] [NAME...]    --renew: writes the pictures and tools/view/view.png of README.md
import assert from "node:assert/strict";
import { existsSync, readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { file, finished, open, sleep, source, test, until, view } from "./browser.mjs";

const MOMENTS_s = {
  ball_in_bowl: 4.1,
  bolt_and_nut: 5.4,
  dominoes: 3.2,
  gear_pair: 4.0,
  hares: 9.9,
  key_in_lock: 3.7,
  knock_the_stack: 3.3,
  moving_obstacle: 7.5,
  nut_on_bolt: 6.0,
  paper_cube: 5.0,
  peg_in_hole: 4.4,
  place_the_peg: 5.5,
  push_the_box: 5.4,
  ratchet: 5.5,
  staircase: 3.9,
  thin_plate: 2.0,
};
const README = "peg_in_hole";
const SIZE = { width: 1280, height: 720 };
// Compares means of blocks: they do not depend on the rasteriser's edges, but a missing or moved body changes them.
const BLOCK_px = 12, LEAST_CHANGE = 14, MOST_BLOCKS = 8;

const words = process.argv.slice(2);
const renew = words.includes("--renew");
const names = words.filter((word) => !word.startsWith("--"));
const pictureOf = (name) => join(source, "tests/data/gallery", `${name}.png`);

/** How many blocks of two pictures differ in their mean colour; the browser decodes them. */
async function differing(page, pictures) {
  return page.evaluate(async ({ pictures, block, least }) => {
    const [a, b] = await Promise.all(pictures.map(async (picture) => {
      const image = new Image();
      image.src = `data:image/png;base64,${picture}`;
      await image.decode();
      const canvas = new OffscreenCanvas(image.width, image.height);
      const context = canvas.getContext("2d", { willReadFrequently: true });
      context.drawImage(image, 0, 0);
      return context.getImageData(0, 0, image.width, image.height);
    }));
    if (a.width !== b.width || a.height !== b.height) return Infinity;
    const mean = ({ data, width }, x0, y0, channel) => {
      let sum = 0;
      for (let y = y0; y < y0 + block; ++y) for (let x = x0; x < x0 + block; ++x) sum += data[4 * (y * width + x) + channel];
      return sum / (block * block);
    };
    let count = 0;
    for (let y = 0; y + block <= a.height; y += block)
      for (let x = 0; x + block <= a.width; x += block)
        if ([0, 1, 2].some((c) => Math.abs(mean(a, x, y, c) - mean(b, x, y, c)) > least)) ++count;
    return count;
  }, { pictures: pictures.map((one) => one.toString("base64")), block: BLOCK_px, least: LEAST_CHANGE });
}

async function shown(name, t_s) {
  const recording = file(`${name}.h5`);
  await finished("wrenchd", ["--config", `gallery/${name}.toml`, "--virtual-time", "--seconds", String(t_s + 0.05), "--arm",
    "--record", recording, "--control", "none"]);
  const server = await view([recording]);
  const page = await open(server.url, { viewport: SIZE, colorScheme: "light" });
  await until("the scene is there", () => page.evaluate(() => window.view?.world().ghost && window.view.frame() !== null));
  await page.evaluate((t) => {
    const slider = document.getElementById("scrub");
    slider.step = "any";
    slider.value = t;
    slider.dispatchEvent(new Event("input"));
  }, t_s);
  await until(`${t_s} s is shown`, () => page.evaluate((t) => Math.abs(window.view.frame().t - t) < 0.002, t_s));
  const drawn = () => page.evaluate(() => window.view.world().drawn);
  for (let before = -1, now = await drawn(); now !== before; now = await drawn()) {
    before = now;
    await sleep(700);
  }
  return { page, server };
}

test(async () => {
  const all = readdirSync(join(source, "config/gallery")).map((one) => one.replace(/\.toml$/, "")).sort();
  assert.deepEqual(all, Object.keys(MOMENTS_s));
  for (const name of names.length > 0 ? names : all) {
    const { page, server } = await shown(name, MOMENTS_s[name]);
    const picture = await page.screenshot({ clip: await page.locator("#canvas").boundingBox() });
    if (renew) {
      writeFileSync(pictureOf(name), picture);
      if (name === README) {
        await sleep(5000);  // the curves are drawn less often than the scene
        writeFileSync(join(source, "tools/view/view.png"), await page.screenshot());
      }
    } else {
      assert.ok(existsSync(pictureOf(name)), `${pictureOf(name)} is not there; node gallery.mjs --renew makes it`);
      const blank = await (await page.context().browser().newContext()).newPage();
      const count = await differing(blank, [picture, readFileSync(pictureOf(name))]);
      console.log(`${name}: ${count} blocks differ`);
      assert.ok(count <= MOST_BLOCKS, `${name} differs: ${count} blocks of ${BLOCK_px} pixels`);
      await blank.close();
    }
    assert.deepEqual(page.complaints(), []);
    await page.close();
    server.child.kill("SIGTERM");
    await server.ended;
  }
});
