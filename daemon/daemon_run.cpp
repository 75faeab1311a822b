// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/daemon_run.hpp"

#include <array>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
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
#include "daemon/first_test.hpp"
#include "daemon/hand_file.hpp"
#include "daemon/hand_scenes.hpp"
#include "daemon/log_prefix.hpp"
#include "daemon/output_queue.hpp"
#include "daemon/realtime.hpp"
#include "daemon/recording/recordings.hpp"
#include "daemon/servo_thread.hpp"
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
                       [&context] { return load_run_configs(context.options).front(); });
}

/// Opens the control socket. Returns null if the configuration asks for none, in virtual time, and if another
/// daemon uses the default path. Throws std::runtime_error if an explicitly named path cannot be used. hand:
/// the simulated device in this process; null if there is none.
std::unique_ptr<ControlInterface> open_control(Runtime& runtime, EventFeed& feed, Recordings& recordings,
                                               DeviceInHand* hand, const RunContext& context) {
  const RunConfig& config = runtime.config();
  SocketPath socket = choose_socket_path(context.options.control, config.settings.control);
  socket.path = file_of_hand(socket.path, config.hand());
  if (socket.path.empty() || context.options.virtual_time) return nullptr;
  auto control = std::make_unique<ControlInterface>(runtime, feed);
  try {
    add_state_methods(control->methods(), runtime);
    add_scene_methods(control->methods(), runtime.reconfigurator(),
                      [&] { return reload_all(runtime, feed, context); });
    add_record_methods(control->methods(), recordings);
    add_hand_methods(control->methods(), hand, config);
    add_wrench_methods(control->methods(), runtime.loop(), feed, config);
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

/// The device of a hand and the link to it.
struct HandDevice {
  LoopbackScript script = {};  ///< faults and commands for a simulated device
  std::unique_ptr<ReportLink> link = {};
  DeviceInHand* simulated = nullptr;    ///< null: a real device, or one in another process
  ReconnectingLink* plugged = nullptr;  ///< null: a simulated device
};

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

/// --link-fd and --loopback-script are for the first hand.
HandDevice make_device(const RunConfig& config, const RunContext& context, Clock& clock) {
  HandDevice device;
  const Options& options = context.options;
  const bool in_other_process = options.link_fd >= 0 && !config.is_second;
  if (!options.script.empty() && !config.is_second) device.script = load_loopback_script(options.script);
  if (in_other_process) {
    device.link = std::make_unique<SocketLink>(options.link_fd, link_settings(config));
  } else if (config.simulated) {
    auto link = make_scripted_link(config, device.script, clock);
    device.simulated = &link->device();
    device.link = std::move(link);
  } else {
    auto link = make_plugged_link(config);
    device.plugged = link.get();
    device.link = std::move(link);
  }
  return device;
}

MeshLoader mesh_loader() {
  return MeshLoader(cache_directory(), [](const std::string& text) { spdlog::info("{}", text); });
}

/// One hand: its device, and everything that is built from its configuration.
struct Hand {
  /// scene: only for one of two hands; `meshes` has read its meshes.
  Hand(RunConfig config, const RunContext& run_context, Clock& clock,
       const MeshLoader& meshes = mesh_loader(), const HandScene& scene = {})
      : context(run_context),
        device(make_device(config, context, clock)),
        runtime(std::move(config), *device.link, clock,
                context.options.virtual_time ? ProxySearchMode::in_tick : ProxySearchMode::background, meshes,
                scene) {}

  RunContext context;
  HandDevice device;
  Runtime runtime;
};

/// Builds two hands in one world.
std::array<std::unique_ptr<Hand>, 2> make_hands(const std::vector<RunConfig>& configs,
                                                const std::array<RunContext, 2>& contexts, Clock& clock) {
  MeshLoader meshes = mesh_loader();
  const std::array<HandScene, 2> scenes = make_hand_scenes(configs[0], configs[1], meshes);
  std::array<std::unique_ptr<Hand>, 2> hands;
  for (std::size_t i = 0; i < hands.size(); ++i) {
    const LogPrefix prefix(configs[i].hand());
    hands[i] = std::make_unique<Hand>(configs[i], contexts[i], clock, meshes, scenes[i]);
  }
  return hands;
}

using RunLoop = std::function<Fault(Recordings&, LiveView&)>;

void log_start(const Runtime& runtime) {
  for (const std::string& remark : runtime.mesh_remarks()) spdlog::warn("{}", remark);
  spdlog::info("wrenchd {}: device {}, tool of {} hull vertices, {} obstacles, {} Hz", kVersion,
               runtime.config().profile.name, runtime.scene().tool().hull.vertices_T_m.size(),
               runtime.scene().obstacle_count(), runtime.config().settings.servo.rate_Hz);
}

/// Opens recordings and control socket of a hand, and runs its loop by `run_loop`.
Fault run_hand(Hand& hand, Clock& clock, const RunLoop& run_loop) {
  const RunContext& context = hand.context;
  const bool virtual_time = context.options.virtual_time;
  Runtime& runtime = hand.runtime;
  const RunConfig& config = runtime.config();
  const LogPrefix prefix(config.hand());
  const SignalTarget signal_target(runtime.loop());
  log_start(runtime);
  OutputQueue live_output;
  LiveView view(live_print(context.options, live_output), isatty(STDOUT_FILENO) != 0, config.profile,
                config.hand());
  Fault fault = Fault::none;
  double run_s = 0.0;
  {
    EventFeed feed(runtime.loop(), config.hand());
    Recordings recordings(runtime, feed, clock,
                          virtual_time ? Recordings::Pace::manual : Recordings::Pace::threads);
    const std::filesystem::path& recorded = config.settings.recording.file;
    if (!recorded.empty()) recordings.start_file(recorded);
    const auto control = open_control(runtime, feed, recordings, hand.device.simulated, context);
    std::optional<ReloadThread> reload_thread;
    if (!config.is_second) reload_thread.emplace(runtime, feed, context);
    const TimePoint start = clock.now();
    fault = run_loop(recordings, view);
    run_s = seconds(clock.now() - start);
    // The hand is released. The recordings are closed before the threads that may work for long.
    context.start_deadline(fault);
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

/// Opens a simulated device, in this process or in another one.
void open_simulated(Hand& hand) {
  if (hand.device.simulated != nullptr) start_clear(hand.runtime, *hand.device.simulated);
  hand.runtime.open();
  log_missing_motors(hand.runtime.config().profile);
}

/// Opens a device in another process. Tests it before it is armed; such a device has no serial number, so it
/// is tested at each start.
void open_other_process(Hand& hand, Clock& clock, TimePoint end) {
  const RunConfig& config = hand.runtime.config();
  const TestedDevices tested;
  const StopCondition stop = [&] { return hand.context.stop_requested() || clock.now() >= end; };
  const ReportWaiting waiting = [&](const std::string& reason) {
    hand.context.service.waiting(reason, hand.context.hand);
  };
  hand.runtime.set_arming_obstacle(kTestRuns);
  std::string obstacle;
  if (needs_first_test(config, nullptr, tested))
    obstacle = run_first_test(config, *hand.device.link, nullptr, clock, stop, waiting, tested).value_or("");
  open_simulated(hand);
  if (needs_direction_test(config, nullptr, tested))
    obstacle =
        run_direction_test(config, hand.runtime.device(), nullptr, clock, stop, waiting, tested).value_or("");
  if (!obstacle.empty()) spdlog::warn("the device cannot be armed: {}", obstacle);
  hand.runtime.set_arming_obstacle(obstacle);
}

/// Runs the loop with a simulated device. If a script unplugs the device, waits until it can be opened again,
/// as for a real device; it is disarmed then. `run_once` runs the loop until it ends.
Fault run_with_reconnection(Hand& hand, Clock& clock, TimePoint end, ScheduledRequests& requests,
                            const std::function<Fault()>& run_once) {
  constexpr Duration kOpenPeriod = std::chrono::milliseconds(1);
  for (;;) {
    const Fault fault = run_once();
    if (fault != Fault::device_lost) return fault;
    hand.runtime.close();
    requests.cancel_arm();
    log_unplugged(hand.context);
    while (!open_again(hand.runtime)) {
      if (hand.context.stop_requested() || clock.now() >= end) return Fault::none;
      clock.sleep_until(clock.now() + kOpenPeriod);
    }
  }
}

Fault run_one_in_virtual_time(RunConfig config, const RunContext& context) {
  VirtualClock clock;
  Hand hand(std::move(config), context, clock);
  return run_hand(hand, clock, [&](Recordings& recordings, LiveView& view) {
    open_simulated(hand);
    const TimePoint end = end_time(context.options, clock);
    ScheduledRequests requests(context.options.arm, hand.device.script.commands, clock.now());
    return run_with_reconnection(hand, clock, end, requests, [&] {
      return run_in_virtual_time(hand.runtime, context, recordings, end, clock, view, requests);
    });
  });
}

/// Both loops run on the calling thread, by one clock.
Fault run_both_in_virtual_time(const std::vector<RunConfig>& configs, const RunContext& context) {
  VirtualClock clock;
  RunContext context_of_second = context;
  context_of_second.hand = 1;
  const auto hands = make_hands(configs, {context, context_of_second}, clock);
  Hand& first = *hands[0];
  Hand& second = *hands[1];
  std::array<Fault, 2> faults{};
  run_hand(first, clock, [&](Recordings& recordings, LiveView& view) {
    open_simulated(first);
    ScheduledRequests requests(context.options.arm, first.device.script.commands, clock.now());
    run_hand(second, clock, [&](Recordings& recordings_of_second, LiveView& view_of_second) {
      open_simulated(second);
      ScheduledRequests requests_of_second(context.options.arm, {}, clock.now());
      std::array<VirtualHand, 2> virtual_hands = {
          VirtualHand{first.runtime, recordings, view, requests, first.context},
          VirtualHand{second.runtime, recordings_of_second, view_of_second, requests_of_second,
                      second.context}};
      faults = run_two_in_virtual_time(virtual_hands, end_time(context.options, clock), clock);
      return faults[1];
    });
    return faults[0];
  });
  return faults[0] != Fault::none ? faults[0] : faults[1];
}

/// Runs the loop of a hand by the clock of the machine. end: of a run with a real device, which includes the
/// time of waiting for it.
Fault run_one_in_wall_time(Hand& hand, WallClock& clock, TimePoint end) {
  const RunContext& context = hand.context;
  return run_hand(hand, clock, [&](Recordings&, LiveView& view) {
    if (hand.device.plugged != nullptr)
      return run_with_device(hand.runtime, context, *hand.device.plugged, end, clock, view);
    if (hand.device.simulated != nullptr)
      open_simulated(hand);
    else
      open_other_process(hand, clock, end);
    const TimePoint simulated_end = end_time(context.options, clock);
    const bool arm = context.options.arm && hand.runtime.arming_obstacle().empty();
    ScheduledRequests requests(arm, hand.device.script.commands, clock.now());
    const auto run_once = [&] {
      return run_in_wall_time(hand.runtime, context, hand.runtime.config().profile.name + ", simulated",
                              simulated_end, clock, view, requests);
    };
    // The process at the other end of a socket cannot come back over the same socket.
    if (hand.device.simulated == nullptr) return run_once();
    return run_with_reconnection(hand, clock, simulated_end, requests, run_once);
  });
}

/// Each hand has a thread that waits for its device and supervises its loop. If one ends with an exception,
/// the other one ends too.
Fault run_both_in_wall_time(Hand& first, Hand& second, TwoHandRun& shared, WallClock& clock, TimePoint end) {
  std::array<Fault, 2> faults{};
  std::array<std::exception_ptr, 2> errors;
  const auto run = [&](Hand& hand) noexcept {
    const std::size_t i = hand.context.hand;
    try {
      faults[i] = run_one_in_wall_time(hand, clock, end);
    } catch (...) {
      errors[i] = std::current_exception();
      shared.failed.store(true);
    }
  };
  std::thread thread_of_second([&] { run(second); });
  run(first);
  thread_of_second.join();
  for (const std::exception_ptr& error : errors)
    if (error) std::rethrow_exception(error);
  return faults[0] != Fault::none ? faults[0] : faults[1];
}

/// Waits for the device that decides the profile, for each hand whose configuration names none. Returns false
/// if a signal or `end` ended the waiting.
bool choose_profiles(std::vector<RunConfig>& configs, const RunContext& context, const WallClock& clock,
                     TimePoint end) {
  const StopCondition stop = [&] { return context.stop_requested() || clock.now() >= end; };
  for (std::size_t i = 0; i < configs.size(); ++i) {
    RunConfig& config = configs[i];
    if (!config.profile.name.empty()) continue;
    const LogPrefix prefix(config.hand());
    const ReportWaiting waiting = [&](const std::string& reason) {
      for (std::size_t hand = 0; hand < configs.size(); ++hand)
        context.service.waiting(hand == i ? reason : "the other hand has no device yet", hand);
    };
    if (!choose_profile(config, stop, waiting)) return false;
  }
  return true;
}

Fault run_by_machine_clock(std::vector<RunConfig> configs, const RunContext& context) {
  WallClock clock;
  const TimePoint end = end_time(context.options, clock);
  if (!choose_profiles(configs, context, clock, end)) return Fault::none;
  const ServoSettings servo = configs[0].settings.servo;
  log_grants(lock_memory(servo.realtime));
  if (configs.size() == 1) {
    Hand hand(std::move(configs[0]), context, clock);
    return run_one_in_wall_time(hand, clock, end);
  }
  TwoHandThread thread(servo, clock);
  TwoHandRun shared{.thread = thread};
  RunContext first_context = context;
  first_context.two_hands = &shared;
  RunContext second_context = first_context;
  second_context.hand = 1;
  const auto hands = make_hands(configs, {first_context, second_context}, clock);
  return run_both_in_wall_time(*hands[0], *hands[1], shared, clock, end);
}

}  // namespace

Fault run_daemon(std::vector<RunConfig> hands, const RunContext& context) {
  if (hands.size() > 1) context.service.add_second_hand(hands[1].hand());
  if (!context.options.virtual_time) return run_by_machine_clock(std::move(hands), context);
  if (hands.size() == 1) return run_one_in_virtual_time(std::move(hands[0]), context);
  return run_both_in_virtual_time(hands, context);
}

}  // namespace wrenchd
