// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <string_view>

namespace wrenchd {

/// Returns the SHA-256 of the bytes, in hexadecimal. Throws std::runtime_error if OpenSSL has no SHA-256. Not
/// RT-safe: allocates.
std::string sha256_hex(std::string_view bytes);

}  // namespace wrenchd
