// SPDX-License-Identifier: GPL-3.0-or-later
// Prints wrench and contacts ten times per second until wrenchd ends, or until the given number of lines.
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include <wrenchd/client.hpp>

int main(int argc, char** argv) {
  const long lines = argc > 1 ? std::atol(argv[1]) : -1;
  try {
    wrenchd::Client client;
    std::printf("wrenchd is %s\n", client.state().c_str());
    wrenchd::StateReader reader = client.open_state();
    wrenchd::TickState tick;
    const auto every = static_cast<std::uint64_t>(std::lround(reader.rate_Hz() / 10.0));
    for (long printed = 0; printed != lines;) {
      if (!reader.next(tick) || tick.tick() % every != 0) continue;
      const auto F = tick.wrench();
      std::printf("tick %8llu %-8s F %+6.2f %+6.2f %+6.2f N |", static_cast<unsigned long long>(tick.tick()),
                  tick.state().c_str(), F[0], F[1], F[2]);
      for (const wrenchd::ProxyContact& contact : tick.contacts())
        std::printf(" %s on %s %s (%.0f %%)", contact.tool_feature.c_str(), contact.obstacle.c_str(),
                    contact.obstacle_feature.c_str(), 100.0 * contact.load_fraction);
      std::printf("\n");
      std::fflush(stdout);
      ++printed;
    }
    if (reader.missed() > 0)
      std::printf("%llu ticks were missed\n", static_cast<unsigned long long>(reader.missed()));
  } catch (const wrenchd::ClientError& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
