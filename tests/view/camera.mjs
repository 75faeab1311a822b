// SPDX-License-Identifier: GPL-3.0-or-later
// The camera follows the daemon's [view] until the user moves the camera.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import { daemon, file, open, source, test, until, view } from "./browser.mjs";

const away = (a, b) => Math.hypot(...a.map((x, i) => x - b[i]));

test(async () => {
  const config = file("wrenchd.toml");
  const shipped = readFileSync(`${source}/config/gallery/paper_cube.toml`, "utf8").replace(/^\[view\][\s\S]*/m, "");
  const looking = (eye, target) => writeFileSync(config, `${shipped}\n[view]\neye_m = [${eye}]\ntarget_m = [${target}]\n`);
  looking([0.2, 0.1, 0.15], [0.01, 0.0, 0.02]);
  const wrenchd = await daemon(["--config", config]);
  const server = await view(["--socket", wrenchd.socket]);
  const page = await open(server.url, { viewport: { width: 700, height: 500 } });
  const camera = () => page.evaluate(() => window.view.world());
  const seen_from = (eye, target) => async () => {
    const now = await camera();
    return away(now.eye, eye) < 1e-9 && away(now.target, target) < 1e-9;
  };
  await until("it is seen from where [view] says", seen_from([0.2, 0.1, 0.15], [0.01, 0.0, 0.02]));

  // A reload with another viewpoint moves the camera.
  looking([-0.1, 0.25, 0.1], [0.0, 0.0, 0.0]);
  wrenchd.child.kill("SIGHUP");
  await until("it is seen from the new place", seen_from([-0.1, 0.25, 0.1], [0.0, 0.0, 0.0]));

  // A camera that the user has moved stays when the scene arrives again; Fit restores the viewpoint.
  await page.mouse.move(300, 250);
  await page.mouse.down();
  await page.mouse.move(380, 260, { steps: 4 });
  await page.mouse.up();
  const turned = (await camera()).eye;
  assert.ok(away(turned, [-0.1, 0.25, 0.1]) > 0.01);
  const previousCount = (await camera()).sceneCount;
  wrenchd.child.kill("SIGHUP");
  await until("the scene arrives again", async () => (await camera()).sceneCount > previousCount);
  assert.ok(away((await camera()).eye, turned) < 1e-9);
  await page.keyboard.press("f");
  await until("Fit goes back", seen_from([-0.1, 0.25, 0.1], [0.0, 0.0, 0.0]));

  // From the top, the front and the side; the tool is then in the picture.
  for (const [key, axis, sign] of [["1", 2, 1], ["2", 0, -1], ["3", 1, -1]]) {
    await page.keyboard.press(key);
    const now = await camera();
    const sight = now.eye.map((x, i) => x - now.target[i]);
    assert.ok(sign * sight[axis] > 0.999 * Math.hypot(...sight), `key ${key}: ${sight}`);
    const [x, y] = await page.evaluate(() => window.view.toolOnScreen());
    const canvas = await page.locator("#canvas").boundingBox();
    assert.ok(x > canvas.x && x < canvas.x + canvas.width && y > canvas.y && y < canvas.y + canvas.height, `key ${key}: the tool is at ${x}, ${y}`);
  }

  // The length of the scale is the distance on the screen between two points of the world that are so far apart at the target. The
  // scale follows the camera a frame later.
  await until("the scale has its length", async () => {
    const scale = await page.evaluate(() => window.view.scale());
    const line = await page.locator("#scale-line").boundingBox();
    const apart = await page.evaluate((length_m) => {  // seen along +y, +x is to the right
      const { target } = window.view.world();
      const [left, right] = [-0.5, 0.5].map((half) => window.view.onScreen([target[0] + half * length_m, target[1], target[2]]));
      return right[0] - left[0];
    }, scale.length_m);
    return Math.abs(line.width - apart) < 2 && line.width > 30 && line.width < 120;
  }, 10000);
  assert.match(await page.locator("#scale-text").textContent(), /^[\d.]+ (m|mm|um); force arrows [\d.]+ N$/);

  // The camera follows the tool of a hand that moves, at a constant distance.
  await page.keyboard.press("l");
  assert.equal(await page.locator("#follow").getAttribute("aria-pressed"), "true");
  const gap = () => page.evaluate(() => {
    const { eye, ghost } = window.view.world();
    return { gap: eye.map((x, i) => x - ghost[i]), ghost };
  });
  const start = await gap();
  await until("the tool has moved", async () => away((await gap()).ghost.slice(0, 3), start.ghost.slice(0, 3)) > 2e-3);
  assert.ok(away((await gap()).gap, start.gap) < 1e-6);
  await page.keyboard.press("l");
  assert.deepEqual(page.complaints(), []);
});
