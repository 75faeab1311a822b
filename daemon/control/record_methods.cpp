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
                   "It is recorded already, into " + running->file.string() + "; 'record.stop' ends that.",
                   {{"file", running->file.string()}});
  try {
    const auto file =
        recordings.start(params.value("file", std::string()), caller.role >= Role::administrator);
    return Json{{"file", file.string()}};
  } catch (const RecordingError& error) {
    throw RpcError(RpcCode::rejected, error.what());
  }
}

MethodResult stop(Recordings& recordings) {
  if (const auto written = recordings.stop()) return written_json(*written);
  const std::string failed = recordings.status().failed;
  throw RpcError(RpcCode::invalid_state, failed.empty() ? "Nothing is recorded; 'record.start' begins."
                                                        : "Nothing is recorded any more: " + failed + ".");
}

Json list(const Recordings& recordings) {
  Json all = Json::array();
  for (const StoredRecording& one : recordings.list())
    all.push_back({{"name", one.name}, {"bytes", one.bytes}, {"written", utc_stamp(one.modified_at)}});
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
          {"failed", status.failed.empty() ? Json(nullptr) : Json(status.failed)},
          {"directory", path_or_null(status.directory)},
          {"flight_s", status.flight_s},
          {"last_flight", path_or_null(status.last_flight)},
          {"flights", status.flights}};
}

void add_record_methods(MethodTable& table, Recordings& recordings) {
  table.add(EventRow{"recording",
                     "what: started, ended (ticks, lost: how many are missing), failed (why), flight (fault: "
                     "the flight recorder has written what led to it). file: which."});
  table.add(MethodRow{
      "record.start",
      Role::operator_,
      {{"file", ParamType::text, false,
        "a plain name, which goes into the directory that record.status names; without it "
        "one of the time. Administrators may give an absolute path"}},
      "Writes every tick from now on to an HDF5 file. Answers file. One at a time.",
      [&recordings](const Json& params, const Caller& caller) { return start(recordings, params, caller); },
      true});
  table.add(MethodRow{"record.stop",
                      Role::operator_,
                      {},
                      "Ends what record.start began: answers file, ticks, and lost, how many are missing.",
                      [&recordings](const Json&, const Caller&) { return stop(recordings); },
                      true});
  table.add(MethodRow{
      "record.status",
      Role::observer,
      {},
      "running: file, ticks and lost so far, or null; failed: why the last one ended by "
      "itself; directory; flight_s: what the flight recorder holds; last_flight: its newest "
      "file since the start; flights: how many.",
      [&recordings](const Json&, const Caller&) { return MethodResult(recording_json(recordings)); }});
  table.add(
      MethodRow{"record.list",
                Role::observer,
                {},
                "The recordings of the directory that record.status names, the oldest first: name, bytes, "
                "and when they were written (UTC). What is being written is not among them.",
                [&recordings](const Json&, const Caller&) { return MethodResult(list(recordings)); },
                true});
  table.add(MethodRow{"record.open",
                      Role::observer,
                      {{"name", ParamType::text, true, "as record.list names it"}},
                      "Hands over the descriptor of a recording, to be read, beside the answer (SCM_RIGHTS).",
                      [&recordings](const Json& params, const Caller&) { return open(recordings, params); },
                      true});
}

}  // namespace wrenchd
