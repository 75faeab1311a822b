// SPDX-License-Identifier: GPL-3.0-or-later
// Compares every scene of the gallery, at its most characteristic moment, with tests/data/gallery/NAME.png.
//   node gallery.mjs [--renew] [NAME...]    --renew: writes the pictures and tools/view/view.png of README.md
import assert from "node:assert/strict";
import { existsSync, readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { sleep, source, test } from "./browser.mjs";
import { MOMENTS_s, shown } from "./gallery_scene.mjs";

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

test(async () => {
  const all = readdirSync(join(source, "config/gallery")).map((one) => one.replace(/\.toml$/, "")).sort();
  assert.deepEqual(all, Object.keys(MOMENTS_s));
  for (const name of names.length > 0 ? names : all) {
    const { page, server } = await shown(name, SIZE);
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
