# SPDX-License-Identifier: GPL-3.0-or-later
"""The tests of the release build that a mutant can be shown to, and how they are run."""

import dataclasses
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import time

MEMORY_LIMIT = 8 << 30  # address space of one test program: a mutant may allocate without end
FILE_LIMIT = 1 << 30
OUTPUT_LIMIT = 4 << 20


@dataclasses.dataclass(frozen=True)
class TestCase:
    """One test as ctest runs it."""

    name: str
    program: str  # in bin/
    command: tuple  # the words before the program, then "", then those behind it
    directory: str
    source: str  # of the test case, relative to the root; empty if the program is one test
    environment: tuple = ()
    must_print: str = ""  # text that the test must print to pass; empty: its exit code decides
    skip_code: int = -1

    @property
    def of_catch(self):
        return bool(self.source)

    @property
    def noun(self):
        return re.sub(r"^test_|\.cpp$", "", os.path.basename(self.source)) if self.source else ""


# Tests that need the machine for themselves, another machine, a browser or root.
LEFT_OUT_LABELS = {"wall_time", "system"}


def read_cases(build):
    """Returns all tests of programs that link the project's libraries, by name."""
    shown = subprocess.run(["ctest", "--show-only=json-v1"], cwd=build.directory, check=True, capture_output=True, text=True)
    bins = build.directory + "/bin/"
    cases, catch = {}, {}
    for test in json.loads(shown.stdout)["tests"]:
        words = test.get("command", [])
        values = {p["name"]: p["value"] for p in test.get("properties", [])}
        place = next((i for i, word in enumerate(words) if word.startswith(bins)), None)
        if place is None or place > 1 or LEFT_OUT_LABELS & set(values.get("LABELS", [])) or values.get("RUN_SERIAL"):
            continue
        program = words[place][len(bins) :]
        if "cmake" in os.path.basename(words[0]) or os.path.basename(words[0]) in ("node", "python3"):
            continue
        if program not in catch:
            catch[program] = _catch_sources(build, words[: place + 1])
        must_print = values.get("PASS_REGULAR_EXPRESSION", "")
        cases[test["name"]] = TestCase(
            name=test["name"],
            program=program,
            command=(*words[:place], "", *words[place + 1 :]),
            directory=values.get("WORKING_DIRECTORY", build.directory),
            source=catch[program].get(test["name"], ""),
            environment=tuple(values.get("ENVIRONMENT", [])),
            must_print=must_print[0] if isinstance(must_print, list) else must_print,
            skip_code=int(values.get("SKIP_RETURN_CODE", -1)),
        )
    return cases


def _catch_sources(build, words):
    """Test case -> source of a program of Catch2; nothing for other programs."""
    if not os.path.basename(words[-1]).endswith("tests"):
        return {}
    listed = subprocess.run([*words, "--list-test-names-only", "-v", "high"], cwd=build.directory, capture_output=True, text=True)
    found = {}
    for line in listed.stdout.splitlines():
        match = re.match(r"(.*?)\s*\t@(.*?):\d+$", line)
        if match:
            source = match.group(2)
            cut = source.rfind("/tests/") if not source.startswith("tests/") else -1
            found[match.group(1).strip()] = source[cut + 1 :]
    return found


@dataclasses.dataclass
class Outcome:
    red: bool
    timed_out: bool
    seconds: float
    first_red: str  # the test case that went red first; empty if that is not known
    words: str  # the last that was printed


def run_cases(cases, program, limit_s, scratch, trace=""):
    """Runs test cases of one program in one process, until the first failure.

    program: the executable to run in the place of the one built. scratch: a directory for everything they write.
    """
    temporary = f"{scratch}/tmp"
    shutil.rmtree(temporary, ignore_errors=True)
    os.makedirs(temporary)
    os.makedirs(f"{scratch}/cache", exist_ok=True)
    one = cases[0]
    place = one.command.index("")
    words = [*one.command[:place], program]
    if one.of_catch:
        # Commas join names as alternatives; names in words of their own would all have to match. No test is red.
        names = ",".join(case.command[place + 1] for case in cases)
        words += [names, "-a", "-w", "NoTests", "-r", "xml"]
    else:
        words += one.command[place + 1 :]
    environment = dict(os.environ)
    environment.update(e.split("=", 1) for e in one.environment)
    environment.update(TMPDIR=temporary, XDG_CACHE_HOME=f"{scratch}/cache", WRENCHD_TEST_CACHE=f"{scratch}/cache")
    environment.pop("WRENCHD_TRACE", None)
    if trace:
        environment["WRENCHD_TRACE"] = trace
    started = time.monotonic()
    timed_out = False
    with open(f"{scratch}/printed", "wb+") as printed:
        process = subprocess.Popen(
            words, cwd=one.directory, env=environment, stdin=subprocess.DEVNULL, stdout=printed, stderr=printed,
            start_new_session=True, preexec_fn=_limit,
        )  # fmt: skip
        try:
            process.wait(limit_s)
        except subprocess.TimeoutExpired:
            timed_out = True
        _end_group(process)
        seconds = time.monotonic() - started
        size = printed.seek(0, os.SEEK_END)
        printed.seek(max(0, size - OUTPUT_LIMIT))
        text = printed.read().decode(errors="replace")
    shutil.rmtree(temporary, ignore_errors=True)
    if process.returncode == one.skip_code:
        return Outcome(False, False, seconds, "", "skipped")
    red = timed_out or process.returncode != 0
    if one.must_print:
        red = timed_out or not re.search(one.must_print, text)
    first = ""
    if red:
        first = _first_red(text, cases) if one.of_catch else one.name
        if not first and len(cases) == 1:
            first = one.name
    return Outcome(red, timed_out, seconds, first, text[-2000:])


def _limit():
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    resource.setrlimit(resource.RLIMIT_FSIZE, (FILE_LIMIT, FILE_LIMIT))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _end_group(process):
    """Ends the program and all that it has started."""
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    process.wait()


def _first_red(text, cases):
    """The test case in which Catch2's report first says that something failed, or that was the last to begin."""
    starts = list(re.finditer(r'<TestCase name="([^"]*)"', text))
    red = re.search(r'success="false"|<Failure|<Exception|<FatalErrorCondition', text)
    begun = [m for m in starts if not red or m.start() < red.start()]
    if not begun:
        return ""
    name = begun[-1].group(1)
    for old, new in (("&lt;", "<"), ("&gt;", ">"), ("&quot;", '"'), ("&apos;", "'"), ("&amp;", "&")):
        name = name.replace(old, new)
    known = {case.name: case.name for case in cases}
    return known.get(name, known.get(name.strip(), ""))
