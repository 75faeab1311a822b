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

/// How the bits of an integer are laid into bytes.
enum class Coding : std::uint8_t {
  binary,        ///< as they are
  nibble_ascii,  ///< four bits a byte, as characters from 'A' on (Novint Falcon); whole nibbles only
};

/// One integer in a report, as a profile gives it: where it lies, how it is coded, what one count means.
///
///   value_SI = step * raw + offset
struct ReportField {
  bool present = false;
  std::size_t byte = 0;  ///< offset from the start of the report; byte 0 is the report id where there is one
  unsigned bits = 0;     ///< width, 1 to 64
  bool is_signed = false;   ///< two's complement
  double step = 1.0;        ///< SI value of one count; a negative one turns the axis round
  std::size_t count = 1;    ///< how many equal integers follow each other
  unsigned bit = 0;         ///< where in the first byte it starts; 0 = least significant
  bool big_endian = false;  ///< most significant byte, or nibble, first; whole bytes only
  double offset = 0.0;      ///< SI value of raw 0
  Coding coding = Coding::binary;
  std::uint8_t base = 0;  ///< taken from each byte before it is looked at: 0x41 for characters from 'A' on
};

/// One bit of a report.
struct ReportBit {
  bool present = false;
  std::size_t byte = 0;
  unsigned bit = 0;       ///< 0 = least significant
  std::uint8_t base = 0;  ///< taken from the byte before it is looked at
};

/// A bit, or a number, that has a name for people and no meaning for the servo loop.
struct NamedBit {
  std::string name;
  ReportBit bit;
};
struct NamedField {
  std::string name;  ///< ends in its unit
  ReportField field;
};

/// A byte that always has the same value: frame markers and the like.
struct ReportConstant {
  std::size_t byte = 0;
  std::uint8_t value = 0;
};

/// Check value in a report.
enum class Checksum : std::uint8_t {
  none,
  crc16_ccitt_false,  ///< two bytes, little-endian
  sum8,               ///< the bytes added up, modulo 256
  xor8,               ///< the bytes, exclusive or
};

/// What every report has, whichever way it goes.
struct ReportFrame {
  bool has_id = true;          ///< false: byte 0 belongs to the content
  std::uint8_t id = 0;         ///< byte 0, where the device uses report ids
  std::size_t length = 0;      ///< bytes, report id included
  std::size_t min_length = 0;  ///< a shorter report that is still one; what it lacks is 0. 0: none is
  std::vector<ReportConstant> constants;
  Checksum checksum = Checksum::none;      ///< over the bytes before it
  std::size_t checksum_from = 0;           ///< first byte it covers
  std::optional<std::size_t> checksum_at;  ///< where it stands; empty: in the last bytes
};

/// Device to host: one sample of a pose, or a part of one; a device may have several of these, told apart by
/// id or length. D = the device's own base axes, E = the frame whose pose it sends: for a device that follows
/// devices/README.md the base B and the handle point H.
struct PoseReportLayout : ReportFrame {
  std::string name;              ///< for people; optional
  ReportField sequence;          ///< counts reports, wraps at its width
  ReportField device_time;       ///< [s], wraps at its width
  ReportField position;          ///< p_DE [m], x y z
  ReportField orientation;       ///< R_DE unit quaternion, x y z w
  ReportField linear_velocity;   ///< of E, in D [m/s]; optional
  ReportField angular_velocity;  ///< in D [rad/s]; optional
  ReportField acknowledged;      ///< sequence of the last command the device took; optional
  ReportBit motors_on;
  ReportBit watchdog_tripped;
  ReportField buttons;                 ///< bit mask; optional
  std::vector<ReportBit> button_bits;  ///< instead of a mask: button 0, 1, 2 ... where they stand
  std::vector<ReportBit> homed;        ///< all of them 1: the encoders know where they are
  ReportField translation;             ///< deflection of a cap that springs back, in D [m], x y z
  ReportField rotation;                ///< likewise, a rotation vector in D [rad], x y z
  ReportField joints;                  ///< encoder counts, one a joint
  std::vector<NamedBit> status;
  std::vector<NamedField> values;
};

/// Host to device: one wrench command.
struct WrenchReportLayout : ReportFrame {
  std::vector<std::uint8_t> template_bytes;  ///< what stands in it before the fields do; empty: zeros
  ReportField sequence;
  ReportField force;      ///< on the hand, at E, in D [N]
  ReportField torque;     ///< on the hand, about E, in D [N.m]
  ReportField efforts;    ///< of the motors, instead of force and torque: [A], or counts of the device's own
  ReportField hold_time;  ///< [s] how long the device may hold this command before its watchdog trips
  ReportBit enable;       ///< motors on
};

/// A report that never changes: keep-alive, shutdown, calibration.
struct FixedReport {
  std::vector<std::uint8_t> bytes;  ///< as the wire has them; empty: the device has no such report
};

/// Where the wrench a device receives is taken about, and in which axes.
enum class WrenchPoint : std::uint8_t {
  handle,        ///< about the device's handle point, in the axes of its base: what a device's motors need
  world_origin,  ///< the paper's spatial wrench W_S (section 2.4), about the world origin in world axes
};

/// How a device's bytes travel.
enum class Transport : std::uint8_t {
  loopback,  ///< the simulated device
  hidraw,    ///< the kernel's HID reports
  libusb,    ///< endpoints of the device, past the kernel
};

/// When a device speaks.
enum class StreamStyle : std::uint8_t {
  free_running,    ///< at its rate, whatever the host does
  lock_step,       ///< one report for each command, so the host has to speak first
  silent_at_rest,  ///< only while it is touched: silence after a report of rest is no fault
};

/// What makes a pose of the reports.
enum class PoseSource : std::uint8_t {
  pose,        ///< the device sends it
  joints,      ///< it sends joint angles: forward kinematics
  deflection,  ///< it sends how far a cap is pushed
};

/// How the deflection of a cap moves a pose (devices/deflection_pose.hpp has the equations).
struct Deflection {
  static constexpr double kNotStated = std::numeric_limits<double>::quiet_NaN();
  static constexpr double kUnbounded = std::numeric_limits<double>::infinity();

  enum class Mode : std::uint8_t {
    rate,      ///< deflection is velocity; the pose stays where it is left
    position,  ///< deflection is the pose; it springs back with the cap
  };
  Mode mode = Mode::rate;
  double linear_gain = 1.0;   ///< rate: m/s a metre of deflection; position: m a metre
  double angular_gain = 1.0;  ///< rad/s, or rad, a radian

  // Where the pose stays: within this distance of where it began, and within this box of B.
  double reach_m = 0.2;
  Vector3d box_min_m = Vector3d::Constant(-kUnbounded);
  Vector3d box_max_m = Vector3d::Constant(kUnbounded);

  // Rate only, and but for `slow` only where the end of the cap's way is stated.
  double full_deflection_m =
      kNotStated;  ///< deflection at the end of the cap's way, where the speed is gain times it
  double full_deflection_rad = kNotStated;
  double dead_zone = 0.0;          ///< share of the way in which nothing moves
  double response_exponent = 1.0;  ///< exponent from deflection to speed; more is finer near the rest
  double slow_factor = 0.2;        ///< share of the speed while the slow button is held
  double max_proxy_distance_m =
      kNotStated;  ///< how far from where the world holds it the pose may be, the cap at its end
  double max_proxy_angle_rad = kNotStated;

  bool has_proxy_distance_limit() const noexcept { return max_proxy_distance_m > 0.0; }
};

inline constexpr std::size_t kMaxJoints = 6;
inline constexpr std::size_t kMaxMotors = 3;

/// Joints and links of a device that sends joint angles (devices/kinematics.hpp has the equations). Joint
/// angle i [rad] = rad_per_count[i] * counts[slot[i]] + zero_rad[i].
struct Kinematics {
  enum class Kind : std::uint8_t {
    none,
    capstan_arm,  ///< WoodenHaptics, Polhem version 1
    delta,        ///< Novint Falcon
  };
  Kind kind = Kind::none;
  std::size_t joints = 0;  ///< that are sensed; the first kMaxMotors of them are driven
  std::array<std::size_t, kMaxJoints> report_index = {0, 1, 2,
                                                      3, 4, 5};  ///< which integer of the report is joint i
  std::array<double, kMaxJoints> rad_per_count{};
  std::array<double, kMaxJoints> zero_rad{};
  std::array<double, kMaxJoints> home_counts{};    ///< by slot: what the encoders say at the home position
  std::array<double, kMaxMotors> effort_per_Nm{};  ///< what a motor is told for 1 N.m about its joint
  double max_effort = std::numeric_limits<double>::quiet_NaN();  ///< of any motor; cut as a group

  // capstan_arm
  Vector3d length_m = Vector3d::Zero();  ///< of bodies a, b, c
  Vector3d origin_m = Vector3d::Zero();  ///< of D, from the foot of body a

  // delta; the names and the letters are Stamper's (1997)
  double thigh_m = 0.0;                      ///< a
  double shin_m = 0.0;                       ///< b, side of the parallelogram
  Vector3d shin_joint_m = Vector3d::Zero();  ///< c, d + e, f: offsets along u, along the shin, along v
  Vector3d leg_base_m = Vector3d::Zero();    ///< r, s: along u and v; z is not used
  std::array<double, 3> leg_angle_rad{};     ///< of each leg about z

  /// A button that hides in a count: above `above` it is pressed, and `minus` has to be taken off.
  struct CountButton {
    bool present = false;
    std::size_t report_index = 0;
    double threshold_counts = 0.0;
    double offset_counts = 0.0;
    unsigned button = 0;
  };
  CountButton count_button;
};

/// A vendor and a product id.
struct UsbId {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  friend bool operator==(const UsbId&, const UsbId&) = default;
};

/// Which plugged-in devices a profile is for.
struct DeviceMatch {
  std::vector<UsbId> usb;
  std::vector<UsbId> usb_by_layout;  ///< only where the device's own descriptor shows this profile's reports
  std::string serial;                ///< empty: any
  bool only_when_named = false;      ///< it shares its ids with another profile: the configuration names it
  std::optional<std::uint16_t> usage_page;
  std::optional<std::uint16_t> usage;
};

/// Endpoints of a device that is spoken to past the kernel (transport libusb).
struct UsbEndpoints {
  unsigned interface = 0;
  std::uint8_t in = 0x81;
  std::uint8_t out = 0x01;
  std::size_t prefix_bytes =
      0;                     ///< at the start of each packet in, not part of the report: FTDI modem status
  bool serial_chip = false;  ///< an FTDI serial chip with a Falcon behind it: reports are a stream of bytes
  std::string firmware;      ///< file that is loaded into it where it runs none; empty: none is known
};

/// Degrees of freedom as bits: 0 to 2 along x, y, z; 3 to 5 about them.
using DofMask = std::uint8_t;
inline constexpr DofMask kNoDof = 0;
inline constexpr DofMask kLinearDofs = 0b000'111;
inline constexpr DofMask kAngularDofs = 0b111'000;
inline constexpr DofMask kAllDofs = kLinearDofs | kAngularDofs;

/// Everything wrenchd knows of a device model. One TOML file each (config/profiles/example.toml is the
/// manual). Limits have no default: NaN means "not stated", and a profile that leaves one out does not load
/// where the device has motors.
struct DeviceProfile {
  static constexpr double kNotStated = std::numeric_limits<double>::quiet_NaN();

  std::string name;
  std::string description;
  Transport transport = Transport::loopback;
  DeviceMatch match;
  UsbEndpoints endpoints;
  double report_rate_Hz = kNotStated;  ///< at which the device sends poses

  // Limits [mandatory]. No client and no daemon setting can raise them.
  double max_force_N = kNotStated;
  double max_torque_Nm = kNotStated;
  double max_linear_speed_m_per_s = kNotStated;
  double max_angular_speed_rad_per_s = kNotStated;

  // More limits, each optional. NaN: not stated, and then there is none.
  double workspace_radius_m = kNotStated;  ///< of the handle point about the centre: no wrench far outside
  Vector3d workspace_centre_m = Vector3d::Zero();  ///< in B
  double max_power_W = kNotStated;                 ///< mechanical, into the hand; what brakes it is free
  double continuous_force_N = kNotStated;          ///< what the motors bear for ever, in any direction
  double continuous_torque_Nm = kNotStated;        ///< likewise; NaN also where the device takes no torque
  double thermal_time_s = kNotStated;              ///< time constant of their windings

  // Buttons that have a meaning here, by their number in the reports. -1: the device has none.
  int deadman_button = -1;   ///< held, or there is no force
  int stop_button = -1;      ///< pressed: emergency stop
  int recentre_button = -1;  ///< pressed: handle and tool are back where they began
  int slow_button = -1;      ///< held: a cap steers at a share of its speed

  // What the device is, closed loop: bounds for stiffness. NaN: not stated.
  double damping_N_s_per_m = kNotStated;
  double damping_Nm_s_per_rad = kNotStated;
  double encoder_step_m = kNotStated;  ///< at the handle: what reports cannot tell apart
  double encoder_step_rad = kNotStated;
  double max_stiffness_N_per_m = kNotStated;
  double max_stiffness_Nm_per_rad = kNotStated;

  double watchdog_s = kNotStated;  ///< firmware zeroes its motors this long after the last command
  double stale_fault_s = 0.020;    ///< no new sample for this long: fault
  WrenchPoint wrench_point = WrenchPoint::handle;
  StreamStyle stream = StreamStyle::free_running;

  Pose X_BD;  ///< the device's own base axes in ours: x forward, y left, z up
  Pose X_EH;  ///< the handle point in the frame whose pose the device sends

  // What has to be seen of a device before it is armed, and what its handle weighs.
  HomingPlan homing;
  bool has_rest_pose = false;  ///< homing.X_BR is stated; a device with joints has its home position else
  bool check_axes = false;     ///< each device has to be calibrated once, with all axes moved
  MovingMasses masses;

  PoseReportLayout pose_report;
  std::vector<PoseReportLayout> more_reports;  ///< the other kinds it sends
  std::optional<Deflection> deflection;        ///< for reports that carry a translation or a rotation
  Kinematics kinematics;                       ///< for reports that carry joints
  bool has_output = true;                      ///< false: it only senses, and there is no wrench_report
  WrenchReportLayout wrench_report;

  FixedReport shutdown;     ///< sent after the zeros of a release
  FixedReport calibration;  ///< tells the device that its encoders stand at the home position
  FixedReport keep_alive;
  double keep_alive_period_s = kNotStated;
};

/// The bit of a button in a mask of them; none for -1.
inline std::uint32_t button_bit(int button) noexcept {
  return button < 0 ? 0U : std::uint32_t{1} << static_cast<unsigned>(button);
}

/// What makes a pose of this device's reports.
inline PoseSource pose_source(const DeviceProfile& profile) noexcept {
  if (profile.kinematics.kind != Kinematics::Kind::none) return PoseSource::joints;
  return profile.deflection ? PoseSource::deflection : PoseSource::pose;
}

/// The degrees of freedom whose motion the device reports. Along the others it stays where it is.
DofMask sensed_dofs(const DeviceProfile& profile) noexcept;

/// The degrees of freedom its motors can push along. A wrench along the others is dropped, and told.
DofMask driven_dofs(const DeviceProfile& profile) noexcept;

/// The components of a wrench that are not 0. RT safe.
DofMask nonzero_dofs(const Wrench& F) noexcept;

/// The wrench without its components along other degrees of freedom. RT safe.
Wrench restrict_to_dofs(Wrench F, DofMask dofs) noexcept;

/// "loopback", "hidraw", "libusb"
const char* text(Transport transport) noexcept;

/// "x y z rx ry rz", as far as they are in the mask; "none".
std::string dof_text(DofMask dofs);

}  // namespace wrenchd
