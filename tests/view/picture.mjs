// SPDX-License-Identifier: GPL-3.0-or-later
// Writes a picture of a recording at a time, as the page of wrenchctl view shows it: for the tutorials.
//   node picture.mjs RECORDING TIME_s FILE.png [HEIGHT]    HEIGHT: the upper pixels of the whole page; default: the scene alone
// with the environment of the tests: WRENCHD_BINARY_DIR, WRENCHD_SOURCE_DIR, WRENCHD_TEST_LIBRARIES.
import { writeFileSync } from "node:fs";
import { shownRecording } from "./gallery_scene.mjs";
import { sleep, test } from "./browser.mjs";

const SIZE = { width: 1280, height: 720 };

test(async () => {
  const [recording, time_s, target, height] = process.argv.slice(2);
  const { page } = await shownRecording(recording, SIZE, Number(time_s));
  await sleep(5000);  // the curves are drawn less often than the scene
  const clip = height ? { x: 0, y: 0, width: SIZE.width, height: Number(height) } : await page.locator("#canvas").boundingBox();
  writeFileSync(target, await page.screenshot({ clip }));
}, null);
