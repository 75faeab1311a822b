// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/view/rolling_histogram.hpp"

#include <algorithm>
#include <cmath>

namespace wrenchd {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;

}  // namespace

double RollingHistogram::lower_edge_us(std::size_t bin) {
  return std::pow(10.0, static_cast<double>(bin) / static_cast<double>(kBinsPerDecade));
}

void RollingHistogram::add(std::int64_t time_ns, std::int64_t took_ns) {
  const std::int64_t number = time_ns / kSecond_ns;
  if (number < newest_second_ - kWindow_s) *this = {};  // the clock has restarted
  newest_second_ = std::max(newest_second_, number);
  Second& second = seconds_[static_cast<std::size_t>(number % kWindow_s)];
  if (second.number != number) {
    second = Second{};
    second.number = number;
  }
  const double us = 1e-3 * static_cast<double>(std::max<std::int64_t>(took_ns, 1));
  const double at = std::log10(us) * static_cast<double>(kBinsPerDecade * kSubBins);
  const double last = static_cast<double>(second.bins.size() - 1);
  ++second.bins[static_cast<std::size_t>(std::clamp(std::floor(at), 0.0, last))];
  second.max_ns = std::max(second.max_ns, took_ns);
}

RollingHistogram::Summary RollingHistogram::summary() const {
  Summary out;
  std::array<std::uint64_t, kBins * kSubBins> fine{};
  std::int64_t max_ns = 0;
  for (const Second& second : seconds_) {
    if (second.number < 0 || second.number > newest_second_ || second.number <= newest_second_ - kWindow_s)
      continue;
    for (std::size_t i = 0; i < fine.size(); ++i) fine[i] += second.bins[i];
    max_ns = std::max(max_ns, second.max_ns);
  }
  for (std::size_t i = 0; i < fine.size(); ++i) {
    out.bins[i / kSubBins] += fine[i];
    out.count += fine[i];
  }
  out.max_us = 1e-3 * static_cast<double>(max_ns);
  const auto quantile_us = [&](double share) {
    const auto wanted = static_cast<std::uint64_t>(std::ceil(share * static_cast<double>(out.count)));
    std::uint64_t passed = 0;
    for (std::size_t i = 0; i < fine.size(); ++i)
      if ((passed += fine[i]) >= wanted)
        return std::min(out.max_us, std::pow(10.0, static_cast<double>(i + 1) /
                                                       static_cast<double>(kBinsPerDecade * kSubBins)));
    return out.max_us;
  };
  if (out.count == 0) return out;
  out.p50_us = quantile_us(0.5);
  out.p99_9_us = quantile_us(0.999);
  return out;
}

}  // namespace wrenchd
