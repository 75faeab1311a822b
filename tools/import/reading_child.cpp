// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/import/reading_child.hpp"

#include <array>
#include <cerrno>
#include <chrono>
#include <new>

#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/files/limited_process.hpp"
#include "daemon/control/owned_fd.hpp"
#include "tools/import/import_error.hpp"

namespace wrenchd {
namespace {

/// The first byte of an answer says how the child ended. An answer without a byte: the child crashed.
constexpr char kResult = 'R', kRejection = 'X', kNoMemory = 'M';
/// A machine under load may take this many times longer than the processor.
constexpr double kWallFactor = 10.0;

void send(std::string_view bytes) noexcept {
  while (!bytes.empty()) {
    const ssize_t n = ::write(kChildPipe, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) ::_exit(1);
    bytes.remove_prefix(static_cast<std::size_t>(n));
  }
}

[[noreturn]] void run_child(int pipe, const ReadingLimits& limits,
                            const std::function<std::string()>& read) noexcept {
  // Libraries print messages; the child's messages to the user come through the pipe.
  const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC);
  if (nowhere < 0 || ::dup2(nowhere, 1) < 0 || ::dup2(nowhere, 2) < 0) ::_exit(1);
  begin_limited_child(nowhere, pipe, static_cast<std::uint64_t>(limits.cpu_s) + 1);
  if (!kSanitized) {
    limit_resource(RLIMIT_AS, address_space_bytes() + limits.memory_bytes);
    limit_resource(RLIMIT_NOFILE, 0);  // what is open stays open
    restrict_system_calls();
  }
  try {
    const std::string result = read();
    send({&kResult, 1});
    send(result);
    ::_exit(0);
  } catch (const ImportError& error) {
    send({&kRejection, 1});
    send(error.what());
    ::_exit(0);
  } catch (const std::bad_alloc&) {
    send({&kNoMemory, 1});
  } catch (...) {  // an exception of the library: as a crash
  }
  ::_exit(1);
}

/// Receives bytes until the child closes the pipe.
std::string receive(int pipe, const LimitedChild& child, const std::string& library,
                    const ReadingLimits& limits) {
  const auto begin = std::chrono::steady_clock::now();
  std::string answer;
  std::array<char, 1 << 16> piece{};
  for (;;) {
    const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    if (child.cpu_s() > limits.cpu_s || wall_s > kWallFactor * limits.cpu_s)
      throw ImportError(library + " needs more than " + std::to_string(static_cast<int>(limits.cpu_s)) +
                        " s of processor time; use a coarser --chord, select parts with --part, or "
                        "simplify the model");
    pollfd ready{pipe, POLLIN, 0};
    if (::poll(&ready, 1, 100) <= 0) continue;
    const ssize_t n = ::read(pipe, piece.data(), piece.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return answer;
    if (answer.size() + static_cast<std::size_t>(n) > limits.answer_bytes)
      throw ImportError("has more content than can be imported; select parts with --part");
    answer.append(piece.data(), static_cast<std::size_t>(n));
  }
}

}  // namespace

std::string read_in_child(const std::string& library, const ReadingLimits& limits,
                          const std::function<std::string()>& read) {
  std::array<int, 2> pipe{};
  const std::string no_process = "cannot be read: no process can be started; try again";
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0) throw ImportError(no_process);
  const OwnedFd read_end(pipe[0]);
  OwnedFd write_end(pipe[1]);
  const pid_t pid = ::fork();
  if (pid < 0) throw ImportError(no_process);
  if (pid == 0) run_child(write_end.get(), limits, read);
  const LimitedChild child(pid);
  write_end.reset();
  std::string answer = receive(read_end.get(), child, library, limits);
  const char kind = answer.empty() ? '\0' : answer.front();
  if (!answer.empty()) answer.erase(0, 1);
  if (kind == kResult) return answer;
  if (kind == kRejection) throw ImportError(answer);
  if (kind == kNoMemory)
    throw ImportError(library + " needs more than " + std::to_string(limits.memory_bytes >> 30) +
                      " GiB of memory; use a coarser --chord, select parts with --part, or simplify the "
                      "model");
  throw ImportError("is damaged: " + library + " crashes on it; export it again");
}

}  // namespace wrenchd
