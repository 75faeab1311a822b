// SPDX-License-Identifier: GPL-3.0-or-later
#include "daemon/recording/recording_stream.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

namespace wrenchd {
namespace {

constexpr std::size_t kHead_bytes = 1 + sizeof(std::uint32_t);
/// A run has a configuration, a profile with its parents, a hand script and the meshes of its scene.
constexpr std::size_t kMaxFiles = 100'000;
constexpr std::size_t kLongestRole = 64;
constexpr std::size_t kLongestError = 2000;

/// Roles become file names when a replay unpacks the recording.
bool is_role(const std::string& role) {
  return !role.empty() && role.size() <= kLongestRole && std::all_of(role.begin(), role.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_';
  });
}

template <class Row>
void append_rows(std::vector<Row>& rows, std::string_view bytes) {
  const std::size_t before = rows.size();
  rows.resize(before + bytes.size() / sizeof(Row));
  if (!bytes.empty()) std::memcpy(static_cast<void*>(rows.data() + before), bytes.data(), bytes.size());
}

/// Returns true for a row that was allocated but not written when the process died. HDF5 reads it as zeros.
bool is_unwritten(const TickRow& row) {
  return row.tick.now_ns == 0 && row.tick.wrench_ready_ns == 0 && row.tick.tick == 0 && row.tick.state == 0;
}

/// Replaces control characters but line feeds: the text goes to a terminal.
std::string printable_error(std::string_view text) {
  std::string shown(text.substr(0, kLongestError));
  std::replace_if(
      shown.begin(), shown.end(), [](unsigned char c) { return (c < ' ' && c != '\n') || c == 0x7f; }, '?');
  return shown;
}

}  // namespace

void RecordingEncoder::put(FrameKind kind, std::string_view content) {
  do {
    const std::string_view part = content.substr(0, kMaxFrame_bytes);
    content.remove_prefix(part.size());
    std::array<char, kHead_bytes> head{};
    head[0] = static_cast<char>(kind);
    const auto length = static_cast<std::uint32_t>(part.size());
    std::memcpy(head.data() + 1, &length, sizeof length);
    write_({head.data(), head.size()});
    write_(part);
  } while (!content.empty());
}

void RecordingEncoder::put(const RecordingFacts& facts) {
  put(FrameKind::facts, {reinterpret_cast<const char*>(&facts), sizeof facts});
}

void RecordingDecoder::reject() const {
  throw RecordingError(name_ + ": is damaged; use a complete copy");
}

bool RecordingDecoder::feed(std::string_view bytes) {
  received_bytes_ += bytes.size();
  if (received_bytes_ > max_bytes_)
    throw RecordingError(name_ + ": has more content than a file of this size can hold; the file is damaged");
  pending_ += bytes;
  std::string_view rest = pending_;
  while (!complete_ && rest.size() >= kHead_bytes) {
    std::uint32_t length = 0;
    std::memcpy(&length, rest.data() + 1, sizeof length);
    if (length > RecordingEncoder::kMaxFrame_bytes) reject();
    if (rest.size() < kHead_bytes + length) break;
    take_frame(static_cast<FrameKind>(rest[0]), rest.substr(kHead_bytes, length));
    rest.remove_prefix(kHead_bytes + length);
  }
  pending_.erase(0, pending_.size() - rest.size());
  return !complete_;
}

RecordedFile& RecordingDecoder::last_file() {
  if (recording_.header.files.empty()) reject();
  return recording_.header.files.back();
}

void RecordingDecoder::take_frame(FrameKind kind, std::string_view content) {
  RecordingHeader& header = recording_.header;
  const auto append_path = [content](std::filesystem::path& path) { path += content; };
  switch (kind) {
    case FrameKind::error:
      throw RecordingError(name_ + ": " + printable_error(content));
    case FrameKind::version:
      header.version += content;
      return;
    case FrameKind::kernel:
      header.kernel += content;
      return;
    case FrameKind::realtime:
      header.realtime += content;
      return;
    case FrameKind::settings:
      header.settings += content;
      return;
    case FrameKind::settings_file:
      return append_path(header.settings_file);
    case FrameKind::scene:
      header.scene += content;
      return;
    case FrameKind::scene_file:
      return append_path(header.scene_file);
    case FrameKind::profile:
      header.profile += content;
      return;
    case FrameKind::profile_file:
      return append_path(header.profile_file);
    case FrameKind::facts: {
      RecordingFacts facts;
      if (content.size() != sizeof facts) reject();
      std::memcpy(&facts, content.data(), sizeof facts);
      header.rate_Hz = facts.rate_Hz;
      header.started_ns = facts.started_ns;
      header.started_unix_ns = facts.started_unix_ns;
      header.virtual_time = facts.virtual_time != 0;
      return;
    }
    case FrameKind::new_file:
      if (header.files.size() >= kMaxFiles) reject();
      header.files.emplace_back();
      return;
    case FrameKind::file_role:
      last_file().role += content;
      return;
    case FrameKind::file_path:
      return append_path(last_file().path);
    case FrameKind::file_sha256:
      last_file().sha256 += content;
      return;
    case FrameKind::file_embedded:
      if (content.size() != 1) reject();
      last_file().embedded = content[0] != 0;
      return;
    case FrameKind::file_bytes:
      last_file().bytes += content;
      return;
    case FrameKind::ticks:
      if (content.size() % sizeof(TickRow) != 0) reject();
      return append_rows(rows_, content);
    case FrameKind::contacts:
      if (content.size() % sizeof(Touch) != 0) reject();
      return append_rows(recording_.contacts, content);
    case FrameKind::end:
      complete_ = true;
      return;
  }
  reject();
}

Recording RecordingDecoder::take() {
  if (!complete_) reject();
  for (const RecordedFile& file : recording_.header.files)
    if (!is_role(file.role)) reject();
  while (rows_.size() > 1 && is_unwritten(rows_.back())) rows_.pop_back();
  recording_.ticks.reserve(rows_.size());
  recording_.contact_ranges.reserve(rows_.size());
  const std::uint64_t contacts = recording_.contacts.size();
  for (const TickRow& row : rows_) {
    const bool valid = row.first_contact <= contacts && row.contact_count <= contacts - row.first_contact;
    recording_.ticks.push_back(row.tick);
    recording_.contact_ranges.push_back(valid ? ContactRange{row.first_contact, row.contact_count}
                                              : ContactRange{});
  }
  rows_.clear();
  return std::move(recording_);
}

}  // namespace wrenchd
