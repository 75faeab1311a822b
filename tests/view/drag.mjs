// SPDX-License-Identifier: GPL-3.0-or-later
// With Shift the mouse moves and rotates the tool of a simulated device; afterwards the hand returns to its path.
import assert from "node:assert/strict";
import { test, text, until } from "./browser.mjs";
import { openRestingHand } from "./resting_hand.mjs";

test(async () => {
  const { page, pose, rest } = await openRestingHand({ width: 700, height: 500 });
  const eye = () => page.evaluate(() => window.view.world().eye);
  // The mouse may miss the tool on a slow machine; then it aims again.
  const grab = (button) => until("the tool is grabbed", async () => {
    const [x, y] = await page.evaluate(() => window.view.toolOnScreen());
    await page.mouse.move(x, y);
    await page.keyboard.down("Shift");
    await page.mouse.down({ button });
    if (await page.evaluate(() => window.view.dragging())) return [x, y];
    await page.mouse.up({ button });
    await page.keyboard.up("Shift");
    return null;
  });
  const release = async (button) => {
    await page.mouse.up({ button });
    await page.keyboard.up("Shift");
    await until("the hand is back on its path", async () => {
      const now = await pose();
      return Math.hypot(...now.slice(0, 3).map((x, i) => x - rest[i])) < 1e-3 && Math.hypot(...now.slice(3, 6)) < 0.01;
    });
  };
  const before = await eye();

  // Up on the screen is mostly up in the world.
  let [x, y] = await grab("left");
  await page.mouse.move(x, y - 60, { steps: 5 });
  await until("the hand is higher", async () => (await pose())[2] > rest[2] + 0.01);
  assert.ok((await pose())[2] < rest[2] + 0.3);
  await release("left");

  [x, y] = await grab("right");
  await page.mouse.move(x + 60, y, { steps: 5 });
  await until("the hand is turned about the vertical", async () => Math.abs((await pose())[5]) > 0.15);
  await release("right");

  // The camera stays during a drag of the tool; beside the tool, Shift pans the camera as before.
  assert.deepEqual(await eye(), before);
  await page.keyboard.down("Shift");
  await page.mouse.move(15, 400);
  await page.mouse.down();
  await page.mouse.move(60, 400, { steps: 4 });
  await page.mouse.up();
  await page.keyboard.up("Shift");
  assert.notDeepEqual(await eye(), before);
  assert.equal(await text(page, "toast"), "");
  assert.deepEqual(page.complaints(), []);
});
