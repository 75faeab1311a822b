// SPDX-License-Identifier: GPL-3.0-or-later
#include <algorithm>
#include <atomic>
#include <bit>
#include <cstring>
#include <map>
#include <mutex>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <nlohmann/json.hpp>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <wrenchd/state_reader.hpp>

namespace wrenchd {
namespace {

using nlohmann::json;

constexpr std::uint64_t kVersion = 2;
/// Interval at which a waiting reader checks whether the daemon is still connected.
constexpr auto kConnectionCheckInterval = std::chrono::milliseconds(50);

[[noreturn]] void fail_protocol(const std::string& what) {
  throw ClientError(ClientError::kProtocol, "the daemon's state cannot be read: " + what +
                                                "; use the client library of the daemon's version");
}

struct Field {
  std::string name, unit, doc;
  char type = 'f';  ///< 'f', 'i' or 'u'
  std::size_t width = 8;
  std::size_t count = 1;
  std::size_t offset = 0;
  std::vector<std::string> values, bits;
};

using Fields = std::map<std::string, Field, std::less<>>;

Field read_field(const json& from, std::size_t room) {
  Field field;
  field.name = from.at("name");
  field.unit = from.at("unit");
  field.doc = from.at("doc");
  field.count = from.at("count");
  field.offset = from.at("offset");
  const std::string type = from.at("type");
  static const std::map<std::string, std::size_t> kWidths = {{"u8", 1},  {"u16", 2}, {"u32", 4},
                                                             {"u64", 8}, {"i64", 8}, {"f64", 8}};
  const auto width = kWidths.find(type);
  if (width == kWidths.end()) fail_protocol("field '" + field.name + "' is of type '" + type + "'");
  field.type = type.front();
  field.width = width->second;
  if (field.count == 0 || field.count > room || field.offset > room ||
      field.offset + field.count * field.width > room)
    fail_protocol("field '" + field.name + "' lies outside of its record");
  if (from.contains("values")) field.values = from.at("values").get<std::vector<std::string>>();
  if (from.contains("bits")) field.bits = from.at("bits").get<std::vector<std::string>>();
  return field;
}

Fields read_fields(const json& list, std::size_t room) {
  if (!list.is_array() || list.empty()) fail_protocol("its layout has no fields");
  Fields fields;
  for (const json& one : list) {
    Field field = read_field(one, room);
    fields.emplace(field.name, field);
  }
  return fields;
}

const Field& field_of(const Fields& fields, std::string_view name) {
  const auto found = fields.find(name);
  if (found == fields.end())
    throw ClientError(ClientError::kProtocol,
                      "the daemon's state has no field '" + std::string(name) + "'; describe() lists them");
  return found->second;
}

std::uint64_t bits_of(const Field& field, const std::byte* record, std::size_t i) {
  if (i >= field.count)
    throw ClientError(ClientError::kProtocol, "field '" + field.name + "' has " +
                                                  std::to_string(field.count) + " numbers, and index " +
                                                  std::to_string(i) + " was requested");
  std::uint64_t bits = 0;  // value on a little-endian machine, which the constructor requires
  std::memcpy(&bits, record + field.offset + i * field.width, field.width);
  return bits;
}

double parse_number(const Field& field, const std::byte* record, std::size_t i) {
  const std::uint64_t bits = bits_of(field, record, i);
  if (field.type == 'f') return std::bit_cast<double>(bits);
  if (field.type == 'i') return static_cast<double>(static_cast<std::int64_t>(bits));
  return static_cast<double>(bits);
}

std::string text_of(const Field& field, const std::byte* record) {
  const std::uint64_t value = bits_of(field, record, 0);
  if (!field.bits.empty()) {
    std::string all;
    for (unsigned bit = 0; bit < 64; ++bit) {
      if ((value >> bit & 1) == 0) continue;
      const std::string name = bit < field.bits.size() ? field.bits[bit] : "bit " + std::to_string(bit);
      all += (all.empty() ? "" : ", ") + name;
    }
    return all;
  }
  return value < field.values.size() ? field.values[value] : std::to_string(value);
}

}  // namespace

struct TickState::Layout {
  std::size_t bytes, header_bytes, written_offset, slots, slot_bytes, record_offset, record_bytes;
  double rate_Hz;
  Fields fields;
  std::size_t contacts_offset, contact_bytes, max_contacts;
  Fields contact_fields;

  explicit Layout(const json& from) {
    if (from.at("version").get<std::uint64_t>() != kVersion)
      fail_protocol("its layout has version " + from.at("version").dump());
    if (from.at("byte_order") != "little" || std::endian::native != std::endian::little)
      fail_protocol("only little-endian machines are supported");
    bytes = from.at("bytes");
    header_bytes = from.at("header_bytes");
    written_offset = from.at("written_offset");
    slots = from.at("slots");
    slot_bytes = from.at("slot_bytes");
    record_offset = from.at("record_offset");
    record_bytes = from.at("record_bytes");
    rate_Hz = from.at("rate_Hz");
    const bool fits = slots > 0 && slot_bytes % 8 == 0 && record_bytes % 8 == 0 && header_bytes % 8 == 0 &&
                      record_offset == 8 && record_bytes < slot_bytes && header_bytes >= 64 &&
                      header_bytes < bytes && written_offset % 8 == 0 && written_offset < header_bytes &&
                      slots <= (bytes - header_bytes) / slot_bytes && rate_Hz > 0.0;
    if (!fits) fail_protocol("the sizes in its layout contradict each other");
    fields = read_fields(from.at("fields"), record_bytes);
    const json& contacts = from.at("contacts");
    contacts_offset = contacts.at("offset");
    contact_bytes = contacts.at("bytes");
    max_contacts = contacts.at("max_count");
    if (contact_bytes == 0 || contacts_offset > record_bytes ||
        max_contacts > (record_bytes - contacts_offset) / contact_bytes)
      fail_protocol("the contacts lie outside of the record");
    contact_fields = read_fields(contacts.at("fields"), contact_bytes);
  }
};

/// Caches the names of obstacles by rendering, because a tick may belong to an earlier rendering.
class TickState::Names {
 public:
  Names(const json& layout, std::function<std::string()> ask) : ask_(std::move(ask)) { keep(layout); }

  std::string of(std::uint32_t rendering, std::uint32_t number) {
    const std::scoped_lock lock(mutex_);
    if (rendering > known_.rbegin()->first && ask_) {
      try {
        keep(json::parse(ask_()));
      } catch (const std::exception&) {  // the daemon is gone or busy; the obstacle number identifies the
                                         // obstacle instead
      }
    }
    const auto found = known_.find(rendering);
    return found != known_.end() && number < found->second.size() ? found->second[number]
                                                                  : "obstacle " + std::to_string(number);
  }

 private:
  void keep(const json& from) {
    known_[from.at("rendering_id")] = from.at("obstacles").get<std::vector<std::string>>();
    while (known_.size() > kMostKept) known_.erase(known_.begin());
  }

  static constexpr std::size_t kMostKept = 8;

  std::mutex mutex_;
  std::function<std::string()> ask_;
  std::map<std::uint32_t, std::vector<std::string>> known_;
};

double TickState::number(std::string_view field, std::size_t i) const {
  if (!layout_) throw ClientError(ClientError::kProtocol, "no tick was read yet; call next() or latest()");
  return parse_number(field_of(layout_->fields, field), reinterpret_cast<const std::byte*>(words_.data()), i);
}

std::int64_t TickState::integer(std::string_view field, std::size_t i) const {
  if (!layout_) throw ClientError(ClientError::kProtocol, "no tick was read yet; call next() or latest()");
  const Field& what = field_of(layout_->fields, field);
  const std::uint64_t bits = bits_of(what, reinterpret_cast<const std::byte*>(words_.data()), i);
  return what.type == 'f' ? static_cast<std::int64_t>(std::bit_cast<double>(bits))
                          : static_cast<std::int64_t>(bits);
}

std::string TickState::text(std::string_view field) const {
  if (!layout_) throw ClientError(ClientError::kProtocol, "no tick was read yet; call next() or latest()");
  return text_of(field_of(layout_->fields, field), reinterpret_cast<const std::byte*>(words_.data()));
}

std::vector<ProxyContact> TickState::contacts() const {
  const auto count =
      std::min<std::size_t>(static_cast<std::size_t>(integer("contact_count")), layout_->max_contacts);
  std::vector<ProxyContact> out(count);
  const auto rendering_id = static_cast<std::uint32_t>(integer("rendering_id"));
  for (std::size_t k = 0; k < count; ++k) {
    const std::byte* from = reinterpret_cast<const std::byte*>(words_.data()) + layout_->contacts_offset +
                            k * layout_->contact_bytes;
    const auto get = [&](std::string_view name, std::size_t i = 0) {
      return parse_number(field_of(layout_->contact_fields, name), from, i);
    };
    const auto feature = [&](const std::string& body) {
      std::string name = text_of(field_of(layout_->contact_fields, body + "_feature_kind"), from);
      if (name == "plane" || name == "none") return name;
      const auto number = [&](const std::string& which) {
        return std::to_string(bits_of(field_of(layout_->contact_fields, body + which), from, 0));
      };
      name += " " + number("_first");
      return name.find("edge") == std::string::npos ? name : name + "-" + number("_second");
    };
    ProxyContact& contact = out[k];
    for (std::size_t i = 0; i < 3; ++i) {
      contact.point_W_m[i] = get("point_W_m", i);
      contact.normal_W[i] = get("normal_W", i);
    }
    contact.load_fraction = get("load_fraction");
    contact.multiplier_kg_m = get("multiplier_kg_m");
    contact.obstacle_number = static_cast<std::uint32_t>(get("obstacle"));
    contact.obstacle = names_->of(rendering_id, contact.obstacle_number);
    contact.tool_feature = feature("tool");
    contact.obstacle_feature = feature("obstacle");
  }
  return out;
}

StateReader::StateReader(const std::string& layout, int descriptor, std::function<bool()> is_there,
                         std::function<std::string()> ask_names)
    : is_connected_(std::move(is_there)) {
  const struct Closed {
    int descriptor;
    ~Closed() { close(descriptor); }
  } closed{descriptor};
  try {
    const json described = json::parse(layout);
    layout_ = std::make_shared<const TickState::Layout>(described);
    names_ = std::make_shared<TickState::Names>(described, std::move(ask_names));
  } catch (const json::exception& error) {
    fail_protocol(error.what());
  }
  // The memory must be sealed: if it shrank, a read would end this process.
  const int seals = fcntl(descriptor, F_GET_SEALS);
  struct stat file {};
  if (seals < 0 || (seals & F_SEAL_SHRINK) == 0 || fstat(descriptor, &file) != 0 ||
      static_cast<std::uint64_t>(file.st_size) < layout_->bytes)
    fail_protocol("its memory is not sealed, or too small");
  void* const mapped = mmap(nullptr, layout_->bytes, PROT_READ, MAP_SHARED, descriptor, 0);
  if (mapped == MAP_FAILED) fail_protocol(std::string("mmap: ") + std::strerror(errno));
  memory_ = static_cast<const std::byte*>(mapped);
  bytes_ = layout_->bytes;
  if (std::memcmp(memory_, "WRENCHST", 8) != 0) {
    unmap();
    fail_protocol("its memory does not begin with WRENCHST");
  }
  next_ = unread();
}

StateReader::~StateReader() {
  unmap();
}

StateReader::StateReader(StateReader&& other) noexcept
    : layout_(std::move(other.layout_)),
      names_(std::move(other.names_)),
      is_connected_(std::move(other.is_connected_)),
      memory_(std::exchange(other.memory_, nullptr)),
      bytes_(other.bytes_),
      next_(other.next_),
      missed_(other.missed_),
      next_check_(other.next_check_) {}

StateReader& StateReader::operator=(StateReader&& other) noexcept {
  if (this == &other) return *this;
  unmap();
  layout_ = std::move(other.layout_);
  names_ = std::move(other.names_);
  is_connected_ = std::move(other.is_connected_);
  memory_ = std::exchange(other.memory_, nullptr);
  bytes_ = other.bytes_;
  next_ = other.next_;
  missed_ = other.missed_;
  next_check_ = other.next_check_;
  return *this;
}

void StateReader::unmap() noexcept {
  if (memory_ != nullptr) munmap(const_cast<std::byte*>(memory_), bytes_);
  memory_ = nullptr;
}

namespace {

/// Loads a word that another process writes. A load of a lock-free atomic does not write, so read-only memory
/// suffices.
std::uint64_t load(const std::byte* at, std::memory_order order) {
  static_assert(std::atomic<std::uint64_t>::is_always_lock_free);
  return reinterpret_cast<const std::atomic<std::uint64_t>*>(at)->load(order);
}

}  // namespace

std::uint64_t StateReader::unread() const noexcept {
  return load(memory_ + layout_->written_offset, std::memory_order_acquire) - next_;
}

/// The daemon stores words with release order, so a word of a newer record becomes visible together with the
/// record's guard. Therefore two equal guards enclose words of one record only.
StateReader::CopyResult StateReader::copy(std::uint64_t i, TickState& out) const {
  const std::byte* slot = memory_ + layout_->header_bytes + i % layout_->slots * layout_->slot_bytes;
  const std::uint64_t whole = 2 * i + 2;
  if (load(slot, std::memory_order_acquire) != whole) return CopyResult::overrun;
  out.layout_ = layout_;
  out.names_ = names_;
  out.words_.resize(layout_->record_bytes / 8);
  for (std::size_t k = 0; k < out.words_.size(); ++k)
    out.words_[k] = load(slot + layout_->record_offset + 8 * k, std::memory_order_acquire);
  return load(slot, std::memory_order_relaxed) == whole ? CopyResult::complete : CopyResult::overrun;
}

/// Continues in the middle of the available ticks, so that the next overrun is not immediate.
void StateReader::skip_overwritten() {
  const std::uint64_t ahead = unread();
  if (ahead <= layout_->slots / 2) return;
  const std::uint64_t left_out = ahead - layout_->slots / 2;
  missed_ += left_out;
  next_ += left_out;
}

bool StateReader::next(TickState& out, std::chrono::milliseconds timeout) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + timeout;
  const auto pause = std::chrono::duration<double>(0.25 / layout_->rate_Hz);
  for (;;) {
    while (unread() > 0) {
      if (copy(next_, out) == CopyResult::complete) {
        ++next_;
        return true;
      }
      skip_overwritten();
    }
    const auto now = Clock::now();
    // Before the end is tested: a caller that never waits detects the loss too.
    if (now >= next_check_) {
      next_check_ = now + kConnectionCheckInterval;
      if (is_connected_ && !is_connected_() && unread() == 0)
        throw ClientError(ClientError::kDisconnected,
                          "the daemon is gone; connect again when wrenchd is running");
    }
    if (now >= end) return false;
    std::this_thread::sleep_for(pause);
  }
}

bool StateReader::latest(TickState& out) const {
  for (;;) {
    const std::uint64_t written = load(memory_ + layout_->written_offset, std::memory_order_acquire);
    if (written == 0) return false;
    if (copy(written - 1, out) == CopyResult::complete) return true;
  }
}

double StateReader::rate_Hz() const noexcept {
  return layout_->rate_Hz;
}

std::vector<std::string> StateReader::describe() const {
  std::vector<std::string> lines;
  for (const auto& [name, field] : layout_->fields)
    lines.push_back(name + " [" + field.unit + "]: " + field.doc);
  return lines;
}

}  // namespace wrenchd
