// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/log_output.hpp"

#include <memory>
#include <utility>

#include <spdlog/details/log_msg_buffer.h>
#include <spdlog/sinks/sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "daemon/journal.hpp"
#include "daemon/log_prefix.hpp"
#include "daemon/standard_streams.hpp"

namespace wrenchd {
namespace {

/// Queues each log entry, with the prefix and the journal fields of the thread that logs it. spdlog's own
/// asynchronous logger is not used: at the end it waits for its thread without a limit.
class QueuedSink final : public spdlog::sinks::sink {
 public:
  QueuedSink(OutputQueue& queue, std::shared_ptr<spdlog::sinks::sink> target)
      : queue_(queue), target_(std::move(target)) {}

  void log(const spdlog::details::log_msg& original) override {
    const std::string text =
        LogPrefix::current() + std::string(original.payload.data(), original.payload.size());
    spdlog::details::log_msg message = original;
    message.payload = text;  // the buffer below copies it
    queue_.post(message.payload.size(), [target = target_, entry = spdlog::details::log_msg_buffer(message),
                                         fields = JournalFields::current()] {
      const JournalFields here(fields);
      target->log(entry);
      target->flush();
    });
  }
  void flush() override {}
  void set_pattern(const std::string& pattern) override { target_->set_pattern(pattern); }
  void set_formatter(std::unique_ptr<spdlog::formatter> formatter) override {
    target_->set_formatter(std::move(formatter));
  }

 private:
  OutputQueue& queue_;
  std::shared_ptr<spdlog::sinks::sink> target_;
};

std::shared_ptr<spdlog::sinks::sink> make_target() {
  if (stderr_is_journal()) return make_journal_sink();
  auto terminal = std::make_shared<spdlog::sinks::stderr_color_sink_mt>();
  terminal->set_pattern("%H:%M:%S.%e %^%l%$ %v");
  return terminal;
}

OutputQueue::ReportDropped report_dropped_by(std::shared_ptr<spdlog::sinks::sink> target) {
  return [target = std::move(target)](std::uint64_t count) {
    const std::string text = std::to_string(count) + " log lines were dropped: the log was not read in time";
    target->log(spdlog::details::log_msg("wrenchd", spdlog::level::warn, text));
    target->flush();
  };
}

}  // namespace

LogOutput::LogOutput(bool verbose) : LogOutput(verbose, make_target()) {}

LogOutput::LogOutput(bool verbose, const std::shared_ptr<spdlog::sinks::sink>& target)
    : queue_(report_dropped_by(target)) {
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>("wrenchd", std::make_shared<QueuedSink>(queue_, target)));
  if (verbose) spdlog::set_level(spdlog::level::debug);
}

LogOutput::~LogOutput() {
  spdlog::set_default_logger(std::make_shared<spdlog::logger>("wrenchd"));  // no sink
  queue_.close();
}

void LogOutput::print_error(std::string text) {
  queue_.post(text.size(), [text = std::move(text)] { write_all(STDERR_FILENO, text); });
}

}  // namespace wrenchd
