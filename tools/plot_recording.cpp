// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/plot_recording.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <string>
#include <system_error>

#include "core/pose.hpp"
#include "core/state.hpp"
#include "tools/csv_row.hpp"
#include "tools/gnuplot.hpp"
#include "tools/output_file.hpp"
#include "tools/plot_script.hpp"

namespace wrenchd {
namespace {

namespace fs = std::filesystem;

/// A figure cannot show more points than this.
constexpr std::size_t kMaxRows = 6000;
/// Resolution of the histogram of durations.
constexpr double kBinsPerDecade = 20.0;
constexpr std::array kFigures = {"force", "torque", "penetration", "energy", "ticks", "trajectory"};

double time_s(const Recording& recording, const TickRecord& tick) {
  return 1e-9 * static_cast<double>(tick.now_ns - recording.ticks.front().now_ns);
}

double norm(const std::array<double, 6>& F, std::size_t from) {
  return std::hypot(F[from], F[from + 1], F[from + 2]);
}

/// Returns the distance [mm] and the angle [deg] between p and q; NaN if q is not valid.
std::array<double, 2> penetration(const TickRecord& tick) {
  const Pose p = pose_from_numbers(tick.X_WP), q = pose_from_numbers(tick.X_WQ);
  return {1e3 * (q.translation_m - p.translation_m).norm(),
          180.0 / std::numbers::pi * rotation_vector(p.rotation.conjugate() * q.rotation).norm()};
}

/// Writes at most kMaxRows rows. Each row shows the tick with the largest force of its interval, so that no
/// peak is lost.
std::string recording_csv(const Recording& recording) {
  std::ostringstream csv;
  csv << "t,fx,fy,fz,f,tx,ty,tz,torque,depth_mm,rotation_deg,in_mJ,out_mJ,injected_mJ,armed,"
         "px,py,pz,qx,qy,qz\n";
  const auto& ticks = recording.ticks;
  bool sampled = false;
  const std::size_t every = (ticks.size() + kMaxRows - 1) / kMaxRows;
  for (std::size_t i = 0; i < ticks.size(); i += every) {
    const auto begin = ticks.begin() + static_cast<std::ptrdiff_t>(i);
    const auto end = ticks.begin() + static_cast<std::ptrdiff_t>(std::min(i + every, ticks.size()));
    const TickRecord& tick = *std::max_element(begin, end, [](const TickRecord& a, const TickRecord& b) {
      return norm(a.F_out, 0) < norm(b.F_out, 0);
    });
    CsvRow row(csv);
    row << time_s(recording, tick) << tick.F_out[0] << tick.F_out[1] << tick.F_out[2] << norm(tick.F_out, 0);
    for (std::size_t k = 3; k < 6; ++k) row << 1e3 * tick.F_out[k];
    row << 1e3 * norm(tick.F_out, 3);
    for (const double x : penetration(tick)) row << x;
    row << 1e3 * tick.energy_in_J << 1e3 * tick.energy_out_J << 1e3 * tick.injected_J
        << (is_driving(static_cast<State>(tick.state)) ? 1.0 : 0.0);
    sampled = sampled || tick.fresh != 0;  // p is unknown before the first sample
    for (const auto* X : {&tick.X_WP, &tick.X_WQ})
      for (std::size_t k = 0; k < 3; ++k) row << (sampled ? 1e3 * (*X)[k] : std::nan(""));
  }
  return csv.str();
}

/// Writes histograms of tick durations and wake latencies, with the fraction of ticks above each bin.
std::string tick_times_csv(const Recording& recording) {
  std::vector<double> duration_us, latency_us;
  for (const TickRecord& tick : recording.ticks) {
    double us = 0.0;
    for (const std::int64_t ns : tick.stage_ns) us += 1e-3 * static_cast<double>(ns);
    if (tick.released != 0 || us <= 0.0) continue;
    duration_us.push_back(us);
    latency_us.push_back(std::max(1e-3 * static_cast<double>(tick.wake_latency_ns), 0.0));
  }
  std::ostringstream csv;
  csv << "from_us,to_us,durations,latencies,duration_tail,latency_tail\n";
  if (duration_us.empty()) return csv.str();
  std::sort(duration_us.begin(), duration_us.end());
  std::sort(latency_us.begin(), latency_us.end());
  const double all = static_cast<double>(duration_us.size());
  const auto below = [](const std::vector<double>& sorted, double us) {
    return static_cast<double>(std::lower_bound(sorted.begin(), sorted.end(), us) - sorted.begin());
  };
  const double longest_us = std::max(duration_us.back(), latency_us.back());
  for (int bin = 0;; ++bin) {
    const double from_us = bin == 0 ? 0.0 : std::pow(10.0, bin / kBinsPerDecade);
    const double to_us = std::pow(10.0, (bin + 1) / kBinsPerDecade);
    CsvRow(csv) << std::max(from_us, 1.0) << to_us << below(duration_us, to_us) - below(duration_us, from_us)
                << below(latency_us, to_us) - below(latency_us, from_us)
                << 1.0 - below(duration_us, from_us) / all << 1.0 - below(latency_us, from_us) / all;
    if (to_us > longest_us) break;
  }
  return csv.str();
}

/// Returns the variables of the gnuplot script.
std::string variables(const Recording& recording, const std::string& terminal, const std::string& one,
                      const std::string& title) {
  std::string text = "terminal = '" + terminal + "'\none = '" + one + "'\ntitle = '" + title + "'\n";
  const double rate_Hz = recording.header.rate_Hz;
  text += "period_us = " + std::to_string(rate_Hz > 0.0 ? 1e6 / rate_Hz : 1000.0) + "\n";
  const bool timed = std::any_of(recording.ticks.begin(), recording.ticks.end(), [](const TickRecord& tick) {
    return tick.released == 0 && tick.stage_ns != TickRecord{}.stage_ns;
  });
  const bool proxy_valid = std::any_of(recording.ticks.begin(), recording.ticks.end(),
                                       [](const TickRecord& tick) { return std::isfinite(tick.X_WQ[0]); });
  text += "proxy_valid = " + std::string(proxy_valid ? "1" : "0") + "\n";
  text += "timed = " + std::string(timed ? "1" : "0") + "\n";
  return text;
}

std::string gnuplot_title(const std::string& text) {
  std::string good;
  for (const char c : text)
    if (c != '\'' && c != '\\' && static_cast<unsigned char>(c) >= ' ') good += c;
  return good;
}

void write_tables(const Recording& recording, const fs::path& directory, const std::string& variables) {
  const auto write = [&](const char* name, const std::string& text) {
    write_output((directory / name).string(), text);
  };
  write("run.csv", recording_csv(recording));
  write("ticks.csv", tick_times_csv(recording));
  write("figures.gp", variables + kPlotScript);
}

/// A temporary directory, removed by the destructor.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string name = (fs::temp_directory_path() / "wrenchctl-plot-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::system_error(errno, std::generic_category(), name);
    path_ = name;
  }
  ~TemporaryDirectory() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

}  // namespace

std::vector<fs::path> plot_recording(const Recording& recording, const fs::path& output) {
  if (recording.ticks.empty())
    throw std::runtime_error("the recording has no ticks; record again while the loop runs");
  const std::string title = gnuplot_title(recording.header.scene_file.stem().string());
  const std::string kind = output.extension().string();
  if (kind == ".svg" || kind == ".pdf" || kind == ".png") {
    const TemporaryDirectory directory;
    write_tables(recording, directory.path(), variables(recording, kind.substr(1), "all" + kind, title));
    run_gnuplot(directory.path(), "figures.gp", "");
    std::error_code error;
    fs::copy_file(directory.path() / ("all" + kind), output, fs::copy_options::overwrite_existing, error);
    if (error)
      throw std::runtime_error(output.string() + ": cannot be written (" + error.message() +
                               "); name a file in a writable directory");
    return {output};
  }
  std::error_code error;
  fs::create_directories(output, error);
  if (!fs::is_directory(output))
    throw std::runtime_error(
        output.string() +
        ": is not a directory and cannot be created; name another directory, or a file that "
        "ends in .svg, .pdf or .png");
  write_tables(recording, output, variables(recording, "svg", "", title));
  run_gnuplot(output, "figures.gp", "; the tables are in " + output.string());
  std::vector<fs::path> pictures;
  for (const char* figure : kFigures) pictures.push_back(output / (std::string(figure) + ".svg"));
  return pictures;
}

}  // namespace wrenchd
