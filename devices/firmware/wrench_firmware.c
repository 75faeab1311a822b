/* SPDX-License-Identifier: GPL-3.0-or-later */
#include "wrench_firmware.h"

const uint8_t wf_report_descriptor[WF_REPORT_DESCRIPTOR_BYTES] = {
    0x06, 0x00, 0xFF, /* Usage Page (Vendor Defined 0xFF00) */
    0x09, 0x01,       /* Usage (0x01): kinaesthetic device */
    0xA1, 0x01,       /* Collection (Application) */
    0x15, 0x00,       /*   Logical Minimum (0) */
    0x26, 0xFF, 0x00, /*   Logical Maximum (255) */
    0x75, 0x08,       /*   Report Size (8 bits) */
    0x85, 0x01,       /*   Report ID (1) */
    0x09, 0x02,       /*   Usage (0x02): pose report */
    0x95, 0x3F,       /*   Report Count (63) */
    0x81, 0x02,       /*   Input (Data, Variable, Absolute) */
    0x85, 0x02,       /*   Report ID (2) */
    0x09, 0x03,       /*   Usage (0x03): wrench report */
    0x95, 0x1F,       /*   Report Count (31) */
    0x91, 0x02,       /*   Output (Data, Variable, Absolute) */
    0xC0              /* End Collection */
};

enum {
  POSE_REPORT_ID = 0x01,
  WRENCH_REPORT_ID = 0x02,

  /* Bytes of the fields, from devices/README.md. */
  POSE_FLAGS = 1,
  POSE_SEQUENCE = 2,
  POSE_TIME = 4,
  POSE_POSITION = 8,
  POSE_ORIENTATION = 20,
  POSE_LINEAR_VELOCITY = 36,
  POSE_ANGULAR_VELOCITY = 48,
  POSE_BUTTONS = 60,
  POSE_ACKNOWLEDGED = 61,
  POSE_CRC = 62,
  WRENCH_FLAGS = 1,
  WRENCH_SEQUENCE = 2,
  WRENCH_FORCE = 4,
  WRENCH_TORQUE = 16,
  WRENCH_HOLD = 28,
  WRENCH_CRC = 30,

  FLAG_MOTORS_ON = 1,
  FLAG_WATCHDOG_TRIPPED = 2,
  FLAG_ENABLE = 1,

  MAX_SEQUENCE_AHEAD = 32767
};

/* --- bytes -----------------------------------------------------------------------------------------------
 */

static void put_u16(uint8_t* bytes, uint16_t value) {
  bytes[0] = (uint8_t)(value & 0xFFU);
  bytes[1] = (uint8_t)(value >> 8);
}

static void put_u32(uint8_t* bytes, uint32_t value) {
  put_u16(bytes, (uint16_t)(value & 0xFFFFU));
  put_u16(bytes + 2, (uint16_t)(value >> 16));
}

static void put_integers(uint8_t* bytes, const int32_t* values, size_t count) {
  size_t i;
  for (i = 0; i < count; ++i) put_u32(bytes + 4 * i, (uint32_t)values[i]);
}

static uint16_t get_u16(const uint8_t* bytes) {
  return (uint16_t)(bytes[0] | ((unsigned)bytes[1] << 8));
}

/* The conversion of a value above INT32_MAX to int32_t is not defined by C99, so this function avoids it. */
static int32_t get_i32(const uint8_t* bytes) {
  const uint32_t value = get_u16(bytes) | ((uint32_t)get_u16(bytes + 2) << 16);
  return value <= 0x7FFFFFFFU ? (int32_t)value : -(int32_t)(0xFFFFFFFFU - value) - 1;
}

uint16_t wf_crc16(const uint8_t* bytes, size_t length) {
  uint16_t crc = 0xFFFF;
  size_t i;
  int bit;
  for (i = 0; i < length; ++i) {
    crc = (uint16_t)(crc ^ ((unsigned)bytes[i] << 8));
    for (bit = 0; bit < 8; ++bit)
      crc = (uint16_t)((crc & 0x8000U) != 0 ? ((unsigned)crc << 1) ^ 0x1021U : (unsigned)crc << 1);
  }
  return crc;
}

/* --- limits ----------------------------------------------------------------------------------------------
 */

/* Returns the largest integer whose square is at most `value`. */
static uint32_t integer_sqrt(uint64_t value) {
  uint64_t root = 0;
  uint64_t bit = (uint64_t)1 << 62;
  for (; bit != 0; bit >>= 2) {
    if (value >= root + bit) {
      value -= root + bit;
      root = (root >> 1) + bit;
    } else {
      root >>= 1;
    }
  }
  return (uint32_t)root;
}

/* Scales the vector to a length of at most `max`. The sum of three squares of at most 2^62 fits in 64 bits.
 */
static void limit_length(int32_t vector[3], uint32_t max) {
  uint64_t square = 0;
  uint32_t length;
  int i;
  for (i = 0; i < 3; ++i) square += (uint64_t)((int64_t)vector[i] * vector[i]);
  if (square <= (uint64_t)max * max) return;
  length = integer_sqrt(square - 1) + 1; /* rounded up, so that the result is not longer than max */
  for (i = 0; i < 3; ++i) vector[i] = (int32_t)((int64_t)vector[i] * (int64_t)max / (int64_t)length);
}

/* --- commands --------------------------------------------------------------------------------------------
 */

void wf_init(struct wf_firmware* firmware, const struct wf_limits* limits) {
  firmware->limits = *limits;
  if (firmware->limits.default_hold_ms == 0 || firmware->limits.default_hold_ms > WF_MAX_HOLD_MS)
    firmware->limits.default_hold_ms = WF_MAX_HOLD_MS;
  firmware->report_sequence = 0;
  firmware->last_sequence = 0;
  firmware->command_accepted = false;
  firmware->published = 0;
  firmware->applied = 0;
  firmware->motors_on = false;
  firmware->watchdog_tripped = false;
  firmware->acknowledged = 0;
}

/* Returns true if the motors are on, or switch on at the next call of the motor context. */
static bool motors_are_on(const struct wf_firmware* firmware) {
  const uint32_t published = firmware->published;
  return firmware->applied == published ? firmware->motors_on : firmware->slots[published & 1U].enable;
}

/* A repeated command is never accepted: a host that hangs must not keep the motors on. A sequence that lies
 * behind is accepted only while the motors are off, because it belongs to a restarted host. */
static bool in_order(const struct wf_firmware* firmware, uint16_t sequence) {
  const uint16_t ahead = (uint16_t)(sequence - firmware->last_sequence);
  if (!firmware->command_accepted) return true;
  if (ahead == 0) return false;
  return ahead <= MAX_SEQUENCE_AHEAD || !motors_are_on(firmware);
}

static uint32_t hold_us(const struct wf_firmware* firmware, uint16_t requested_ms) {
  uint32_t ms = requested_ms == 0 ? firmware->limits.default_hold_ms : requested_ms;
  if (ms > WF_MAX_HOLD_MS) ms = WF_MAX_HOLD_MS;
  return 1000U * ms;
}

static void publish(struct wf_firmware* firmware, const struct wf_command* command) {
  const uint32_t next = firmware->published + 1U;
  volatile struct wf_command* slot = &firmware->slots[next & 1U];
  int i;
  slot->accepted_us = command->accepted_us;
  slot->hold_us = command->hold_us;
  slot->sequence = command->sequence;
  slot->enable = command->enable;
  for (i = 0; i < 3; ++i) {
    slot->wrench.force_uN[i] = command->wrench.force_uN[i];
    slot->wrench.torque_uNm[i] = command->wrench.torque_uNm[i];
  }
  firmware->published = next; /* last: from here on the motor context reads this slot */
}

bool wf_take_command(struct wf_firmware* firmware, uint32_t now_us, const uint8_t* bytes, size_t length) {
  struct wf_command command;
  int i;
  if (length != WF_WRENCH_REPORT_BYTES || bytes[0] != WRENCH_REPORT_ID) return false;
  if (get_u16(bytes + WRENCH_CRC) != wf_crc16(bytes, WRENCH_CRC)) return false;
  command.sequence = get_u16(bytes + WRENCH_SEQUENCE);
  if (!in_order(firmware, command.sequence)) return false;

  command.enable = (bytes[WRENCH_FLAGS] & FLAG_ENABLE) != 0;
  command.accepted_us = now_us;
  command.hold_us = hold_us(firmware, get_u16(bytes + WRENCH_HOLD));
  for (i = 0; i < 3; ++i) {
    command.wrench.force_uN[i] = get_i32(bytes + WRENCH_FORCE + 4 * i);
    command.wrench.torque_uNm[i] = get_i32(bytes + WRENCH_TORQUE + 4 * i);
  }
  limit_length(command.wrench.force_uN, firmware->limits.max_force_uN);
  limit_length(command.wrench.torque_uNm, firmware->limits.max_torque_uNm);
  firmware->last_sequence = command.sequence;
  firmware->command_accepted = true;
  publish(firmware, &command);
  return true;
}

void wf_disable(struct wf_firmware* firmware, uint32_t now_us) {
  struct wf_command command = {0, 0, {{0, 0, 0}, {0, 0, 0}}, 0, false};
  command.accepted_us = now_us;
  command.sequence = firmware->last_sequence;
  publish(firmware, &command);
}

/* --- motors ----------------------------------------------------------------------------------------------
 */

static void set_zero(struct wf_wrench* wrench) {
  int i;
  for (i = 0; i < 3; ++i) wrench->force_uN[i] = wrench->torque_uNm[i] = 0;
}

/* A command that is newer than now_us counts as expired, because its age wraps. This is the safe side. */
bool wf_motor_wrench(struct wf_firmware* firmware, uint32_t now_us, struct wf_wrench* wrench) {
  const uint32_t published = firmware->published;
  const volatile struct wf_command* command = &firmware->slots[published & 1U];
  int i;
  set_zero(wrench);
  if (published != firmware->applied) {
    firmware->applied = published;
    firmware->motors_on = command->enable;
    if (command->enable) firmware->watchdog_tripped = false;
    firmware->acknowledged = (uint8_t)(command->sequence & 0xFFU);
  }
  if (!firmware->motors_on) return false;
  if ((uint32_t)(now_us - command->accepted_us) > command->hold_us) {
    firmware->watchdog_tripped = true;
    firmware->motors_on = false;
    return false;
  }
  for (i = 0; i < 3; ++i) {
    wrench->force_uN[i] = command->wrench.force_uN[i];
    wrench->torque_uNm[i] = command->wrench.torque_uNm[i];
  }
  return true;
}

/* --- reports ---------------------------------------------------------------------------------------------
 */

void wf_make_report(struct wf_firmware* firmware, const struct wf_sample* sample,
                    uint8_t report[WF_POSE_REPORT_BYTES]) {
  uint8_t flags = 0;
  if (firmware->motors_on) flags = (uint8_t)(flags | FLAG_MOTORS_ON);
  if (firmware->watchdog_tripped) flags = (uint8_t)(flags | FLAG_WATCHDOG_TRIPPED);
  ++firmware->report_sequence;
  report[0] = POSE_REPORT_ID;
  report[POSE_FLAGS] = flags;
  put_u16(report + POSE_SEQUENCE, firmware->report_sequence);
  put_u32(report + POSE_TIME, sample->device_time_us);
  put_integers(report + POSE_POSITION, sample->position, 3);
  put_integers(report + POSE_ORIENTATION, sample->orientation, 4);
  put_integers(report + POSE_LINEAR_VELOCITY, sample->linear_velocity, 3);
  put_integers(report + POSE_ANGULAR_VELOCITY, sample->angular_velocity, 3);
  report[POSE_BUTTONS] = sample->buttons;
  report[POSE_ACKNOWLEDGED] = firmware->acknowledged;
  put_u16(report + POSE_CRC, wf_crc16(report, POSE_CRC));
}

/* --- velocity --------------------------------------------------------------------------------------------
 */

/*   linear:  difference 1e-7 m / (period 1e-6 s)     = difference * 1e5 / period               [1e-6 m/s]
 *   angular: 2 * difference 2^-30 / (period 1e-6 s)  = difference * 244140625 / (2^17 period)  [1e-6 rad/s]
 *
 * The estimates have a fraction of 1/256, the angular factor another one. */
void wf_velocity_init(struct wf_velocity* velocity, uint32_t period_us, uint32_t gain) {
  int i;
  if (period_us < 10) period_us = 10;
  if (period_us > 10000) period_us = 10000;
  velocity->linear_factor = (int32_t)((25600000U + period_us / 2) / period_us);
  velocity->angular_factor =
      (int32_t)((122070313U + period_us / 2) / period_us); /* 244140625 * 2^16 / 2^17 */
  velocity->gain = gain == 0 ? 1 : gain > 256 ? 256 : (int32_t)gain;
  velocity->started = false;
  for (i = 0; i < 3; ++i) velocity->linear[i] = velocity->angular[i] = 0;
}

/* The vector part of q1 * conjugate(q0): half the rotation between two samples, in B, for small angles
 * [2^-30]. The squares of a unit quaternion add up to 2^60, so the sums of products do not exceed 2^60. The
 * sign selects the shorter of the two rotations, because q and -q are the same orientation. */
static void rotation_between(const int32_t q0[4], const int32_t q1[4], int64_t rotation[3]) {
  const int64_t x0 = q0[0], y0 = q0[1], z0 = q0[2], w0 = q0[3];
  const int64_t x1 = q1[0], y1 = q1[1], z1 = q1[2], w1 = q1[3];
  const int64_t sign = w1 * w0 + x1 * x0 + y1 * y0 + z1 * z0 < 0 ? -1 : 1;
  const int64_t unit = (int64_t)1 << 30;
  rotation[0] = sign * ((x1 * w0 - w1 * x0 - y1 * z0 + z1 * y0) / unit);
  rotation[1] = sign * ((y1 * w0 - w1 * y0 - z1 * x0 + x1 * z0) / unit);
  rotation[2] = sign * ((z1 * w0 - w1 * z0 - x1 * y0 + y1 * x0) / unit);
}

static int64_t clamped(int64_t value, int64_t max) {
  return value > max ? max : value < -max ? -max : value;
}

/* The range of a report field, with the fraction. Its product with the gain fits in 64 bits. */
#define MAX_VELOCITY ((int64_t)INT32_MAX * 256)

static void filter(int64_t* velocity, int64_t difference, int32_t gain) {
  *velocity += (clamped(difference, MAX_VELOCITY) - *velocity) * gain / 256;
}

void wf_velocity_update(struct wf_velocity* velocity, struct wf_sample* sample) {
  int64_t rotation[3];
  int i;
  if (velocity->started) {
    rotation_between(velocity->orientation, sample->orientation, rotation);
    for (i = 0; i < 3; ++i) {
      const int64_t moved = (int64_t)sample->position[i] - velocity->position[i];
      filter(&velocity->linear[i], moved * velocity->linear_factor, velocity->gain);
      filter(&velocity->angular[i], rotation[i] * velocity->angular_factor / 256, velocity->gain);
    }
  }
  velocity->started = true;
  for (i = 0; i < 3; ++i) {
    velocity->position[i] = sample->position[i];
    sample->linear_velocity[i] = (int32_t)(velocity->linear[i] / 256);
    sample->angular_velocity[i] = (int32_t)(velocity->angular[i] / 256);
  }
  for (i = 0; i < 4; ++i) velocity->orientation[i] = sample->orientation[i];
}
