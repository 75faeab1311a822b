// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/view.hpp"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include <spawn.h>
#include <unistd.h>

#include "collision/meshes/mesh_source.hpp"
#include "daemon/control/scene_geometry.hpp"
#include "daemon/hand_scenes.hpp"
#include "daemon/recording/recorded_inputs.hpp"
#include "daemon/recording/recorded_run.hpp"
#include "tools/view/address_file.hpp"
#include "tools/view/live_feed.hpp"
#include "tools/view/recorded_feed.hpp"
#include "tools/view/view_server.hpp"

namespace wrenchd {
namespace {

/// Opens a file in the user's browser. Returns false if xdg-open is missing.
bool open_in_browser(const std::filesystem::path& file) {
  std::string program = "xdg-open", name = file.string();
  char* const words[] = {program.data(), name.data(), nullptr};
  pid_t pid = -1;
  return posix_spawnp(&pid, program.c_str(), nullptr, nullptr, words, environ) == 0;
}

void serve(ViewServer& server, const ViewOptions& options) {
  const std::string wanted = ":" + std::to_string(options.port) + "/";
  if (options.port != 0 && server.url().find(wanted) == std::string::npos)
    std::fprintf(stderr, "wrenchctl: port %u is taken; another one serves the page\n",
                 unsigned{options.port});
  std::printf("%s\n", server.url().c_str());
  std::fflush(stdout);
  std::optional<AddressFile> address;
  if (options.open_browser) {
    address.emplace(server.url());
    server.on_first_page([&address] { address->remove(); });
    if (!open_in_browser(address->path()))
      std::fputs("wrenchctl: xdg-open is missing; open the address by hand\n", stderr);
  }
  server.run();
}

/// Loads the scene that the recording contains.
std::shared_ptr<const ViewScene> scene_of(const Recording& recording, const RunConfig& plan) {
  MeshLoader meshes(cache_directory(),
                    [](const std::string& what) { std::fprintf(stderr, "wrenchctl: %s\n", what.c_str()); });
  auto scene = std::make_shared<const Scene>(plan.scene, meshes);
  if (hands_have_same_tool(recording.header)) scene = with_equal_tool(*scene, plan.settings.rendering);
  const SceneGeometry shapes(scene);
  Json description = shapes.description(*scene);
  const DeviceSettings& device = plan.settings.device;
  description["geometry_id"] = 1;
  description["rendering_id"] = 0;
  // Scene time starts at tick 0. If the recording starts later, extrapolates with the nominal period.
  const TickRecord& first = recording.ticks.front();
  description["scene_time_begins_ns"] =
      first.now_ns - std::llround(1e9 * static_cast<double>(first.tick) / plan.settings.servo.rate_Hz);
  description["X_WB"] = pose_json(device.base_in_world.pose());
  description["X_HT"] = pose_json(device.tool_in_handle.pose() * scene->tool().X_MT());
  description["wrench_about"] = plan.profile.wrench_point == WrenchPoint::handle ? "handle" : "world origin";
  description["view"] = view_json(plan.settings.view);
  return std::make_shared<const ViewScene>(description, shapes.bytes());
}

}  // namespace

void run_view(const ViewOptions& options) {
  PageFiles files(PageFiles::directory());
  if (options.recording.empty()) {
    LiveFeed feed(options.socket);
    ViewServer server(options.port, std::move(files), feed);
    return serve(server, options);
  }
  std::optional<RecordedFeed> compared;  // read first: if it cannot be opened, no scene is prepared in vain
  if (!options.compared.empty())
    compared.emplace(options.compared.filename().string(), read_recording(options.compared), nullptr, "");
  Recording recording = read_recording(options.recording);
  std::shared_ptr<const ViewScene> scene;
  std::string why;
  if (!recording.ticks.empty()) try {
      const RecordedRun run(recording.header);
      scene = scene_of(recording, run.config());
    } catch (const std::exception& error) {
      why = error.what();
      std::fprintf(stderr, "wrenchctl: the scene cannot be shown: %s\n", why.c_str());
    }
  const RecordedFeed feed(options.recording.filename().string(), std::move(recording), std::move(scene), why);
  ViewServer server(options.port, std::move(files), feed);
  if (compared) {
    if (!compared->has_scene_of(feed))
      std::fprintf(stderr, "wrenchctl: %s has another scene; its tool is drawn with the shape of %s\n",
                   compared->name().c_str(), feed.name().c_str());
    server.compare_with(*compared);
  }
  serve(server, options);
}

}  // namespace wrenchd
