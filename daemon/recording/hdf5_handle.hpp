// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <hdf5.h>

namespace wrenchd {

/// Owns an HDF5 identifier. Not RT-safe: closing may write a file.
class Hdf5Handle {
 public:
  using Close = herr_t (*)(hid_t);
  Hdf5Handle(hid_t id, Close close) : id_(id), close_(close) {}
  ~Hdf5Handle() {
    if (id_ >= 0) close_(id_);
  }
  Hdf5Handle(const Hdf5Handle&) = delete;
  Hdf5Handle& operator=(const Hdf5Handle&) = delete;
  operator hid_t() const { return id_; }  // NOLINT(google-explicit-constructor): HDF5 takes plain identifiers
  bool ok() const { return id_ >= 0; }

 private:
  hid_t id_;
  Close close_;
};

}  // namespace wrenchd
