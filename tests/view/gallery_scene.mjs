// SPDX-License-Identifier: GPL-3.0-or-later
// The scenes of the gallery on the page, each at its most characteristic moment.
import { file, finished, open, sleep, until, view } from "./browser.mjs";

export const MOMENTS_s = {
  ball_in_bowl: 4.1,
  bolt_and_nut: 5.4,
  carry_the_plate: 5.5,
  dominoes: 3.7,
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

/** Records the scene until this time and opens the recording there; returns the page and its server. */
export async function shown(name, size, t_s = MOMENTS_s[name]) {
  const recording = file(`${name}.h5`);
  await finished("wrenchd", ["--config", `gallery/${name}.toml`, "--virtual-time", "--seconds", String(t_s + 0.05), "--arm",
    "--record", recording, "--control", "none"]);
  return shownRecording(recording, size, t_s);
}

/** Opens a recording at this time; returns the page and its server. */
export async function shownRecording(recording, size, t_s) {
  const server = await view([recording]);
  const page = await open(server.url, { viewport: size, colorScheme: "light" });
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
