// SPDX-License-Identifier: GPL-3.0-or-later
#include <atomic>
#include <csignal>
#include <cstdio>
#include <exception>
#include <functional>
#include <future>
#include <memory>
#include <thread>

#include <CLI/CLI.hpp>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "config/load_loopback_script.hpp"
#include "daemon/control/control_interface.hpp"
#include "daemon/control/event_feed.hpp"
#include "daemon/control/record_methods.hpp"
#include "daemon/control/scene_methods.hpp"
#include "daemon/control/state_methods.hpp"
#include "daemon/device_start.hpp"
#include "daemon/journal.hpp"
#include "daemon/live_line.hpp"
#include "daemon/option_checks.hpp"
#include "daemon/realtime.hpp"
#include "daemon/recording/playback.hpp"
#include "daemon/recording/recordings.hpp"
#include "daemon/runtime.hpp"
#include "daemon/service_notify.hpp"
#include "daemon/servo/realtime_watch.hpp"
#include "daemon/version.hpp"
#include "daemon/wall_clock.hpp"
#include "devices/links/reconnecting_link.hpp"
#include "devices/links/simulated_link.hpp"
#include "devices/links/socket_link.hpp"

// Arguments -> plan -> station -> device -> run -> exit code. A device that is unplugged leads back to the
// device; every other fault out.

namespace {

using namespace wrenchd;

constexpr int kExitRefused = 1;  ///< a file, a device or the kernel said no; nothing was started
constexpr int kExitFault = 3;    ///< it ended with a fault that nobody acknowledged; the hand was released

constexpr auto kLook = std::chrono::milliseconds(100);  ///< how often the live line looks
/// The zeros of a release are written by a thread of the link's, which a dying process leaves this long.
constexpr auto kLastWords = std::chrono::milliseconds(50);

std::atomic<bool> stop_requested{false};
std::atomic<bool> reload_requested{false};
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<CommandSet>::is_always_lock_free &&
                  std::atomic<ServoLoop*>::is_always_lock_free,
              "a signal handler may only touch lock-free atomics");

std::atomic<ServoLoop*> the_loop{nullptr};  ///< for signals, and for std::terminate

/// There is one manager of this process, and it is told from everywhere here. Lives as long as main().
ServiceNotify* the_service = nullptr;
void tell_waiting(const std::string& what) {
  the_service->waiting(what);
}

struct Options {
  RunConfigFiles files;
  std::string simulate;
  std::string realtime;
  std::string record;
  std::string script;
  std::string playback;
  std::string playback_mode;
  std::string control;
  double seconds = 0.0;
  int link_fd = -1;  ///< -1: none
  bool arm = false;
  bool live = false;
  bool virtual_time = false;
  bool verbose = false;
};

void describe(CLI::App& app, Options& options) {
  app.description(
      "wrenchd: a haptic servo daemon. Reads the hand's pose, computes the generalized penetration\n"
      "depth of the tool in its scene, and writes the wrench back.");
  app.footer(
      "Signals: SIGHUP reads the configuration again (all of it or, where anything is refused, nothing);\n"
      "SIGUSR1 is an emergency stop, SIGUSR2 acknowledges a stop or a fault; both leave it "
      "disarmed.\n"
      "Exit codes: 0 stopped as asked; 1 refused (file, device, kernel); 3 it ended with a fault that "
      "nobody\n"
      "acknowledged; others: usage. On every way out the hand is released: zero wrench, motors off.");
  app.set_version_flag("--version", std::string("wrenchd ") + kVersion);
  app.add_option(
         "-c,--config", options.files.config,
         "wrenchd.toml; a plain name is looked for in /etc/wrenchd, /usr/share/wrenchd, then the source tree")
      ->capture_default_str()
      ->check(not_empty());
  app.add_option("--scene", options.files.scene, "scene file, instead of the one the configuration names")
      ->check(not_empty());
  app.add_option("--profile", options.files.profile,
                 "device profile, instead of the one the configuration names")
      ->check(not_empty());
  app.add_option("--simulate", options.simulate,
                 "a simulated device that speaks as this profile says, in place of a real one")
      ->check(not_empty())
      ->excludes("--profile");
  app.add_option("--loopback-script", options.script,
                 "simulated device only: what shall go wrong with it and when (devices/README.md)")
      ->check(not_empty());
  app.add_option("--playback", options.playback,
                 "simulated device only: the hand does what this recording, or CSV file of "
                 "poses, says\n(time_s,px,py,pz,qx,qy,qz,qw: X_BH), in place of its script")
      ->check(not_empty());
  app.add_option("--playback-mode", options.playback_mode,
                 "instead of the configuration's: open: the handle is there, whatever pushes; closed: the "
                 "hand wants it\nthere")
      ->check(CLI::IsMember({"open", "closed"}));
  app.add_option(
         "--link-fd", options.link_fd,
         "inherited SOCK_SEQPACKET socket to a device in another process, which speaks as the profile "
         "says (devices/README.md)")
      ->check(CLI::Range(3, 1 << 20))
      ->excludes("--simulate");
  app.add_option("--realtime", options.realtime, "instead of the configuration's: required, best_effort, off")
      ->check(CLI::IsMember({"required", "best_effort", "off"}));
  app.add_option("--control", options.control,
                 "path of the control socket, instead of the configuration's; none: no socket")
      ->check(not_empty());
  app.add_option("--record", options.record, "write every tick to this HDF5 file (it must not exist yet)")
      ->check(not_empty());
  app.add_option("--seconds", options.seconds, "stop after this many seconds; without it, run until Ctrl-C")
      ->check(number_in_range(0.001, 1e9));
  app.add_flag(
      "--arm", options.arm,
      "arm as soon as the self-test has passed; without it the loop measures, and the motors stay off");
  app.add_flag("--live", options.live, "show a live line, and a summary at the end");
  app.add_flag("--virtual-time", options.virtual_time,
               "simulated device only: time passes as fast as it can be computed, and every run is the same")
      ->needs("--seconds")
      ->excludes("--link-fd");
  app.add_flag("-v,--verbose", options.verbose, "log more");
}

/// The command line on top of the configuration.
RunConfig plan_of(const Options& options) {
  RunConfigFiles files = options.files;
  if (!options.simulate.empty()) files.profile = options.simulate;
  files.simulate = !options.simulate.empty();
  RunConfig plan = load_run_config(files, SearchPath());
  const std::string& name = plan.profile.name;
  if (options.link_fd >= 0 && name.empty())
    throw std::runtime_error(
        "--link-fd: nobody is asked what device is at its other end; name its profile with --profile");
  if (files.simulate && name.empty())
    throw std::runtime_error("--simulate auto: name the profile to simulate, as in --simulate loopback");
  if (options.virtual_time && !plan.simulated)
    throw std::runtime_error(
        "--virtual-time: a real device lives in real time; simulate one, as with --simulate " +
        (name.empty() ? "loopback" : name));
  if (!options.script.empty() && (!plan.simulated || options.link_fd >= 0))
    throw std::runtime_error(
        "--loopback-script: nothing can be asked of a real device; simulate one, as with --simulate " +
        (name.empty() ? "loopback" : name));
  if (options.realtime == "required") plan.settings.servo.realtime = Realtime::required;
  if (options.realtime == "best_effort") plan.settings.servo.realtime = Realtime::best_effort;
  if (options.realtime == "off" || options.virtual_time) plan.settings.servo.realtime = Realtime::off;
  if (!options.record.empty()) plan.settings.recording.file = options.record;
  SimulationSettings& simulation = plan.settings.simulation;
  if (options.playback_mode == "open") simulation.playback_mode = PlaybackMode::open;
  if (options.playback_mode == "closed") simulation.playback_mode = PlaybackMode::closed;
  if (!options.playback.empty()) {
    if (!plan.simulated || options.link_fd >= 0)
      throw std::runtime_error("--playback: a person holds a real device; simulate one, as with --simulate " +
                               (name.empty() ? "loopback" : name));
    simulation.playback = std::filesystem::absolute(options.playback).lexically_normal();
    simulation.playback_path = read_playback(simulation.playback);
  } else if (!options.playback_mode.empty() && simulation.playback.empty()) {
    throw std::runtime_error("--playback-mode: nothing is played back; name it with --playback");
  }
  return plan;
}

void log_grants(const std::vector<RealtimeGrant>& grants) {
  for (const RealtimeGrant& grant : grants) {
    if (grant.granted)
      spdlog::info("granted: {}", grant.request);
    else
      spdlog::warn("refused: {}: {}", grant.request, grant.cure);
  }
}

/// Shows the loop to a person: in place on a terminal, a line twice a second elsewhere.
class LiveView {
 public:
  LiveView(bool shown, const DeviceProfile& profile) : shown_(shown), terminal_(isatty(STDOUT_FILENO) != 0) {
    if (!profile.has_output) totals_.shown = ShownWrench::on_tool;
  }

  void look_at(ServoLoop& loop) {
    TickRecord record;
    if (!loop.telemetry().latest_record().read(record)) return;
    add_sample(totals_, record);
    if (!shown_ || (!terminal_ && totals_.samples % 5 != 0)) return;
    std::fputs(terminal_ ? "\r\x1b[K" : "", stdout);
    std::fputs(live_line(record, loop.telemetry().timing(), totals_.shown).c_str(), stdout);
    std::fputs(terminal_ ? "" : "\n", stdout);
    std::fflush(stdout);
  }

  void close(const ServoLoop& loop, double seconds) {
    if (!shown_) return;
    totals_.seconds = seconds;
    std::fputs(terminal_ ? "\n" : "", stdout);
    std::fputs(summary(totals_, loop.telemetry().timing()).c_str(), stdout);
    std::fflush(stdout);
  }

 private:
  bool shown_;
  bool terminal_;
  RunTotals totals_;
};

/// What the command line asks of the loop: to arm, once, as soon as it can be armed, and what a script has at
/// its times.
class Wishes {
 public:
  Wishes(bool arm, std::vector<TimedCommand> commands, TimePoint start)
      : arm_(arm), commands_(std::move(commands)), start_(start) {}

  void pass_on(ServoLoop& loop, TimePoint now) {
    for (; next_ < commands_.size() && start_ + commands_[next_].at <= now; ++next_)
      loop.requests().request(commands_[next_].commands);
    if (!arm_ || loop.telemetry().state() != State::disarmed) return;
    loop.requests().arm();
    arm_ = false;
  }
  /// When there is something to pass on again, if it is before t.
  TimePoint next(TimePoint t) const {
    return next_ < commands_.size() ? std::min(t, start_ + commands_[next_].at) : t;
  }

 private:
  bool arm_;
  std::vector<TimedCommand> commands_;
  TimePoint start_;
  std::size_t next_ = 0;
};

/// What the run came to: the fault that the loop stands in at its end, if it does.
Fault fault_of(const ServoLoop& loop, Fault ended) {
  return ended == Fault::none && is_latched(loop.telemetry().state()) ? loop.telemetry().cause() : ended;
}

/// Where real time is required a hand shall not feel a loop that has lost it.
void tell_realtime(const RealtimeWatch::Change& news, Runtime& station) {
  const bool disarms = news.lost && station.config().settings.servo.realtime == Realtime::required;
  if (disarms) station.loop().requests().disarm();
  spdlog::log(news.lost ? spdlog::level::err : spdlog::level::info, "{}{}", news.message,
              disarms ? "; disarmed, as realtime = \"required\"" : "");
}

/// Wall time: the servo thread ticks, this one looks on.
Fault run_in_wall_time(Runtime& station, const std::string& device, TimePoint end, WallClock& clock,
                       LiveView& view, Wishes wishes) {
  const ServoSettings& servo = station.config().settings.servo;
  std::promise<std::vector<RealtimeGrant>> prepared;
  auto grants = prepared.get_future();
  std::atomic<bool> stop_loop{false};
  std::atomic<bool> over{false};
  std::atomic<pid_t> servo_number{0};
  Fault fault = Fault::none, latched = Fault::none;
  std::thread servo_thread([&] {
    try {
      servo_number.store(gettid());
      prepared.set_value(prepare_servo_thread(servo));
      fault = station.loop().run(clock, stop_loop);
    } catch (...) {  // only prepare_servo_thread() throws: the loop has not run yet
      prepared.set_exception(std::current_exception());
    }
    over.store(true);
  });
  const auto joined = [&]() noexcept {
    stop_loop.store(true);
    servo_thread.join();
    the_service->loop_ended();
  };
  try {
    log_grants(grants.get());
    the_service->running(
        [&loop = station.loop()] {
          return LoopStatus{loop.telemetry().state(), loop.telemetry().cause(),
                            loop.telemetry().timing().tick.count()};
        },
        device);
    RealtimeWatch realtime(servo_number.load());
    while (!stop_requested.load() && !over.load() && clock.now() < end) {
      std::this_thread::sleep_until(wishes.next(clock.now() + kLook));
      wishes.pass_on(station.loop(), clock.now());
      view.look_at(station.loop());
      if (const auto news = realtime.check()) tell_realtime(*news, station);
    }
    latched = fault_of(station.loop(), Fault::none);
    if (!over.load()) the_service->stopping("stopping");
    joined();
  } catch (...) {
    joined();
    throw;
  }
  return fault == Fault::none ? latched : fault;
}

/// Virtual time: the same ticks one after the other, on this thread.
Fault run_in_virtual_time(Runtime& station, Recordings& recordings, TimePoint end, VirtualClock& clock,
                          LiveView& view, Wishes wishes) {
  const Duration period = from_seconds(1.0 / station.config().settings.servo.rate_Hz);
  TimePoint next_look = clock.now() + kLook;
  Fault fault = Fault::none;
  while (fault != Fault::device_lost && clock.now() < end && !stop_requested.load()) {
    clock.sleep_until(clock.now() + period);
    fault = station.loop().tick(clock.now(), clock.now());
    wishes.pass_on(station.loop(), clock.now());
    if (clock.now() < next_look) continue;
    next_look += kLook;
    view.look_at(station.loop());
    recordings.pump();
  }
  if (fault == Fault::device_lost) return fault;
  fault = fault_of(station.loop(), Fault::none);
  station.loop().release(clock.now());
  return fault;
}

/// A real device, and the loop for as long as it is there. One that was unplugged is waited for, and comes
/// back disarmed.
Fault run_with_device(Runtime& station, const ReconnectingLink& link, const Options& options, TimePoint end,
                      WallClock& clock, LiveView& view) {
  DeviceWait wait;
  const StopCondition stop = [&] { return stop_requested.load() || clock.now() >= end; };
  for (bool at_start = true;; at_start = false) {
    if (!open_device(station, wait, at_start, stop, tell_waiting)) return Fault::none;
    const UsbDevice& device = link.device().value();
    if (at_start) log_device(station.config().profile, device);
    if (at_start) log_missing_motors(station.config().profile);
    if (!at_start) spdlog::info("the device is back, disarmed: {}", describe(device));
    const std::string not_armed = calibrate(station, device, CalibrationStore());
    if (!not_armed.empty()) spdlog::warn("the device may not be armed: {}", not_armed);
    if (!wait_for_rest_pose(station, clock, stop, tell_waiting)) {
      station.close();
      if (stop()) return Fault::none;
      continue;
    }
    const Wishes wishes(options.arm && at_start && not_armed.empty(), {}, clock.now());
    const Fault fault = run_in_wall_time(station, station.config().profile.name + ", " + describe(device),
                                         end, clock, view, wishes);
    if (fault == Fault::device_lost) tell_waiting("the device was unplugged");
    station.close();
    if (fault != Fault::device_lost) return fault;
  }
}

/// Reads the configuration again, and tells everybody who wants to know. Throws as Workbench::reload().
ReloadResult read_again(Runtime& station, EventFeed& feed, const Options& options) {
  struct Reloading {
    Reloading() {
      if (the_service != nullptr) the_service->reloading();
    }
    ~Reloading() {
      if (the_service != nullptr) the_service->reloaded();
    }
  };
  const Reloading reloading;
  return reload_config(station.reconfigurator(), feed, [&options] { return plan_of(options); });
}

/// The control socket, where one is wanted. The usual place may be another daemon's; one that somebody named
/// may not.
std::unique_ptr<ControlInterface> open_control(Runtime& station, EventFeed& feed, Recordings& recordings,
                                               const Options& options) {
  const SocketPath place = choose_socket_path(options.control, station.config().settings.control);
  if (place.path.empty() || options.virtual_time) return nullptr;
  auto control = std::make_unique<ControlInterface>(station, feed);
  try {
    add_state_methods(control->methods(), station);
    add_scene_methods(control->methods(), station.reconfigurator(),
                      [&] { return read_again(station, feed, options); });
    add_record_methods(control->methods(), recordings);
    control->status_sections()["recording"] = [&recordings] { return recording_json(recordings); };
    control->open(place.path);
    spdlog::info("control socket: {}", place.path.string());
    return control;
  } catch (const std::runtime_error& error) {
    if (place.explicitly_named) throw;
    spdlog::warn("no control socket: {}", error.what());
    return nullptr;
  }
}

/// Reads the configuration again where a signal asks for it, on a thread of its own: meshes take time.
class Reloader {
 public:
  Reloader(Runtime& station, EventFeed& feed, const Options& options)
      : thread_([&](const std::stop_token& stop) {
          while (!stop.stop_requested()) {
            try {
              if (reload_requested.exchange(false)) read_again(station, feed, options);
            } catch (const std::exception&) {  // that is told by now
            }
            std::this_thread::sleep_for(kLook);
          }
        }) {}

 private:
  std::jthread thread_;
};

/// Builds the station around its link, and runs it.
Fault run(RunConfig plan, const Options& options, ReportLink& link, Clock& clock,
          const std::function<Fault(Runtime&, Recordings&, LiveView&)>& run_it) {
  Runtime station(std::move(plan), link, clock,
                  options.virtual_time ? ProxySearchMode::in_tick : ProxySearchMode::background,
                  MeshLoader(cache_directory(), [](const std::string& what) { spdlog::info("{}", what); }));
  const Settings& settings = station.config().settings;
  the_loop = &station.loop();
  for (const std::string& remark : station.mesh_remarks()) spdlog::warn("{}", remark);
  spdlog::info("wrenchd {}: device {}, tool of {} hull vertices, {} obstacles, {} Hz", kVersion,
               station.config().profile.name, station.scene().tool().hull.vertices_T_m.size(),
               station.scene().obstacle_count(), settings.servo.rate_Hz);
  LiveView view(options.live, station.config().profile);
  Fault fault = Fault::none;
  double ran_s = 0.0;
  {
    EventFeed feed(station.loop());
    Recordings recordings(station, feed, clock,
                          options.virtual_time ? Recordings::Pace::manual : Recordings::Pace::threads);
    if (!settings.recording.file.empty()) recordings.start_file(settings.recording.file);
    const auto control = open_control(station, feed, recordings, options);
    const Reloader reloader(station, feed, options);
    const TimePoint start = clock.now();
    fault = run_it(station, recordings, view);
    ran_s = seconds(clock.now() - start);
  }
  view.close(station.loop(), ran_s);
  the_loop = nullptr;
  return fault;
}

TimePoint end_of(const Options& options, const Clock& clock) {
  return options.seconds > 0.0 ? clock.now() + from_seconds(options.seconds) : TimePoint::max();
}

/// The simulated device, with what shall go wrong with it.
std::unique_ptr<SimulatedLink> scripted_link(const RunConfig& plan, const LoopbackScript& script,
                                             Clock& clock) {
  auto link = make_simulated_link(plan.profile, plan.settings.simulation, clock);
  for (const SimulatedFault& fault : script.faults) try {
      link->device().inject(fault);
    } catch (const std::invalid_argument& error) {
      throw std::runtime_error(script.file.string() + ": " + error.what());
    }
  return link;
}

/// The end of a link that is not plugged in: in this process, or in another.
std::unique_ptr<ReportLink> link_in_wall_time(const RunConfig& plan, const LoopbackScript& script,
                                              const Options& options, Clock& clock) {
  if (options.link_fd >= 0) return std::make_unique<SocketLink>(options.link_fd, link_settings(plan));
  return scripted_link(plan, script, clock);
}

Fault run_simulated(RunConfig plan, const Options& options) {
  LoopbackScript script;
  if (!options.script.empty()) script = load_loopback_script(options.script);
  const auto run_it = [&](auto& clock, auto run_in_time) {
    return
        [&clock, &options, &script, run_in_time](Runtime& station, Recordings& recordings, LiveView& view) {
          station.open();
          log_missing_motors(station.config().profile);
          return run_in_time(station, recordings, end_of(options, clock), clock, view,
                             Wishes(options.arm, script.commands, clock.now()));
        };
  };
  if (options.virtual_time) {
    VirtualClock clock;
    const auto link = scripted_link(plan, script, clock);
    return run(std::move(plan), options, *link, clock, run_it(clock, run_in_virtual_time));
  }
  WallClock clock;
  const auto link = link_in_wall_time(plan, script, options, clock);
  log_grants(lock_memory(plan.settings.servo.realtime));
  const auto in_wall_time = [&](Runtime& station, Recordings&, auto&&... more) {
    return run_in_wall_time(station, station.config().profile.name + ", simulated", more...);
  };
  return run(std::move(plan), options, *link, clock, run_it(clock, in_wall_time));
}

Fault run_real(RunConfig plan, const Options& options) {
  WallClock clock;
  const TimePoint end = end_of(options, clock);
  if (plan.profile.name.empty() &&
      !choose_profile(
          plan, [&] { return stop_requested.load() || clock.now() >= end; }, tell_waiting))
    return Fault::none;
  const auto link = make_plugged_link(plan);
  log_grants(lock_memory(plan.settings.servo.realtime));
  return run(std::move(plan), options, *link, clock, [&](Runtime& station, Recordings&, LiveView& view) {
    return run_with_device(station, *link, options, end, clock, view);
  });
}

/// From a signal handler.
void ask(CommandSet commands) {
  if (ServoLoop* loop = the_loop) loop->requests().request(commands);
}

void catch_signals() {
  struct sigaction action {};
  action.sa_handler = [](int) { stop_requested.store(true); };
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  action.sa_handler = [](int) { reload_requested.store(true); };
  sigaction(SIGHUP, &action, nullptr);
  action.sa_handler = [](int) { ask(kStop); };
  sigaction(SIGUSR1, &action, nullptr);
  action.sa_handler = [](int) { ask(kAcknowledge); };
  sigaction(SIGUSR2, &action, nullptr);
  std::set_terminate([] {
    if (ServoLoop* loop = the_loop) {
      loop->release(std::chrono::steady_clock::now());
      std::this_thread::sleep_for(kLastWords);
    }
    std::abort();
  });
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app;
  Options options;
  describe(app, options);
  CLI11_PARSE(app, argc, argv);
  if (stderr_is_journal()) {
    log_to_journal();
  } else {
    spdlog::set_default_logger(spdlog::stderr_color_mt("wrenchd"));
    spdlog::set_pattern("%H:%M:%S.%e %^%l%$ %v");
  }
  if (options.verbose) spdlog::set_level(spdlog::level::debug);
  catch_signals();
  ServiceNotify service;
  the_service = &service;
  try {
    RunConfig plan = plan_of(options);
    const bool simulated = plan.simulated || options.link_fd >= 0;
    const Fault fault =
        simulated ? run_simulated(std::move(plan), options) : run_real(std::move(plan), options);
    return fault == Fault::none ? 0 : kExitFault;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "wrenchd: %s\n", error.what());
    service.stopping(std::string("refused: ") + error.what());
    return kExitRefused;
  }
}
