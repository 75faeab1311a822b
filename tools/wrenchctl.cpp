// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <optional>
#include <sstream>
#include <string>

#include <CLI/CLI.hpp>

#include "collision/meshes/make_mesh.hpp"
#include "collision/meshes/mesh_check.hpp"
#include "collision/meshes/mesh_source.hpp"
#include "collision/tool_body.hpp"
#include "config/known_profiles.hpp"
#include "config/load_profile.hpp"
#include "config/load_scene.hpp"
#include "config/pose_table.hpp"
#include "config/report_bytes.hpp"
#include "core/finite.hpp"
#include "core/friction.hpp"
#include "core/inertia.hpp"
#include "daemon/option_checks.hpp"
#include "daemon/recording/recording_file.hpp"
#include "daemon/runtime.hpp"
#include "daemon/version.hpp"
#include "tools/calibrate.hpp"
#include "tools/check.hpp"
#include "tools/control_commands.hpp"
#include "tools/descriptor_source.hpp"
#include "tools/doctor.hpp"
#include "tools/export_recording.hpp"
#include "tools/fault_text.hpp"
#include "tools/gallery.hpp"
#include "tools/list_devices.hpp"
#include "tools/output_file.hpp"
#include "tools/paper_figures.hpp"
#include "tools/paper_tables.hpp"
#include "tools/plot_recording.hpp"
#include "tools/propose_profile.hpp"
#include "tools/replay_recording.hpp"
#include "tools/report_text.hpp"
#include "tools/solve.hpp"
#include "tools/udev_rules.hpp"
#include "tools/view/view.hpp"

namespace {

using namespace wrenchd;

constexpr int kExitRefused = 1;     ///< a file was rejected, or cannot be written
constexpr int kExitDefects = 2;     ///< wrenchctl mesh: the mesh is not a solid
constexpr int kExitDiffers = 4;     ///< wrenchctl replay: a tick differs
constexpr int kExitUnfit = 5;       ///< wrenchctl doctor: a check failed
constexpr int kExitInfeasible = 3;  ///< wrenchctl solve: no admissible pose was found near a pose

const std::map<std::string, Method> kMethods = {{"exact", Method::exact},
                                                {"planar", Method::planar},
                                                {"descent", Method::descent},
                                                {"translational", Method::translational}};

struct SolveOptions {
  std::filesystem::path scene;
  std::string poses;
  std::string output = "-";
  std::string method = "exact";
  std::string law = "pid";
  std::string friction = "0,0";
  SolveSettings settings;
};

/// Parses "0.5,0.3": static and dynamic friction coefficient; a single number sets both.
std::optional<FrictionSettings> friction_of(const std::string& text) {
  FrictionSettings friction;
  const char* const end = text.data() + text.size();
  const auto read = [end](const char* from, double& x) {
    const auto [stop, error] = std::from_chars(from, end, x);
    return error == std::errc() && x >= 0.0 && x <= FrictionSettings::kMaxCoefficient ? stop : nullptr;
  };
  const char* stop = read(text.data(), friction.static_coefficient);
  friction.dynamic_coefficient = friction.static_coefficient;
  if (stop != nullptr && stop != end)
    stop = *stop == ',' ? read(stop + 1, friction.dynamic_coefficient) : nullptr;
  if (stop != end || friction.dynamic_coefficient > friction.static_coefficient) return {};
  return friction;
}

CLI::Validator friction_pair() {
  return {[](std::string& text) -> std::string {
            return friction_of(text) ? ""
                                     : "expected two numbers from 0 to 5, the second no more than the first, "
                                       "as in 0.5,0.3; found '" +
                                           text + "'";
          },
          ""};
}

struct MeshOptions {
  std::filesystem::path file;
  double scale = 1.0;
  GeneratedMesh wanted;
  std::string output = "-";
};

std::vector<Pose> read_poses_from(const std::string& name) {
  if (name == "-") return read_poses(std::cin, "standard input");
  std::ifstream file(name);
  if (!file || std::filesystem::is_directory(name))
    throw PoseTableError(name + ": cannot be read; name a CSV file, or - for standard input");
  return read_poses(file, name);
}

/// Prints progress and changes to standard error.
void say(const std::string& what) {
  std::fprintf(stderr, "wrenchctl: %s\n", what.c_str());
}

MeshLoader mesh_loader() {
  return {cache_directory(), say};
}

int run_solve(const SolveOptions& options) {
  MeshLoader meshes = mesh_loader();
  const Scene scene(load_scene(options.scene), meshes);
  for (const std::string& change : meshes.changes()) say(change);
  const std::vector<Pose> poses = read_poses_from(options.poses);
  SolveSettings settings = options.settings;
  if (scene.has_moving_obstacles() && !settings.proxy)
    say("obstacles move, and every pose is solved with them where they stand at time 0; --proxy moves them");
  settings.depth.method = kMethods.at(options.method);
  settings.depth.friction = friction_of(options.friction).value();
  settings.law = options.law == "energy" ? SpringLaw::energy : SpringLaw::pid;
  const std::vector<SolvedPose> rows = solve(scene, poses, settings);
  std::ostringstream text;
  write_csv(text, rows, settings.proxy);
  write_output(options.output, text.str());
  int exit_code = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i].penetration.projection.status != ProjectionStatus::infeasible) continue;
    std::fprintf(stderr,
                 "wrenchctl: pose %zu of %s: no admissible pose found near it, its energy is nan; do the "
                 "obstacles leave room for the tool?\n",
                 i + 1, options.poses.c_str());
    exit_code = kExitInfeasible;
  }
  return exit_code;
}

void print(const char* label, const Vector3d& v, const char* unit) {
  std::printf("%-18s %.9g %.9g %.9g %s\n", label, v.x(), v.y(), v.z(), unit);
}

int run_mesh(const std::filesystem::path& file, double scale) {
  const std::string name = file.filename().string();
  MeshSource source = read_mesh_source(file);
  const std::size_t size = source.bytes.size();
  if (size >= MeshLoader::kLargeMeshBytes)
    say(name + ": reading " + with_thousands_separators(size / 1'000'000) + " MB");
  PolygonSoup soup = parse_mesh(std::move(source));
  if (soup.faces.size() >= MeshLoader::kLargeMeshTriangles)
    say(name + ": " + with_thousands_separators(soup.faces.size()) + " faces, checking");
  std::printf("%-18s %zu\n%-18s %zu\n", "vertices", soup.vertices.size(), "faces", soup.faces.size());
  TriangleMesh mesh;
  const MeshReport report = repair_and_check_solid(soup, &mesh);
  for (const std::string& change : report.repairs) std::printf("%-18s %s\n", "repaired", change.c_str());
  std::printf("%-18s %s\n%-18s %s\n", "closed", report.closed ? "yes" : "no", "consistent",
              report.consistent ? "yes" : "no");
  if (!report.solid()) {
    std::fprintf(stderr, "wrenchctl: %s\n", rejection_text(file, soup, BodyKind::solid, report).c_str());
    return kExitDefects;
  }
  const auto unlikely = implausible_size(mesh, scale, kPlausibleToolSize);
  for (Vector3d& p : mesh.vertices_m) p *= scale;
  const SolidProperties solid = solid_properties(mesh, 1.0);
  require_usable(solid, file, scale);
  Eigen::AlignedBox3d box;
  for (const Vector3d& p : mesh.vertices_m) box.extend(p);
  const Matrix3d& H = solid.inertia.H_kg_m2;
  std::printf("%-18s %zu\n", "triangles", mesh.triangles.size());
  print("size", box.sizes(), "m");
  if (unlikely) std::printf("%-18s as a tool, %s\n", "remark", unlikely->c_str());
  std::printf("%-18s %.9g m^3\n", "volume", solid.volume_m3);
  print("centre of mass", solid.p_MT_m, "m");
  print("inertia xx yy zz", H.diagonal(), "m^2 (per kg, uniform solid, about the centre of mass)");
  print("inertia xy xz yz", {H(0, 1), H(0, 2), H(1, 2)}, "m^2");
  return 0;
}

void add_solve(CLI::App& app, SolveOptions& options, int& exit_code) {
  CLI::App* solve = app.add_subcommand("solve", "Closest admissible configuration of each pose of a table");
  solve->add_option("scene", options.scene, "scene file (TOML)")->required()->check(not_empty());
  solve
      ->add_option("--poses", options.poses,
                   "CSV with the header px,py,pz,qx,qy,qz,qw: poses of the mesh's own\n"
                   "frame in the world [m]; - reads standard input")
      ->required()
      ->check(not_empty());
  solve->add_option("--method", options.method, "how the closest admissible pose is found")
      ->check(CLI::IsMember({"exact", "planar", "descent", "translational"}))
      ->capture_default_str();
  solve->add_option("--planes", options.settings.depth.planes, "N_delta of Eq. (40), for method planar")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  solve->add_option("--law", options.law, "what makes a wrench of it: Eq. (16), or the gradient of (k/2) T")
      ->check(CLI::IsMember({"pid", "energy"}))
      ->capture_default_str();
  solve->add_option("--energy-stiffness", options.settings.energy_stiffness_per_s2, "k of law energy [1/s2]")
      ->check(number_in_range(0.0, 1e9))
      ->capture_default_str();
  solve->add_option("--k-p", options.settings.k_P, "k_P of Eq. (16); no integral, no derivative")
      ->check(number_in_range(0.0, 1e9))
      ->capture_default_str();
  auto* proxy =
      solve->add_flag("--proxy", options.settings.proxy,
                      "take the poses for a trajectory, and follow it as the daemon does: each from the\n"
                      "answer before, never into an obstacle or through one");
  solve
      ->add_option("--rate", options.settings.rate_Hz,
                   "poses a second of that trajectory [Hz], by which obstacles move")
      ->check(number_in_range(0.001, 1e6))
      ->needs(proxy)
      ->capture_default_str();
  solve
      ->add_option("--friction", options.friction,
                   "STATIC,DYNAMIC: coefficients of Coulomb's friction on the proxy, for method exact")
      ->check(friction_pair())
      ->needs(proxy)
      ->capture_default_str();
  solve->add_option("-o,--output", options.output, "CSV to write; - writes standard output")
      ->check(not_empty())
      ->capture_default_str();
  solve->footer(
      "One row a pose: contacts (tool vertices that touch at the projection; 0 where the pose is\n"
      "admissible), energy T [kg m^2] of Eq. (8), the projected pose of the same frame, eps of Eq. (15) in\n"
      "the body frame at the centre of mass, the wrench in that frame and about the world origin, and the\n"
      "time of the solve [ns]. Each pose is solved without history: exact then seeks the global optimum. "
      "With\n"
      "--proxy: then status (free, converged, budget_spent, infeasible) and iterations.\n"
      "The first pose is at scene time 0; without --proxy all are, and obstacles that move stand there.");
  solve->callback([&] { exit_code = run_solve(options); });
}

void add_mesh(CLI::App& app, MeshOptions& options, int& exit_code) {
  CLI::App* mesh =
      app.add_subcommand("mesh",
                         "What a mesh is: closed, volume, inertia, repairs, defects. Or makes one\n"
                         "to try things with");
  auto* file = mesh->add_option("file", options.file, "OFF, OBJ, STL or PLY")->check(not_empty());
  mesh->add_option("--scale", options.scale, "metres per mesh unit")
      ->check(number_in_range(1e-9, 1e6))
      ->capture_default_str();
  std::vector<std::string> kinds;
  std::string list = "Kinds that can be made:\n";
  for (const auto& [name, what] : mesh_kinds()) {
    kinds.push_back(name);
    list += "  " + name + std::string(10 - name.size(), ' ') + what + '\n';
  }
  auto* make = mesh->add_option("--make", options.wanted.kind, "make a solid of this kind, in metres")
                   ->check(CLI::IsMember(kinds))
                   ->excludes(file);
  mesh->add_option("--triangles", options.wanted.triangles, "about so many")
      ->check(CLI::Range(GeneratedMesh::kMinTriangles, GeneratedMesh::kMaxTriangles))
      ->needs(make)
      ->capture_default_str();
  mesh->add_option("--seed", options.wanted.seed, "which of the bumpy ones")
      ->needs(make)
      ->capture_default_str();
  mesh->add_option("-o,--output", options.output, "OFF file to write; - writes standard output")
      ->check(not_empty())
      ->needs(make)
      ->capture_default_str();
  mesh->footer(list);
  mesh->callback([&options, &exit_code] {
    if (!options.wanted.kind.empty()) {
      std::ostringstream text;
      write_off(text, make_mesh(options.wanted));
      write_output(options.output, text.str());
    } else if (options.file.empty()) {
      throw CLI::RequiredError("mesh: a file, or --make KIND,");
    } else {
      exit_code = run_mesh(options.file, options.scale);
    }
  });
}

struct ReportOptions {
  std::string profile;
  std::string hex;
  std::string wrench;
  std::string at;
  std::uint64_t sequence = 1;
  bool to_device = false;
};

std::vector<std::uint8_t> bytes_of(const char* option, const std::string& text) {
  const ReportBytes parsed = parse_bytes(text);
  if (parsed.error.empty()) return parsed.bytes;
  const std::string found =
      parsed.error_index < text.size() ? "'" + text.substr(parsed.error_index, 1) + "'" : "the end";
  throw std::runtime_error(std::string(option) + ": character " + std::to_string(parsed.error_index + 1) +
                           ", " + found + ", " + std::string(parsed.error) +
                           "; write bytes in hexadecimal, as in \"01 00 ff\"");
}

/// Parses "fx,fy,fz,tx,ty,tz".
Wrench wrench_of(const std::string& text) {
  std::array<double, 6> numbers{};
  if (const auto commas = static_cast<std::size_t>(std::count(text.begin(), text.end(), ',')); commas != 5)
    throw std::runtime_error("--wrench: six numbers are wanted, and " + std::to_string(commas + 1) +
                             " given; give force in N and torque in N.m, as in 1,0,-2.5,0,0.05,0");
  const char* from = text.data();
  const char* const end = from + text.size();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const auto [stop, error] = std::from_chars(from, end, numbers[i]);
    const bool last = i + 1 == numbers.size();
    if (error != std::errc() || !is_finite(numbers[i]) || (last ? stop != end : stop == end || *stop != ','))
      throw std::runtime_error("--wrench: number " + std::to_string(i + 1) + " of 6 is wrong, at '" +
                               std::string(from, end) +
                               "'; give force in N and torque in N.m, as in 1,0,-2.5,0,0.05,0");
    from = stop + (last ? 0 : 1);
  }
  return {{numbers[0], numbers[1], numbers[2]}, {numbers[3], numbers[4], numbers[5]}};
}

void run_encode(const ReportOptions& options) {
  const DeviceProfile profile = load_profile_named(options.profile);
  const EncodedWrench encoded =
      encode_wrench(profile, wrench_of(options.wrench), bytes_of("--at", options.at), options.sequence);
  for (const std::string& remark : encoded.remarks) say(remark);
  std::printf("%s\n", hex_text(encoded.bytes).c_str());
}

void add_decode(CLI::App& app, ReportOptions& options) {
  CLI::App* decode = app.add_subcommand("decode", "What the bytes of a device's report say, in SI units");
  decode->add_option("profile", options.profile, "name or file of a device profile")
      ->required()
      ->check(not_empty());
  decode->add_option("--hex", options.hex, "the bytes of one report, as in \"01 00 ff\"")
      ->required()
      ->check(not_empty("give bytes in hexadecimal, as in \"01 00 ff\""));
  decode->add_flag("--to-device", options.to_device,
                   "they go to the device: where both ways have reports of the same form");
  decode->footer(
      "Fields stand in the device's own axes, as its bytes have them; lines that end in 'in base' are what\n"
      "wrenchd makes of them: x forward, away from the user, y left, z up.");
  decode->callback([&] {
    std::cout << report_text(load_profile_named(options.profile), bytes_of("--hex", options.hex),
                             options.to_device);
  });
}

void add_encode(CLI::App& app, ReportOptions& options) {
  CLI::App* encode = app.add_subcommand("encode", "The bytes that a wrench becomes on its way to a device");
  encode->add_option("profile", options.profile, "name or file of a device profile")
      ->required()
      ->check(not_empty());
  encode
      ->add_option("--wrench", options.wrench,
                   "fx,fy,fz,tx,ty,tz on the hand, about the handle point [N, N.m]")
      ->required()
      ->check(not_empty("give force in N and torque in N.m, as in 1,0,-2.5,0,0.05,0"));
  encode->add_option("--at", options.at,
                     "a report of the device, in hexadecimal: where the hand is. Devices with joints need\n"
                     "it; without it they stand at their home position");
  encode->add_option("--sequence", options.sequence, "of the command, where the device counts them")
      ->check(CLI::Range(1, 65535))
      ->capture_default_str();
  encode->footer(
      "The wrench is in the axes of the base: x forward, away from the user, y left, z up. The limits of "
      "the\n"
      "profile hold. What is cut or dropped is told on standard error.");
  encode->callback([&] { run_encode(options); });
}

void add_devices(CLI::App& app, bool& all) {
  CLI::App* devices =
      app.add_subcommand("devices",
                         "What is plugged in: which profile each device has and whether it can be opened,\n"
                         "and for every other profile why not");
  devices->add_flag("--all", all, "every reason for devices too that are nothing for wrenchd");
  devices->footer(
      "Looks, and opens nothing. Profiles are those of /etc/wrenchd/profiles, /usr/share/wrenchd/profiles "
      "and\n"
      "config/profiles of the source tree; of two files with the same name the first counts.");
  devices->callback([&all] {
    const auto may_open = [](const UsbDevice& device, const std::string& node) {
      return open_error(device, node);
    };
    std::cout << device_list(list_usb_devices(), known_profiles(SearchPath()), all, may_open);
  });
}

struct RuleOptions {
  std::filesystem::path from;
  std::string output = "-";
};

void run_udev_rules(const RuleOptions& options) {
  const SearchPath search = options.from.empty() ? SearchPath() : SearchPath({options.from});
  const KnownProfiles known = known_profiles(search);
  if (!known.refused.empty()) throw std::runtime_error(known.refused.front());
  if (known.profiles.empty())
    throw std::runtime_error((options.from.empty() ? "the search path" : options.from.string()) +
                             " holds no profiles/*.toml; name the directory above that of the profiles");
  write_output(options.output, udev_rules(known.profiles));
}

void add_udev_rules(CLI::App& app, RuleOptions& options) {
  CLI::App* rules = app.add_subcommand("udev-rules",
                                       "The udev rules for the devices that there are profiles for: who may\n"
                                       "open them, no autosuspend, and that plugging one in starts wrenchd");
  rules
      ->add_option("--from", options.from,
                   "a directory whose profiles/*.toml are meant, instead of the search path")
      ->check(not_empty());
  rules->add_option("-o,--output", options.output, "rules file to write; - writes standard output")
      ->check(not_empty())
      ->capture_default_str();
  rules->callback([&options] { run_udev_rules(options); });
}

int run_doctor() {
  MachineState patient = read_machine_state(known_profiles(SearchPath()).profiles);
  patient.wake_latency = measure_wake_latency(std::chrono::seconds(1));
  const std::vector<Finding> findings = check_machine(patient);
  std::cout << text(findings);
  return has_failure(findings) ? kExitUnfit : 0;
}

void add_doctor(CLI::App& app, int& exit_code) {
  CLI::App* doctor = app.add_subcommand(
      "doctor",
      "Whether this machine is fit for a servo loop: kernel, processors, limits, service,\n"
      "udev rules, devices, and how late it wakes up; and what to do about each");
  doctor->footer(
      "Each line begins with ok, better (it would do good) or WRONG. Sleeps for a second, to measure; opens\n"
      "no device and changes nothing. Exit code 5: something is wrong.");
  doctor->callback([&exit_code] { exit_code = run_doctor(); });
}

struct FaultOptions {
  std::string name;
  bool states = false;
};

void add_faults(CLI::App& app, FaultOptions& options) {
  CLI::App* faults =
      app.add_subcommand("faults",
                         "What can go wrong: how it is found, what the hand feels of it and how soon,\n"
                         "why anybody looks for it, and what to do");
  faults->add_option("name", options.name, "one of them, as the log names it; without it all")
      ->check(not_empty());
  faults->add_flag("--states", options.states, "the states instead, and what leads from one to the next");
  faults->callback([&options] {
    if (options.states)
      std::cout << state_machine_text();
    else
      std::cout << (options.name.empty() ? fault_text() : fault_text(options.name));
  });
}

void add_calibrate(CLI::App& app, CalibrateOptions& options, int& exit_code) {
  CLI::App* calibrate =
      app.add_subcommand("calibrate",
                         "Has a person show a plugged-in device its rest and its axes, motors off, and\n"
                         "keeps what it found for its serial number");
  calibrate
      ->add_option("profile", options.profile,
                   "name or file of its profile; auto: that of whatever device is plugged in")
      ->check(not_empty("name a profile, or leave it out"))
      ->capture_default_str();
  calibrate->add_option("--serial", options.serial, "which of several equal devices")
      ->check(not_empty("give the serial number; wrenchctl devices lists it"));
  calibrate->footer(
      "Says what to do, a step at a time. Enter, or a button that the profile names, confirms that the "
      "handle\n"
      "is in its rest. Calibrations are in calibration/ of $STATE_DIRECTORY, or of /var/lib/wrenchd.");
  calibrate->callback([&] { exit_code = run_calibrate(options); });
}

struct ProfileOptions {
  std::filesystem::path from;
  std::string output = "-";
};

void add_profile(CLI::App& app, ProfileOptions& options) {
  CLI::App* profile =
      app.add_subcommand("profile",
                         "Proposes a profile for a device, from what it says of its reports: what only\n"
                         "a person can know, its limits first of all, is left to be filled in");
  profile
      ->add_option("--from", options.from,
                   "/dev/hidrawN, or a file with a report descriptor: its bytes, or hexadecimal text")
      ->required()
      ->check(not_empty());
  profile->add_option("-o,--output", options.output, "TOML file to write; - writes standard output")
      ->check(not_empty())
      ->capture_default_str();
  profile->callback(
      [&] { write_output(options.output, propose_profile(read_descriptor_source(options.from))); });
}

void add_paper(CLI::App& app, std::filesystem::path& directory) {
  CLI::App* paper =
      app.add_subcommand("paper",
                         "The examples of Kolesnikov and Zefran's paper, beside the numbers it\n"
                         "prints, and its Figs. 11 to 15");
  paper->add_option("-o,--output", directory, "directory for the figures (PNG) and what they show (CSV)")
      ->check(not_empty())
      ->capture_default_str();
  paper->callback([&] {
    std::cout << paper_tables() << std::flush;
    write_paper_figures(directory);
    std::cout << "\nFigs. 11 to 15 (fig11.png, fig11.csv, ...) are in " << directory.string() << '\n';
  });
}

void add_gallery(CLI::App& app, std::string& name) {
  CLI::App* gallery =
      app.add_subcommand("gallery", "Scenes to try: what there is to feel and see, and the command for each");
  gallery->add_option("name", name, "one of them; without it, a line for each")
      ->check(not_empty("name a scene, or leave it out"));
  gallery->callback([&name] {
    std::cout << (name.empty() ? gallery_text(SearchPath()) : gallery_text(SearchPath(), name));
  });
}

void add_view(CLI::App& app, ViewOptions& options) {
  CLI::App* view = app.add_subcommand("view",
                                      "Serves a page that shows what the hand feels, to browsers on this\n"
                                      "machine: of a daemon that runs, or of a recording");
  view->group("A daemon that runs");
  view->add_option("recording", options.recording, "HDF5 file of wrenchd --record; without it the daemon")
      ->check(not_empty());
  view->add_option("--port", options.port, "to listen on, at 127.0.0.1; 0: one that is free")
      ->capture_default_str();
  view->add_option("--socket", options.socket, "the daemon's control socket; without it as for status")
      ->check(not_empty());
  view->add_flag("--open", options.open_browser, "open the page in a browser, by xdg-open");
  view->footer(
      "Prints the address, which only works as a whole: it holds a token. The page arms with the rights of\n"
      "whoever runs this, for as long as it is open and seen; anybody's stop works always.");
  view->callback([&options] { run_view(options); });
}

struct RecordingOptions {
  std::filesystem::path file;
  RunConfigFiles files;
  std::string output;
  ExportSettings wanted;
};

void add_replay(CLI::App& app, RecordingOptions& options, int& exit_code) {
  CLI::App* again = app.add_subcommand("replay",
                                       "Feeds a recording through the servo loop again, and names the first\n"
                                       "tick that comes out differently");
  again->add_option("recording", options.file, "HDF5 file of wrenchd --record")
      ->required()
      ->check(not_empty());
  const std::array named = {
      again->add_option("-c,--config", options.files.config,
                        "replay it with this configuration; without any of these three with what is in it"),
      again->add_option("--scene", options.files.scene, "with this scene instead of the configuration's"),
      again->add_option("--profile", options.files.profile, "with this profile, likewise")};
  for (CLI::Option* option : named) option->check(not_empty());
  again->callback([&options, &exit_code, named] {
    const bool from_files = std::any_of(named.begin(), named.end(), [](auto* o) { return o->count() > 0; });
    const bool same = replay_recording(options.file, from_files ? std::optional<RunConfigFiles>(options.files)
                                                                : std::optional<RunConfigFiles>());
    exit_code = same ? 0 : kExitDiffers;
  });
}

void add_export(CLI::App& app, RecordingOptions& options) {
  CLI::App* exported = app.add_subcommand("export", "A recording as CSV, with units in its headings");
  exported->add_option("recording", options.file, "HDF5 file")->required()->check(not_empty());
  exported->add_option("-o,--output", options.output, "CSV to write; without it standard output")
      ->check(not_empty());
  exported
      ->add_option("--columns", options.wanted.columns,
                   "names, with commas between: F_out,state; without it all")
      ->delimiter(',');
  exported->add_option("--every", options.wanted.every, "a row for so many ticks")
      ->check(CLI::Range(std::size_t{1}, std::size_t{1'000'000'000}))
      ->capture_default_str();
  exported->add_option("--from", options.wanted.from_s, "leave out what was before [s since the first tick]")
      ->check(number_in_range(0.0, 1e9));
  exported->add_option("--to", options.wanted.to_s, "leave out what came after [s, likewise]")
      ->check(number_in_range(0.0, 1e9));
  exported->callback([&options] {
    const Recording recording = read_recording(options.file);
    if (options.output.empty()) return write_csv(std::cout, recording, options.wanted);
    std::ostringstream text;
    write_csv(text, recording, options.wanted);
    write_output(options.output, text.str());
  });
}

void add_plot(CLI::App& app, RecordingOptions& options) {
  CLI::App* plot =
      app.add_subcommand("plot",
                         "The figures of a recording: force, torque, penetration and energy over\n"
                         "time, tick times and their tail, and the way of the tool");
  plot->add_option("recording", options.file, "HDF5 file")->required()->check(not_empty());
  plot->add_option("-o,--output", options.output,
                   "a file that ends in .svg, .pdf or .png: all of them in one; else a directory for an SVG\n"
                   "each, their tables and the script; without it the recording's name, without .h5")
      ->check(not_empty());
  plot->callback([&options] {
    const auto output = options.output.empty() ? std::filesystem::path(options.file).replace_extension()
                                               : std::filesystem::path(options.output);
    for (const auto& picture : plot_recording(read_recording(options.file), output))
      std::printf("%s\n", picture.c_str());
  });
}

void add_recordings(CLI::App& app, RecordingOptions& options, int& exit_code) {
  add_replay(app, options, exit_code);
  add_export(app, options);
  add_plot(app, options);
}

/// Adds the commands for a running daemon.
void add_control(CLI::App& app, ControlOptions& options, int& exit_code) {
  const auto add = [&](const char* name, const char* what, auto&& run) {
    CLI::App* command = app.add_subcommand(name, what);
    command->group("A daemon that runs");
    command
        ->add_option("--socket", options.socket,
                     "its control socket; without it $WRENCHD_SOCKET, then /run/wrenchd/control.sock, then\n"
                     "$XDG_RUNTIME_DIR/wrenchd/control.sock")
        ->check(not_empty());
    command->add_flag("--json", options.json, "what it says, as it says it");
    command->callback([run] { run(); });
    return command;
  };
  add("status", "State, cause and cure, device, limits, lease, and the times of ticks",
      [&] { run_status(options); });
  add("watch", "The status, then everything that happens, until Ctrl-C", [&] {
    run_watch(options);
  })->add_option("events", options.events, "names of events to show; without them all (wrenchctl describe)");
  add("arm", "Takes the lease and arms; Ctrl-C, or the end of this program, disarms", [&] {
    exit_code = run_arm(options);
  })->add_flag("--from-other", options.preempt, "administrators: take the lease from whoever has it");
  add("describe", "What can be asked of it, by whom; and its events", [&] {
    run_describe(options);
  })->add_option("method", options.method, "one method");
  CLI::App* record = add("record",
                         "Begins or ends a recording of every tick, says what is recorded, lists\n"
                         "recordings and fetches them",
                         [&] { run_record(options); });
  record->add_option("what", options.method, "start, stop, status, list or get")
      ->required()
      ->check(CLI::IsMember({"start", "stop", "status", "list", "get"}));
  record
      ->add_option(
          "file", options.file,
          "for start: a name, for the daemon's own directory; or, for administrators, a path. Without\n"
          "it a name of the time. For get: a name of the list")
      ->check(not_empty());
  record->add_option("-o,--output", options.output, "for get: where to; without it the same name here")
      ->check(not_empty());
  for (const auto& [name, what] : {std::pair{"disarm", "The force fades, whoever armed"},
                                   std::pair{"stop", "Emergency stop; anybody may"},
                                   std::pair{"acknowledge", "Somebody has looked at a fault, or a stop"},
                                   std::pair{"reload", "Reads the configuration again"}})
    add(name, what, [&options, name = name] { run_request(name, options); });
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("wrenchctl: talks to wrenchd, checks what it reads, and computes what it would feel.");
  app.set_version_flag("--version", std::string("wrenchctl ") + kVersion);
  app.footer(
      "Exit codes: 0 done; 1 refused (a file, its place and the cure are on standard error);\n"
      "2 mesh: not a solid; 3 solve: a pose had no admissible pose near it; 4 replay: a tick differs;\n"
      "5 doctor: something is wrong; "
      "over 100: the command line was not understood.");
  app.require_subcommand(0, 1);  // optional, so that an unknown command appears by name in the error
  int exit_code = 0;

  SolveOptions solve_options;
  add_solve(app, solve_options, exit_code);

  std::filesystem::path checked;
  CLI::App* check = app.add_subcommand("check",
                                       "Reads a configuration, scene, profile or hand script, and what it\n"
                                       "names, and says what is wrong with it");
  check->add_option("file", checked, "TOML file; its kind is told by what it holds")
      ->required()
      ->check(not_empty());
  std::filesystem::path device;
  check
      ->add_option("--against", device,
                   "for a profile: /dev/hidrawN, or a file with a report descriptor, that it has\n"
                   "to agree with")
      ->check(not_empty());
  check->callback([&] {
    MeshLoader meshes = mesh_loader();
    std::cout << check_file(checked, meshes);
    if (!device.empty()) std::cout << check_against_descriptor(checked, read_descriptor_source(device));
  });

  ReportOptions report_options;
  add_decode(app, report_options);
  add_encode(app, report_options);

  bool all_devices = false;
  add_devices(app, all_devices);

  RuleOptions rule_options;
  add_udev_rules(app, rule_options);

  add_doctor(app, exit_code);
  ControlOptions control_options;
  add_control(app, control_options, exit_code);

  ViewOptions view_options;
  add_view(app, view_options);

  FaultOptions fault_options;
  add_faults(app, fault_options);

  CalibrateOptions calibrate_options;
  add_calibrate(app, calibrate_options, exit_code);

  MeshOptions mesh_options;
  add_mesh(app, mesh_options, exit_code);

  ProfileOptions profile_options;
  add_profile(app, profile_options);

  std::string exhibit;
  add_gallery(app, exhibit);

  std::filesystem::path paper_directory = "wrenchd-paper";
  add_paper(app, paper_directory);

  RecordingOptions recording_options;
  add_recordings(app, recording_options, exit_code);

  try {
    app.parse(argc, argv);
    if (app.get_subcommands().empty())
      throw CLI::RequiredError(
          "A subcommand (status, watch, view, arm, disarm, stop, acknowledge, reload, record, describe; "
          "solve, "
          "check, decode, devices, doctor, encode, export, faults, gallery, mesh, profile, paper, plot, "
          "replay or "
          "udev-rules)");
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
      throw std::runtime_error("standard output: cannot be written; is the disk full?");
    return exit_code;
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "wrenchctl: %s\n", error.what());
    return kExitRefused;
  }
}
