// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/reconfigurator.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include "collision/touch.hpp"
#include "config/load_scene.hpp"
#include "config/load_settings.hpp"
#include "config/scene_text.hpp"
#include "config/search_path.hpp"
#include "config/setting_table.hpp"
#include "core/files/absolute_name.hpp"
#include "core/finite.hpp"
#include "daemon/control/scene_cost.hpp"

namespace wrenchd {
namespace {

/// Longest wait for the crossfade to the previous rendering. It covers the longest soft start. Only a search
/// for a feasible pose takes longer.
constexpr auto kMaxCrossfadeWait = std::chrono::seconds(2);
/// Largest gain of a local model. The loop scales the gain further to what is stable.
constexpr double kMaxModelGain = 1e5;
constexpr auto kWaitPeriod = std::chrono::milliseconds(5);

/// "cube, post, floor"
std::string names(const SceneSettings& scene) {
  std::string all;
  for (const HalfSpaceSettings& obstacle : scene.half_spaces)
    all += (all.empty() ? "" : ", ") + obstacle.name;
  for (const MeshObstacleSettings& obstacle : scene.meshes) all += (all.empty() ? "" : ", ") + obstacle.name;
  return all.empty() ? "none" : all;
}

[[noreturn]] void reject_unknown(const std::string& name, const SceneSettings& scene) {
  throw std::invalid_argument("there is no obstacle '" + name + "' in the scene; there are: " + names(scene));
}

/// Starts all obstacle motions at this scene time.
void start_motions(double now_s, SceneSettings& scene) {
  for (MeshObstacleSettings& obstacle : scene.meshes) obstacle.motion.start_s = now_s;
}

/// Replaces a finished motion by the pose at its end.
void finish_motion(MeshObstacleSettings& obstacle, double now_s) {
  if (obstacle.scheduled && now_s >= obstacle.scheduled->start_s) {
    obstacle.X_WM = obstacle.scheduled->X_WO;
    obstacle.motion = obstacle.scheduled->motion;
    obstacle.scheduled.reset();
  }
  const ObstacleMotion& motion = obstacle.motion;
  if (!(motion.duration_s > 0.0) || now_s < motion.start_s + motion.duration_s) return;
  obstacle.X_WM = motion.pose_at(obstacle.X_WM, now_s);
  obstacle.motion = {};
}

double least_time_s(const ObstacleMotion& motion) {
  return motion.duration_s *
         std::max(motion.linear_m_per_s.norm() / ObstacleMotion::kMaxSpeed_m_per_s,
                  motion.angular_rad_per_s.norm() / ObstacleMotion::kMaxAngularSpeed_rad_per_s);
}

std::vector<std::string> names_of(const Scene& scene) {
  std::vector<std::string> names;
  for (std::uint32_t i = 0; i < scene.obstacle_count() + scene.bodies().size(); ++i)
    names.push_back(obstacle_name(scene, i));
  return names;
}

/// Returns a text that changes if a file of the scene changes.
std::string files_fingerprint(const SceneSettings& scene) {
  std::string text = scene.file.string() + '\n' + scene.text;
  const auto add = [&text](const std::filesystem::path& mesh) {
    std::error_code error;
    text += '\n' + mesh.string() + ' ' + std::to_string(std::filesystem::file_size(mesh, error)) + ' ' +
            std::to_string(std::filesystem::last_write_time(mesh, error).time_since_epoch().count());
  };
  const auto add_all = [&add](const std::vector<std::filesystem::path>& meshes) {
    for (const std::filesystem::path& mesh : meshes) add(mesh);
  };
  add_all(mesh_files(scene.tool));
  for (const MeshObstacleSettings& obstacle : scene.meshes) add_all(mesh_files(obstacle));
  for (const BodySettings& body : scene.bodies) add_all(mesh_files(body.shape));
  return text;
}

/// Returns why the loop cannot apply a changed setting now; empty if it can. wanted: present settings with
/// the new value of this setting.
std::string reason_not_to_apply(const Setting& setting, const Settings& present, const Settings& wanted,
                                const DeviceProfile& profile, bool armed) {
  if (setting.effect == Setting::Effect::restart) return "requires a restart";
  if (setting.effect != Setting::Effect::limits || !armed) return {};
  Settings allowed = wanted;
  allowed.limits = tighter(present.limits, wanted.limits, profile);
  if (setting.equal(allowed, wanted)) return {};
  return "is looser than " + to_text(setting.number(present)) +
         ", which holds as long as the loop is armed; disarm, and reload again";
}

}  // namespace

Reconfigurator::Reconfigurator(RunConfig config, std::shared_ptr<const Scene> scene, ServoLoop& loop,
                               ProxySearchMode proxy_search_mode, MeshLoader loader, MeshLoader loaded)
    : config_(std::move(config)),
      file_settings_(config_.settings),
      profile_text_(config_.profile_texts.empty() ? "" : config_.profile_texts.front().text),
      scene_fingerprint_(files_fingerprint(config_.scene)),
      scene_(std::move(scene)),
      loop_(loop),
      proxy_search_mode_(proxy_search_mode),
      loader_(std::move(loader)),
      loaded_(std::make_shared<const MeshLoader>(std::move(loaded))),
      contacts_(config_.settings.rendering.contacts),
      present_(std::make_shared<const PresentScene>(
          PresentScene{config_.scene, config_.scene.text, names_of(*scene_), 0, loaded_})) {}

/// Builds a scene. meshes: reads the files; meshes that it has loaded are used as they are.
Reconfigurator::BuiltScene Reconfigurator::build_scene(const SceneSettings& scene, MeshLoader meshes,
                                                       const FileScope& scope) {
  meshes.set_scope(scope);
  meshes.begin_scene();
  auto built = std::make_shared<const Scene>(scene, meshes);
  meshes.drop_unused();
  std::vector<std::string> warnings = meshes.changes();
  warnings.insert(warnings.end(), meshes.warnings().begin(), meshes.warnings().end());
  return {std::move(built), std::move(warnings), std::make_shared<const MeshLoader>(std::move(meshes))};
}

/// Builds a scene whose obstacle motions start now, and sets their start times in `scene`. Reads its files.
Reconfigurator::BuiltScene Reconfigurator::build_starting_scene(SceneSettings& scene,
                                                                const FileScope& scope) {
  BuiltScene built = build_scene(scene, loader_, scope);
  start_motions(scene_time_s(), scene);
  if (built.scene->has_moving_obstacles())
    built.scene = std::make_shared<const Scene>(*built.scene, scene.meshes);
  return built;
}

/// Throws std::invalid_argument if there are two hands: both render one scene, and no mechanism exchanges the
/// renderings of two loops in the same tick.
void Reconfigurator::reject_with_two_hands() const {
  if (config_.two_hands())
    throw std::invalid_argument(
        "two hands share the scene and its rendering, which do not change while they run; change the file "
        "and start wrenchd again");
}

/// The bodies of a scene that is built again start at rest where they are now.
void Reconfigurator::keep_bodies(SceneSettings& scene) {
  const BodyPoses X_WB = loop_.telemetry().handle_pose().X_WB;
  if (X_WB.size() != scene.bodies.size()) return;  // the loop still renders another scene
  for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
    BodySettings& body = scene.bodies[i];
    body.X_WM = X_WB[i] * inverse(scene_->bodies()[i].body.X_MT());
    body.velocity_m_per_s.setZero();
    body.spin_rad_per_s.setZero();
  }
}

/// Returns the present scene, built again if its smoothing changes. scene: its settings, which get the new
/// value.
Reconfigurator::BuiltScene Reconfigurator::with_smoothing(SceneSettings& scene, double smoothing_m) {
  if (scene.smoothing_m == smoothing_m) return {scene_, {}, loaded_};
  scene.smoothing_m = smoothing_m;
  keep_bodies(scene);
  return build_scene(scene, *loaded_, FileScope());
}

FileScope Reconfigurator::client_scope() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::filesystem::path> directories = SearchPath().directories();
  for (const std::filesystem::path& file : {file_settings_.file, file_settings_.scene})
    if (!file.empty()) directories.push_back(absolute_name(file).parent_path());
  return FileScope::beneath(directories);
}

/// Virtual time has no warm-up: its result depends on the speed of the machine.
std::unique_ptr<Rendering> Reconfigurator::build_rendering(const Settings& settings,
                                                           std::shared_ptr<const Scene> scene) {
  auto initializer = make_proxy_initializer(scene, proxy_search_mode_, settings.rendering.contacts);
  auto rendering = std::make_unique<Rendering>(rendering_id_ + 1, settings, config_.profile, std::move(scene),
                                               std::move(initializer));
  const HandlePose hand = loop_.telemetry().handle_pose();
  if (proxy_search_mode_ == ProxySearchMode::background) rendering->warm_up(hand.X_WH, hand.scene_time_s);
  return rendering;
}

void Reconfigurator::offer(std::unique_ptr<Rendering> rendering, const Settings& settings,
                           SceneSettings scene, std::string text, BuiltScene built) {
  config_.settings = settings;
  contacts_.store(settings.rendering.contacts);
  config_.scene = std::move(scene);
  scene_ = std::move(built.scene);
  loaded_ = std::move(built.meshes);
  rendering_id_ = rendering->id();
  checksum_ = rendering->checksum();
  auto present = std::make_shared<const PresentScene>(
      PresentScene{config_.scene, std::move(text), names_of(*scene_), rendering_id_, loaded_});
  {
    const std::lock_guard present_lock(present_mutex_);
    present_ = std::move(present);
  }
  loop_.requests().renderings().offer(std::move(rendering));
}

void Reconfigurator::replace_scene(const std::filesystem::path& file, const FileScope& scope) {
  const std::lock_guard lock(mutex_);
  reject_with_two_hands();
  SceneSettings scene = load_scene(file, scope);
  scene.smoothing_m = config_.settings.rendering.smoothing_m;
  std::string text = scene.text;
  check_scene_cost(scene, config_.scene);
  BuiltScene built = build_starting_scene(scene, scope);
  Settings settings = config_.settings;
  settings.scene = file;
  auto rendering = build_rendering(settings, built.scene);
  offer(std::move(rendering), settings, std::move(scene), std::move(text), std::move(built));
}

std::string Reconfigurator::insert_obstacle(const TomlNode& obstacle, const std::filesystem::path& source,
                                            const FileScope& scope) {
  const std::lock_guard lock(mutex_);
  reject_with_two_hands();
  SceneSettings scene = config_.scene;
  const std::size_t half_spaces = scene.half_spaces.size();
  add_obstacle(obstacle, source, scene, scope);
  check_scene_cost(scene, config_.scene);
  const bool is_half_space = scene.half_spaces.size() > half_spaces;
  const double now = scene_time_s();
  if (!is_half_space) scene.meshes.back().motion.start_s = now;
  for (MeshObstacleSettings& mesh : scene.meshes) finish_motion(mesh, now);
  keep_bodies(scene);
  BuiltScene built = build_scene(scene, *loaded_, scope);
  std::string name = is_half_space ? scene.half_spaces.back().name : scene.meshes.back().name;
  auto rendering = build_rendering(config_.settings, built.scene);
  std::string text = scene_text(scene, scene_time_s());
  offer(std::move(rendering), config_.settings, std::move(scene), std::move(text), std::move(built));
  return name;
}

void Reconfigurator::remove_obstacle(const std::string& name) {
  const std::lock_guard lock(mutex_);
  reject_with_two_hands();
  SceneSettings scene = config_.scene;
  const auto is_it = [&name](const auto& obstacle) { return obstacle.name == name; };
  if (std::erase_if(scene.half_spaces, is_it) + std::erase_if(scene.meshes, is_it) == 0)
    reject_unknown(name, scene);
  for (MeshObstacleSettings& mesh : scene.meshes) finish_motion(mesh, scene_time_s());
  keep_bodies(scene);
  BuiltScene built = build_scene(scene, *loaded_, FileScope());
  auto rendering = build_rendering(config_.settings, built.scene);
  std::string text = scene_text(scene, scene_time_s());
  offer(std::move(rendering), config_.settings, std::move(scene), std::move(text), std::move(built));
}

/// Waits until the loop has taken the last rendering and finished its crossfade. Otherwise an obstacle could
/// start to move before the loop renders it. Returns early if the loop does not tick. Throws BusyError after
/// kMaxCrossfadeWait.
void Reconfigurator::wait_until_idle() {
  const auto idle = [this] {
    return loop_.requests().renderings().taken() && !loop_.telemetry().crossfading();
  };
  if (idle()) return;
  const auto busy = [] {
    throw BusyError("another change of the rendering is in progress; repeat the request in a moment");
  };
  if (proxy_search_mode_ == ProxySearchMode::in_tick) busy();
  const auto end = std::chrono::steady_clock::now() + kMaxCrossfadeWait;
  const std::uint64_t ticks = loop_.telemetry().timing().tick.count();
  while (!idle()) {
    if (std::chrono::steady_clock::now() > end) {
      if (loop_.telemetry().timing().tick.count() == ticks) return;
      busy();
    }
    std::this_thread::sleep_for(kWaitPeriod);
  }
}

void Reconfigurator::move_obstacle(const std::string& name, const Pose& X_WO, double duration_s) {
  const std::lock_guard lock(mutex_);
  reject_with_two_hands();
  SceneSettings scene = config_.scene;
  const auto is_it = [&name](const auto& obstacle) { return obstacle.name == name; };
  const auto mesh = std::find_if(scene.meshes.begin(), scene.meshes.end(), is_it);
  if (mesh == scene.meshes.end()) {
    if (std::any_of(scene.half_spaces.begin(), scene.half_spaces.end(), is_it))
      throw std::invalid_argument("'" + name +
                                  "' is a half_space, which cannot move; use a mesh for a moving obstacle");
    reject_unknown(name, scene);
  }
  if (!is_finite(X_WO)) throw std::invalid_argument("the pose of '" + name + "' is not finite");
  if (!(duration_s > 0.0) || !(duration_s <= 86400.0))
    throw std::invalid_argument("duration_s: expected more than 0 and at most 86400 s, found " +
                                to_text(duration_s));
  wait_until_idle();
  const double now = scene_time_s(), begin = now + kMoveDelay_s;
  for (MeshObstacleSettings& obstacle : scene.meshes) finish_motion(obstacle, now);
  if (mesh->scheduled)
    throw BusyError("'" + name + "' has a motion that has not started yet; repeat the request in " +
                    to_text(kMoveDelay_s) + " s");
  const Pose X_begin = mesh->motion.pose_at(mesh->X_WM, begin);
  const ObstacleMotion motion = ObstacleMotion::between(X_begin, X_WO, begin, duration_s);
  if (const double least_s = least_time_s(motion); least_s > duration_s)
    throw std::invalid_argument("'" + name + "' would exceed the highest speed of an obstacle (" +
                                to_text(ObstacleMotion::kMaxSpeed_m_per_s) + " m/s, " +
                                to_text(ObstacleMotion::kMaxAngularSpeed_rad_per_s) +
                                " rad/s); give it at least duration_s = " + to_text(least_s));
  mesh->scheduled = {begin, X_begin, motion};
  BuiltScene built{std::make_shared<const Scene>(*scene_, scene.meshes), {}, loaded_};
  auto rendering = build_rendering(config_.settings, built.scene);
  std::string text = scene_text(scene, scene_time_s());
  offer(std::move(rendering), config_.settings, std::move(scene), std::move(text), std::move(built));
}

std::vector<ChangedValue> Reconfigurator::set_rendering(const TomlNode& changes,
                                                        const std::filesystem::path& source) {
  const std::lock_guard lock(mutex_);
  reject_with_two_hands();
  Settings settings = config_.settings;
  change_rendering(changes, source, settings);
  std::vector<ChangedValue> changed = changed_values(config_.settings, settings);
  SceneSettings scene = config_.scene;
  BuiltScene built = with_smoothing(scene, settings.rendering.smoothing_m);
  auto rendering = build_rendering(settings, built.scene);
  offer(std::move(rendering), settings, std::move(scene), present_scene()->text, std::move(built));
  return changed;
}

void Reconfigurator::set_workspace(const WorkspaceRequest& request) {
  workspace_ = request;
  loop_.requests().set_workspace(request);
}

void Reconfigurator::set_scale(double scale) {
  const std::lock_guard lock(mutex_);
  if (!(scale >= WorkspaceRequest::kMinScale && scale <= WorkspaceRequest::kMaxScale))
    throw std::invalid_argument("scale: expected " + to_text(WorkspaceRequest::kMinScale) + " to " +
                                to_text(WorkspaceRequest::kMaxScale) + ", found " + to_text(scale));
  WorkspaceRequest request = workspace_;
  request.scale = scale;
  set_workspace(request);
}

void Reconfigurator::set_clutched(bool clutched) {
  const std::lock_guard lock(mutex_);
  WorkspaceRequest request = workspace_;
  request.clutched = clutched;
  set_workspace(request);
}

void Reconfigurator::recentre() {
  const std::lock_guard lock(mutex_);
  WorkspaceRequest request = workspace_;
  ++request.recentre_count;
  set_workspace(request);
}

/// Returns the models that have another id and have not expired.
LocalModelSet Reconfigurator::other_models(std::uint32_t id) {
  const TimePoint now = loop_.telemetry().handle_pose().at;
  LocalModelSet others;
  for (const LocalModel& model : models_)
    if (model.id != id && model.expires > now) others.add(model);
  return others;
}

void Reconfigurator::set_model(LocalModel model, double lifetime_s) {
  const std::lock_guard lock(mutex_);
  const auto expect = [](double x, double most, const char* name) {
    if (!(x >= 0.0 && x <= most))
      throw std::invalid_argument(std::string(name) + ": expected 0 to " + to_text(most) + ", found " +
                                  to_text(x));
  };
  if (config_.profile.wrench_point == WrenchPoint::world_origin)
    throw std::invalid_argument(
        "local models need a wrench about the handle, and the profile of this device names the world origin");
  if (!(lifetime_s > 0.0 && lifetime_s <= LocalModel::kMaxLifetime_s))
    throw std::invalid_argument("lifetime_s: expected more than 0 and at most " +
                                to_text(LocalModel::kMaxLifetime_s) + ", found " + to_text(lifetime_s) +
                                "; to keep a model, send it again");
  expect(model.stiffness_N_per_m, kMaxModelGain, "stiffness_N_per_m");
  expect(model.stiffness_Nm_per_rad, kMaxModelGain, "stiffness_Nm_per_rad");
  expect(model.damping_N_s_per_m, kMaxModelGain, "damping_N_s_per_m");
  expect(model.damping_Nm_s_per_rad, kMaxModelGain, "damping_Nm_s_per_rad");
  if (!is_finite(model.normal_W) || !is_finite(model.offset_m) || !is_finite(model.X_WA))
    throw std::invalid_argument("the pose of the model is not finite");
  const double length = model.normal_W.norm();
  if (!(length > 1e-9)) throw std::invalid_argument("normal: must not be zero; it points out of the solid");
  model.normal_W /= length;
  model.offset_m /= length;
  model.X_WA.rotation.normalize();
  model.expires = loop_.telemetry().handle_pose().at + from_seconds(lifetime_s);
  LocalModelSet models = other_models(model.id);
  if (!models.add(model))
    throw std::invalid_argument("there are " + std::to_string(kMaxLocalModels) +
                                " local models already; remove one, or let it expire");
  models_ = models;
  loop_.requests().set_local_models(models_);
}

void Reconfigurator::remove_model(std::uint32_t id) {
  const std::lock_guard lock(mutex_);
  models_ = other_models(id);
  loop_.requests().set_local_models(models_);
}

/// Applies every setting that the files have changed since the last reload and that the loop can take now.
/// file: settings that were read from the files. Scene and profile are compared by their files instead.
Reconfigurator::ReloadedSettings Reconfigurator::reload_settings(const Settings& file) const {
  ReloadedSettings result{.present = config_.settings, .from_files = file_settings_};
  const bool armed = loop_.telemetry().state() == State::waiting || is_driving(loop_.telemetry().state());
  for (const Setting& setting : setting_table()) {
    if (setting.effect == Setting::Effect::scene || setting.effect == Setting::Effect::none) continue;
    if (setting.equal(file, file_settings_)) continue;
    Settings wanted = result.present;
    setting.copy(file, wanted);
    const std::string reason = reason_not_to_apply(setting, result.present, wanted, config_.profile, armed);
    if (!reason.empty()) {
      result.not_applied.push_back(setting.name() + ": " + reason);
      continue;
    }
    result.limits_changed |= setting.effect == Setting::Effect::limits;
    result.rendering_changed |= setting.effect == Setting::Effect::new_rendering;
    result.present = wanted;
    setting.copy(file, result.from_files);
    result.applied.push_back(setting.name());
  }
  return result;
}

bool Reconfigurator::is_profile_changed(const RunConfig& config) const {
  return config.settings.device.profile == file_settings_.device.profile && !config.profile_texts.empty() &&
         config.profile_texts.front().text != profile_text_;
}

/// Builds the scene if its name or one of its files has changed since the last reload, or the smoothing of
/// its surfaces changes.
Reconfigurator::ReloadedScene Reconfigurator::reload_scene(const SceneSettings& scene) {
  std::string fingerprint = files_fingerprint(scene);
  if (fingerprint == scene_fingerprint_) {
    SceneSettings settings = config_.scene;
    BuiltScene built = with_smoothing(settings, scene.smoothing_m);
    return {false, std::move(fingerprint), std::move(settings), present_scene()->text, std::move(built)};
  }
  SceneSettings settings = scene;
  std::string text = scene.text;
  BuiltScene built = build_starting_scene(settings, FileScope());
  return {true, std::move(fingerprint), std::move(settings), std::move(text), std::move(built)};
}

ReloadResult Reconfigurator::reload(const std::function<RunConfig()>& read) {
  const std::lock_guard lock(mutex_);
  reject_with_two_hands();
  const RunConfig config = read();
  ReloadedSettings settings = reload_settings(config.settings);
  SceneSettings new_scene = config.scene;
  new_scene.smoothing_m = settings.present.rendering.smoothing_m;
  ReloadedScene scene = reload_scene(new_scene);
  if (is_profile_changed(config))
    settings.not_applied.emplace_back("the device profile was changed: requires a restart");
  if (config.two_hands()) settings.not_applied.emplace_back("hand: requires a restart");
  if (scene.changed) {
    settings.present.scene = settings.from_files.scene = config.settings.scene;
    settings.applied.emplace_back("scene");
  }
  std::unique_ptr<Rendering> rendering;
  if (settings.rendering_changed || scene.changed)
    rendering = build_rendering(settings.present, scene.built.scene);

  // Everything is valid.
  const std::vector<std::string> mesh_warnings = scene.built.mesh_warnings;
  if (settings.limits_changed) loop_.requests().set_limits(settings.present.limits);
  config_.settings = settings.present;
  file_settings_ = settings.from_files;
  scene_fingerprint_ = scene.fingerprint;
  if (rendering)
    offer(std::move(rendering), settings.present, std::move(scene.settings), std::move(scene.text),
          std::move(scene.built));
  return {settings.applied, settings.not_applied, mesh_warnings};
}

Settings Reconfigurator::settings() const {
  const std::lock_guard lock(mutex_);
  return config_.settings;
}

std::shared_ptr<const Reconfigurator::PresentScene> Reconfigurator::present_scene() const {
  const std::lock_guard present_lock(present_mutex_);
  return present_;
}

WorkspaceRequest Reconfigurator::workspace() const {
  const std::lock_guard lock(mutex_);
  return workspace_;
}

Reconfigurator::CurrentRendering Reconfigurator::current_rendering() const {
  const std::lock_guard lock(mutex_);
  return {rendering_id_, checksum_};
}

Reconfigurator::ObstacleNames Reconfigurator::obstacle_names() const {
  const auto present = present_scene();
  return {present->rendering_id, present->obstacle_names};
}

Pose Reconfigurator::present_pose(const MeshObstacleSettings& obstacle) {
  const std::lock_guard lock(mutex_);
  const double now = scene_time_s();
  if (obstacle.scheduled && now >= obstacle.scheduled->start_s)
    return obstacle.scheduled->motion.pose_at(obstacle.scheduled->X_WO, now);
  return obstacle.motion.pose_at(obstacle.X_WM, now);
}

Reconfigurator::SceneView Reconfigurator::scene_view() {
  const std::lock_guard lock(mutex_);
  const HandlePose pose = loop_.telemetry().handle_pose();
  const DeviceSettings& device = config_.settings.device;
  // The configured camera belongs to the configured scene. A scene that a client has loaded has no camera.
  const bool configured = config_.settings.scene == file_settings_.scene;
  return {scene_,
          rendering_id_,
          pose.at - from_seconds(pose.scene_time_s),
          device.base_in_world.pose(),
          device.tool_in_handle.pose() * scene_->tool().X_MT(),
          config_.profile.wrench_point,
          configured ? config_.settings.view : ViewSettings{}};
}

}  // namespace wrenchd
