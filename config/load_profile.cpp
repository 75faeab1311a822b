// SPDX-License-Identifier: GPL-3.0-or-later
#include "config/load_profile.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <vector>

#include "config/inherited_toml.hpp"
#include "config/load_kinematics.hpp"
#include "config/load_report_layout.hpp"
#include "config/report_bytes.hpp"
#include "config/toml_reader.hpp"
#include "core/limits.hpp"
#include "core/profile_name.hpp"

namespace wrenchd {
namespace {

/// Properties that decide which keys of a profile are mandatory.
struct Capabilities {
  bool output = true;
  bool torque = true;
};

/// True if the key is present and not "none". "none" removes an inherited value.
bool is_stated(const TomlValue& value) {
  return value && !value.is_text("none");
}

void read_workspace(TomlTable& table, DeviceProfile& p) {
  const TomlValue radius = table.optional("workspace_radius_m");
  const TomlValue centre = table.optional("workspace_centre_m");
  if (is_stated(radius)) radius.number(p.workspace_radius_m, {0.01, 2});
  centre.vector(p.workspace_centre_m, {-2, 2});
  if (centre && !centre.is_inherited() && !is_stated(radius))
    centre.reject("has no effect without workspace_radius_m; state both");
}

/// Rejects a rating above the maximum. An inherited rating above a lowered maximum is clamped to it: the
/// motors sustain that maximum indefinitely.
void read_rating(const TomlValue& value, double& rating, Range range, double maximum) {
  if (!value.number(rating, range) || !(rating > maximum)) return;
  if (value.is_inherited())
    rating = maximum;
  else
    value.reject("is more than the maximum, " + value.with_unit(maximum) +
                 "; lower it, or leave all three out");
}

/// Reads the continuous ratings and the thermal time constant: all of them, or none.
void read_motor_ratings(TomlTable& table, DeviceProfile& p, const Capabilities& capabilities) {
  const TomlValue force = table.optional("continuous_force_N");
  const TomlValue torque = table.optional("continuous_torque_Nm");
  const TomlValue time = table.optional("thermal_time_s");
  if (is_stated(torque) && !capabilities.torque)
    return torque.reject("the device takes no torque; leave it out, or give wrench_report its field");
  std::vector<const TomlValue*> stated, all = {&force, &time};
  if (capabilities.torque) all.push_back(&torque);
  std::copy_if(all.begin(), all.end(), std::back_inserter(stated),
               [](const auto* v) { return is_stated(*v); });
  if (stated.empty()) return;
  if (stated.size() < all.size())
    return stated.front()->reject(capabilities.torque
                                      ? "needs continuous_force_N, continuous_torque_Nm and "
                                        "thermal_time_s; state all three, or none"
                                      : "needs continuous_force_N and thermal_time_s; state both, or none");
  read_rating(force, p.continuous_force_N, {0.01, kAbsoluteMaxForce_N}, p.max_force_N);
  if (capabilities.torque)
    read_rating(torque, p.continuous_torque_Nm, {0.001, kAbsoluteMaxTorque_Nm}, p.max_torque_Nm);
  time.number(p.thermal_time_s, {0.1, 10000});
}

/// Optional limits of a device with motors.
void read_more_limits(TomlTable& table, DeviceProfile& p, const Capabilities& capabilities) {
  const TomlValue power = table.optional("max_power_W");
  if (capabilities.output) {
    if (is_stated(power)) power.number(p.max_power_W, {0.01, 10000});
    read_workspace(table, p);
    return read_motor_ratings(table, p, capabilities);
  }
  const auto reject = [](const TomlValue& value) {
    if (value) value.reject("the device has no motors: there is no wrench_report; leave it out");
  };
  reject(power);
  for (const char* key : {"workspace_radius_m", "workspace_centre_m", "continuous_force_N",
                          "continuous_torque_Nm", "thermal_time_s"})
    reject(table.optional(key));
}

/// Mandatory limits. Only the manufacturer knows what the device may apply to a hand.
void read_limits(TomlTable& table, DeviceProfile& p, const Capabilities& capabilities) {
  const TomlValue force =
      capabilities.output ? table.mandatory("max_force_N") : table.optional("max_force_N");
  const TomlValue torque =
      capabilities.torque ? table.mandatory("max_torque_Nm") : table.optional("max_torque_Nm");
  if (capabilities.output)
    force.number(p.max_force_N, {0.01, kAbsoluteMaxForce_N});
  else if (force)
    force.reject("the device takes no force: there is no wrench_report; leave it out");
  if (capabilities.torque)
    torque.number(p.max_torque_Nm, {0.001, kAbsoluteMaxTorque_Nm});
  else if (torque)
    torque.reject("the device takes no torque; leave it out, or give wrench_report its field");
  if (!capabilities.output) p.max_force_N = 0.0;
  if (!capabilities.torque) p.max_torque_Nm = 0.0;
  table.mandatory("max_linear_speed_m_per_s").number(p.max_linear_speed_m_per_s, {0.01, 10});
  table.mandatory("max_angular_speed_rad_per_s").number(p.max_angular_speed_rad_per_s, {0.1, 100});
  read_more_limits(table, p, capabilities);
}

// --- buttons ----------------------------------------------------------------------------------------------

std::size_t buttons_in(const PoseReportLayout& layout) {
  return layout.buttons.present ? layout.buttons.bits : layout.button_bits.size();
}

/// True if any report has the button of this number.
bool has_button(const DeviceProfile& p, int button) {
  const Kinematics::CountButton& hidden = p.kinematics.count_button;
  if (hidden.present && static_cast<int>(hidden.button) == button) return true;
  std::size_t most = buttons_in(p.pose_report);
  for (const PoseReportLayout& layout : p.more_reports) most = std::max(most, buttons_in(layout));
  return button >= 0 && static_cast<std::size_t>(button) < most;
}

/// Ranges of button numbers, for example "0 to 7" or "0"; empty: no button.
std::string buttons_text(const DeviceProfile& p) {
  std::string text;
  for (int first = 0; first < 32; ++first) {
    if (!has_button(p, first)) continue;
    int last = first;
    while (last < 31 && has_button(p, last + 1)) ++last;
    text += (text.empty() ? "" : ", ") + std::to_string(first);
    if (last > first) text += " to " + std::to_string(last);
    first = last;
  }
  return text;
}

void read_button(const TomlValue& value, int& button, const DeviceProfile& p) {
  int number = -1;
  if (!is_stated(value) || !value.integer(number, {0, 31})) return;
  if (has_button(p, number)) {
    button = number;
    return;
  }
  const std::string known = buttons_text(p);
  value.reject(known.empty() ? "no report carries buttons; give pose_report its 'buttons', or leave this out"
                             : "no report carries a button of this number; they carry " + known);
}

/// Reads the functions of the buttons. Precondition: the reports were read before.
void read_buttons(TomlTable& table, DeviceProfile& p) {
  struct Meaning {
    const char* name;
    int* button;
    TomlValue value;
    bool ends_force;
  };
  const std::array<Meaning, 5> meanings = {
      {{"deadman", &p.deadman_button, table.optional("deadman"), true},
       {"stop", &p.stop_button, table.optional("stop"), true},
       {"recentre", &p.recentre_button, table.optional("recentre"), false},
       {"grasp", &p.grasp_button, table.optional("grasp"), false},
       {"slow", &p.slow_button, table.optional("slow"), false}}};
  for (std::size_t i = 0; i < meanings.size(); ++i) {
    const auto& [name, button, value, ends_force] = meanings[i];
    if (is_stated(value) && ends_force && !p.has_output) {
      value.reject("the device has no motors, and no force to end: there is no wrench_report; leave it out");
      continue;
    }
    if (is_stated(value) && button == &p.slow_button &&
        !(p.deflection && p.deflection->mode == Deflection::Mode::rate)) {
      value.reject("a slow button requires [deflection] with mode \"rate\"; leave it out");
      continue;
    }
    read_button(value, *button, p);
    for (std::size_t k = 0; k < i; ++k)
      if (*button >= 0 && *button == *meanings[k].button)
        value.reject(std::string("is the ") + meanings[k].name +
                     " button as well; a button means one thing, so name another");
  }
}

// ----------------------------------------------------------------------------------------------------------

void read_closed_loop(TomlTable& table, DeviceProfile& p) {
  const TomlValue linear = table.optional("damping_N_s_per_m");
  const TomlValue angular = table.optional("damping_Nm_s_per_rad");
  if (is_stated(linear)) linear.number(p.damping_N_s_per_m, {0, 1000});
  if (is_stated(angular)) angular.number(p.damping_Nm_s_per_rad, {0, 100});
  const TomlValue step = table.optional("encoder_step_m");
  const TomlValue turn = table.optional("encoder_step_rad");
  if (is_stated(step)) step.number(p.encoder_step_m, {0, 0.01});
  if (is_stated(turn)) turn.number(p.encoder_step_rad, {0, 0.1});
  table.optional("max_stiffness_N_per_m").number(p.max_stiffness_N_per_m, {1, 1e6});
  table.optional("max_stiffness_Nm_per_rad").number(p.max_stiffness_Nm_per_rad, {1e-3, 1e4});
}

// --- which device -----------------------------------------------------------------------------------------

/// Parses "046d:c626": two numbers of four hexadecimal digits.
std::optional<UsbId> usb_id(const std::string& text) {
  if (text.size() != 9 || text[4] != ':') return {};
  const auto number = [&](std::size_t at, std::uint16_t& out) {
    const char* begin = text.data() + at;
    const auto [end, error] = std::from_chars(begin, begin + 4, out, 16);
    return error == std::errc() && end == begin + 4;
  };
  UsbId id;
  if (!number(0, id.vendor) || !number(5, id.product)) return {};
  return id;
}

void read_usb_ids(const TomlValue& list, std::vector<UsbId>& ids) {
  for (const TomlValue& element : list.elements("an array of ids, as in [\"046d:c626\"]")) {
    std::string text;
    if (!element.text(text)) continue;
    if (const auto id = usb_id(text))
      ids.push_back(*id);
    else
      element.reject_found("vendor and product as four hexadecimal digits each, as in \"046d:c626\"");
  }
}

/// Parses "256f": four hexadecimal digits.
void read_usb_vendors(const TomlValue& list, std::vector<std::uint16_t>& vendors) {
  for (const TomlValue& element : list.elements("an array of vendor ids, as in [\"256f\"]")) {
    std::string text;
    if (!element.text(text)) continue;
    if (const auto id = usb_id(text + ":0000"))
      vendors.push_back(id->vendor);
    else
      element.reject_found("a vendor as four hexadecimal digits, as in \"256f\"");
  }
}

void read_id16(const TomlValue& value, std::optional<std::uint16_t>& out) {
  std::uint16_t number = 0;
  if (value.integer(number, {0, 65535})) out = number;
}

void read_match(TomlTable& table, DeviceMatch& match) {
  const TomlValue usb = table.optional("usb");
  const TomlValue by_layout = table.optional("usb_by_layout");
  read_usb_ids(usb, match.usb);
  read_usb_ids(by_layout, match.usb_by_layout);
  read_usb_vendors(table.optional("usb_vendors_by_layout"), match.usb_vendors_by_layout);
  if (!usb && !by_layout) usb.reject("is missing; name at least one device, as in usb = [\"046d:c626\"]");
  if (usb.is_array() && match.usb.empty() && !by_layout && usb.elements("").empty())
    usb.reject("is empty; name at least one device, as in usb = [\"046d:c626\"]");
  table.optional("serial").text(match.serial);
  table.optional("product").text(match.product);
  table.optional("only_when_named").boolean(match.only_when_named);
  const TomlValue page = table.optional("usage_page");
  read_id16(page, match.usage_page);
  const TomlValue usage = table.optional("usage");
  read_id16(usage, match.usage);
  if (usage && !page) usage.reject("has no effect without usage_page; state both");
}

void read_endpoints(TomlTable& table, UsbEndpoints& endpoints) {
  table.optional("interface").integer(endpoints.interface, {0, 31});
  table.mandatory("in").integer(endpoints.in, {0x81, 0x8f});
  table.mandatory("out").integer(endpoints.out, {0x01, 0x0f});
  table.optional("prefix_bytes").integer(endpoints.prefix_bytes, {0, 8});
  table.optional("serial_chip").choice(endpoints.serial_chip, {{"none", false}, {"ftdi", true}});
  const TomlValue firmware = table.optional("firmware");
  firmware.text(endpoints.firmware);
  if (firmware && !endpoints.serial_chip)
    firmware.reject("is loaded through a serial chip; state serial_chip = \"ftdi\", or leave it out");
}

// --- frames -----------------------------------------------------------------------------------------------

/// Reads "x", "-y" and so on: a row of a rotation between parallel axes.
bool read_axis(const TomlValue& value, Vector3d& axis) {
  Vector3d chosen = Vector3d::Zero();
  struct Named {
    std::string_view name;
    Vector3d axis;
  };
  const bool good = value.choice(chosen, {{"x", Vector3d::UnitX()},
                                          {"y", Vector3d::UnitY()},
                                          {"z", Vector3d::UnitZ()},
                                          {"-x", Vector3d(-Vector3d::UnitX())},
                                          {"-y", Vector3d(-Vector3d::UnitY())},
                                          {"-z", Vector3d(-Vector3d::UnitZ())}});
  if (good) axis = chosen;
  return good;
}

void read_frames(TomlTable& table, DeviceProfile& p) {
  const TomlValue axes = table.optional("base_axes");
  const auto rows = axes.elements("an array of three axes, as in [\"-y\", \"-x\", \"-z\"]");
  Matrix3d R = Matrix3d::Identity();
  bool good = rows.size() == 3;
  if (axes.is_array() && !good) axes.reject_found("three axes, as in [\"-y\", \"-x\", \"-z\"]");
  for (std::size_t i = 0; i < rows.size() && i < 3; ++i) {
    Vector3d row;
    if (read_axis(rows[i], row))
      R.row(static_cast<Eigen::Index>(i)) = row;
    else
      good = false;
  }
  if (good && std::abs(R.determinant() - 1.0) > 0.5)
    axes.reject(
        "the axes are not right-handed, or one is used twice; x forward, y left and z up, each named by an "
        "axis "
        "of the device");
  else if (good)
    p.X_BD.rotation = Quaterniond(R);
  table.optional("base_origin_m").vector(p.X_BD.translation_m, {-2, 2});
  table.optional("handle_position_m").vector(p.X_EH.translation_m, {-1, 1});
  Vector3d turn = Vector3d::Zero();
  if (table.optional("handle_rotation_vector_rad").vector(turn, {-3.2, 3.2}))
    p.X_EH.rotation = rotation_from(turn);
}

// --- the rest ---------------------------------------------------------------------------------------------

/// Limits of a pose in mode rate. A stated box replaces the default of reach_m.
void read_pose_limits(TomlTable& table, Deflection& d) {
  const TomlValue reach = table.optional("reach_m");
  const TomlValue least = table.optional("box_min_m"), most = table.optional("box_max_m");
  if (is_stated(reach)) reach.number(d.reach_m, {1e-3, 10});
  if (is_stated(least) != is_stated(most))
    (is_stated(least) ? least : most)
        .reject("is one of two corners: state box_min_m and box_max_m, or neither");
  if (!is_stated(least) || !is_stated(most)) return;
  if (!is_stated(reach)) d.reach_m = Deflection::kUnbounded;
  if (!least.vector(d.box_min_m, {-10, 10}) || !most.vector(d.box_max_m, {-10, 10})) return;
  if (d.box_min_m.maxCoeff() > 0.0)
    least.reject("the pose starts at 0, which must be inside of the box; no number may be above 0");
  if (d.box_max_m.minCoeff() < 0.0)
    most.reject("the pose starts at 0, which must be inside of the box; no number may be below 0");
}

/// Optional response of a puck. "none" removes an inherited value.
void read_steering(TomlTable& table, Deflection& d) {
  const TomlValue full_m = table.optional("full_deflection_m");
  const TomlValue full_rad = table.optional("full_deflection_rad");
  const TomlValue dead_zone = table.optional("dead_zone"), exponent = table.optional("response_exponent");
  const TomlValue slow_factor = table.optional("slow_factor");
  const TomlValue distance = table.optional("max_proxy_distance_m");
  const TomlValue angle = table.optional("max_proxy_angle_rad");
  const bool has_full_scale = is_stated(full_m) && is_stated(full_rad);
  const auto read = [&](const TomlValue& value, double& out, Range range, bool needs_full_scale) {
    if (!is_stated(value)) return;
    if (d.mode != Deflection::Mode::rate) {
      if (!value.is_inherited())
        value.reject("belongs to mode \"rate\", in which the deflection is a velocity; leave it out");
    } else if (needs_full_scale && !has_full_scale) {
      value.reject("needs the full deflection of the puck; state full_deflection_m and full_deflection_rad");
    } else {
      value.number(out, range);
    }
  };
  read(full_m, d.full_deflection_m, {1e-5, 1}, true);
  read(full_rad, d.full_deflection_rad, {1e-4, 3.2}, true);
  read(dead_zone, d.dead_zone, {0, 0.9}, true);
  read(exponent, d.response_exponent, {1, 5}, true);
  read(slow_factor, d.slow_factor, {0.01, 1}, false);
  read(distance, d.max_proxy_distance_m, {1e-4, 0.5}, true);
  read(angle, d.max_proxy_angle_rad, {1e-3, 3.1}, true);
  if (is_stated(distance) == is_stated(angle)) return;
  (is_stated(distance) ? distance : angle)
      .reject("is one of two: state max_proxy_distance_m and max_proxy_angle_rad, or neither");
}

void read_deflection(TomlTable& table, DeviceProfile& p) {
  Deflection d;
  table.optional("mode").choice(d.mode,
                                {{"rate", Deflection::Mode::rate}, {"position", Deflection::Mode::position}});
  table.mandatory("linear_gain").number(d.linear_gain, {1e-3, 1e6});
  table.mandatory("angular_gain").number(d.angular_gain, {1e-3, 1e6});
  read_pose_limits(table, d);
  read_steering(table, d);
  p.deflection = d;
}

void read_homing(TomlTable& table, DeviceProfile& p) {
  HomingPlan& plan = p.homing;
  table.optional("reference")
      .choice(plan.reference, {{"never", ReferenceSchedule::never},
                               {"once", ReferenceSchedule::once},
                               {"each_start", ReferenceSchedule::each_start}});
  table.optional("check_axes").boolean(p.check_axes);
  const TomlValue position = table.optional("reference_position_m");
  const TomlValue rotation = table.optional("reference_rotation_vector_rad");
  p.has_reference_pose = position || rotation;
  position.vector(plan.X_BR.translation_m, {-2, 2});
  Vector3d turn = Vector3d::Zero();
  if (rotation.vector(turn, {-3.2, 3.2})) plan.X_BR.rotation = rotation_from(turn);
  table.optional("max_offset_m").number(plan.max_offset_m, {0, 2});
  table.optional("max_offset_rad").number(plan.max_offset_rad, {0, 4});
  table.optional("confirm_buttons").integer(plan.confirm_buttons, {0, 4294967295.0});
  table.optional("travel_m").number(plan.travel_m, {0.001, 0.5});
  table.optional("travel_rad").number(plan.travel_rad, {0.01, 1.5});
  table.optional("workspace_min_m").vector(plan.workspace_min_m, {-2, 2});
  const TomlValue most = table.optional("workspace_max_m");
  most.vector(plan.workspace_max_m, {-2, 2});
  const double least = (plan.workspace_max_m - plan.workspace_min_m).minCoeff();
  if (least < plan.travel_m)
    most.reject("the workspace must be larger than travel_m, " + to_text(plan.travel_m) +
                ", along each axis; along one it is " + to_text(least));
  const TomlValue turns = table.optional("max_rotation_rad");
  turns.number(plan.max_rotation_rad, {0.01, 4});
  if (plan.max_rotation_rad < plan.travel_rad) turns.reject("must be no less than travel_rad");
}

void read_masses(TomlTable& table, MovingMasses& masses) {
  table.optional("handle_kg").number(masses.handle_kg, {0, 20});
  table.optional("handle_centre_m").vector(masses.p_HHcm_m, {-0.5, 0.5});
  table.optional("carried_kg").number(masses.carried_kg, {0, 20});
}

void read_fixed_report(TomlTable& table, FixedReport& report) {
  read_bytes(table.mandatory("bytes"), report.bytes);
}

void read_keep_alive(TomlTable& table, DeviceProfile& p) {
  read_bytes(table.mandatory("bytes"), p.keep_alive.bytes);
  table.mandatory("period_s").number(p.keep_alive_period_s, {0.001, 60});
}

void read_more_reports(const TomlValue& list, DeviceProfile& p) {
  constexpr std::size_t kMost = 16;
  const auto reports = list.elements("tables, each headed [[more_reports]]");
  if (reports.size() > kMost) list.reject("has more than 16 reports; name only those that matter");
  for (const TomlValue& report : reports) {
    PoseReportLayout& layout = p.more_reports.emplace_back();
    report.table(read_more_report, layout, p);
  }
}

void read_profile(TomlTable& table, DeviceProfile& p) {
  const TomlValue name = table.mandatory("name");
  if (name.text(p.name) && !is_profile_name(p.name))
    name.reject(
        "must consist of 1 to 64 letters, digits, '_', '.' and '-', because udev rules, logs and records " +
        std::string("contain it; found \"") + printable(p.name) + '"');
  table.optional("description").paragraphs(p.description);
  table.mandatory("transport")
      .choice(
          p.transport,
          {{"loopback", Transport::loopback}, {"hidraw", Transport::hidraw}, {"libusb", Transport::libusb}});
  table.mandatory("report_rate_Hz").number(p.report_rate_Hz, {10, 8000});
  table.optional("stream").choice(p.stream, {{"free_running", StreamStyle::free_running},
                                             {"lock_step", StreamStyle::lock_step},
                                             {"silent_at_rest", StreamStyle::silent_at_rest}});
  const TomlValue wrench_report = table.mandatory("wrench_report");
  const Capabilities capabilities = {!wrench_report.is_text("none"),
                                     !wrench_report.is_text("none") && !wrench_report.has("efforts") &&
                                         (!wrench_report.is_table() || !wrench_report.is_none("torque"))};
  p.has_output = capabilities.output;
  const TomlValue watchdog =
      capabilities.output ? table.mandatory("watchdog_s") : table.optional("watchdog_s");
  if (!capabilities.output && watchdog)
    watchdog.reject("the device has no motors: there is no wrench_report; leave it out");
  else if (!watchdog.is_text("none"))
    watchdog.number(p.watchdog_s, {0.001, 2});
  table.optional("stale_fault_s").number(p.stale_fault_s, {0.001, 1});
  table.optional("wrench_point")
      .choice(p.wrench_point, {{"handle", WrenchPoint::handle}, {"world_origin", WrenchPoint::world_origin}});

  const TomlValue match =
      p.transport == Transport::loopback ? table.optional("match") : table.mandatory("match");
  match.table(read_match, p.match);
  const TomlValue endpoints =
      p.transport == Transport::libusb ? table.mandatory("endpoints") : table.optional("endpoints");
  endpoints.table(read_endpoints, p.endpoints);
  if (endpoints && p.transport != Transport::libusb)
    endpoints.reject("only transport = \"libusb\" uses endpoints; select it, or leave this out");
  table.optional("frames").table(read_frames, p);
  table.mandatory("limits").table(read_limits, p, capabilities);
  table.optional("closed_loop").table(read_closed_loop, p);
  table.optional("homing").table(read_homing, p);
  const TomlValue masses = table.optional("masses");
  masses.table(read_masses, p.masses);
  if (masses && !capabilities.output)
    masses.reject("the device has no motors to hold them, because there is no wrench_report; leave it out");
  if (masses && p.wrench_point == WrenchPoint::world_origin)
    masses.reject(
        "gravity compensation acts about the handle point; leave out wrench_point = \"world_origin\", or "
        "this");
  table.optional("deflection").table(read_deflection, p);
  table.optional("kinematics").table(read_kinematics, p.kinematics);
  const TomlValue pose_report = table.mandatory("pose_report");
  pose_report.table(read_pose_report, p, pose_report);
  const TomlValue more_reports = table.optional("more_reports");
  read_more_reports(more_reports, p);
  if (capabilities.output) wrench_report.table(read_wrench_report, p, wrench_report);
  table.optional("shutdown").table(read_fixed_report, p.shutdown);
  table.optional("calibration").table(read_fixed_report, p.calibration);
  const TomlValue keep_alive = table.optional("keep_alive");
  keep_alive.table(read_keep_alive, p);
  if (keep_alive && p.stream == StreamStyle::lock_step)
    keep_alive.reject("a lock-step device receives commands all the time; leave it out");
  table.optional("buttons").table(read_buttons, p);
  check_pose_complete(pose_report, p);
  check_distinguishable(pose_report, more_reports, p);
}

}  // namespace

DeviceProfile load_profile(const std::filesystem::path& file, const SearchPath& search,
                           std::vector<ConfigText>* texts) {
  DeviceProfile profile;
  read_toml_node(file, read_inherited(file, search, texts), read_profile, profile);
  return profile;
}

DeviceProfile load_profile_named(const std::string& name, const SearchPath& search) {
  const std::filesystem::path file = profile_file(name);
  std::error_code error;
  return load_profile(std::filesystem::exists(file, error) ? file : search.require(file), search);
}

}  // namespace wrenchd
