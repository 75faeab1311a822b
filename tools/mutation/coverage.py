# SPDX-License-Identifier: GPL-3.0-or-later
"""Which test cases run which source lines: found once by traced test programs, kept while the objects are the same.

The traced programs link the product's objects with a call at the start of each basic block. A block owns the
lines of all code from its call to the next one.
"""

import bisect
import collections
import concurrent.futures
import glob
import hashlib
import json
import os
import shlex
import shutil
import struct
import subprocess
import sys

import cases as test_cases

# Compiler options that keep the blocks of the source, each with its own trace call.
TRACE_FLAGS = [
    "-O1", "-g1", "-w", "-fsanitize-coverage=trace-pc", "-fno-reorder-blocks", "-fno-if-conversion",
    "-fno-if-conversion2", "-fno-ssa-phiopt", "-fno-tree-sink",
]  # fmt: skip
TRACE_CALL = "__sanitizer_cov_trace_pc"
HERE = os.path.dirname(os.path.abspath(__file__))


class Coverage:
    """lines[case][file]: a number with bit n set if the case runs line n. seconds[case]: how long it took."""

    def __init__(self):
        self.lines = {}
        self.seconds = {}
        self.red = {}  # cases that fail without any mutant -> what they printed
        self._runs = collections.defaultdict(list)  # file -> [(case, lines)]

    def add(self, case, lines, seconds):
        self.lines[case] = lines
        self.seconds[case] = seconds
        for file, mask in lines.items():
            self._runs[file].append((case, mask))

    def cases_on(self, file, first, last):
        """The test cases that run one of the lines `first` to `last` of the file."""
        wanted = ((1 << (last - first + 1)) - 1) << first
        return [case for case, mask in self._runs.get(file, []) if mask & wanted]

    def cases_in(self, file):
        return [case for case, _ in self._runs.get(file, [])]


def find_coverage(build, sources, cases, place, jobs, log):
    """Builds the traced programs in the directory `place` and runs the tests that changed since the last run."""
    os.makedirs(place, exist_ok=True)
    programs = sorted({case.program for case in cases.values()})
    objects = _build_traced(build, sources, programs, place, jobs, log)
    hashes = {source: _hash_of(file) for source, file in objects.items()}
    kept = {}
    kept_file = f"{place}/coverage.json"
    if os.path.exists(kept_file):
        with open(kept_file) as file:
            kept = json.load(file)
    own = _own_hashes(build, cases)
    coverage, to_run = Coverage(), []
    for name, case in cases.items():
        old = kept.get(name)
        if old and old["own"] == own[name] and all(hashes.get(s) == h for s, h in old["objects"].items()):
            coverage.add(name, {f: int(mask, 16) for f, mask in old["lines"].items()}, old["seconds"])
        else:
            to_run.append(case)
    if to_run:
        log(f"tracing {len(to_run)} of {len(cases)} test cases")
        blocks = {program: _Blocks(build, f"{place}/{program}", set(sources)) for program in {c.program for c in to_run}}
        done = 0
        with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
            free = [f"{place}/run{i}" for i in range(jobs)]
            futures = {pool.submit(_trace, case, blocks[case.program], place, free): case for case in
                       sorted(to_run, key=lambda c: (c.of_catch, c.name))}  # fmt: skip
            for future in concurrent.futures.as_completed(futures):
                case = futures[future]
                outcome, lines, files = future.result()
                done += 1
                if done % 200 == 0:
                    log(f"  {done} traced")
                if outcome.red:
                    coverage.red[case.name] = outcome.words
                    kept.pop(case.name, None)
                    continue
                coverage.add(case.name, lines, outcome.seconds)
                kept[case.name] = {
                    "own": own[case.name],
                    "objects": {s: hashes[s] for s in files if s in hashes},
                    "lines": {f: hex(mask) for f, mask in lines.items()},
                    "seconds": outcome.seconds,
                }
        for directory in glob.glob(f"{place}/run*"):
            shutil.rmtree(directory, ignore_errors=True)
        kept = {name: entry for name, entry in kept.items() if name in cases}
        with open(kept_file + ".new", "w") as file:
            json.dump(kept, file)
        os.replace(kept_file + ".new", kept_file)
    return coverage


def _hash_of(file):
    with open(file, "rb") as opened:
        return hashlib.sha1(opened.read()).hexdigest()


def _own_hashes(build, cases):
    """For each test case a hash of the objects that are its own: its source's and those all cases share."""
    per_program, per_object = {}, {}
    own = {}
    for name, case in cases.items():
        if case.program not in per_program:
            objects = [w for w in build.link_words(case.program) if w.endswith(".o")]
            shared = [o for o in objects if not (case.of_catch and os.path.basename(o).startswith("test_"))]
            per_program[case.program] = "".join(_hash_of(f"{build.directory}/{o}") for o in shared)
        made = build.object_of.get(case.source, "")
        if made and made not in per_object:
            per_object[made] = _hash_of(f"{build.directory}/{made}")
        text = per_program[case.program] + per_object.get(made, "") + "\0".join(case.command)
        own[name] = hashlib.sha1(text.encode()).hexdigest()
    return own


def _build_traced(build, sources, programs, place, jobs, log):
    """Compiles the sources with calls at each block and links the test programs. source -> object."""
    objects = {source: f"{place}/objects/{source}.o" for source in sources}
    runtime = f"{place}/objects/trace_blocks.o"
    text = ["rule compile", "  command = cd $directory && $words -MD -MF $out.d -o $out -c $in",
            "  depfile = $out.d", "  deps = gcc", "rule link", "  command = cd $directory && $words"]  # fmt: skip
    ninja = lambda path: path.replace("$", "$$").replace(" ", "$ ").replace(":", "$:")
    value = lambda words: shlex.join(words).replace("$", "$$")
    launcher = os.environ.get("CMAKE_CXX_COMPILER_LAUNCHER", "").split(";")
    launcher = [launcher[0]] if launcher[0] else []
    for source, made in objects.items():
        words = launcher + build.compiler_words(source, precompiled=False) + TRACE_FLAGS
        text += [f"build {ninja(made)}: compile {ninja(f'{build.root}/{source}')}",
                 f"  directory = {build.directory}", f"  words = {value(words)}"]  # fmt: skip
    text += [f"build {ninja(runtime)}: compile {ninja(f'{HERE}/trace_blocks.cpp')}", f"  directory = {build.directory}",
             "  words = c++ -std=c++20 -O2"]  # fmt: skip
    for program in programs:
        words = list(build.link_words(program))
        libraries = [w for w in words if w.endswith(".a")]
        words[words.index("-o") + 1] = f"{place}/{program}"
        first = next(i for i, word in enumerate(words) if word.endswith(".o"))
        ours = [o for s, o in objects.items() if any(_is_in(build, s, library) for library in libraries)]
        words[first:first] = [runtime, *ours]
        built = [ninja(f"{build.directory}/{w}") for w in words if w.endswith((".o", ".a")) and not w.startswith("/")]
        text += [f"build {ninja(f'{place}/{program}')}: link | {' '.join(map(ninja, [runtime, *ours]))} {' '.join(built)}",
                 f"  directory = {build.directory}", f"  words = {value(words + ['-fuse-ld=mold'])}"]  # fmt: skip
    with open(f"{place}/build.ninja.new", "w") as file:
        file.write("\n".join(text) + "\n")
    os.replace(f"{place}/build.ninja.new", f"{place}/build.ninja")
    log("building the traced test programs")
    done = subprocess.run(["ninja", "-C", place, f"-j{jobs}"], stdout=sys.stderr if sys.stderr.isatty() else subprocess.PIPE)
    if done.returncode != 0:
        raise SystemExit(f"tools/mutate: the traced programs cannot be built:\n{(done.stdout or b'').decode()[-4000:]}")
    return objects


def _is_in(build, source, library):
    """Whether the library holds the object of the source: CMake builds both in the same directory."""
    return build.object_of[source].split("/CMakeFiles/")[0] == os.path.dirname(library)


def _inside(build, name):
    """The file relative to the root of the source tree; empty if it is not in there."""
    whole = os.path.normpath(os.path.join(build.directory, name))
    return os.path.relpath(whole, build.root) if whole.startswith(build.root + "/") else ""


class _Blocks:
    """The basic blocks of a traced program: for each address that a run writes down, the lines of the block."""

    def __init__(self, build, program, sources):
        starts, returns = self._calls(program)
        masks = [collections.defaultdict(int) for _ in starts]
        rooms = tuple({source.split("/")[0] + "/" for source in sources})
        rows = self._rows(build, program)
        addresses = sorted({row[0] for row in rows})
        following = dict(zip(addresses, addresses[1:]))
        for address, file, line in rows:
            if not file.startswith(rooms):
                continue
            first = max(bisect.bisect_right(starts, address) - 1, 0)
            last = bisect.bisect_left(starts, following.get(address, address + 1))
            for mask in masks[first:last]:
                mask[file] |= 1 << line
        self.masks = {at: mask for at, mask in zip(returns, masks) if at}

    @staticmethod
    def _calls(program):
        """Addresses at which blocks start, and those their calls return to: 0 for a function that is not traced."""
        starts, returns = [], []
        begun = called = False
        command = ["objdump", "-d", "--no-show-raw-insn", program]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as out:
            for line in out.stdout:
                if line[:1] == "0" and line.endswith(">:\n"):  # a function: its first block starts before its call
                    starts.append(int(line.split()[0], 16))
                    returns.append(0)
                    begun, called = True, False
                elif called and line.startswith(" "):
                    returns[-1] = int(line.split(":")[0], 16)
                    called = False
                if TRACE_CALL in line and "call" in line:
                    if not begun:
                        starts.append(int(line.split(":")[0], 16))
                        returns.append(0)
                    begun, called = False, True
        return starts, returns

    def _rows(self, build, program):
        """Address, file and line of each row of the program's line table, in the order of addresses."""
        rows, unnamed = [], []
        names = {}
        file = None
        command = ["objdump", "--dwarf=decodedline", program]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, errors="replace") as out:
            for line in out.stdout:
                parts = line.split()
                if len(parts) >= 3 and parts[2].startswith("0x") and file != "":
                    row = (int(parts[2], 16), file or "", int(parts[1]) if parts[1].isdigit() else 0)
                    (unnamed if file is None else rows).append(row)
                elif len(parts) >= 3 and parts[2].startswith("0x"):
                    rows.append((int(parts[2], 16), "", 0))
                elif line[:1] not in (" ", "\n") and line.rstrip().endswith((":", ":[++]")):
                    name = line.strip().replace(":[++]", "").rstrip(":")
                    if name not in names:
                        names[name] = _inside(build, name) if "/" in name else None
                    file = names[name]
        # objdump names the first file of a unit without its directory.
        asked = "\n".join(hex(row[0]) for row in unnamed)
        answer = subprocess.run(["addr2line", "-e", program], input=asked, capture_output=True, text=True, check=True)
        for row, line in zip(unnamed, answer.stdout.splitlines()):
            rows.append((row[0], _inside(build, line.rsplit(":", 1)[0]), row[2]))
        rows.sort(key=lambda row: row[0])
        return rows

    def lines_of(self, addresses):
        found = collections.defaultdict(int)
        for address in addresses:
            for file, mask in self.masks.get(address, {}).items():
                found[file] |= mask
        return dict(found)


def _trace(case, blocks, place, free):
    """Runs one test case in a traced program. Outcome, lines and the traced sources it ran."""
    scratch = free.pop()
    try:
        for _ in range(2):
            shutil.rmtree(scratch, ignore_errors=True)  # a cache that others have filled hides what fills it
            os.makedirs(scratch)
            trace = f"{scratch}/trace"
            outcome = test_cases.run_cases([case], f"{place}/{case.program}", 600, scratch, trace)
            if not outcome.red:
                break
        addresses = set()
        for name in glob.glob(trace + ".*"):
            with open(name, "rb") as file:
                data = file.read()
            addresses.update(at for (at,) in struct.iter_unpack("<I", data[: len(data) // 4 * 4]))
        lines = blocks.lines_of(addresses)
        return outcome, lines, [file for file in lines if file.endswith(".cpp")]
    finally:
        free.append(scratch)
