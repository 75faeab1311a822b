// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stdexcept>
#include <string>

namespace wrenchd {

/// A file cannot be imported. what() states the place in the file, the reason and the remedy, without the
/// name of the file: "part 'lid', face 3 near (1, 2, 3) mm: ...; close it in the CAD program".
class ImportError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace wrenchd
