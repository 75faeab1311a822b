// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/control/record_methods.hpp"

namespace wrenchd {
namespace {

Json written_json(const Recordings::Summary& written) {
  return {{"file", written.file.string()}, {"ticks", written.ticks}, {"lost", written.lost}};
}

MethodResult start(Recordings& recordings, const Json& params, const Caller& caller) {
  if (const auto running = recordings.status().running)
    throw RpcError(RpcCode::invalid_state,
                   "A recording is already running: " + running->file.string() + "; 'record.stop' ends it.",
                   {{"file", running->file.string()}});
  try {
    const auto file =
        recordings.start(params.value("file", std::string()), caller.role >= Role::administrator);
    return Json{{"file", file.string()}};
  } catch (const RecordingError& error) {
    throw RpcError(RpcCode::rejected, error.what());
  }
}

MethodResult stop_recording(Recordings& recordings) {
  if (const auto written = recordings.stop()) return written_json(*written);
  const std::string failed = recordings.status().failed;
  throw RpcError(RpcCode::invalid_state,
                 failed.empty() ? "No recording runs; 'record.start' starts one."
                                : "No recording runs; the last one ended with an error: " + failed + ".");
}

MethodResult mark(Recordings& recordings, const Json& params) {
  try {
    const Json conditions = params.value("conditions", Json::object());
    if (const auto marked = recordings.mark(params["label"].get<std::string>(), conditions))
      return Json{{"file", marked->file.string()}, {"time_ns", marked->time_ns}};
  } catch (const std::invalid_argument& error) {
    throw RpcError(RpcCode::invalid_params, "record.mark: " + std::string(error.what()) + ".");
  } catch (const RecordingError& error) {
    throw RpcError(RpcCode::rejected, "record.mark: " + std::string(error.what()) + ".");
  }
  throw RpcError(RpcCode::invalid_state,
                 "No recording runs, so nothing would contain the marker; 'record.start' starts one.");
}

Json list(const Recordings& recordings) {
  Json all = Json::array();
  for (const StoredRecording& one : recordings.list())
    all.push_back({{"name", one.name}, {"bytes", one.bytes}, {"modified_utc", utc_stamp(one.modified_at)}});
  return {{"directory", recordings.status().directory.string()}, {"recordings", all}};
}

MethodResult open(const Recordings& recordings, const Json& params) {
  try {
    const auto name = params["name"].get<std::string>();
    return {Json{{"name", name}}, recordings.open(name)};
  } catch (const RecordingError& error) {
    throw RpcError(RpcCode::rejected, error.what());
  }
}

}  // namespace

Json recording_json(const Recordings& recordings) {
  const Recordings::Status status = recordings.status();
  const auto path_or_null = [](const std::filesystem::path& path) {
    return path.empty() ? Json(nullptr) : Json(path.string());
  };
  return {{"running", status.running ? written_json(*status.running) : Json(nullptr)},
          {"failure", status.failed.empty() ? Json(nullptr) : Json(status.failed)},
          {"directory", path_or_null(status.directory)},
          {"flight_s", status.flight_s},
          {"last_flight", path_or_null(status.last_flight)},
          {"flight_count", status.flights}};
}

void add_record_methods(MethodTable& table, Recordings& recordings) {
  table.add(
      EventRow{"recording",
               "A recording changed. phase: started, ended (ticks; lost: number of missing ticks), failed "
               "(reason), flight (fault: the fault that the flight recorder has recorded). file: the "
               "recording."});
  table.add(
      EventRow{"marker",
               "A client set a marker in the running recording. label; conditions: an object of numbers "
               "and texts, which hold until the next marker changes them."});
  table.add(MethodRow{"record.mark",
                      Role::operator_,
                      {{"label", ParamType::text, true, "one line of at most 120 bytes, as in 'trial 3'"},
                       {"conditions", ParamType::object, false,
                        "numbers and texts by name, as in {\"stiffness\": 2000}; at most 16, names of at "
                        "most 32 letters, digits "
                        "and underscores"}},
                      "Sets a marker in the running recording: a row of /events with the tick. Returns file "
                      "and time_ns, the time "
                      "of the marker on the clock of the ticks. At most 20 markers per second.",
                      [&recordings](const Json& params, const Caller&) { return mark(recordings, params); }});
  table.add(MethodRow{
      "record.start",
      Role::operator_,
      {{"file", ParamType::text, false,
        "a plain name in the directory of record.status; default: a name with the present time. "
        "Administrators "
        "may give an absolute path"}},
      "Starts to write every tick to an HDF5 file. Returns the file. One recording at a time.",
      [&recordings](const Json& params, const Caller& caller) { return start(recordings, params, caller); },
      true});
  table.add(MethodRow{"record.stop",
                      Role::operator_,
                      {},
                      "Ends the recording. Returns file, ticks, and lost: the number of missing ticks.",
                      [&recordings](const Json&, const Caller&) { return stop_recording(recordings); },
                      true});
  table.add(MethodRow{
      "record.status",
      Role::observer,
      {},
      "running: file, ticks and lost of the running recording, or null; failure: why the last "
      "recording ended early, or null; directory; flight_s: duration that the flight recorder stores; "
      "last_flight: its newest file since the start; flight_count: number of its files since the "
      "start.",
      [&recordings](const Json&, const Caller&) { return MethodResult(recording_json(recordings)); }});
  table.add(MethodRow{
      "record.list",
      Role::observer,
      {},
      "Returns the recordings in the directory of record.status, the oldest first: name, bytes, and "
      "modified_utc. Unfinished recordings are left out.",
      [&recordings](const Json&, const Caller&) { return MethodResult(list(recordings)); },
      true});
  table.add(MethodRow{"record.open",
                      Role::observer,
                      {{"name", ParamType::text, true, "a name from record.list"}},
                      "Opens a recording for reading. The reply carries its descriptor (SCM_RIGHTS).",
                      [&recordings](const Json& params, const Caller&) { return open(recordings, params); },
                      true});
}

}  // namespace wrenchd
