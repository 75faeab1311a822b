// SPDX-License-Identifier: GPL-3.0-or-later
// A large scene on a machine that draws slowly: few triangles while something moves, all triangles when it is static.
import assert from "node:assert/strict";
import { file, finished, open, test, until, view } from "./browser.mjs";

test(async () => {
  const recording = file("hares.h5");
  await finished("wrenchd", ["--config", "gallery/hares.toml", "--virtual-time", "--seconds", "1", "--record", recording,
    "--control", "none"]);
  const server = await view([recording]);
  const page = await open(server.url, { viewport: { width: 700, height: 500 } });
  const world = () => page.evaluate(() => window.view.world());
  await until("the scene is drawn finely", async () => (await world()).triangles > 100000 && !(await world()).simplified);
  const note = page.locator("#note");
  assert.match(await note.textContent(), /^201,640 triangles, drawn with 1\d\d,\d{3}$/);

  await page.evaluate(() => window.view.slow());
  await page.locator("#speed").selectOption("0.1");
  await page.locator("#play").click();
  const moving = await until("it is drawn coarsely while it plays", async () => {
    const now = await world();
    return now.simplified && now.triangles < 40000 && now;
  });
  assert.ok(moving.tool !== null || moving.ghost !== null);
  await until("the note says so", async () => /^201,640 triangles, drawn with 1\d,\d{3}$/.test(await note.textContent()));

  await page.locator("#play").click();
  await until("it is drawn finely at rest", async () => (await world()).triangles > 100000 && !(await world()).simplified);
  assert.deepEqual(page.complaints(), []);
});
