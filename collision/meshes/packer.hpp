// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "collision/meshes/mesh_surface.hpp"
#include "core/pose.hpp"

namespace wrenchd {

/// True for types whose bytes are their complete value. Eigen's vectors are such types although they have a
/// user-defined copy constructor.
template <class T>
constexpr bool kBytewiseCopyable = std::is_trivially_copyable_v<T>;
template <>
inline constexpr bool kBytewiseCopyable<Vector3d> = true;
template <>
inline constexpr bool kBytewiseCopyable<MeshSurface::Plane> = true;

/// Appends values to a byte string in the format of this machine (sizes, byte order). Not RT-safe: allocates.
class Packer {
 public:
  explicit Packer(std::string& bytes) : bytes_(bytes) {}

  template <class T>
  void operator()(const T& value) const {
    static_assert(kBytewiseCopyable<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  template <class T>
  void operator()(const std::vector<T>& list) const {
    (*this)(static_cast<std::uint64_t>(list.size()));
    if constexpr (kBytewiseCopyable<T>)
      bytes_.append(reinterpret_cast<const char*>(list.data()), list.size() * sizeof(T));
    else
      for (const T& value : list) (*this)(value);
  }
  void operator()(const std::string& text) const { (*this)(std::vector<char>(text.begin(), text.end())); }

 private:
  std::string& bytes_;
};

/// Reads values in the order in which a Packer wrote them. good() is false after a value was missing; the
/// values are then undefined. Not RT-safe: allocates.
class Unpacker {
 public:
  explicit Unpacker(std::string_view bytes) : rest_(bytes) {}

  template <class T>
  void operator()(T& value) const {
    static_assert(kBytewiseCopyable<T>);
    if (!has(sizeof value)) return;
    std::memcpy(static_cast<void*>(&value), rest_.data(), sizeof value);
    rest_.remove_prefix(sizeof value);
  }
  template <class T>
  void operator()(std::vector<T>& list) const {
    std::uint64_t size = 0;
    (*this)(size);
    constexpr std::size_t least = kBytewiseCopyable<T> ? sizeof(T) : 1;
    if (!has(0) || size > rest_.size() / least) return void(good_ = false);
    list.resize(size);
    if constexpr (kBytewiseCopyable<T>) {
      if (size > 0) std::memcpy(static_cast<void*>(list.data()), rest_.data(), size * sizeof(T));
      rest_.remove_prefix(size * sizeof(T));
    } else {
      for (T& value : list) (*this)(value);
    }
  }
  void operator()(std::string& text) const {
    std::vector<char> letters;
    (*this)(letters);
    text.assign(letters.begin(), letters.end());
  }

  bool good() const noexcept { return good_; }
  bool at_end() const noexcept { return good_ && rest_.empty(); }

 private:
  bool has(std::size_t size) const noexcept { return good_ = good_ && rest_.size() >= size; }

  mutable std::string_view rest_;
  mutable bool good_ = true;
};

}  // namespace wrenchd
