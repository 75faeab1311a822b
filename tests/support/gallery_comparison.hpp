// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>

namespace wrenchd::test {

/// What two runs of a gallery scene in virtual time have in common: one with wrenchd's kernels, one with
/// [rendering] contacts = "cgal".
struct GalleryComparison {
  long ticks = 0;
  long in_contact = 0;
  long compared = 0;          ///< ticks in which both hands are equal, and both proxies converged or are free
  long equal_bits = 0;        ///< compared ticks whose proxies are equal to the last bit
  double largest_m = 0.0;     ///< largest distance of the two proxies, in translation
  double largest_rad = 0.0;   ///< and in rotation
  long first_different = -1;  ///< first compared tick with a distance above 1e-9; -1: none
  long different = 0;         ///< number of these ticks
  long native_spent = 0;      ///< ticks in which wrenchd's kernels did not converge
  long first_native_spent = -1;
  long cgal_spent = 0;
  long hands_parted = -1;  ///< closed loop: first tick whose poses p differ by more than 1e-11; -1: none
  /// Open loop: processor time of a tick's projection, over the ticks in contact.
  double cgal_p50_us = 0.0, cgal_p999_us = 0.0;
  double native_p50_us = 0.0, native_p999_us = 0.0;
};

/// Runs a scene of the gallery with CGAL and compares it with a run with wrenchd's kernels.
///
/// closed_loop: both runs are complete servo loops, whose hands feel their own forces. After a tick in which
/// the kernels defer work the hands take different paths, so their proxies cannot be compared. Otherwise two
/// proxies without work limit follow the poses p of one run. seconds: maximum duration; 0: the whole hand
/// script.
GalleryComparison compare_gallery_scene(const std::string& name, bool closed_loop, double seconds = 0.0);

}  // namespace wrenchd::test
