// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/daemon_run.hpp"

#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <thread>
#include <utility>

#include <spdlog/spdlog.h>
#include <unistd.h>

#include "config/load_loopback_script.hpp"
#include "daemon/clear_start.hpp"
#include "daemon/control/control_interface.hpp"
#include "daemon/control/event_feed.hpp"
#include "daemon/control/hand_methods.hpp"
#include "daemon/control/record_methods.hpp"
#include "daemon/control/scene_methods.hpp"
#include "daemon/control/state_methods.hpp"
#include "daemon/control/wrench_methods.hpp"
#include "daemon/device_run.hpp"
#include "daemon/device_start.hpp"
#include "daemon/output_queue.hpp"
#include "daemon/realtime.hpp"
#include "daemon/recording/recordings.hpp"
#include "daemon/standard_streams.hpp"
#include "daemon/thread_guard.hpp"
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
/// daemon uses the default path. Throws std::runtime_error if an explicitly named path cannot be used. hand:
/// the simulated device in this process; null if there is none.
std::unique_ptr<ControlInterface> open_control(Runtime& runtime, EventFeed& feed, Recordings& recordings,
                                               DeviceInHand* hand, const RunContext& context) {
  const SocketPath socket = choose_socket_path(context.options.control, runtime.config().settings.control);
  if (socket.path.empty() || context.options.virtual_time) return nullptr;
  auto control = std::make_unique<ControlInterface>(runtime, feed);
  try {
    add_state_methods(control->methods(), runtime);
    add_scene_methods(control->methods(), runtime.reconfigurator(),
                      [&] { return reload_all(runtime, feed, context); });
    add_record_methods(control->methods(), recordings);
    add_hand_methods(control->methods(), hand, runtime.config());
    add_wrench_methods(control->methods(), runtime.loop(), feed, runtime.config());
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
          ThreadGuard guard("reload");
          while (!stop.stop_requested()) {
            guard.run([&] { reload_if_requested(runtime, feed, context); });
            std::this_thread::sleep_for(kReloadPeriod);
          }
        }) {}

 private:
  static void reload_if_requested(Runtime& runtime, EventFeed& feed, const RunContext& context) {
    if (!context.signals.take_reload_request()) return;
    try {
      reload_all(runtime, feed, context);
    } catch (const std::exception&) {  // the event feed has reported the error
    }
  }

  std::jthread thread_;
};

/// Returns how the live view prints; null if it is not requested. In virtual time the run waits for the
/// reader. In wall time the queue drops lines that are not read in time.
LiveView::Print live_print(const Options& options, OutputQueue& queue) {
  if (!options.live) return {};
  if (options.virtual_time) return [](const std::string& text) { write_all(STDOUT_FILENO, text); };
  return [&queue](std::string text) {
    queue.post(text.size(), [text = std::move(text)] { write_all(STDOUT_FILENO, text); });
  };
}

using RunLoop = std::function<Fault(Runtime&, Recordings&, LiveView&)>;

/// Builds the runtime on its link, opens recordings and control socket, and runs the loop by `run_loop`.
/// hand: the simulated device at the other end of the link, in this process; null if there is none.
Fault run_on_link(RunConfig config, const RunContext& context, ReportLink& link, DeviceInHand* hand,
                  Clock& clock, const RunLoop& run_loop) {
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
  OutputQueue live_output;
  LiveView view(live_print(context.options, live_output), isatty(STDOUT_FILENO) != 0,
                runtime.config().profile);
  Fault fault = Fault::none;
  double run_s = 0.0;
  {
    EventFeed feed(runtime.loop());
    Recordings recordings(runtime, feed, clock,
                          virtual_time ? Recordings::Pace::manual : Recordings::Pace::threads);
    if (!settings.recording.file.empty()) recordings.start_file(settings.recording.file);
    const auto control = open_control(runtime, feed, recordings, hand, context);
    const ReloadThread reload_thread(runtime, feed, context);
    const TimePoint start = clock.now();
    fault = run_loop(runtime, recordings, view);
    run_s = seconds(clock.now() - start);
    // The hand is released. The recordings are closed before the threads that may work for long.
    context.deadline.start(exit_code(fault));
    const StopDeadline::RecordingTime recording(context.deadline);
    recordings.close();
  }
  view.close(runtime.loop(), run_s);
  live_output.close();
  if (live_output.dropped() > 0)
    spdlog::warn("{} outputs of the live view were dropped: standard output was not read in time",
                 live_output.dropped());
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

/// Displaces the path of a simulated hand that would start inside an obstacle, and says so.
void start_clear(const Runtime& runtime, DeviceInHand& device) {
  const Settings& settings = runtime.config().settings;
  if (!settings.simulation.playback_path.empty()) return;  // recorded poses stay as they are
  const auto d_B_m = displacement_to_clear_start(runtime.scene(), settings);
  if (!d_B_m)
    spdlog::warn(
        "the simulated hand starts where the tool overlaps an obstacle, and no pose near it is free: it will "
        "not arm. "
        "Start its path, [simulation] hand_script, where the tool has room");
  else if (*d_B_m != Vector3d::Zero() && device.displace_path(*d_B_m))
    spdlog::info(
        "the simulated hand would start where the tool overlaps an obstacle: its path is displaced by "
        "({:.1f}, {:.1f}, "
        "{:.1f}) mm in the device base",
        1e3 * d_B_m->x(), 1e3 * d_B_m->y(), 1e3 * d_B_m->z());
}

/// Runs the loop with a simulated device. If a script unplugs the device, waits until it can be opened again,
/// as for a real device; it is disarmed then. `run_once` runs the loop until it ends.
Fault run_with_reconnection(Runtime& runtime, const RunContext& context, Clock& clock, TimePoint end,
                            ScheduledRequests& requests, const std::function<Fault()>& run_once) {
  constexpr Duration kOpenPeriod = std::chrono::milliseconds(1);
  const auto opened = [&] {
    try {
      runtime.open();
      return true;
    } catch (const std::runtime_error&) {  // the script still keeps the device unplugged
      return false;
    }
  };
  for (;;) {
    const Fault fault = run_once();
    if (fault != Fault::device_lost) return fault;
    runtime.close();
    requests.cancel_arm();
    spdlog::info("the simulated device was unplugged; waiting for it");
    context.service.waiting("the device was unplugged");
    while (!opened()) {
      if (context.signals.stop_requested() || clock.now() >= end) return Fault::none;
      clock.sleep_until(clock.now() + kOpenPeriod);
    }
    spdlog::info("the device is connected again, and is disarmed");
  }
}

Fault run_simulated_in_virtual_time(RunConfig config, const RunContext& context,
                                    const LoopbackScript& script) {
  VirtualClock clock;
  const auto link = make_scripted_link(config, script, clock);
  return run_on_link(std::move(config), context, *link, &link->device(), clock,
                     [&](Runtime& runtime, Recordings& recordings, LiveView& view) {
                       start_clear(runtime, link->device());
                       runtime.open();
                       log_missing_motors(runtime.config().profile);
                       const TimePoint end = end_time(context.options, clock);
                       ScheduledRequests requests(context.options.arm, script.commands, clock.now());
                       return run_with_reconnection(runtime, context, clock, end, requests, [&] {
                         return run_in_virtual_time(runtime, context, recordings, end, clock, view, requests);
                       });
                     });
}

/// The simulated device is in this process, or in another process at the other end of --link-fd.
Fault run_simulated_in_wall_time(RunConfig config, const RunContext& context, const LoopbackScript& script) {
  WallClock clock;
  std::unique_ptr<ReportLink> link;
  DeviceInHand* device = nullptr;  // null: in another process
  if (context.options.link_fd >= 0) {
    link = std::make_unique<SocketLink>(context.options.link_fd, link_settings(config));
  } else {
    auto simulated = make_scripted_link(config, script, clock);
    device = &simulated->device();
    link = std::move(simulated);
  }
  log_grants(lock_memory(config.settings.servo.realtime));
  return run_on_link(
      std::move(config), context, *link, device, clock, [&](Runtime& runtime, Recordings&, LiveView& view) {
        if (device != nullptr) start_clear(runtime, *device);
        runtime.open();
        log_missing_motors(runtime.config().profile);
        const TimePoint end = end_time(context.options, clock);
        ScheduledRequests requests(context.options.arm, script.commands, clock.now());
        const auto run_once = [&] {
          return run_in_wall_time(runtime, context, runtime.config().profile.name + ", simulated", end, clock,
                                  view, requests);
        };
        // The process at the other end of a socket cannot come back over the same socket.
        if (context.options.link_fd >= 0) return run_once();
        return run_with_reconnection(runtime, context, clock, end, requests, run_once);
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
  return run_on_link(std::move(config), context, *link, nullptr, clock,
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
