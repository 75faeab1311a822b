// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/daemon_run.hpp"

#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>

#include <spdlog/spdlog.h>

#include "config/load_loopback_script.hpp"
#include "daemon/control/control_interface.hpp"
#include "daemon/control/event_feed.hpp"
#include "daemon/control/record_methods.hpp"
#include "daemon/control/scene_methods.hpp"
#include "daemon/control/state_methods.hpp"
#include "daemon/device_run.hpp"
#include "daemon/device_start.hpp"
#include "daemon/realtime.hpp"
#include "daemon/recording/recordings.hpp"
#include "daemon/version.hpp"
#include "daemon/virtual_time_run.hpp"
#include "daemon/wall_time_run.hpp"
#include "devices/links/simulated_link.hpp"
#include "devices/links/socket_link.hpp"

namespace wrenchd {
namespace {

/// Time between two checks for a reload request.
constexpr auto kReloadPeriod = std::chrono::milliseconds(100);

/// Reads the configuration again and applies it. Notifies the service manager and the event feed. Throws as
/// Reconfigurator::reload().
ReloadResult reload_all(Runtime& runtime, EventFeed& feed, const RunContext& context) {
  struct Notification {
    explicit Notification(ServiceNotify& service_manager) : service(service_manager) { service.reloading(); }
    ~Notification() { service.reloaded(); }
    ServiceNotify& service;
  };
  const Notification notification(context.service);
  return reload_config(runtime.reconfigurator(), feed,
                       [&context] { return load_run_config(context.options); });
}

/// Opens the control socket. Returns null if the configuration asks for none, in virtual time, and if another
/// daemon uses the default path. Throws std::runtime_error if an explicitly named path cannot be used.
std::unique_ptr<ControlInterface> open_control(Runtime& runtime, EventFeed& feed, Recordings& recordings,
                                               const RunContext& context) {
  const SocketPath socket = choose_socket_path(context.options.control, runtime.config().settings.control);
  if (socket.path.empty() || context.options.virtual_time) return nullptr;
  auto control = std::make_unique<ControlInterface>(runtime, feed);
  try {
    add_state_methods(control->methods(), runtime);
    add_scene_methods(control->methods(), runtime.reconfigurator(),
                      [&] { return reload_all(runtime, feed, context); });
    add_record_methods(control->methods(), recordings);
    control->status_sections()["recording"] = [&recordings] { return recording_json(recordings); };
    control->open(socket.path);
    spdlog::info("control socket: {}", socket.path.string());
    return control;
  } catch (const std::runtime_error& error) {
    if (socket.explicitly_named) throw;
    spdlog::warn("no control socket: {}", error.what());
    return nullptr;
  }
}

/// Reads the configuration again after each SIGHUP, on a thread of its own: reading meshes may take seconds.
class ReloadThread {
 public:
  ReloadThread(Runtime& runtime, EventFeed& feed, const RunContext& context)
      : thread_([&runtime, &feed, context](const std::stop_token& stop) {
          while (!stop.stop_requested()) {
            try {
              if (context.signals.take_reload_request()) reload_all(runtime, feed, context);
            } catch (const std::exception& error) {
              // The event of the feed, which every observer receives, quotes nothing. The log does.
              spdlog::error("reload: {}", error.what());
            }
            std::this_thread::sleep_for(kReloadPeriod);
          }
        }) {}

 private:
  std::jthread thread_;
};

using RunLoop = std::function<Fault(Runtime&, Recordings&, LiveView&)>;

/// Builds the runtime on its link, opens recordings and control socket, and runs the loop by `run_loop`.
Fault run_on_link(RunConfig config, const RunContext& context, ReportLink& link, Clock& clock,
                  const RunLoop& run_loop) {
  const bool virtual_time = context.options.virtual_time;
  Runtime runtime(std::move(config), link, clock,
                  virtual_time ? ProxySearchMode::in_tick : ProxySearchMode::background,
                  MeshLoader(cache_directory(), [](const std::string& text) { spdlog::info("{}", text); }));
  const SignalTarget signal_target(runtime.loop());
  const Settings& settings = runtime.config().settings;
  for (const std::string& remark : runtime.mesh_remarks()) spdlog::warn("{}", remark);
  spdlog::info("wrenchd {}: device {}, tool of {} hull vertices, {} obstacles, {} Hz", kVersion,
               runtime.config().profile.name, runtime.scene().tool().hull.vertices_T_m.size(),
               runtime.scene().obstacle_count(), settings.servo.rate_Hz);
  LiveView view(context.options.live, runtime.config().profile);
  Fault fault = Fault::none;
  double run_s = 0.0;
  {
    EventFeed feed(runtime.loop());
    Recordings recordings(runtime, feed, clock,
                          virtual_time ? Recordings::Pace::manual : Recordings::Pace::threads);
    if (!settings.recording.file.empty()) recordings.start_file(settings.recording.file);
    const auto control = open_control(runtime, feed, recordings, context);
    const ReloadThread reload_thread(runtime, feed, context);
    const TimePoint start = clock.now();
    fault = run_loop(runtime, recordings, view);
    run_s = seconds(clock.now() - start);
  }
  view.close(runtime.loop(), run_s);
  return fault;
}

TimePoint end_time(const Options& options, const Clock& clock) {
  return options.seconds > 0.0 ? clock.now() + from_seconds(options.seconds) : TimePoint::max();
}

/// Returns the simulated device with the faults of the script.
std::unique_ptr<SimulatedLink> make_scripted_link(const RunConfig& config, const LoopbackScript& script,
                                                  Clock& clock) {
  auto link = make_simulated_link(config.profile, config.settings.simulation, clock);
  for (const SimulatedFault& fault : script.faults) try {
      link->device().inject(fault);
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(script.file.string() + ": " + error.what());
    }
  return link;
}

Fault run_simulated_in_virtual_time(RunConfig config, const RunContext& context,
                                    const LoopbackScript& script) {
  VirtualClock clock;
  const auto link = make_scripted_link(config, script, clock);
  return run_on_link(std::move(config), context, *link, clock,
                     [&](Runtime& runtime, Recordings& recordings, LiveView& view) {
                       runtime.open();
                       log_missing_motors(runtime.config().profile);
                       return run_in_virtual_time(
                           runtime, context, recordings, end_time(context.options, clock), clock, view,
                           ScheduledRequests(context.options.arm, script.commands, clock.now()));
                     });
}

/// The simulated device is in this process, or in another process at the other end of --link-fd.
Fault run_simulated_in_wall_time(RunConfig config, const RunContext& context, const LoopbackScript& script) {
  WallClock clock;
  std::unique_ptr<ReportLink> link;
  if (context.options.link_fd >= 0)
    link = std::make_unique<SocketLink>(context.options.link_fd, link_settings(config));
  else
    link = make_scripted_link(config, script, clock);
  log_grants(lock_memory(config.settings.servo.realtime));
  return run_on_link(
      std::move(config), context, *link, clock, [&](Runtime& runtime, Recordings&, LiveView& view) {
        runtime.open();
        log_missing_motors(runtime.config().profile);
        return run_in_wall_time(runtime, context, runtime.config().profile.name + ", simulated",
                                end_time(context.options, clock), clock, view,
                                ScheduledRequests(context.options.arm, script.commands, clock.now()));
      });
}

Fault run_simulated(RunConfig config, const RunContext& context) {
  LoopbackScript script;
  if (!context.options.script.empty()) script = load_loopback_script(context.options.script);
  return context.options.virtual_time ? run_simulated_in_virtual_time(std::move(config), context, script)
                                      : run_simulated_in_wall_time(std::move(config), context, script);
}

Fault run_real(RunConfig config, const RunContext& context) {
  WallClock clock;
  const TimePoint end = end_time(context.options, clock);
  const StopCondition stop = [&] { return context.signals.stop_requested() || clock.now() >= end; };
  const ReportWaiting waiting = [&](const std::string& reason) { context.service.waiting(reason); };
  if (config.profile.name.empty() && !choose_profile(config, stop, waiting)) return Fault::none;
  const auto link = make_plugged_link(config);
  log_grants(lock_memory(config.settings.servo.realtime));
  return run_on_link(std::move(config), context, *link, clock,
                     [&](Runtime& runtime, Recordings&, LiveView& view) {
                       return run_with_device(runtime, context, *link, end, clock, view);
                     });
}

}  // namespace

Fault run_daemon(RunConfig config, const RunContext& context) {
  const bool simulated = config.simulated || context.options.link_fd >= 0;
  return simulated ? run_simulated(std::move(config), context) : run_real(std::move(config), context);
}

}  // namespace wrenchd
