// SPDX-License-Identifier: GPL-3.0-or-later
// Drags the tool of a simulated device with the mouse while Shift is pressed: the left button moves it in the plane of the
// screen, the right button rotates it, and the wheel moves it along the line of sight.
const RADIANS_PER_PIXEL = 0.01;
const WHEEL_PIXELS = 0.2;  // pixels of motion for each unit of the wheel
const SEND_INTERVAL_MS = 20;
const REPEAT_INTERVAL_MS = 100;  // a goal expires, so it is sent again while the button is pressed

export class ToolDrag {
  /**
   * handPose: returns the pose of the handle in the device base; null if the tool cannot be dragged.
   * send: receives {from, d, r}: the pose at the start, displacement [m] and rotation vector [rad] since then, in the world.
   */
  constructor(world, { handPose, send }) {
    this.world = world;
    this.handPose = handPose;
    this.send = send;
    const canvas = world.canvas;
    // In the capture phase, before the camera's own listeners.
    canvas.addEventListener("pointerdown", (event) => this.begin(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("wheel", (event) => this.wheel(event), { capture: true, passive: false });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) canvas.addEventListener(end, () => this.end());
  }

  begin(event) {
    if (!event.shiftKey || this.drag || (event.button !== 0 && event.button !== 2)) return;
    const from = this.handPose();
    const distance_m = from ? this.world.distanceToTool(event) : null;
    if (distance_m === null) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.world.canvas.setPointerCapture(event.pointerId);
    this.drag = { from, x: event.clientX, y: event.clientY, rotates: event.button === 2, forward_px: 0,
      axes: this.world.screenAxes(), m_per_px: this.world.metresPerPixel(distance_m) };
    this.update(event.clientX, event.clientY);
    this.repeating = setInterval(() => this.sendNow(), REPEAT_INTERVAL_MS);
  }

  move(event) {
    if (this.drag) this.update(event.clientX, event.clientY);
  }

  wheel(event) {
    if (!this.drag) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.drag.forward_px -= WHEEL_PIXELS * (event.deltaY || event.deltaX);  // Shift turns the wheel into a horizontal one
    this.update(this.drag.last_x, this.drag.last_y);
  }

  update(x, y) {
    const drag = this.drag;
    [drag.last_x, drag.last_y] = [x, y];
    const right_px = x - drag.x, up_px = drag.y - y;
    const { right, up, forward } = drag.axes;
    const sum = (a, b, c) => right.map((_, i) => a * right[i] + b * up[i] + c * forward[i]);
    drag.d = drag.rotates ? [0, 0, 0] : sum(drag.m_per_px * right_px, drag.m_per_px * up_px, drag.m_per_px * drag.forward_px);
    drag.r = drag.rotates ? sum(-RADIANS_PER_PIXEL * up_px, RADIANS_PER_PIXEL * right_px, 0) : [0, 0, 0];
    if (performance.now() - (this.sentAt ?? 0) >= SEND_INTERVAL_MS) this.sendNow();
  }

  sendNow() {
    this.sentAt = performance.now();
    this.send({ from: this.drag.from, d: this.drag.d, r: this.drag.r });
  }

  /** Ends the drag; the hand then returns to its path. */
  end() {
    clearInterval(this.repeating);
    this.drag = null;
  }
}
