// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/journal.hpp"

#include <cstdlib>
#include <memory>
#include <string_view>

#include <spdlog/details/null_mutex.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <syslog.h>
#include <systemd/sd-journal.h>
#include <unistd.h>

namespace wrenchd {
namespace {

thread_local JournalFieldList fields_here;

int priority_of(spdlog::level::level_enum level) {
  switch (level) {
    case spdlog::level::trace:
    case spdlog::level::debug:
      return LOG_DEBUG;
    case spdlog::level::info:
      return LOG_INFO;
    case spdlog::level::warn:
      return LOG_WARNING;
    case spdlog::level::err:
      return LOG_ERR;
    default:
      return LOG_CRIT;
  }
}

/// The journal sink of spdlog supports no fields. sd_journal_sendv() is thread-safe, so the sink needs no
/// lock.
class JournalSink final : public spdlog::sinks::base_sink<spdlog::details::null_mutex> {
  void sink_it_(const spdlog::details::log_msg& message) override {
    const std::string text(message.payload.data(), message.payload.size());
    std::vector<std::string> assignments = {"MESSAGE=" + text,
                                            "PRIORITY=" + std::to_string(priority_of(message.level)),
                                            "SYSLOG_IDENTIFIER=wrenchd"};
    for (const auto& [name, value] : JournalFields::current()) assignments.push_back(name + "=" + value);
    std::vector<iovec> parts;
    parts.reserve(assignments.size());
    for (std::string& assignment : assignments) parts.push_back({assignment.data(), assignment.size()});
    sd_journal_sendv(parts.data(), static_cast<int>(parts.size()));
  }
  void flush_() override {}
};

}  // namespace

bool stderr_is_journal() {
  const char* const stream = std::getenv("JOURNAL_STREAM");
  struct stat status {};
  if (stream == nullptr || ::fstat(STDERR_FILENO, &status) != 0) return false;
  return std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino) == stream;
}

std::shared_ptr<spdlog::sinks::sink> make_journal_sink() {
  return std::make_shared<JournalSink>();
}

JournalFields::JournalFields(JournalFieldList fields) : previous_(std::exchange(fields_here, {})) {
  fields_here = std::move(fields);
}

JournalFields::~JournalFields() {
  fields_here = std::move(previous_);
}

const JournalFieldList& JournalFields::current() noexcept {
  return fields_here;
}

}  // namespace wrenchd
