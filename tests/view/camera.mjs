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
  assert.deepEqual(page.complaints(), []);
});
