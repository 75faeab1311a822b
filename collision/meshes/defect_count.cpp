// SPDX-License-Identifier: GPL-3.0-or-later
#include "collision/meshes/defect_count.hpp"

#include <locale>
#include <sstream>

namespace wrenchd {

std::string format_point(const Vector3d& p) {
  std::ostringstream text;
  text.imbue(std::locale::classic());
  text << '(' << p.x() << ", " << p.y() << ", " << p.z() << ')';
  return text.str();
}

std::string total_suffix(std::size_t count) {
  return count > 1 ? " (" + std::to_string(count) + " in all)" : "";
}

void DefectCount::report(std::vector<std::string>& changes, const std::string& before, const std::string& one,
                         const std::string& after) const {
  if (count_ == 0) return;
  changes.push_back(before + ' ' + std::to_string(count_) + ' ' + one + (count_ > 1 ? "s" : "") + after +
                    (count_ > 1 ? ", first " : ": ") + first_);
}

}  // namespace wrenchd
