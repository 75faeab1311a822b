// SPDX-License-Identifier: GPL-3.0-or-later

// Example of a main loop for Teensy 4 with the Arduino core of PJRC. wrenchd does not compile this file: it
// needs that core. The functions named board_ are the maker's: encoders and motors.
//
// The USB type "Raw HID" is almost right. Change these properties in usb_desc.h and usb_desc.c of the core:
//
//   RAWHID_TX_SIZE 64, RAWHID_RX_SIZE 32, both intervals 1, RAWHID_USAGE_PAGE 0xFF00, RAWHID_USAGE 0x01
//   rawhid_report_desc: the bytes of wf_report_descriptor
//   VENDOR_ID and PRODUCT_ID: the maker's own. Every Teensy has the ids of PJRC, so wrenchd does not use them
//   to recognise a device.
#include <Arduino.h>

#include "board.h"
#include "wrench_firmware.h"

namespace {

constexpr uint32_t kSamplePeriod_us = 125;
constexpr uint32_t kSamplesPerReport = 8;
constexpr uint32_t kVelocityGain = 20;

wf_firmware firmware;
wf_velocity velocity;
IntervalTimer motor_timer;

void motor_interrupt() {
  wf_wrench wrench;
  const bool on = wf_motor_wrench(&firmware, micros(), &wrench);
  board_set_motors(on, &wrench);
}

}  // namespace

void setup() {
  const wf_limits limits = {5000000, 200000, 8};  // 5 N, 0.2 N.m, 8 ms
  board_init();
  wf_init(&firmware, &limits);
  wf_velocity_init(&velocity, kSamplePeriod_us, kVelocityGain);
  motor_timer.priority(32);  // above USB, so that the watchdog runs whatever the main loop does
  motor_timer.begin(motor_interrupt, kSamplePeriod_us);
}

void loop() {
  static uint32_t next_us = micros(), samples = 0;
  static uint8_t report[WF_POSE_REPORT_BYTES];
  static bool waiting = false, configured = false;

  uint8_t command[WF_WRENCH_REPORT_BYTES];
  const int length = RawHID.recv(command, 0);
  if (length > 0) wf_take_command(&firmware, micros(), command, static_cast<size_t>(length));

  const bool was_configured = configured;
  configured = usb_configuration != 0;
  if (was_configured && !configured) wf_disable(&firmware, micros());

  if (micros() - next_us < 0x80000000U) {
    next_us += kSamplePeriod_us;
    wf_sample sample;
    board_read_encoders(&sample);  // sets device_time_us to the time of the reading
    wf_velocity_update(&velocity, &sample);
    if (++samples % kSamplesPerReport == 0) {
      wf_make_report(&firmware, &sample, report);  // overwrites a report that the host has not fetched
      waiting = true;
    }
  }
  // RawHID.send() waits up to 1 ms if the host does not fetch reports. The motor interrupt runs meanwhile.
  if (waiting && RawHID.send(report, 0) > 0) waiting = false;
}
