// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/gravity_compensation.hpp"
#include "core/homing_plan.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// Encoding of an integer in the bytes of a report.
enum class Coding : std::uint8_t {
  binary,        ///< plain bits
  nibble_ascii,  ///< four bits per byte as characters from 'A' on (Novint Falcon); only whole nibbles
};

/// Position, encoding and scale of one integer field in a report, as stated by the profile.
///
///   value_SI = step * raw + offset
struct ReportField {
  bool present = false;
  /// offset from the start of the report; byte 0 is the report id if the device uses ids
  std::size_t byte = 0;
  unsigned bits = 0;        ///< width, 1 to 64
  bool is_signed = false;   ///< two's complement
  double step = 1.0;        ///< SI value of one count; a negative step reverses the axis
  std::size_t count = 1;    ///< number of consecutive integers of this layout
  unsigned bit = 0;         ///< start bit in the first byte; 0 = least significant
  bool big_endian = false;  ///< most significant byte (or nibble) first; only whole bytes
  double offset = 0.0;      ///< SI value of raw 0
  Coding coding = Coding::binary;
  /// value subtracted from each byte before decoding: 0x41 for characters from 'A' on
  std::uint8_t base = 0;
};

/// One bit of a report.
struct ReportBit {
  bool present = false;
  std::size_t byte = 0;
  unsigned bit = 0;       ///< bit index in the byte; 0 = least significant
  std::uint8_t base = 0;  ///< value subtracted from the byte before decoding
};

/// A named bit or number for display. The servo loop does not use it.
struct NamedBit {
  std::string name;
  ReportBit bit;
};
struct NamedField {
  std::string name;  ///< name for display, ends in the unit
  ReportField field;
};

/// A byte with a constant value, for example a frame marker.
struct ReportConstant {
  std::size_t byte = 0;
  std::uint8_t value = 0;
};

/// Checksum type of a report.
enum class Checksum : std::uint8_t {
  none,
  crc16_ccitt_false,  ///< two bytes, little-endian
  sum8,               ///< sum of the bytes modulo 256
  xor8,               ///< exclusive or of the bytes
};

/// Layout common to reports of both directions.
struct ReportFrame {
  bool has_id = true;      ///< false: byte 0 is part of the content
  std::uint8_t id = 0;     ///< report id in byte 0, if has_id
  std::size_t length = 0;  ///< length in bytes, including the report id
  /// minimum length of an accepted short report; missing fields read 0. The value 0 rejects short reports
  std::size_t min_length = 0;
  std::vector<ReportConstant> constants;
  /// checksum type; it covers the bytes from checksum_from to the byte before the checksum
  Checksum checksum = Checksum::none;
  std::size_t checksum_from = 0;  ///< first byte that the checksum covers
  /// byte offset of the checksum; empty: the last bytes of the report
  std::optional<std::size_t> checksum_at;
};

/// Device to host: a pose sample or a part of one. A device may send several layouts, which differ in id or
/// length. D: the device's own base axes. E: the frame whose pose the device sends. For a device that follows
/// devices/README.md, D is the base frame B and E is the handle frame H.
struct PoseReportLayout : ReportFrame {
  std::string name;              ///< name for display; optional
  ReportField sequence;          ///< counts reports, wraps at its width
  ReportField device_time;       ///< device clock [s], wraps at its width
  ReportField position;          ///< p_DE [m], x y z
  ReportField orientation;       ///< R_DE unit quaternion, x y z w
  ReportField linear_velocity;   ///< linear velocity of E, in D [m/s]; optional
  ReportField angular_velocity;  ///< angular velocity of E, in D [rad/s]; optional
  ReportField acknowledged;      ///< sequence number of the last command that the device accepted; optional
  ReportBit motors_on;
  ReportBit watchdog_tripped;
  ReportField buttons;                 ///< bit mask of the buttons; optional
  std::vector<ReportBit> button_bits;  ///< positions of button 0, 1, 2, ... as single bits, instead of a mask
  std::vector<ReportBit> homed;        ///< all bits are 1 if the encoders are homed
  ReportField translation;             ///< deflection of a spring-centred puck in D [m], x y z
  ReportField rotation;  ///< rotation vector of the deflection of a spring-centred puck in D [rad], x y z
  ReportField joints;    ///< encoder counts, one per joint
  std::vector<NamedBit> status;
  std::vector<NamedField> values;
};

/// Host to device: one wrench command.
struct WrenchReportLayout : ReportFrame {
  /// initial content of the report before the fields are written; empty: zeros
  std::vector<std::uint8_t> template_bytes;
  ReportField sequence;
  ReportField force;      ///< force on the hand at E, in D [N]
  ReportField torque;     ///< torque on the hand about E, in D [N.m]
  ReportField efforts;    ///< motor efforts, instead of force and torque: [A] or counts of the device
  ReportField hold_time;  ///< time for which the device may hold this command before its watchdog trips [s]
  ReportBit enable;       ///< switches the motors on
};

/// A report with constant content: keep-alive, shutdown, calibration.
struct FixedReport {
  std::vector<std::uint8_t> bytes;  ///< complete report; empty: the device has no such report
};

/// Reference point and axes of the wrench that a device expects.
enum class WrenchPoint : std::uint8_t {
  handle,  ///< about the handle point, in the axes of the device base; the usual choice for a device's motors
  /// the spatial wrench W_S, METHOD (66) (paper, section 2.4), about the world origin in world axes
  world_origin,
};

/// Transport of the reports.
enum class Transport : std::uint8_t {
  loopback,  ///< the simulated device
  hidraw,    ///< HID reports through the kernel's hidraw interface
  libusb,    ///< USB endpoints through libusb
};

/// When a device sends reports.
enum class StreamStyle : std::uint8_t {
  free_running,    ///< at its own rate, independent of the host
  lock_step,       ///< one report for each command; the host has to send first
  silent_at_rest,  ///< only while the handle is moved; silence after a rest report is no fault
};

/// How the reports determine the handle pose.
enum class PoseSource : std::uint8_t {
  pose,        ///< the device sends the pose
  joints,      ///< the device sends joint angles; wrenchd computes forward kinematics
  deflection,  ///< the device sends the deflection of a puck
};

/// Maps the deflection of a puck to a pose (equations: devices/deflection_pose.hpp).
struct Deflection {
  static constexpr double kNotStated = std::numeric_limits<double>::quiet_NaN();
  static constexpr double kUnbounded = std::numeric_limits<double>::infinity();

  enum class Mode : std::uint8_t {
    rate,      ///< the deflection commands a velocity; the pose stays when the puck returns to rest
    position,  ///< the deflection is the pose; the pose returns to rest with the puck
  };
  Mode mode = Mode::rate;
  double linear_gain = 1.0;  ///< mode rate: [m/s] per metre of deflection; mode position: [m] per metre
  /// mode rate: [rad/s] per radian of deflection; mode position: [rad] per radian
  double angular_gain = 1.0;

  // Limits of the pose: it is clamped to this distance from its start and to this box in B.
  double reach_m = 0.2;
  Vector3d box_min_m = Vector3d::Constant(-kUnbounded);
  Vector3d box_max_m = Vector3d::Constant(kUnbounded);

  // Only for mode rate. All values except `slow_factor` require the full deflection to be stated.
  /// translation of the puck at its mechanical stop [m]; there the speed is gain times this value
  double full_deflection_m = kNotStated;
  double full_deflection_rad = kNotStated;
  double dead_zone = 0.0;  ///< fraction of the full deflection in which the pose does not move
  /// exponent from deflection to speed; a larger value gives finer control near rest
  double response_exponent = 1.0;
  double slow_factor = 0.2;  ///< factor on the speed while the slow button is held
  double max_proxy_distance_m =
      kNotStated;  ///< maximum distance between commanded pose and proxy at full deflection [m]
  double max_proxy_angle_rad = kNotStated;

  bool has_proxy_distance_limit() const noexcept { return max_proxy_distance_m > 0.0; }
};

inline constexpr std::size_t kMaxJoints = 6;
inline constexpr std::size_t kMaxMotors = 3;

/// Joints and links of a device that sends joint angles (equations: devices/kinematics.hpp). Joint angle i
/// [rad] = rad_per_count[i] * counts[report_index[i]] + zero_rad[i].
struct Kinematics {
  enum class Kind : std::uint8_t {
    none,
    capstan_arm,  ///< WoodenHaptics, Polhem version 1
    delta,        ///< Novint Falcon
  };
  Kind kind = Kind::none;
  std::size_t joints = 0;  ///< number of sensed joints; the first kMaxMotors of them are driven
  /// index of joint i among the integers of the report
  std::array<std::size_t, kMaxJoints> report_index = {0, 1, 2, 3, 4, 5};
  std::array<double, kMaxJoints> rad_per_count{};
  std::array<double, kMaxJoints> zero_rad{};
  std::array<double, kMaxJoints> home_counts{};    ///< encoder counts at the home position, by report index
  std::array<double, kMaxMotors> effort_per_Nm{};  ///< motor effort for 1 N.m about the joint
  /// maximum effort of any motor; a larger set of efforts is scaled as a group
  double max_effort = std::numeric_limits<double>::quiet_NaN();

  // kind capstan_arm
  Vector3d length_m = Vector3d::Zero();  ///< lengths of bodies a, b, c
  Vector3d origin_m = Vector3d::Zero();  ///< origin of D relative to the foot of body a

  // kind delta; names and letters after Stamper (1997)
  double thigh_m = 0.0;                      ///< a, thigh length
  double shin_m = 0.0;                       ///< b, side of the parallelogram
  Vector3d shin_joint_m = Vector3d::Zero();  ///< c, d + e, f: offsets along u, along the shin, along v
  Vector3d leg_base_m = Vector3d::Zero();    ///< r, s: offsets along u and v; z is not used
  std::array<double, 3> leg_angle_rad{};     ///< angle of each leg about z

  /// A button coded into an encoder count: the button is pressed if the count exceeds threshold_counts. Then
  /// offset_counts is subtracted from the count.
  struct CountButton {
    bool present = false;
    std::size_t report_index = 0;
    double threshold_counts = 0.0;
    double offset_counts = 0.0;
    unsigned button = 0;
  };
  CountButton count_button;
};

/// USB vendor and product id.
struct UsbId {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  friend bool operator==(const UsbId&, const UsbId&) = default;
};

/// Criteria for devices that a profile applies to.
struct DeviceMatch {
  std::vector<UsbId> usb;
  /// ids that match only if the device's report descriptor contains the reports of this profile
  std::vector<UsbId> usb_by_layout;
  /// vendor ids whose devices match only if their report descriptor contains the reports of this profile
  std::vector<std::uint16_t> usb_vendors_by_layout;
  std::string serial;   ///< required serial number; empty: any
  std::string product;  ///< required product string; empty: any
  /// the ids are shared with another profile; this profile applies only if the configuration names it
  bool only_when_named = false;
  std::optional<std::uint16_t> usage_page;
  std::optional<std::uint16_t> usage;
};

/// USB endpoints of a device with transport libusb.
struct UsbEndpoints {
  unsigned interface = 0;
  std::uint8_t in = 0x81;
  std::uint8_t out = 0x01;
  std::size_t prefix_bytes =
      0;  ///< bytes at the start of each input packet that are not part of the report (FTDI modem status)
  /// true for a Falcon behind an FTDI serial chip; reports arrive as a byte stream
  bool serial_chip = false;
  std::string firmware;  ///< firmware file that wrenchd uploads if the device runs none; empty: no file
};

/// Degrees of freedom as a bit mask: bits 0 to 2 translation along x, y, z; bits 3 to 5 rotation about x, y,
/// z.
using DofMask = std::uint8_t;
inline constexpr DofMask kNoDof = 0;
inline constexpr DofMask kLinearDofs = 0b000'111;
inline constexpr DofMask kAngularDofs = 0b111'000;
inline constexpr DofMask kAllDofs = kLinearDofs | kAngularDofs;

/// Description of a device model. Each profile is one TOML file (manual: config/profiles/example.toml). Force
/// limits have no default: NaN means "not stated". A profile of a device with motors that omits one does not
/// load.
struct DeviceProfile {
  static constexpr double kNotStated = std::numeric_limits<double>::quiet_NaN();

  std::string name;
  std::string description;
  Transport transport = Transport::loopback;
  DeviceMatch match;
  UsbEndpoints endpoints;
  double report_rate_Hz = kNotStated;  ///< rate at which the device sends poses

  // Mandatory limits. No client and no daemon setting can raise them.
  double max_force_N = kNotStated;
  double max_torque_Nm = kNotStated;
  double max_linear_speed_m_per_s = kNotStated;
  double max_angular_speed_rad_per_s = kNotStated;

  // Optional limits. NaN: not stated, no limit.
  /// radius of the handle point's workspace; outside, the wrench fades to zero
  double workspace_radius_m = kNotStated;
  Vector3d workspace_centre_m = Vector3d::Zero();  ///< centre of the workspace in B
  double max_power_W = kNotStated;         ///< maximum mechanical power into the hand; braking is not limited
  double continuous_force_N = kNotStated;  ///< force that the motors sustain indefinitely, in any direction
  /// torque that the motors sustain indefinitely, about any axis; NaN also if the device takes no torque
  double continuous_torque_Nm = kNotStated;
  double thermal_time_s = kNotStated;  ///< thermal time constant of the motor windings

  // Button numbers in the reports by function. -1: the device has no such button.
  int deadman_button = -1;   ///< force is enabled only while this button is held
  int stop_button = -1;      ///< pressed: emergency stop
  int grasp_button = -1;     ///< held: the tool holds the free body that it touches
  int recentre_button = -1;  ///< pressed: handle and tool return to their start pose
  int slow_button = -1;      ///< held: a puck in mode rate steers at reduced speed

  // Closed-loop properties of the device; they bound the stiffness. NaN: not stated.
  double damping_N_s_per_m = kNotStated;
  double damping_Nm_s_per_rad = kNotStated;
  double encoder_step_m = kNotStated;  ///< position resolution of the reports at the handle
  double encoder_step_rad = kNotStated;
  double max_stiffness_N_per_m = kNotStated;
  double max_stiffness_Nm_per_rad = kNotStated;

  double watchdog_s = kNotStated;  ///< time after the last command at which the firmware zeroes its motors
  double stale_fault_s = 0.020;    ///< time without a new sample after which wrenchd raises a fault
  WrenchPoint wrench_point = WrenchPoint::handle;
  StreamStyle stream = StreamStyle::free_running;

  Pose X_BD;  ///< the device's own base axes in B: x forward, y left, z up
  Pose X_EH;  ///< the handle frame in the frame whose pose the device sends

  // Homing requirements before the device may be armed, and the moving masses of the handle.
  HomingPlan homing;
  /// true if homing.X_BR is stated; otherwise a device with joints uses its home position
  bool has_reference_pose = false;
  bool check_axes = false;  ///< each device needs one calibration in which all axes are moved
  MovingMasses masses;

  PoseReportLayout pose_report;
  std::vector<PoseReportLayout> more_reports;  ///< further report layouts that the device sends
  std::optional<Deflection> deflection;        ///< for reports with a translation or rotation of a puck
  Kinematics kinematics;                       ///< for reports with joint counts
  bool has_output = true;                      ///< false: the device has no motors and no wrench_report
  WrenchReportLayout wrench_report;

  FixedReport shutdown;     ///< sent after the zero wrenches of a release
  FixedReport calibration;  ///< sets the encoders of the device to the home position
  FixedReport keep_alive;
  double keep_alive_period_s = kNotStated;
};

/// Bit mask of a button; 0 for button -1. RT-safe.
inline std::uint32_t button_bit(int button) noexcept {
  return button < 0 ? 0U : std::uint32_t{1} << static_cast<unsigned>(button);
}

/// Pose source of the profile: joints if kinematics are stated, deflection if stated, otherwise pose.
inline PoseSource pose_source(const DeviceProfile& profile) noexcept {
  if (profile.kinematics.kind != Kinematics::Kind::none) return PoseSource::joints;
  return profile.deflection ? PoseSource::deflection : PoseSource::pose;
}

/// Degrees of freedom that the device senses. The others remain at their start value.
DofMask sensed_dofs(const DeviceProfile& profile) noexcept;

/// Degrees of freedom that the motors drive. Wrench components along the others are dropped and reported.
DofMask driven_dofs(const DeviceProfile& profile) noexcept;

/// Mask of the non-zero wrench components. RT-safe.
DofMask nonzero_dofs(const Wrench& F) noexcept;

/// The wrench with its components outside of `dofs` set to 0. RT-safe.
Wrench restrict_to_dofs(Wrench F, DofMask dofs) noexcept;

/// "loopback", "hidraw", "libusb"; "unknown" for any other value.
const char* text(Transport transport) noexcept;

/// Names of the degrees of freedom in the mask, for example "x y z rx ry rz"; "none" for an empty mask.
std::string dof_text(DofMask dofs);

}  // namespace wrenchd
