// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>

namespace wrenchd {

/// Owns an identifier of HDF5, a hid_t. Headers do not include hdf5.h; event_table.cpp checks that the types
/// agree. Not RT-safe: closing may write a file.
class H5Handle {
 public:
  using Close = int (*)(std::int64_t);
  H5Handle(std::int64_t id, Close close) : id_(id), close_(close) {}
  ~H5Handle() {
    if (id_ >= 0) close_(id_);
  }
  H5Handle(const H5Handle&) = delete;
  H5Handle& operator=(const H5Handle&) = delete;
  operator std::int64_t() const {
    return id_;
  }  // NOLINT(google-explicit-constructor): HDF5 takes plain identifiers
  bool ok() const { return id_ >= 0; }

 private:
  std::int64_t id_;
  Close close_;
};

}  // namespace wrenchd
