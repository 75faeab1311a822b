// SPDX-License-Identifier: GPL-3.0-or-later
// Measures whether the machine gives programs a rate of 1 kHz, by the rule of machine_load.hpp.
const PERIOD_MS = 1;
const LATE_MS = 2;
const BUSY_SHARE = 0.003;
const INSTANTS = 1000;

/** Returns "machine too busy to judge: ..." with the measured figures, or null if the machine gives the rate. Takes 1 s. */
export async function busyText() {
  let late = 0, worst_ms = 0;
  for (let i = 0; i < INSTANTS; ++i) {
    const due_ms = performance.now() + PERIOD_MS;
    await new Promise((done) => setTimeout(done, PERIOD_MS));
    const late_ms = performance.now() - due_ms;
    if (late_ms > LATE_MS) ++late;
    worst_ms = Math.max(worst_ms, late_ms);
  }
  if (late <= BUSY_SHARE * INSTANTS) return null;
  return `machine too busy to judge: ${(100 * late / INSTANTS).toFixed(1)} % of ${INSTANTS} wake-ups came more than ` +
    `${LATE_MS} ms late, the worst ${worst_ms.toFixed(1)} ms`;
}
