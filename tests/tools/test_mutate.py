#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""tools/mutate: the mutants it finds, the sample it draws, the survivors it reports, the explanations it rejects.

Each test works on a source tree of its own: a library of one function and a test program.
"""

import os
import re
import subprocess
import sys
import tempfile
import textwrap
import unittest

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
TOOL = f"{ROOT}/tools/mutation"
sys.path.insert(0, TOOL)
sys.dont_write_bytecode = True

import cases  # noqa: E402
import explained  # noqa: E402
import operators  # noqa: E402

SAMPLE = """\
#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

constexpr double kMargin = 1e-9;
static_assert(kMargin < 1.0);

enum class Kind { a = 1, b = 2 };

/// A comment with x < y and 1 + 1.
double limited(double x, double most, bool on) {
  if (!on) return 0.0;
  double y = -x;
  if (x > most && on) y = most * 2.5;
  return std::min(y, most);
}

int count(const std::vector<int>& values, int above) {
  int found = 0;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (values[i] > above) ++found;
  return found;
}

std::string joined(const std::string& a, const std::string& b) {
  std::string both;
  both.reserve(a.size() + 7);
  both = a + b;
  return both;
}

template <int N>
int times() { return N; }
int thrice() { return times<3>(); }
int table[4];
"""


def mutants_of(text):
    with tempfile.TemporaryDirectory() as root:
        with open(f"{root}/sample.cpp", "w") as file:
            file.write(text)
        return operators.find_mutants("sample.cpp", root, ["-std=c++20"])["sample.cpp"]


class Operators(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.found = mutants_of(SAMPLE)

    def changes(self, function, operator=None):
        return {m.shown for m in self.found if m.function == function and operator in (None, m.operator)}

    def test_a_relation_of_real_numbers_is_reversed(self):
        self.assertEqual(self.changes("limited", "relation"), {"> -> <="})

    def test_a_relation_of_whole_numbers_is_reversed_and_moved_by_one(self):
        self.assertEqual(self.changes("count", "relation"), {"> -> <=", "> -> >=", "values.size() -> (values.size()) - 1"})

    def test_arithmetic_signs_and_logic(self):
        self.assertEqual(self.changes("limited", "arithmetic"), {"* -> /"})
        self.assertEqual(self.changes("limited", "sign"), {"- -> (nothing)", "! -> (nothing)"})
        self.assertEqual(self.changes("limited", "logic"), {"&& -> ||"})

    def test_constants_become_others(self):
        self.assertEqual(self.changes("limited", "constant"), {"0.0 -> 1.0", "2.5 -> 5.0", "2.5 -> 1.25"})
        self.assertEqual(self.changes("count", "constant"), {"0 -> 1"})
        margin = {m.shown for m in self.found if m.declares == "kMargin"}
        self.assertEqual(margin, {"1e-9 -> 1e-06", "1e-9 -> 1e-12"})

    def test_statements_are_dropped_but_the_last_return(self):
        self.assertEqual(self.changes("limited", "drop"), {"drop return 0.0", "drop y = most * 2.5"})
        self.assertEqual(self.changes("count", "drop"), {"drop ++found"})

    def test_extrema_and_conditions(self):
        self.assertEqual(self.changes("limited", "extremum"), {"min -> max"})
        self.assertEqual(self.changes("limited", "condition"), {"x > most && on -> !(x > most && on)"})

    def test_what_has_no_result_is_left_alone(self):
        # Room in memory, sums of strings, template arguments, sizes of arrays, enumerators, what the compiler checks.
        self.assertEqual(self.changes("joined"), {"drop both = a + b"})
        self.assertEqual(self.changes("thrice"), set())
        self.assertEqual({m.line for m in self.found if not m.function}, {6})

    def test_a_step_is_turned_but_not_that_of_a_loop(self):
        self.assertEqual(self.changes("count", "step"), {"++ -> --"})

    def test_each_mutant_is_one_change_of_the_text(self):
        for mutant in self.found:
            changed = mutant.apply(SAMPLE.encode()).decode()
            self.assertNotEqual(changed, SAMPLE)
            self.assertEqual(len(changed), len(SAMPLE) - len(mutant.before) + len(mutant.after))
        with self.assertRaises(ValueError):
            self.found[0].apply(b"// another source\n" * 100)


class Explanations(unittest.TestCase):
    ENTRY = "file: sample.cpp\nfunction: limited\nline: if (!on) return 0.0;\nmutation: {}\nreason: unused\n"

    def check(self, text):
        lines = SAMPLE.splitlines()
        known = explained.Explained(explained.read_explanations(text))
        known.check(mutants_of(SAMPLE), lambda file: lines if file == "sample.cpp" else open("/no such file"))
        return {m.shown for m in mutants_of(SAMPLE) if known.reason_of(m, lines)}

    def test_an_entry_explains_its_mutant_and_no_other(self):
        self.assertEqual(self.check(self.ENTRY.format("0.0 -> 1.0")), {"0.0 -> 1.0"})
        self.assertEqual(self.check(self.ENTRY.format("drop *")), {"drop return 0.0"})
        self.assertEqual(self.check(self.ENTRY.format("*")), {"0.0 -> 1.0", "drop return 0.0", "! -> (nothing)"})

    def test_an_entry_that_matches_nothing_is_stale(self):
        for wrong in (
            self.ENTRY.format("0.0 -> 2.0"),
            self.ENTRY.format("*").replace("if (!on)", "if (!off)"),
            self.ENTRY.format("*").replace("function: limited", "function: count"),
            self.ENTRY.format("*").replace("file: sample.cpp", "file: gone.cpp"),
        ):
            with self.assertRaises(explained.Stale):
                self.check(wrong)

    def test_an_entry_without_a_reason_is_rejected(self):
        with self.assertRaises(explained.Stale):
            explained.read_explanations("file: a.cpp\nline: x;\nmutation: *\n")
        with self.assertRaises(explained.Stale):
            explained.read_explanations(self.ENTRY.format("*") + "because: of that\n")


class Slices(unittest.TestCase):
    def test_a_slice_runs_each_of_its_cases_and_is_red_if_none_runs(self):
        # Catch2 runs only what matches every word of its command line, but any of the names between commas.
        case = lambda name: cases.TestCase(name, "echo_tests", ("", name.replace(",", "\\,")), "/", "tests/test_toy.cpp")
        with tempfile.TemporaryDirectory() as scratch:
            program = f"{scratch}/echo_tests"
            with open(program, "w") as file:
                file.write("#!/bin/sh\nprintf '<%s>' \"$@\"\n")
            os.chmod(program, 0o755)
            outcome = cases.run_cases([case("one"), case("two, three")], program, 10, scratch)
        self.assertFalse(outcome.red)
        self.assertTrue(outcome.words.startswith("<one,two\\, three>"), outcome.words)
        self.assertIn("<-w><NoTests>", outcome.words)


TREE = {
    "CMakeLists.txt": """\
        cmake_minimum_required(VERSION 3.25)
        project(toy LANGUAGES CXX)
        set(CMAKE_CXX_STANDARD 20)
        set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
        set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
        enable_testing()
        include_directories(${CMAKE_SOURCE_DIR})
        add_subdirectory(core)
        add_subdirectory(tests)
        """,
    "core/CMakeLists.txt": "add_library(toy_core STATIC toy.cpp)\n",
    "core/toy.hpp": """\
        #pragma once
        inline int doubled(int x) { return x * 2; }
        int limited(int x);
        int unused(int x);
        int hidden(int x);
        """,
    "core/toy.cpp": """\
        #include "core/toy.hpp"
        int limited(int x) {
          if (x > 10) return 10;
          return x;
        }
        int unused(int x) { return x + 1; }
        int hidden(int x) { return doubled(x) + 1; }
        """,
    "tests/CMakeLists.txt": """\
        add_executable(toy toy.cpp)
        target_link_libraries(toy toy_core)
        add_test(NAME toy COMMAND toy)
        """,
    # hidden() is called, but its result is checked loosely.
    "tests/toy.cpp": """\
        #include "core/toy.hpp"
        int main() {
          return limited(9) == 9 && limited(10) == 10 && limited(11) == 10 && limited(12) == 10 && hidden(3) > 5 ? 0 : 1;
        }
        """,
}


class Run(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.directory = tempfile.TemporaryDirectory()
        cls.root = cls.directory.name
        for name, text in TREE.items():
            os.makedirs(os.path.dirname(f"{cls.root}/{name}") or cls.root, exist_ok=True)
            with open(f"{cls.root}/{name}", "w") as file:
                file.write(textwrap.dedent(text))
        for command in (
            ["git", "init", "-q"],
            ["git", "add", "."],
            ["cmake", "-G", "Ninja", "-S", ".", "-B", "build/release"],
            ["ninja", "-C", "build/release"],
        ):
            subprocess.run(command, cwd=cls.root, check=True, capture_output=True)

    @classmethod
    def tearDownClass(cls):
        cls.directory.cleanup()

    def mutate(self, *arguments):
        return subprocess.run([sys.executable, f"{TOOL}/run.py", "--root", self.root, "--jobs", "2", *arguments],
                              capture_output=True, text=True)  # fmt: skip

    def test_what_no_test_sees_is_a_survivor(self):
        done = self.mutate("--count", "all", "--at-least", "95")
        self.assertEqual(done.returncode, 1, done.stderr)
        survivors = [line for line in done.stdout.splitlines() if line.startswith("  core/")]
        unused = [line for line in survivors if "unused" in line]
        self.assertTrue(unused)
        for line in unused:
            self.assertIn("[no test runs", line)
        self.assertTrue(any("hidden" in line and "1 -> 2" in line for line in survivors), done.stdout)
        self.assertFalse(any("> -> <=" in line or "drop return 10" in line for line in survivors), done.stdout)
        self.assertRegex(done.stdout, r"seen \d+ of \d+ mutants: [0-9.]+ %")
        self.assertIn("seen", done.stderr)

    def test_the_function_of_a_header_is_mutated_in_all_that_read_it(self):
        done = self.mutate("--count", "all", "--only", "core/toy.hpp")
        self.assertRegex(done.stdout, r"seen [1-9]\d* of \d+", done.stderr)

    def test_a_seed_draws_the_same_sample_each_time(self):
        drawn = [self.mutate("--list", "--count", "6", "--seed", seed).stdout for seed in ("1", "1", "2")]
        self.assertEqual(len(drawn[0].splitlines()), 6)
        self.assertEqual(drawn[0], drawn[1])
        self.assertNotEqual(drawn[0], drawn[2])

    def test_unchanged_sources_turn_no_test_red(self):
        done = self.mutate("--count", "5", "--unchanged")
        self.assertIn("seen 0 of 5", done.stdout)

    def test_an_explained_mutant_is_counted_apart_and_a_stale_entry_stops_the_run(self):
        entry = "file: core/toy.cpp\nfunction: unused\nline: int unused(int x) {{ return x + {}; }}\nmutation: *\nreason: no caller\n"
        place = f"{self.root}/tests/mutants_explained.txt"
        self.addCleanup(lambda: os.path.exists(place) and os.remove(place))
        with open(place, "w") as file:
            file.write(entry.format(1))
        done = self.mutate("--count", "all", "--only", "core/toy.cpp")
        self.assertNotIn("unused", done.stdout)
        self.assertRegex(done.stdout, r"left out: [1-9]\d* that tests/mutants_explained.txt explains")
        with open(place, "w") as file:
            file.write(entry.format(3))
        done = self.mutate("--count", "1")
        self.assertNotEqual(done.returncode, 0)
        self.assertIn("stale", done.stderr)


if __name__ == "__main__":
    unittest.main()
