// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/mcap_writer.hpp"

#include <algorithm>

namespace wrenchd {
namespace {

constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};
constexpr std::size_t kChunkBytes = std::size_t{1} << 20;

enum class Opcode : std::uint8_t {
  header = 0x01,
  footer = 0x02,
  schema = 0x03,
  channel = 0x04,
  message = 0x05,
  chunk = 0x06,
  message_index = 0x07,
  chunk_index = 0x08,
  statistics = 0x0B,
  summary_offset = 0x0E,
  data_end = 0x0F,
};

template <class T>
void put_number(std::string& to, T number) {
  for (std::size_t i = 0; i < sizeof number; ++i) to += static_cast<char>((number >> (8 * i)) & 0xFFU);
}
void put_u16(std::string& to, std::uint16_t number) {
  to += static_cast<char>(number & 0xFFU);
  to += static_cast<char>(number >> 8U);
}
void put_text(std::string& to, std::string_view text) {
  put_number(to, static_cast<std::uint32_t>(text.size()));
  to += text;
}

std::string record(Opcode opcode, const std::string& content) {
  std::string bytes(1, static_cast<char>(opcode));
  put_number(bytes, static_cast<std::uint64_t>(content.size()));
  return bytes + content;
}

std::string map_of(const std::map<std::uint16_t, std::uint64_t>& numbers) {
  std::string pairs;
  for (const auto& [key, value] : numbers) {
    put_u16(pairs, key);
    put_number(pairs, value);
  }
  std::string bytes;
  put_text(bytes, pairs);
  return bytes;
}

std::uint32_t crc32(std::string_view bytes) {
  boost::crc_32_type crc;
  crc.process_bytes(bytes.data(), bytes.size());
  return crc.checksum();
}

}  // namespace

McapWriter::McapWriter(std::ostream& out, const std::string& library) : out_(out) {
  put(std::string(kMagic));
  std::string header;
  put_text(header, "");
  put_text(header, library);
  put(record(Opcode::header, header));
}

void McapWriter::put(const std::string& bytes) {
  out_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  written_ += bytes.size();
  data_crc_.process_bytes(bytes.data(), bytes.size());
}

std::uint16_t McapWriter::add_channel(const std::string& topic, const std::string& schema_name,
                                      const std::string& schema) {
  const auto next = static_cast<std::uint16_t>(schema_ids_.size() + 1);
  const auto [id, is_new] = schema_ids_.emplace(schema_name, next);
  if (is_new) {
    std::string content;
    put_u16(content, next);
    put_text(content, schema_name);
    put_text(content, "jsonschema");
    put_text(content, schema);
    schema_records_.push_back(record(Opcode::schema, content));
    chunk_ += schema_records_.back();
  }
  const auto channel = static_cast<std::uint16_t>(channel_records_.size());
  std::string content;
  put_u16(content, channel);
  put_u16(content, id->second);
  put_text(content, topic);
  put_text(content, "json");
  put_text(content, "");
  channel_records_.push_back(record(Opcode::channel, content));
  chunk_ += channel_records_.back();
  sequences_.push_back(0);
  return channel;
}

void McapWriter::add_message(std::uint16_t channel, std::uint64_t time_ns, std::string_view json) {
  if (chunk_index_.empty()) chunk_start_ns_ = chunk_end_ns_ = time_ns;
  if (messages_ == 0) start_ns_ = end_ns_ = time_ns;
  ++messages_;
  chunk_start_ns_ = std::min(chunk_start_ns_, time_ns), chunk_end_ns_ = std::max(chunk_end_ns_, time_ns);
  start_ns_ = std::min(start_ns_, time_ns), end_ns_ = std::max(end_ns_, time_ns);
  chunk_index_[channel].push_back({time_ns, chunk_.size()});
  std::string content;
  put_u16(content, channel);
  put_number(content, sequences_[channel]++);
  put_number(content, time_ns);
  put_number(content, time_ns);
  content += json;
  chunk_ += record(Opcode::message, content);
  if (chunk_.size() >= kChunkBytes) close_chunk();
}

void McapWriter::close_chunk() {
  if (chunk_.empty()) return;
  std::string content;
  put_number(content, chunk_start_ns_);
  put_number(content, chunk_end_ns_);
  put_number(content, static_cast<std::uint64_t>(chunk_.size()));
  put_number(content, crc32(chunk_));
  put_text(content, "");  // no compression
  put_number(content, static_cast<std::uint64_t>(chunk_.size()));
  content += chunk_;
  ChunkIndex index{chunk_start_ns_, chunk_end_ns_, written_, 0, 0, chunk_.size(), {}};
  put(record(Opcode::chunk, content));
  index.bytes = written_ - index.offset;
  for (const auto& [channel, entries] : chunk_index_) {
    std::string pairs, one;
    for (const IndexEntry& entry : entries) {
      put_number(pairs, entry.time_ns);
      put_number(pairs, entry.offset);
    }
    put_u16(one, channel);
    put_text(one, pairs);
    index.index_offsets[channel] = written_;
    const std::string bytes = record(Opcode::message_index, one);
    index.index_bytes += bytes.size();
    put(bytes);
  }
  chunks_.push_back(std::move(index));
  chunk_.clear();
  chunk_index_.clear();
  chunk_start_ns_ = chunk_end_ns_ = 0;
}

std::string McapWriter::statistics() const {
  std::string content;
  put_number(content, messages_);
  put_u16(content, static_cast<std::uint16_t>(schema_records_.size()));
  put_number(content, static_cast<std::uint32_t>(channel_records_.size()));
  put_number(content, std::uint32_t{0});  // attachments
  put_number(content, std::uint32_t{0});  // metadata
  put_number(content, static_cast<std::uint32_t>(chunks_.size()));
  put_number(content, start_ns_);
  put_number(content, end_ns_);
  std::map<std::uint16_t, std::uint64_t> counts;
  for (std::size_t i = 0; i < sequences_.size(); ++i)
    if (sequences_[i] > 0) counts[static_cast<std::uint16_t>(i)] = sequences_[i];
  return record(Opcode::statistics, content + map_of(counts));
}

void McapWriter::close() {
  close_chunk();
  std::string data_end;
  put_number(data_end, static_cast<std::uint32_t>(data_crc_.checksum()));
  put(record(Opcode::data_end, data_end));

  std::string chunk_records;
  for (const ChunkIndex& chunk : chunks_) {
    std::string content;
    put_number(content, chunk.start_ns);
    put_number(content, chunk.end_ns);
    put_number(content, chunk.offset);
    put_number(content, chunk.bytes);
    content += map_of(chunk.index_offsets);
    put_number(content, chunk.index_bytes);
    put_text(content, "");
    put_number(content, chunk.size);
    put_number(content, chunk.size);
    chunk_records += record(Opcode::chunk_index, content);
  }
  const auto joined = [](const std::vector<std::string>& records) {
    std::string all;
    for (const std::string& one : records) all += one;
    return all;
  };
  const std::uint64_t summary_start = written_;
  std::string summary, offsets;
  const auto add_group = [&](Opcode opcode, const std::string& group) {
    if (group.empty()) return;
    std::string content(1, static_cast<char>(opcode));
    put_number(content, summary_start + summary.size());
    put_number(content, static_cast<std::uint64_t>(group.size()));
    offsets += record(Opcode::summary_offset, content);
    summary += group;
  };
  add_group(Opcode::schema, joined(schema_records_));
  add_group(Opcode::channel, joined(channel_records_));
  add_group(Opcode::statistics, statistics());
  add_group(Opcode::chunk_index, chunk_records);
  const std::uint64_t offsets_start = summary_start + summary.size();
  summary += offsets;
  // The checksum of the summary includes the footer up to the checksum itself.
  std::string footer;
  put_number(footer, summary_start);
  put_number(footer, offsets_start);
  std::string head(1, static_cast<char>(Opcode::footer));
  put_number(head, static_cast<std::uint64_t>(footer.size() + sizeof(std::uint32_t)));
  const std::uint32_t crc = crc32(summary + head + footer);
  put_number(footer, crc);
  put(summary + head + footer + std::string(kMagic));
}

}  // namespace wrenchd
