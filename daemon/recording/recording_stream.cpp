// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recording_stream.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include <poll.h>
#include <unistd.h>

#include "config/config_error.hpp"
#include "daemon/servo/record_fields.hpp"

// A message is a byte with its kind, the number of bytes that follow (std::uint64_t), and these bytes. Both
// ends are the same program on the same machine, so numbers have their native form.

namespace wrenchd {
namespace {

enum Kind : std::uint8_t { kHeader = 1, kTicks, kContacts, kEvents, kEnd, kRejected };

/// Longest reason of a rejection.
constexpr std::uint64_t kMaxReasonBytes = 4096;

void append(std::string& out, std::uint64_t number) {
  out.append(reinterpret_cast<const char*>(&number), sizeof number);
}

void append(std::string& out, const std::string& text) {
  append(out, std::uint64_t{text.size()});
  out += text;
}

/// Takes numbers and texts from the bytes of a message.
class Reader {
 public:
  explicit Reader(std::string_view bytes) : rest_(bytes) {}

  std::uint64_t number() {
    std::uint64_t value = 0;
    std::memcpy(&value, take(sizeof value).data(), sizeof value);
    return value;
  }
  std::string text() { return std::string(take(number())); }
  bool at_end() const { return rest_.empty(); }

 private:
  std::string_view take(std::uint64_t bytes) {
    if (bytes > rest_.size()) throw BrokenStream("a text is longer than its message");
    const std::string_view taken = rest_.substr(0, static_cast<std::size_t>(bytes));
    rest_.remove_prefix(static_cast<std::size_t>(bytes));
    return taken;
  }

  std::string_view rest_;
};

RecordingHeader header_from(std::string_view bytes) {
  Reader in(bytes);
  RecordingHeader header;
  for (std::string* text : {&header.version, &header.settings, &header.scene, &header.profile,
                            &header.realtime, &header.kernel, &header.hand})
    *text = in.text();
  for (std::filesystem::path* path : {&header.settings_file, &header.scene_file, &header.profile_file})
    *path = in.text();
  const std::uint64_t rate = in.number();
  std::memcpy(&header.rate_Hz, &rate, sizeof rate);
  header.virtual_time = in.number() != 0;
  header.hands = static_cast<int>(in.number());
  header.started_ns = static_cast<std::int64_t>(in.number());
  header.started_unix_ns = static_cast<std::int64_t>(in.number());
  while (!in.at_end()) {
    RecordedFile file;
    file.role = in.text();
    file.path = in.text();
    file.sha256 = in.text();
    file.embedded = in.number() != 0;
    file.bytes = in.text();
    header.files.push_back(std::move(file));
  }
  return header;
}

std::vector<RecordedEvent> read_events(std::string_view bytes) {
  Reader in(bytes);
  std::vector<RecordedEvent> events;
  while (!in.at_end()) {
    RecordedEvent event;
    event.time_ns = static_cast<std::int64_t>(in.number());
    event.tick = static_cast<std::int64_t>(in.number());
    const std::uint64_t severity = in.number();
    if (severity > static_cast<std::uint64_t>(EventLevel::error))
      throw BrokenStream("an event has an unknown severity");
    event.severity = static_cast<EventLevel>(severity);
    const std::uint64_t value = in.number();
    std::memcpy(&event.value, &value, sizeof value);
    event.name = in.text();
    event.text = in.text();
    event.conditions = in.text();
    events.push_back(std::move(event));
  }
  return events;
}

/// The stream of one sender.
class Stream {
 public:
  Stream(int pipe, const std::function<void()>& keep_waiting) : pipe_(pipe), keep_waiting_(keep_waiting) {}

  void read(void* to, std::size_t bytes) {
    auto* at = static_cast<char*>(to);
    while (bytes > 0) {
      constexpr int kLook_ms = 20;
      pollfd ready{pipe_, POLLIN, 0};
      const int count = ::poll(&ready, 1, kLook_ms);
      keep_waiting_();
      if (count <= 0) continue;
      const ssize_t got = ::read(pipe_, at, bytes);
      if (got < 0 && (errno == EINTR || errno == EAGAIN)) continue;
      if (got <= 0) throw BrokenStream("the sender has ended");
      at += got;
      bytes -= static_cast<std::size_t>(got);
    }
  }

 private:
  int pipe_;
  const std::function<void()>& keep_waiting_;
};

/// Appends rows to a table, in pieces: a size that is only claimed costs no memory.
template <class Row>
void read_rows(Stream& stream, std::uint64_t bytes, std::vector<Row>& rows) {
  constexpr std::uint64_t kPiece_rows = 4096;
  if (bytes % sizeof(Row) != 0) throw BrokenStream("a table ends within a row");
  for (std::uint64_t left = bytes / sizeof(Row); left > 0;) {
    const std::uint64_t piece = std::min(left, kPiece_rows);
    const std::size_t begin = rows.size();
    rows.resize(begin + static_cast<std::size_t>(piece));
    stream.read(rows.data() + begin, static_cast<std::size_t>(piece) * sizeof(Row));
    left -= piece;
  }
}

std::string read_bytes(Stream& stream, std::uint64_t bytes) {
  constexpr std::uint64_t kPiece = std::uint64_t{1} << 20;
  std::string text;
  while (bytes > 0) {
    const auto piece = static_cast<std::size_t>(std::min(bytes, kPiece));
    text.resize(text.size() + piece);
    stream.read(text.data() + text.size() - piece, piece);
    bytes -= piece;
  }
  return text;
}

std::uint64_t integer_at(const void* row, const RecordField& field) {
  const auto* at = static_cast<const unsigned char*>(row) + field.offset;
  std::uint64_t value = 0;
  std::memcpy(&value, at, std::min(size_of(field.type), sizeof value));  // little endian, as all of wrenchd
  return value;
}

/// Rejects values without a name: programs use them as indices into tables of names.
template <class Row>
void check_named_values(const std::vector<Row>& rows, std::span<const RecordField> fields, const char* table,
                        const std::filesystem::path& file) {
  for (const RecordField& field : fields) {
    if (is_bits(field.values)) continue;
    const std::size_t names = value_names(field.values).size();
    if (names == 0) continue;
    for (std::size_t row = 0; row < rows.size(); ++row)
      if (const std::uint64_t value = integer_at(&rows[row], field); value >= names)
        throw RecordingError(file.string() + ": column '" + field.name + "' of table '" + table +
                             "' has the value " + std::to_string(value) + " in row " + std::to_string(row) +
                             ", which has no meaning; the file is damaged, use a complete copy");
  }
}

}  // namespace

void RecordingSender::message(std::uint8_t kind, const void* data, std::size_t bytes) {
  std::string head(1, static_cast<char>(kind));
  append(head, std::uint64_t{bytes});
  for (std::string_view part :
       {std::string_view(head), std::string_view(static_cast<const char*>(data), bytes)})
    while (!part.empty()) {
      const ssize_t put = ::write(pipe_, part.data(), part.size());
      if (put < 0 && errno == EINTR) continue;
      if (put < 0) throw RecordingError("the receiver of the recording has gone");
      part.remove_prefix(static_cast<std::size_t>(put));
    }
}

void RecordingSender::send(const RecordingHeader& header) {
  std::string out;
  for (const std::string* text : {&header.version, &header.settings, &header.scene, &header.profile,
                                  &header.realtime, &header.kernel, &header.hand})
    append(out, *text);
  for (const std::filesystem::path* path : {&header.settings_file, &header.scene_file, &header.profile_file})
    append(out, path->string());
  std::uint64_t rate = 0;
  std::memcpy(&rate, &header.rate_Hz, sizeof rate);
  append(out, rate);
  append(out, std::uint64_t{header.virtual_time});
  append(out, static_cast<std::uint64_t>(header.hands));
  append(out, static_cast<std::uint64_t>(header.started_ns));
  append(out, static_cast<std::uint64_t>(header.started_unix_ns));
  for (const RecordedFile& file : header.files) {
    append(out, file.role);
    append(out, file.path.string());
    append(out, file.sha256);
    append(out, std::uint64_t{file.embedded});
    append(out, file.bytes);
  }
  message(kHeader, out.data(), out.size());
}

void RecordingSender::send(std::span<const TickRow> rows) {
  message(kTicks, rows.data(), rows.size_bytes());
}

void RecordingSender::send(std::span<const Touch> rows) {
  message(kContacts, rows.data(), rows.size_bytes());
}

void RecordingSender::send(std::span<const RecordedEvent> events) {
  std::string out;
  for (const RecordedEvent& event : events) {
    append(out, static_cast<std::uint64_t>(event.time_ns));
    append(out, static_cast<std::uint64_t>(event.tick));
    append(out, std::uint64_t{static_cast<std::uint8_t>(event.severity)});
    std::uint64_t value = 0;
    std::memcpy(&value, &event.value, sizeof value);
    append(out, value);
    for (const std::string* text : {&event.name, &event.text, &event.conditions}) append(out, *text);
  }
  message(kEvents, out.data(), out.size());
}

void RecordingSender::end() {
  message(kEnd, "", 0);
}

void RecordingSender::reject(const std::string& reason) {
  message(kRejected, reason.data(), std::min<std::size_t>(reason.size(), kMaxReasonBytes));
}

ReceivedRecording receive_recording(int pipe, const std::filesystem::path& file, std::uint64_t most_bytes,
                                    const std::function<void()>& keep_waiting) {
  Stream stream(pipe, keep_waiting);
  ReceivedRecording received;
  std::uint64_t left = most_bytes;
  while (true) {
    std::uint8_t kind = 0;
    std::uint64_t bytes = 0;
    stream.read(&kind, sizeof kind);
    stream.read(&bytes, sizeof bytes);
    if (kind == kRejected && bytes <= kMaxReasonBytes)
      throw RecordingError(file.string() + ": " + printable(read_bytes(stream, bytes), kMaxReasonBytes));
    if (bytes > left)
      throw RecordingError(file.string() + ": unpacks to more than " + std::to_string(most_bytes >> 20) +
                           " MiB, which is more than its size allows; the file is damaged");
    left -= bytes;
    if (kind == kHeader) {
      received.header = header_from(read_bytes(stream, bytes));
    } else if (kind == kTicks) {
      read_rows(stream, bytes, received.ticks);
    } else if (kind == kContacts) {
      read_rows(stream, bytes, received.contacts);
    } else if (kind == kEvents) {
      received.events = read_events(read_bytes(stream, bytes));
    } else if (kind == kEnd && bytes == 0) {
      break;
    } else {
      throw BrokenStream("a message has an unknown kind");
    }
  }
  check_named_values(received.ticks, tick_fields(), "ticks", file);
  check_named_values(received.contacts, contact_fields(), "contacts", file);
  return received;
}

}  // namespace wrenchd
