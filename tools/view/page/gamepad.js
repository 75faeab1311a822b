// SPDX-License-Identifier: GPL-3.0-or-later
// Moves the tool of a simulated device with a gamepad while a shoulder button is held: the left stick moves it in the plane of
// the screen, the triggers move it along the line of sight, and the right stick rotates it.
import { Quaternion, Vector3 } from "three";

const SPEED_m_per_s = 0.12, TURN_rad_per_s = 1.5;  // at full deflection
const MOST_m = 0.2;  // longest way from the place where the shoulder button was pressed
const DEAD_ZONE = 0.15;  // sticks at rest report up to a tenth of their range
const PERIOD_MS = 20, MOST_STEP_MS = 50;
// Numbers of the standard gamepad (W3C Gamepad, "standard" mapping).
const SHOULDERS = [4, 5], TRIGGER_BACK = 6, TRIGGER_FORWARD = 7;
const LEFT_X = 0, LEFT_Y = 1, RIGHT_X = 2, RIGHT_Y = 3;

/** Returns the deflection of an axis without its dead zone, -1 to 1. */
function deflection(value = 0) {
  const rest = Math.min(Math.abs(value), 1) - DEAD_ZONE;
  return rest > 0 ? (Math.sign(value) * rest) / (1 - DEAD_ZONE) : 0;
}

/** Returns the vector from the axis of the rotation times its angle [rad]. */
function rotationVector(q) {
  const sign = q.w < 0 ? -1 : 1;
  const half = new Vector3(sign * q.x, sign * q.y, sign * q.z);
  const sine = half.length();
  return sine < 1e-9 ? [0, 0, 0] : half.multiplyScalar((2 * Math.atan2(sine, sign * q.w)) / sine).toArray();
}

export class GamepadDrag {
  /**
   * handPose: returns the pose of the handle in the device base; null if the tool cannot be moved.
   * send: receives {from, d, r}: the pose at the start, displacement [m] and rotation vector [rad] since then, in the world.
   */
  constructor(world, { handPose, send }) {
    this.world = world;
    this.handPose = handPose;
    this.send = send;
    addEventListener("gamepadconnected", () => (this.polling ??= setInterval(() => this.poll(), PERIOD_MS)));
  }

  poll() {
    const pads = [...navigator.getGamepads()].filter((pad) => pad?.connected && pad.mapping === "standard");
    if (pads.length === 0) this.stopPolling();
    const pad = pads.find(({ buttons }) => SHOULDERS.some((i) => buttons[i]?.pressed));
    if (!pad || document.visibilityState !== "visible") return this.end();
    if (!this.drag && !this.rejected) this.begin();
    if (this.drag) this.step(pad);
  }

  begin() {
    const from = this.handPose();
    if (from) this.drag = { from, d: new Vector3(), q: new Quaternion(), at: performance.now() };
  }

  step({ axes, buttons }) {
    const now = performance.now(), drag = this.drag;
    const step_s = Math.min(now - drag.at, MOST_STEP_MS) / 1000;
    drag.at = now;
    const [right, up, forward] = Object.values(this.world.screenAxes()).map((axis) => new Vector3(...axis));
    const along = (buttons[TRIGGER_FORWARD]?.value ?? 0) - (buttons[TRIGGER_BACK]?.value ?? 0);
    const speed = right.clone().multiplyScalar(deflection(axes[LEFT_X])).addScaledVector(up, -deflection(axes[LEFT_Y]))
      .addScaledVector(forward, deflection(along));
    drag.d.addScaledVector(speed, SPEED_m_per_s * step_s).clampLength(0, MOST_m);
    const turn = up.clone().multiplyScalar(deflection(axes[RIGHT_X])).addScaledVector(right, deflection(axes[RIGHT_Y]));
    const angle_rad = TURN_rad_per_s * step_s * turn.length();
    if (angle_rad > 0) drag.q.premultiply(new Quaternion().setFromAxisAngle(turn.normalize(), angle_rad)).normalize();
    this.send({ from: drag.from, d: drag.d.toArray(), r: rotationVector(drag.q) });
  }

  /** The daemon rejects the drag: nothing moves until the shoulder button is pressed again. */
  reject() {
    this.drag = null;
    this.rejected = true;
  }

  /** Ends the drag; the hand then returns to its path. */
  end() {
    this.drag = null;
    this.rejected = false;
  }

  stopPolling() {
    clearInterval(this.polling);
    this.polling = undefined;
  }
}
