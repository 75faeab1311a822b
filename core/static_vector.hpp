// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <type_traits>

namespace wrenchd {

/// A vector with static capacity N. It never allocates, and a copy copies size() elements only. RT-safe.
template <class T, std::size_t N>
class StaticVector {
  // Elements are overwritten without a destructor call.
  static_assert(std::is_trivially_destructible_v<T>);

 public:
  StaticVector() noexcept {}
  StaticVector(const StaticVector& other) noexcept : size_(other.size_) {
    std::uninitialized_copy(other.begin(), other.end(), elements_);
  }
  StaticVector& operator=(const StaticVector& other) noexcept {
    size_ = other.size_;
    std::uninitialized_copy(other.begin(), other.end(), elements_);
    return *this;
  }

  std::size_t size() const noexcept { return size_; }
  bool empty() const noexcept { return size_ == 0; }
  bool full() const noexcept { return size_ == N; }
  const T& operator[](std::size_t i) const noexcept { return elements_[i]; }
  const T* begin() const noexcept { return elements_; }
  const T* end() const noexcept { return elements_ + size_; }

  /// Appends a copy of the element. Returns false and changes nothing if the vector is full.
  bool add(const T& element) noexcept {
    if (full()) return false;
    std::construct_at(elements_ + size_++, element);
    return true;
  }
  /// Removes element i by moving the last element into its position.
  void remove_unordered(std::size_t i) noexcept { elements_[i] = elements_[--size_]; }
  /// Keeps at most the first `size` elements.
  void truncate(std::size_t size) noexcept { size_ = size < size_ ? size : size_; }
  void clear() noexcept { size_ = 0; }

 private:
  union {
    T elements_[N];  // raw memory beyond size_
  };
  std::size_t size_ = 0;
};

}  // namespace wrenchd
