// SPDX-License-Identifier: GPL-3.0-or-later
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "config/load_profile.hpp"
#include "tests/support/rejection.hpp"
#include "tests/support/temporary_directory.hpp"

namespace wrenchd::test_bad_profiles {

namespace {

/// Four valid profiles, one of each kind. Each row of the table below changes one of them.
const std::string kWhole = R"(name = "p"
transport = "hidraw"
report_rate_Hz = 1000
watchdog_s = 0.01
[match]
usb = ["1209:0001"]
serial = "A1"
usage_page = 0xff00
usage = 1
[limits]
max_force_N = 10.0
max_torque_Nm = 0.5
max_linear_speed_m_per_s = 1.2
max_angular_speed_rad_per_s = 12.0
[closed_loop]
damping_N_s_per_m = 0.5
max_stiffness_N_per_m = 3000.0
[frames]
base_axes = ["-y", "x", "z"]
handle_position_m = [0, 0, 0.02]
[pose_report]
id = 1
length = 40
checksum = "sum8"
motors_on = { byte = 1, bit = 0 }
watchdog_tripped = { byte = 1, bit = 1 }
sequence = { byte = 2, type = "u16" }
device_time = { byte = 4, bits = 24, step_s = 1e-6 }
position = { byte = 8, type = "i32", step_m = 1e-7 }
orientation = { byte = 20, type = "i16", step = 3.06e-5 }
linear_velocity = { byte = 28, bits = 12, bit = 4, step_m_per_s = 0.001 }
button_list = [{ byte = 33, bit = 3 }, { byte = 33, bit = 6 }]
status = [{ name = "warm", byte = 33, bit = 7 }]
values = [{ name = "volts", byte = 34, type = "u16", step = 0.01 }]
[[more_reports]]
name = "buttons"
id = 3
length = 5
min_length = 3
buttons = { byte = 1, type = "u32" }
[wrench_report]
id = 2
length = 21
enable = { byte = 1, bit = 0 }
sequence = { byte = 2, type = "u16" }
force = { byte = 4, bits = 16, order = "big_endian", step_N = 0.001 }
torque = { byte = 10, type = "i16", step_Nm = 0.0001 }
hold_time = { byte = 16, type = "u16", step_s = 0.001 }
checksum = "xor8"
checksum_at = 18
checksum_from = 1
constants = [[20, 0x3e]]
[shutdown]
bytes = "04 00"
[keep_alive]
bytes = "05"
period_s = 0.5
)";

const std::string kMouse = R"(name = "m"
transport = "hidraw"
report_rate_Hz = 62.5
stream = "silent_at_rest"
wrench_report = "none"
[match]
usb = ["046d:c626", "046d:c628"]
[limits]
max_linear_speed_m_per_s = 0.5
max_angular_speed_rad_per_s = 5.0
[deflection]
mode = "rate"
linear_gain = 71.0
angular_gain = 11.0
[pose_report]
id = 1
length = 7
translation = { byte = 1, type = "i16", step_m = 4e-6 }
[[more_reports]]
id = 2
length = 7
rotation = { byte = 1, type = "i16", step_rad = 2.5e-4 }
)";

const std::string kArm = R"(name = "a"
transport = "hidraw"
report_rate_Hz = 1000
stream = "lock_step"
watchdog_s = 0.5
[match]
usb = ["16c0:0486"]
[limits]
max_force_N = 5.0
max_linear_speed_m_per_s = 2.0
max_angular_speed_rad_per_s = 50.0
[kinematics]
type = "capstan_arm"
body_length_m = [0.058, 0.174, 0.133]
origin_m = [0.140, 0.0, 0.100]
capstan_diameter_m = [0.010, 0.010, 0.010]
body_diameter_m = [0.180, 0.100, 0.100]
torque_constant_Nm_per_A = [0.0538, 0.0538, 0.0538]
max_current_A = 2.0
counts_per_turn = [2000, 2000, 2000]
direction = [-1, -1, -1]
joint_report_index = [0, 1, 2]
home_counts = [0, 0, -5000]
count_button = { report_index = 2, threshold_counts = 5000, offset_counts = 10000 }
[pose_report]
id = "none"
length = 64
min_length = 14
joints = { byte = 0, type = "i16" }
[wrench_report]
id = "none"
length = 64
efforts = { byte = 0, type = "i16", step_A = 0.001 }
)";

const std::string kDelta = R"(name = "d"
transport = "libusb"
report_rate_Hz = 1000
watchdog_s = "none"
[match]
usb = ["0403:cb48"]
[endpoints]
in = 0x81
out = 0x02
[limits]
max_force_N = 8.0
max_linear_speed_m_per_s = 2.0
max_angular_speed_rad_per_s = 10.0
[kinematics]
type = "delta"
thigh_m = 0.060
shin_m = 0.1025
shin_joint_m = [0.01443, 0.0225, -0.025]
leg_base_u_m = 0.040
leg_base_v_m = -0.02309
leg_angle_rad = [1.8, -0.26, -2.35]
counts_per_turn = 1280
gear = 0.1295
zero_rad = 0.61
effort_per_Nm = -10000.0
max_effort = 4096.0
[pose_report]
id = "none"
length = 16
constants = [[0, 0x3c], [15, 0x3e]]
joints = { byte = 1, bits = 16, coding = "nibble_ascii" }
homed = [{ byte = 13, bit = 4, base = 0x41 }]
[wrench_report]
id = "none"
length = 16
constants = [[0, 0x3c], [15, 0x3e]]
efforts = { byte = 1, bits = 16, coding = "nibble_ascii" }
template = "3c 41 41 41 41 41 41 41 41 41 41 41 41 42 41 3e"
)";

/// A change of a valid profile, the text at which the message must point, and a part of the message.
struct Bad {
  const std::string& good;
  std::string from, to;
  std::string at;
  std::string cure;
};

/// Returns "line:column" of the expected error: in the changed part, or at the only occurrence in the whole
/// text; of the beginning if `at` is empty.
std::string error_location(const std::string& text, const Bad& bad) {
  std::size_t found = bad.to.find(bad.at);
  if (bad.at.empty()) {
    found = 0;
  } else if (found != std::string::npos) {
    found += bad.good.find(bad.from);
  } else {
    found = text.find(bad.at);
    if (found == std::string::npos || text.find(bad.at, found + 1) != std::string::npos)
      return "no single place";
  }
  return test::line_and_column(text, found);
}

/// Returns the message with which the profile is rejected; empty if it loads.
std::string rejection_text(const std::filesystem::path& file) {
  return test::rejection_message<ConfigError>([&] { load_profile(file, SearchPath({file.parent_path()})); });
}

const std::string kForce = R"(force = { byte = 4, bits = 16, order = "big_endian", step_N = 0.001 })";
const std::string kVelocity = "linear_velocity = { byte = 28, bits = 12, bit = 4, step_m_per_s = 0.001 }";
const std::string kTranslation = R"(translation = { byte = 1, type = "i16", step_m = 4e-6 })";

/// The end of [deflection] in kMouse with one additional key.
std::string steering(const std::string& key) {
  return "angular_gain = 11.0\nfull_deflection_m = 0.001\nfull_deflection_rad = 0.09\n" + key;
}

const std::vector<Bad> kTable = {
    // the device
    {kWhole, "name = \"p\"\n", "", "", "key 'name' is missing"},
    {kWhole, "name = \"p\"", "name = 3", "3", "expected a text between quotation marks, found 3"},
    {kWhole, "name = \"p\"", "nmae = \"p\"", "nmae", "did you mean 'name'?"},
    {kWhole, "\"hidraw\"", "\"hid\"", "\"hid\"", R"(expected "loopback", "hidraw" or "libusb")"},
    {kWhole, "transport = \"hidraw\"", "transport = \"libusb\"", "", "key 'endpoints' is missing"},
    {kDelta, "\"libusb\"", "\"hidraw\"", "[endpoints]", "only transport = \"libusb\" uses endpoints"},
    {kDelta, "in = 0x81", "in = 0x01", "0x01", "from 129 to 143, found 1"},
    {kDelta, "out = 0x02", "out = 0x82", "0x82", "from 1 to 15, found 130"},
    {kDelta, "out = 0x02\n", "", "[endpoints]", "key 'endpoints.out' is missing"},
    {kWhole, "report_rate_Hz = 1000", "report_rate_Hz = 16000", "16000", "from 10 to 8000 Hz, found 16000"},
    {kWhole, "report_rate_Hz", "report_rate_kHz", "report_rate_kHz", "give it in Hz as 'report_rate_Hz'"},
    {kWhole, "watchdog_s = 0.01\n", "", "", "key 'watchdog_s' is missing"},
    {kWhole, "watchdog_s = 0.01", "watchdog_s = 30", "30", "from 0.001 to 2 s, found 30"},
    {kWhole, "watchdog_s = 0.01", "watchdog_s = \"off\"", "\"off\"", "expected a number from 0.001 to 2 s"},
    {kMouse, "stream", "watchdog_s = 0.1\nstream", "0.1", "the device has no motors"},
    {kMouse, "\"silent_at_rest\"", "\"quiet\"", "\"quiet\"",
     R"(expected "free_running", "lock_step" or "silent_at_rest")"},
    {kMouse, "wrench_report = \"none\"\n", "", "", "key 'wrench_report' is missing"},
    {kMouse, "wrench_report = \"none\"", "wrench_report = \"no\"", "\"no\"", "expected a table"},
    // matched devices
    {kWhole, "usb = [\"1209:0001\"]\n", "", "[match]",
     "key 'match.usb': is missing; name at least one device"},
    {kWhole, "[\"1209:0001\"]", "[]", "[]", "is empty; name at least one device"},
    {kWhole, "[\"1209:0001\"]", "\"1209:0001\"", "\"1209:0001\"", "expected an array of ids"},
    {kWhole, "\"1209:0001\"", "\"1209-0001\"", "\"1209-0001\"", "as in \"046d:c626\""},
    {kWhole, "\"1209:0001\"", "\"1209:1\"", "\"1209:1\"", "four hexadecimal digits each"},
    {kWhole, "\"1209:0001\"", "\"120x:0001\"", "\"120x:0001\"", "four hexadecimal digits each"},
    {kWhole, "\"1209:0001\"", "0x1209", "0x1209", "expected a text"},
    {kWhole, "usage_page = 0xff00\n", "", "1\n[limits]", "has no effect without usage_page"},
    {kWhole, "0xff00", "0x1ff00", "0x1ff00", "from 0 to 65535, found 130816"},
    {kWhole, "serial = \"A1\"", "serial = 17", "17", "expected a text"},
    // names reach udev rules, which root executes, and logs
    {kWhole, "serial = \"A1\"", "serial = \"A\\n1\"", "\"A", "expected one line without control characters"},
    {kWhole, "serial = \"A1\"", "product = \"A\\n1\"", "\"A", "expected one line without control characters"},
    {kWhole, "name = \"p\"", "name = \"p\\nRUN+=x\"", "\"p", "expected one line without control characters"},
    {kWhole, "name = \"p\"", "name = \"p RUN\"", "\"p", "must consist of 1 to 64 letters"},
    {kWhole, "name = \"p\"", "name = \"\"", "\"\"", "must consist of 1 to 64 letters"},
    {kWhole, "serial", "serail", "serail", "did you mean 'serial'?"},
    {kMouse, "[match]\nusb = [\"046d:c626\", \"046d:c628\"]\n", "", "", "key 'match' is missing"},
    // limits
    {kWhole, "max_force_N = 10.0\n", "", "[limits]", "key 'limits.max_force_N' is missing"},
    {kWhole, "max_torque_Nm = 0.5\n", "", "[limits]", "key 'limits.max_torque_Nm' is missing"},
    {kWhole, "max_linear_speed_m_per_s = 1.2\n", "", "[limits]",
     "'limits.max_linear_speed_m_per_s' is missing"},
    {kWhole, "max_force_N = 10.0", "max_force_N = 1000", "1000", "from 0.01 to 200 N, found 1000"},
    {kWhole, "max_force_N = 10.0", "max_force_N = nan", "nan", "found nan"},
    {kArm, "max_force_N = 5.0\n", "", "[limits]", "key 'limits.max_force_N' is missing"},
    {kArm, "max_force_N = 5.0", "max_force_N = 5.0\nmax_torque_Nm = 0.1", "0.1\nmax",
     "the device takes no torque"},
    {kMouse, "[limits]", "[limits]\nmax_force_N = 1.5", "1.5", "the device takes no force"},
    // optional limits
    {kWhole, "[closed_loop]", "workspace_radius_m = \"wide\"\n[closed_loop]", "\"wide\"",
     "expected a number from 0.01 to 2 m"},
    {kWhole, "[closed_loop]", "workspace_radius_m = -0.2\n[closed_loop]", "-0.2", "found -0.2"},
    {kWhole, "[closed_loop]", "workspace_radius_m = inf\n[closed_loop]", "inf",
     "from 0.01 to 2 m, found inf"},
    {kWhole, "[closed_loop]", "workspace_radius_mm = 200\n[closed_loop]", "workspace_radius_mm",
     "give it in m as 'workspace_radius_m'"},
    {kWhole, "[closed_loop]", "workspace_centre_m = [0, 0, 0.1]\n[closed_loop]", "[0, 0, 0.1]",
     "has no effect without workspace_radius_m"},
    {kWhole, "[closed_loop]", "workspace_radius_m = 0.2\nworkspace_centre_m = [0, 0.1]\n[closed_loop]",
     "[0, 0.1]", "expected an array of 3 numbers"},
    {kWhole, "[closed_loop]", "workspace_radius_m = 0.2\nworkspace_centre_m = [0, 0, nan]\n[closed_loop]",
     "nan", "from -2 to 2 m, found nan"},
    {kWhole, "[closed_loop]", "max_power_W = true\n[closed_loop]", "true",
     "expected a number from 0.01 to 10000 W"},
    {kWhole, "[closed_loop]", "max_power_W = 0\n[closed_loop]", "0\n[closed",
     "from 0.01 to 10000 W, found 0"},
    {kWhole, "[closed_loop]", "max_power_W = inf\n[closed_loop]", "inf", "from 0.01 to 10000 W, found inf"},
    {kWhole, "[closed_loop]", "max_power_mW = 50\n[closed_loop]", "max_power_mW",
     "give it in W as 'max_power_W'"},
    {kWhole, "[closed_loop]", "continuous_force_N = 4\n[closed_loop]", "4\n[closed",
     "state all three, or none"},
    {kWhole, "[closed_loop]", "continuous_torque_Nm = 0.2\nthermal_time_s = 20\n[closed_loop]", "20\n[closed",
     "needs continuous_force_N, continuous_torque_Nm and thermal_time_s"},
    {kWhole, "[closed_loop]",
     "continuous_force_N = 11\ncontinuous_torque_Nm = 0.2\nthermal_time_s = 20\n[closed_loop]", "11",
     "is more than the maximum, 10 N; lower it"},
    {kWhole, "[closed_loop]",
     "continuous_force_N = 4\ncontinuous_torque_Nm = 0.6\nthermal_time_s = 20\n[closed_loop]", "0.6\nthermal",
     "is more than the maximum, 0.5 N.m; lower it"},
    {kWhole, "[closed_loop]",
     "continuous_force_N = -4\ncontinuous_torque_Nm = 0.2\nthermal_time_s = 20\n[closed_loop]", "-4",
     "from 0.01 to 200 N, found -4"},
    {kWhole, "[closed_loop]",
     "continuous_force_N = 4\ncontinuous_torque_Nm = 0.2\nthermal_time_s = inf\n[closed_loop]", "inf",
     "from 0.1 to 10000 s, found inf"},
    {kArm, "max_force_N = 5.0", "max_force_N = 5.0\nthermal_time_s = 20", "20\nmax_linear",
     "needs continuous_force_N and thermal_time_s; state both, or none"},
    {kArm, "max_force_N = 5.0", "max_force_N = 5.0\ncontinuous_torque_Nm = 0.2", "0.2\nmax_linear",
     "the device takes no torque"},
    {kMouse, "[limits]", "[limits]\nmax_power_W = 7", "7\nmax", "the device has no motors"},
    {kMouse, "[limits]", "[limits]\nworkspace_radius_m = 0.1", "0.1\nmax", "the device has no motors"},
    // meanings of buttons
    {kWhole, "[closed_loop]", "[buttons]\ndeadman = \"yes\"\n[closed_loop]", "\"yes\"",
     "expected a whole number from 0 to 31"},
    {kWhole, "[closed_loop]", "[buttons]\ndeadman = -1\n[closed_loop]", "-1\n", "from 0 to 31, found -1"},
    {kWhole, "[closed_loop]", "[buttons]\nstop = 1.5\n[closed_loop]", "1.5", "a whole number from 0 to 31"},
    {kWhole, "[closed_loop]", "[buttons]\nstop = 32\n[closed_loop]", "32\n[closed", "from 0 to 31, found 32"},
    {kWhole, "[closed_loop]", "[buttons]\nestop = 1\n[closed_loop]", "estop", "did you mean 'stop'?"},
    {kWhole, "[closed_loop]", "[buttons]\ndeadman = 3\nstop = 3\n[closed_loop]", "3\n[closed",
     "is the deadman button as well"},
    {kWhole, "[closed_loop]", "[buttons]\nstop = 3\nrecentre = 3\n[closed_loop]", "3\n[closed",
     "is the stop button as well"},
    {kWhole, "[closed_loop]", "[buttons]\nstop = 3\ngrasp = 3\n[closed_loop]", "3\n[closed",
     "is the stop button as well"},
    {kWhole, "[closed_loop]", "[buttons]\nslow = 3\n[closed_loop]", "3\n[closed",
     "a slow button requires [deflection]"},
    {kWhole, "buttons = { byte = 1, type = \"u32\" }\n[wrench_report]",
     "[buttons]\ndeadman = 2\n[wrench_report]", "2\n",
     "no report carries a button of this number; they carry 0 to 1"},
    {kArm, "[pose_report]", "[buttons]\nstop = 1\n[pose_report]", "1\n[pose",
     "no report carries a button of this number; they carry 0"},
    {kDelta, "[pose_report]", "[buttons]\nstop = 0\n[pose_report]", "0\n[pose",
     "no report carries buttons; give pose_report its 'buttons'"},
    {kMouse, "[deflection]", "[buttons]\nstop = 0\n[deflection]", "0\n[defl", "the device has no motors"},
    {kMouse, "[deflection]", "[buttons]\nrecentre = 0\n[deflection]", "0\n[defl",
     "no report carries buttons"},
    {kWhole, "damping_N_s_per_m = 0.5", "damping_N_s_per_m = -0.5", "-0.5", "found -0.5"},
    {kWhole, "max_stiffness_N_per_m", "max_stiffness_N_per_mm", "max_stiffness_N_per_mm",
     "give it in N/m as 'max_stiffness_N_per_m'"},
    // frames
    {kWhole, R"(["-y", "x", "z"])", R"(["-y", "x"])", R"(["-y", "x"])", "three axes"},
    {kWhole, R"(["-y", "x", "z"])", R"(["y", "x", "z"])", R"(["y", "x", "z"])", "not right-handed"},
    {kWhole, R"(["-y", "x", "z"])", R"(["x", "x", "z"])", R"(["x", "x", "z"])", "one is used twice"},
    {kWhole, R"("-y")", R"("left")", R"("left")", R"(expected "x", "y", "z", "-x", "-y" or "-z")"},
    {kWhole, "handle_position_m = [0, 0, 0.02]", "handle_position_m = [0, 0, 20]", "20]",
     "from -1 to 1 m, found 20"},
    // the frame of a report
    {kWhole, "[pose_report]\nid = 1\n", "[pose_report]\n", "[pose_report]",
     "key 'pose_report.id' is missing"},
    {kWhole, "[pose_report]\nid = 1\n", "[pose_report]\nid = 300\n", "300", "from 0 to 255, found 300"},
    {kWhole, "length = 40", "length = 400", "400", "from 2 to 64, found 400"},
    {kWhole, "length = 40", "length = 34", "{ name = \"volts\"",
     "its last byte is 35, but fields end with byte 32"},
    {kWhole, "\"sum8\"", "\"crc8\"", "\"crc8\"", R"("crc16_ccitt_false", "sum8", "xor8" or "none")"},
    {kWhole, "checksum = \"xor8\"\n", "", "18\n", "there is no checksum; name one"},
    {kWhole, "checksum_at = 18", "checksum_at = 21", "21", "from 2 to 20, found 21"},
    {kWhole, "checksum_at = 18", "checksum_at = 17", "{ byte = 16, type = \"u16\"",
     "overlaps 'wrench_report.checksum_at'"},
    {kWhole, "checksum_from = 1", "checksum_from = 18", "18", "from 0 to 17, found 18"},
    {kWhole, "checksum = \"sum8\"", "checksum = \"sum8\"\nmin_length = 30", "30", "never short"},
    {kWhole, "min_length = 3", "min_length = 9", "9", "from 2 to 5, found 9"},
    {kWhole, "[[20, 0x3e]]", "[20, 0x3e]", "20, 0x3e]", "expected an array of 2 numbers"},
    {kWhole, "[[20, 0x3e]]", "[[20, 0x13e]]", "0x13e", "from 0 to 255, found 318"},
    {kWhole, "[[20, 0x3e]]", "[[4, 0x3e]]", "{ byte = 4, bits = 16", "overlaps 'wrench_report.constants[0]'"},
    {kWhole, "[[20, 0x3e]]", "[[0, 0x3e]]", "[0, 0x3e]", "byte 0 is the report id"},
    {kDelta, "41 42 41 3e\"", "41 42 41\"", "\"3c 41", "has 15 bytes, but the report has 16"},
    {kDelta, "\"3c 41 41 41 41", "\"3c 41 4x 41 41", "\"3c 41 4x", "write bytes as in \"04 00\""},
    // fields
    {kWhole, "motors_on = { byte = 1, bit = 0 }\n", "", "[pose_report]",
     "key 'pose_report.motors_on' is missing"},
    {kWhole, "watchdog_tripped = { byte = 1, bit = 1 }", "watchdog_tripped = { byte = 1, bit = 0 }",
     "{ byte = 1, bit = 0 }\nsequence = { byte = 2, type = \"u16\" }\ndevice",
     "overlaps 'pose_report.motors_on'"},
    {kWhole, "bits = 24", "bits = 0", "0", "from 1 to 64, found 0"},
    {kWhole, "bits = 24", "bits = 65", "65", "from 1 to 64, found 65"},
    {kWhole, "bits = 24", "type = \"u32\", bits = 24", "24", "leave one of the two out"},
    {kWhole, "bits = 24, ", "", "{ byte = 4, step_s", "state it, or 'bits', here"},
    {kWhole, "bits = 12, bit = 4", "bits = 12, bit = 8", "8", "from 0 to 7, found 8"},
    {kWhole, kVelocity, "linear_velocity = { byte = 28, bits = 12, bit = 4, step_m_per_s = 0.0001 }",
     "0.0001", "less than the 1.2 m/s it has to carry"},
    {kWhole, "byte = 28", "byte = 27", "{ byte = 27", "overlaps 'pose_report.orientation'"},
    {kWhole, kForce, R"(force = { byte = 4, bits = 12, order = "big_endian", step_N = 0.01 })",
     R"("big_endian")", "big_endian is for whole bytes"},
    {kWhole, "\"big_endian\"", "\"motorola\"", "\"motorola\"", R"(expected "little_endian" or "big_endian")"},
    {kWhole, kForce, R"(force = { byte = 4, bits = 16, step_N = 0.0001 })", "0.0001",
     "less than the 10 N it has to carry"},
    {kWhole, kForce, "force = { byte = 4, bits = 16, signed = false, sign = 0, step_N = 0.001 }", "0, step_N",
     "must be 1, or -1"},
    {kWhole, kForce, "force = { byte = 4, bits = 16, sign = 2, step_N = 0.001 }", "2, step_N",
     "from -1 to 1, found 2"},
    {kWhole, kForce, "force = { byte = 4, type = \"i16\", signed = true, step_N = 0.001 }", "true",
     "the type determines the sign"},
    {kWhole, kForce, "force = { byte = 4, bits = 16, step_N = 0.001, offset = 1 }", "offset = 1",
     "give it in N as 'offset_N'"},
    {kWhole, kForce, "force = \"none\"", "\"none\"", "state wrench_report = \"none\""},
    {kWhole, "step_m = 1e-7", "step_mm = 1e-4", "step_mm", "give it in m as 'step_m'"},
    {kWhole, "\"i32\", step_m", "\"i64\", step_m", "\"i64\"", R"(expected "i8", "i16" or "i32")"},
    {kWhole, "[{ byte = 33, bit = 3 }", "[{ byte = 33, bit = 6 }", "{ byte = 33, bit = 6 }]",
     "overlaps 'pose_report.button_list[0]'"},
    {kWhole, "[{ byte = 33, bit = 3 }", "[33", "33", "expected a table, found 33"},
    {kWhole, "name = \"warm\"", "name = \"\"", "\"\"", "must not be empty"},
    {kWhole, "name = \"volts\", ", "", "{ byte = 34", "values[0].name' is missing"},
    {kWhole, "status = [", "stauts = [", "stauts", "did you mean 'status'?"},
    {kDelta, "bits = 16, coding = \"nibble_ascii\" }\nhomed", "bits = 10, coding = \"nibble_ascii\" }\nhomed",
     "\"nibble_ascii\" }\nhomed", "a nibble holds 4 bits"},
    {kDelta, "joints = { byte = 1, bits = 16, coding = \"nibble_ascii\" }",
     "joints = { byte = 1, bits = 16, coding = \"bcd\" }", "\"bcd\"",
     R"(expected "binary" or "nibble_ascii")"},
    {kDelta, "base = 0x41", "base = 0x141", "0x141", "from 0 to 255, found 321"},
    {kDelta, "joints = { byte = 1,", "joints = { byte = 0,", "{ byte = 0,",
     "overlaps 'pose_report.constants[0]'"},
    // several reports
    {kMouse, "[[more_reports]]", "[more_reports]", "[more_reports]",
     "expected tables, each headed [[more_reports]]"},
    {kMouse, "id = 2\n", "id = 1\n", "[[more_reports]]",
     "cannot be distinguished from 'pose_report': same id"},
    {kMouse, "id = 2\n", "id = \"none\"\n", "[[more_reports]]", "must both have an id, or neither"},
    {kMouse, "id = 2\nlength = 7\n", "id = 2\n", "[[more_reports]]", "more_reports[0].length' is missing"},
    // sources of the pose
    {kMouse, "[deflection]\nmode = \"rate\"\nlinear_gain = 71.0\nangular_gain = 11.0\n", "", "[pose_report]",
     "a translation or rotation moves a pose only by [deflection]; state it"},
    {kMouse, kTranslation, "joints = { byte = 1, type = \"i16\" }", "[pose_report]", "leave all but one out"},
    {kMouse, "mode = \"rate\"", "mode = \"speed\"", "\"speed\"", R"(expected "rate" or "position")"},
    {kMouse, "linear_gain = 71.0\n", "", "[deflection]", "key 'deflection.linear_gain' is missing"},
    {kMouse, "angular_gain = 11.0", "angular_gain = 0", "0", "from 0.001 to 1000000, found 0"},
    // deflection of a puck
    {kMouse, "angular_gain = 11.0", "angular_gain = 11.0\ndead_zone = 0.1", "0.1",
     "state full_deflection_m and full_deflection_rad"},
    {kMouse, "angular_gain = 11.0", "angular_gain = 11.0\nfull_deflection_m = 0.001", "0.001",
     "state full_deflection_m and full_deflection_rad"},
    {kMouse, "angular_gain = 11.0", steering("dead_zone = 1.0"), "1.0\n[pose", "from 0 to 0.9, found 1"},
    {kMouse, "angular_gain = 11.0", steering("response_exponent = 0.5"), "0.5\n[pose",
     "from 1 to 5, found 0.5"},
    {kMouse, "angular_gain = 11.0", steering("slow_factor = 0"), "0\n[pose", "from 0.01 to 1, found 0"},
    {kMouse, "angular_gain = 11.0", steering("max_proxy_distance_m = 0.01"), "0.01\n",
     "state max_proxy_distance_m and max_proxy_angle_rad"},
    {kMouse, "angular_gain = 11.0", steering("max_proxy_distance_m = 10\nmax_proxy_angle_rad = 0.2"), "10\n",
     "from 0.0001 to 0.5 m, found 10"},
    {kMouse, "angular_gain = 11.0", steering("max_proxy_distance_mm = 10\nmax_proxy_angle_rad = 0.2"),
     "max_proxy_distance_mm", "give it in m as 'max_proxy_distance_m'"},
    {kMouse, "mode = \"rate\"", "mode = \"position\"\nresponse_exponent = 2.0", "2.0",
     "belongs to mode \"rate\""},
    {kMouse, "angular_gain = 11.0", "angular_gain = 11.0\nbox_min_m = [-1, -1, -1]", "[-1, -1, -1]",
     "state box_min_m and box_max_m"},
    {kMouse, "angular_gain = 11.0", "angular_gain = 11.0\nbox_min_m = [-1, 0.1, -1]\nbox_max_m = [1, 1, 1]",
     "[-1, 0.1, -1]", "no number may be above 0"},
    {kMouse, "angular_gain = 11.0", "angular_gain = 11.0\nbox_min_m = [-1, -1, -1]\nbox_max_m = [1, 1, -1]",
     "[1, 1, -1]", "no number may be below 0"},
    {kArm, "joints = { byte = 0, type = \"i16\" }", kTranslation, "[pose_report]",
     "[kinematics] needs joints in a report"},
    {kArm, "type = \"capstan_arm\"", "type = \"scara\"", "\"scara\"", R"(expected "capstan_arm" or "delta")"},
    {kArm, "max_current_A = 2.0\n", "", "[kinematics]", "key 'kinematics.max_current_A' is missing"},
    {kArm, "max_current_A", "max_current_mA", "max_current_mA", "give it in A as 'max_current_A'"},
    {kArm, "[0.058, 0.174, 0.133]", "[0.058, 0.174]", "[0.058, 0.174]", "expected an array of 3 numbers"},
    {kArm, "[0.058, 0.174, 0.133]", "[58, 174, 133]", "58, 174", "from 0.0001 to 2 m, found 58"},
    {kArm, "direction = [-1, -1, -1]", "direction = [-1, 0, -1]", "[-1, 0, -1]", "each must be 1 or -1"},
    {kArm, "joint_report_index = [0, 1, 2]", "joint_report_index = [0, 1, 1]", "[0, 1, 1]",
     "each integer of joints once"},
    {kArm, "counts_per_turn = [2000, 2000, 2000]", "counts_per_turn = [2000, 2000, 2000, 1024]",
     "[2000, 2000, 2000, 1024]", "expected an array of 3 numbers, found an array of 4"},
    {kArm, "report_index = 2", "report_index = 3", "3", "from 0 to 2, found 3"},
    {kArm, "step_A = 0.001", "step_mA = 1", "step_mA", "give it in A as 'step_A'"},
    {kArm, "step_A = 0.001", "step_A = 0.00001", "0.00001", "less than the 2 A it has to carry"},
    {kArm, "efforts = {", "force = { byte = 8, type = \"i16\", step_N = 0.01 }\nefforts = {",
     "{ byte = 0, type = \"i16\", step_A", "replaces force and torque"},
    {kDelta, "effort_per_Nm = -10000.0", "effort_per_Nm = 0", "0", "must not be 0"},
    {kDelta, "gear = 0.1295\n", "", "[kinematics]", "key 'kinematics.gear' is missing"},
    {kDelta, "shin_m = 0.1025", "shin_mm = 102.5", "shin_mm", "give it in m as 'shin_m'"},
    // homing and masses
    {kWhole, "[closed_loop]", "[homing]\nreference = \"sometimes\"\n[closed_loop]", "\"sometimes\"",
     R"(expected "never", "once" or "each_start")"},
    {kWhole, "[closed_loop]", "[homing]\ntravel_m = 0.0\n[closed_loop]", "0.0\n[closed",
     "from 0.001 to 0.5 m"},
    {kWhole, "[closed_loop]",
     "[homing]\nworkspace_min_m = [-1, -1, 0.5]\nworkspace_max_m = [1, 1, 0.5]\n[closed_loop]", "[1, 1, 0.5]",
     "the workspace must be larger than travel_m"},
    {kWhole, "[closed_loop]", "[homing]\nmax_rotation_rad = 0.1\n[closed_loop]", "0.1\n[closed",
     "must be no less than travel_rad"},
    {kWhole, "[closed_loop]", "[homing]\nreference_m = [0, 0, 0]\n[closed_loop]", "reference_m",
     "did you mean 'reference'?"},
    {kWhole, "[closed_loop]", "[masses]\nhandle_kg = 250.0\n[closed_loop]", "250.0", "from 0 to 20 kg"},
    {kWhole, "[closed_loop]", "[masses]\nhandle_g = 250.0\n[closed_loop]", "handle_g",
     "give it in kg as 'handle_kg'"},
    // fixed reports
    {kWhole, "\"04 00\"", "\"4\"", "\"4\"", "a byte is two hexadecimal digits"},
    {kWhole, "\"04 00\"", "\"\"", "\"\"", "has 0 bytes; a report has 1 to 64"},
    {kWhole, "\"04 00\"", "[4, 0]", "[4, 0]", "expected a text"},
    {kWhole, "period_s = 0.5\n", "", "[keep_alive]", "key 'keep_alive.period_s' is missing"},
    {kWhole, "period_s = 0.5", "period_s = 0", "0", "from 0.001 to 60 s, found 0"},
};

}  // namespace

TEST_CASE("the unchanged profiles load", "[config]") {
  const test::TemporaryDirectory dir;
  for (const std::string* text : {&kWhole, &kMouse, &kArm, &kDelta})
    CHECK(rejection_text(dir.write("good.toml", *text)).empty());
}

TEST_CASE("a hundred invalid profiles are rejected with location and remedy", "[config]") {
  CHECK(kTable.size() >= 100);
  const test::TemporaryDirectory dir;
  for (const Bad& bad : kTable) {
    const std::string text = test::with(bad.good, bad.from, bad.to);
    const auto file = dir.write("bad.toml", text);
    test::check_rejection(rejection_text(file), file.string() + ":" + error_location(text, bad) + ": ",
                          bad.cure, bad.from + " -> " + bad.to);
  }
}

}  // namespace wrenchd::test_bad_profiles
