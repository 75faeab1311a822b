/* SPDX-License-Identifier: GPL-3.0-or-later */

/*
 * Example of a main loop with TinyUSB. wrenchd does not compile this file: it needs TinyUSB and the SDK of a
 * board. The functions named board_ are the maker's: encoders, motors, clock and timer.
 *
 * The device and configuration descriptors are the maker's too, with these properties:
 *
 *   one HID interface: TUD_HID_INOUT_DESCRIPTOR(itf, 0, HID_ITF_PROTOCOL_NONE, WF_REPORT_DESCRIPTOR_BYTES,
 *                                               0x01, 0x81, 64, 1)
 *   vendor and product id of the maker, and a different serial number string for each device
 *   tusb_config.h: CFG_TUD_HID 1, CFG_TUD_HID_EP_BUFSIZE 64
 */
#include <string.h>

#include "board.h"
#include "tusb.h"
#include "wrench_firmware.h"

enum { SAMPLE_PERIOD_US = 125, SAMPLES_PER_REPORT = 8, VELOCITY_GAIN = 20 };

static struct wf_firmware firmware;
static struct wf_velocity velocity;

/* A timer calls this at 1 kHz or faster. Its interrupt priority is above that of USB and of the main loop. */
void board_motor_interrupt(void) {
  struct wf_wrench wrench;
  const bool on = wf_motor_wrench(&firmware, board_micros(), &wrench);
  board_set_motors(on, &wrench);
}

uint8_t const* tud_hid_descriptor_report_cb(uint8_t instance) {
  (void)instance;
  return wf_report_descriptor;
}

/* A report from the OUT endpoint contains its id. TinyUSB removes the id from a report that arrives as a
 * control transfer. */
void tud_hid_set_report_cb(uint8_t instance, uint8_t id, hid_report_type_t type, uint8_t const* buffer,
                           uint16_t length) {
  uint8_t report[WF_WRENCH_REPORT_BYTES];
  (void)instance;
  (void)type;
  if (id == 0) {
    wf_take_command(&firmware, board_micros(), buffer, length);
  } else if (length == sizeof(report) - 1) {
    report[0] = id;
    memcpy(report + 1, buffer, length);
    wf_take_command(&firmware, board_micros(), report, sizeof(report));
  }
}

/* The layout has no feature reports and no reports on request. */
uint16_t tud_hid_get_report_cb(uint8_t instance, uint8_t id, hid_report_type_t type, uint8_t* buffer,
                               uint16_t length) {
  (void)instance;
  (void)id;
  (void)type;
  (void)buffer;
  (void)length;
  return 0;
}

void tud_suspend_cb(bool remote_wakeup_en) {
  (void)remote_wakeup_en;
  wf_disable(&firmware, board_micros());
}

void tud_umount_cb(void) {
  wf_disable(&firmware, board_micros());
}

int main(void) {
  const struct wf_limits limits = {.max_force_uN = 5000000, .max_torque_uNm = 200000, .default_hold_ms = 8};
  uint8_t report[WF_POSE_REPORT_BYTES];
  struct wf_sample sample;
  unsigned samples = 0;
  bool waiting = false; /* a report is made and not yet sent */
  uint32_t next_us;

  board_init();
  wf_init(&firmware, &limits);
  wf_velocity_init(&velocity, SAMPLE_PERIOD_US, VELOCITY_GAIN);
  tusb_init();
  board_start_motor_timer();
  next_us = board_micros();
  for (;;) {
    tud_task();
    if ((uint32_t)(board_micros() - next_us) < 0x80000000U) {
      next_us += SAMPLE_PERIOD_US;
      board_read_encoders(&sample); /* sets device_time_us to the time of the reading */
      wf_velocity_update(&velocity, &sample);
      if (++samples % SAMPLES_PER_REPORT == 0) {
        wf_make_report(&firmware, &sample, report); /* overwrites a report that the host has not fetched */
        waiting = true;
      }
    }
    if (waiting && tud_hid_ready()) waiting = !tud_hid_report(0, report, sizeof(report));
  }
}
