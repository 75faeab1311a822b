// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/completion_names.hpp"

#include <chrono>
#include <stdexcept>

#include <wrenchd/client.hpp>

#include "config/nearest_key.hpp"
#include "config/rendering_values.hpp"
#include "config/toml_files.hpp"
#include "core/fault.hpp"
#include "core/generated_mesh.hpp"
#include "tools/daemon_call.hpp"

namespace wrenchd {
namespace {

/// A person waits for the completion, so it gives up early.
constexpr auto kTimeout = std::chrono::milliseconds(500);

std::vector<std::string> stems(const char* folder, const SearchPath& search) {
  std::vector<std::string> names;
  for (const std::filesystem::path& file : toml_files(folder, search)) names.push_back(file.stem().string());
  return names;
}

/// Returns the names in an array of the daemon's response; none if no daemon responds.
std::vector<std::string> asked(const char* method, const char* array, const ControlOptions& options) {
  std::vector<std::string> names;
  try {
    Client client(options.socket, kTimeout);
    const Json result = call(client, method);
    for (const Json& row : result[array]) names.push_back(row["name"]);
  } catch (const ClientError&) {
    names.clear();
  }
  return names;
}

}  // namespace

const std::vector<std::string>& completion_kinds() {
  static const std::vector<std::string> kinds = {"gallery",  "profiles", "scenes",  "faults", "meshes",
                                                 "settings", "values",   "methods", "events", "obstacles"};
  return kinds;
}

std::vector<std::string> completion_names(const std::string& kind, const std::string& name,
                                          const SearchPath& search, const ControlOptions& options) {
  if (kind == "gallery" || kind == "profiles" || kind == "scenes") return stems(kind.c_str(), search);
  if (kind == "methods" || kind == "events") return asked("describe", kind.c_str(), options);
  if (kind == "obstacles") return asked("scene.get", "obstacles", options);
  std::vector<std::string> names;
  if (kind == "faults")
    for (const FaultRow& row : fault_rows()) names.emplace_back(row.name);
  else if (kind == "meshes")
    for (const MeshKind& mesh : mesh_kinds()) names.push_back(mesh.name);
  else if (kind == "settings")
    for (const RenderingValue& value : rendering_values()) names.emplace_back(value.name);
  else if (kind == "values") {
    for (const RenderingValue& value : rendering_values())
      if (value.name == name || value.name.ends_with("." + name)) return accepted_words(value);
  } else {
    throw std::runtime_error("names: there is no kind '" + kind + "'" +
                             nearest_name_advice(kind, completion_kinds()));
  }
  return names;
}

}  // namespace wrenchd
