/* SPDX-License-Identifier: GPL-3.0-or-later */
#ifndef WRENCH_FIRMWARE_H
#define WRENCH_FIRMWARE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/*
 * Firmware core for a haptic device with the wrenchd reference report layout, version 1 (devices/README.md).
 *
 * The core turns samples into pose reports, checks commands, and decides at each instant which wrench the
 * motors apply. It is C99 without dependencies: no heap, no floating point, no operating system, no clock and
 * no USB stack. The maker's code reads the encoders, transfers the reports and drives the motors. examples/
 * shows how.
 *
 * Two contexts use the core:
 *
 *   motor context   A timer interrupt calls wf_motor_wrench() at a fixed rate of at least 1 kHz. It runs the
 *                   watchdog, so a main loop that hangs cannot keep the motors on.
 *   main context    The main loop, or the handlers of the USB stack, call every other function. No two of
 * these calls may overlap.
 *
 * The motor context may interrupt the main context at any instruction; the reverse must be impossible. No
 * lock is necessary on one core. If the contexts run on two cores, surround each call with a lock of the
 * maker's SDK.
 */

enum {
  WF_POSE_REPORT_BYTES = 64,
  WF_WRENCH_REPORT_BYTES = 32,
  WF_REPORT_DESCRIPTOR_BYTES = 31,
  WF_MAX_HOLD_MS = 32 /* longest time for which the motors follow one command, whatever the host requests */
};

/* HID report descriptor of the layout. */
extern const uint8_t wf_report_descriptor[WF_REPORT_DESCRIPTOR_BYTES];

/* One reading of the encoders, in the steps of the report. B: device base, x forward, y left, z up as seen by
 * the user. H: handle frame, whose origin is the handle point. */
struct wf_sample {
  uint32_t device_time_us;     /* time at which the encoders were read; wraps */
  int32_t position[3];         /* handle point in B, x y z [1e-7 m] */
  int32_t orientation[4];      /* unit quaternion from H to B, x y z w [2^-30] */
  int32_t linear_velocity[3];  /* of the handle point, in B [1e-6 m/s] */
  int32_t angular_velocity[3]; /* of the handle, in B [1e-6 rad/s] */
  uint8_t buttons;             /* bit mask, 1: pressed */
};

/* Wrench of the motors on the hand, about the handle point, in B. A force in +z pushes the hand up. */
struct wf_wrench {
  int32_t force_uN[3];   /* x y z [1e-6 N] */
  int32_t torque_uNm[3]; /* x y z [1e-6 N.m] */
};

/* What the device can apply. The core scales a larger force or torque and keeps its direction. */
struct wf_limits {
  uint32_t max_force_uN;
  uint32_t max_torque_uNm;
  uint16_t default_hold_ms; /* hold time of a command that states 0; at most WF_MAX_HOLD_MS */
};

/* An accepted command. The main context writes it, the motor context reads it. */
struct wf_command {
  uint32_t accepted_us;
  uint32_t hold_us;
  struct wf_wrench wrench;
  uint16_t sequence;
  bool enable;
};

/* State of the core. Use the functions below, not the members. */
struct wf_firmware {
  struct wf_limits limits;

  /* Main context. */
  uint16_t report_sequence;
  uint16_t last_sequence; /* of the last accepted command */
  bool command_accepted;  /* true after the first accepted command */

  /* Hand-over. The main context fills the slot that the motor context does not read, then raises `published`,
   * whose lowest bit selects the slot. */
  volatile struct wf_command slots[2];
  volatile uint32_t published;

  /* Motor context. */
  volatile uint32_t applied; /* value of `published` at the last wf_motor_wrench() */
  volatile bool motors_on;
  volatile bool watchdog_tripped;
  volatile uint8_t acknowledged;
};

/* Switches the motors off and forgets all commands. Call it once, before the motor context starts. */
void wf_init(struct wf_firmware* firmware, const struct wf_limits* limits);

/* Main context. Checks a wrench report that arrived at now_us. Returns false if the report is invalid,
 * repeated or out of order; such a report has no effect and does not feed the watchdog. now_us: the clock
 * that the motor context uses, read in this call or before. */
bool wf_take_command(struct wf_firmware* firmware, uint32_t now_us, const uint8_t* bytes, size_t length);

/* Main context. Makes the next pose report and raises the sequence. Call it for each report that is due. If
 * the host has not fetched the previous report yet, overwrite that one. */
void wf_make_report(struct wf_firmware* firmware, const struct wf_sample* sample,
                    uint8_t report[WF_POSE_REPORT_BYTES]);

/* Main context. Switches the motors off as a command with enable 0 does. Call it when USB is suspended,
 * disconnected or not configured. */
void wf_disable(struct wf_firmware* firmware, uint32_t now_us);

/* Motor context. Runs the watchdog and writes the wrench to apply until the next call; zero while the motors
 * are off. Returns true if the motors are on. */
bool wf_motor_wrench(struct wf_firmware* firmware, uint32_t now_us, struct wf_wrench* wrench);

/* CRC-16/CCITT-FALSE: polynomial 0x1021, initial value 0xFFFF, not reflected, no final xor. */
uint16_t wf_crc16(const uint8_t* bytes, size_t length);

/* Velocity of the handle: a first-order low pass on the differences of the samples. Rule 4 asks for a true
 * estimate because the firmware reads the encoders more often than the host. */
struct wf_velocity {
  int32_t position[3];
  int32_t orientation[4];
  int64_t linear[3];      /* [1e-6 m/s], times 256 */
  int64_t angular[3];     /* [1e-6 rad/s], times 256 */
  int32_t linear_factor;  /* (1e-6 m/s) / 256 per 1e-7 m of difference */
  int32_t angular_factor; /* (1e-6 rad/s) / 256 per 2^-30 of half the rotation, times 256 */
  int32_t gain;
  bool started;
};

/* period_us: time between two samples, 10 to 10000. gain: weight of a new difference, 1 to 256, in steps of
 * 1/256. The cut-off frequency is about gain / (256 * 2 pi period): at 125 us a gain of 20 gives 100 Hz. */
void wf_velocity_init(struct wf_velocity* velocity, uint32_t period_us, uint32_t gain);

/* Main context. Call it once per period. Fills the velocities of the sample from its position and
 * orientation. */
void wf_velocity_update(struct wf_velocity* velocity, struct wf_sample* sample);

#ifdef __cplusplus
}
#endif

#endif
