// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <map>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include <boost/crc.hpp>

namespace wrenchd {

/// Writes an MCAP file (mcap.dev/spec): channels of JSON messages in chunks without compression, with message
/// indexes, a summary and checksums. Add all channels, then messages in the order of their times, then call
/// close(). Not RT-safe: writes a stream.
class McapWriter {
 public:
  /// Writes the magic bytes and the header. library: name and version of the program that writes.
  McapWriter(std::ostream& out, const std::string& library);

  /// Adds a channel of JSON messages, and returns its number. schema: a JSON schema; channels with the same
  /// schema name share it.
  std::uint16_t add_channel(const std::string& topic, const std::string& schema_name,
                            const std::string& schema);
  /// Adds a message. time_ns: log time and publish time [ns since 1970].
  void add_message(std::uint16_t channel, std::uint64_t time_ns, std::string_view json);
  /// Writes the last chunk, the summary and the footer.
  void close();

 private:
  struct ChunkIndex {
    std::uint64_t start_ns, end_ns, offset, bytes, index_bytes, size;
    std::map<std::uint16_t, std::uint64_t> index_offsets;
  };
  struct IndexEntry {
    std::uint64_t time_ns, offset;
  };

  void put(const std::string& bytes);
  void close_chunk();
  std::string statistics() const;

  std::ostream& out_;
  std::uint64_t written_ = 0;    ///< bytes written so far
  boost::crc_32_type data_crc_;  ///< of all bytes of the data section so far
  std::map<std::string, std::uint16_t> schema_ids_;
  std::vector<std::string> schema_records_, channel_records_;
  std::vector<std::uint32_t> sequences_;  ///< number of messages of each channel
  std::string chunk_;
  std::uint64_t chunk_start_ns_ = 0, chunk_end_ns_ = 0;
  std::map<std::uint16_t, std::vector<IndexEntry>> chunk_index_;
  std::vector<ChunkIndex> chunks_;
  std::uint64_t messages_ = 0, start_ns_ = 0, end_ns_ = 0;
};

}  // namespace wrenchd
