#!/usr/bin/python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""The mutation run behind tools/mutate: makes small changes of the source and counts the changes that no test detects."""

import argparse
import collections
import concurrent.futures
import dataclasses
import hashlib
import json
import os
import random
import re
import shutil
import subprocess
import sys
import threading
import time

import cases as test_cases
import coverage as traced
import explained as explanations
import operators
from build import CannotBuild, ReleaseBuild

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
ROOMS = ("core/", "collision/", "devices/", "daemon/servo/")
# A header that more sources read costs minutes of compiling a mutant; its functions are left out.
MOST_USERS = 8
# Time slices for the tests of a mutant, as shares of the usual time: short ones first.
SLICES_S = (2.0, 6.0, 20.0, 60.0)
# A mutant counts as hung if its tests take longer than the usual time by this factor plus this time.
PATIENCE, PATIENCE_S = 4.0, 5.0
LIST = "tests/mutants_explained.txt"


@dataclasses.dataclass
class Verdict:
    kind: str  # seen, survived, rejected
    words: str = ""  # the test that saw it, or why it could not be built
    tests: int = 0
    seconds: float = 0.0


def log(text):
    print(text, file=sys.stderr, flush=True)


def stop(reason):
    log(f"tools/mutate: {reason}")
    sys.exit(2)


def parse_arguments():
    parser = argparse.ArgumentParser(
        prog="tools/mutate", description="Changes the source in small ways and lists the changes that no test sees."
    )
    parser.add_argument("--count", default="200", help="how many mutants to judge, or 'all' (default 200)")
    parser.add_argument("--seed", type=int, default=1, help="of the random sample (default 1)")
    parser.add_argument("--since", metavar="REF", help="only files that have changed since this commit")
    parser.add_argument("--only", metavar="FILE", nargs="+", help="only these files")
    parser.add_argument("--line", type=int, nargs="+", help="only these lines; with --only")
    parser.add_argument("--at-least", type=float, metavar="PERCENT", help="exit with 1 if fewer mutants are seen")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="mutants at a time (default: one a core)")
    parser.add_argument("--root", default=ROOT, help=argparse.SUPPRESS)
    parser.add_argument("--build", help=argparse.SUPPRESS)
    parser.add_argument("--list", action="store_true", help="list the mutants that would be drawn, and run nothing")
    parser.add_argument("--unchanged", action="store_true",
                        help="apply no change: every test must stay green, or the run itself is at fault")  # fmt: skip
    arguments = parser.parse_args()
    arguments.build = arguments.build or f"{arguments.root}/build/release"
    return arguments


def population(build, place, jobs):
    """Returns all mutants of the rooms, sorted. Reuses the lists of the last run for unchanged sources."""
    sources = sorted(s for s in build.compilers if s.startswith(ROOMS))
    with open(operators.__file__, "rb") as file:
        version = file.read()
    wanted = {source: [source] for source in sources}  # what is read in one go: a source, and headers with it
    headers = subprocess.run(["git", "ls-files", *[f"{room}*.hpp" for room in ROOMS]], cwd=build.root,
                             capture_output=True, text=True, check=True).stdout.split()  # fmt: skip
    noun = lambda path: os.path.basename(path).rsplit(".", 1)[0]
    for header in sorted(set(headers)):
        users = build.users_of(header)
        readers = sorted((s for s in users if s in wanted), key=lambda s: (noun(s) != noun(header), s))
        if readers and len(users) <= MOST_USERS:
            wanted[readers[0]].append(header)
    os.makedirs(f"{place}/mutants", exist_ok=True)
    work, kept = [], {}
    for source, paths in wanted.items():
        for path in paths:
            with open(f"{build.root}/{path}", "rb") as file:
                key = hashlib.sha1(version + path.encode() + source.encode() + file.read()).hexdigest()
            kept[path] = f"{place}/mutants/{key}.json"
        if not all(os.path.exists(kept[path]) for path in paths):
            work.append((source, build.root, build.clang_arguments(source), {path: kept[path] for path in paths}))
    if work:
        log(f"listing the mutants of {len(work)} sources")
        with concurrent.futures.ProcessPoolExecutor(jobs) as pool:
            list(pool.map(_list_mutants, work))
    for name in os.listdir(f"{place}/mutants"):
        if f"{place}/mutants/{name}" not in kept.values():
            os.remove(f"{place}/mutants/{name}")
    found = []
    for path in sorted(kept):
        with open(kept[path]) as file:
            found += [operators.Mutant(**fields) for fields in json.load(file)]
    return sources, found


def _list_mutants(work):
    source, root, arguments, places = work
    found = operators.find_mutants(source, root, arguments, [path for path in places if path != source])
    for path, place in places.items():
        with open(place + ".new", "w") as file:
            json.dump([dataclasses.asdict(m) for m in found[path]], file)
        os.replace(place + ".new", place)


class Judge:
    """Builds mutants and runs the tests that cover the changed line."""

    def __init__(self, build, cases, coverage, place, unchanged):
        self.build = build
        self.cases = cases
        self.coverage = coverage
        self.place = place
        self.unchanged = unchanged
        self.lock = threading.Lock()
        self.saw = collections.defaultdict(collections.Counter)  # file -> test -> mutants that it saw
        self.alone = set()  # tests that are red in company only

    def tests_of(self, mutant):
        """The tests that can see the mutant, those most likely to first; and whether one runs its line."""
        names, users = set(), set()
        header = mutant.file.endswith(".hpp")
        if header:
            users = self.build.users_of(mutant.file)
            names |= {name for name, case in self.cases.items() if case.source in users}
        if mutant.function:
            names |= set(self.coverage.cases_on(mutant.file, mutant.line, mutant.last_line))
        elif mutant.declares:
            for file in {mutant.file, *(u for u in users if u.startswith(ROOMS))}:
                with open(f"{self.build.root}/{file}") as text:
                    for number, line in enumerate(text, 1):
                        if re.search(rf"\b{mutant.declares}\b", line):
                            names |= set(self.coverage.cases_on(file, number, number))
        if not names and not mutant.function:
            names = {name for file in {mutant.file, *users} for name in self.coverage.cases_in(file)}
        reached = bool(names)
        if not names:  # the line has no code of its own, or no test runs it
            names = set(self.coverage.cases_on(mutant.file, mutant.first_function_line, mutant.last_function_line))
        noun = os.path.basename(mutant.file).rsplit(".", 1)[0]
        saw = self.saw[mutant.file]
        known = [self.cases[name] for name in names if name in self.coverage.seconds]
        order = lambda c: (-min(saw[c.name], 1), c.noun != noun, self.coverage.seconds[c.name], c.name)
        return sorted(known, key=order), reached

    def judge(self, mutant, scratch):
        started = time.monotonic()
        with self.lock:
            tests, reached = self.tests_of(mutant)
        if not tests:
            return Verdict("survived", "no test runs it")
        shutil.rmtree(f"{scratch}/cache", ignore_errors=True)
        try:
            objects = self._compile(mutant, scratch)
            verdict = self._show(mutant, tests, objects, scratch)
        except CannotBuild as error:
            verdict = Verdict("rejected", str(error))
        verdict.seconds = time.monotonic() - started
        if verdict.kind == "survived" and not reached:
            verdict.words = "no test runs the line"
        return verdict

    def _compile(self, mutant, scratch):
        tree = f"{scratch}/source"
        shutil.rmtree(tree, ignore_errors=True)
        with open(f"{self.build.root}/{mutant.file}", "rb") as file:
            text = file.read()
        changed = f"{tree}/{mutant.file}"
        os.makedirs(os.path.dirname(changed))
        with open(changed, "wb") as file:
            file.write(text if self.unchanged else mutant.apply(text))
        objects = {}
        if mutant.file.endswith(".cpp"):
            made = f"{scratch}/changed.o"
            self.build.compile(mutant.file, changed, made, ["-g0", "-w"])
            return {mutant.file: made}
        for number, user in enumerate(sorted(self.build.users_of(mutant.file))):
            made = f"{scratch}/changed{number}.o"
            self.build.compile(user, f"{self.build.root}/{user}", made, ["-g0", "-w"], instead=tree)
            objects[user] = made
        return objects

    def _show(self, mutant, tests, objects, scratch):
        """Runs the tests in slices until one is red, each program linked when it is first needed."""
        linked = {}
        run = 0
        for program, batch in _slices(tests, self.coverage.seconds, self.alone):
            if program not in linked:
                linked[program] = f"{scratch}/{program}"
                self.build.link(program, linked[program], objects)
            while batch:
                usual = sum(self.coverage.seconds[case.name] for case in batch)
                outcome = self._run(batch, linked[program], usual, scratch)
                if not outcome.red:
                    run += len(batch)
                    break
                # Repeats the test alone: it may have failed for another reason, or because of a previous test.
                suspects = [c for c in batch if c.name == outcome.first_red] or batch
                for case in suspects:
                    if len(batch) > 1 or not self.unchanged:
                        outcome = self._run([case], linked[program], self.coverage.seconds[case.name], scratch)
                    run += 1
                    if outcome.red:
                        with self.lock:
                            self.saw[mutant.file][case.name] += 1
                        return Verdict("seen", case.name + (" (hung)" if outcome.timed_out else ""), run)
                if len(suspects) == 1 and len(batch) > 1:
                    self.alone.add(suspects[0].name)
                batch = [c for c in batch if c not in suspects]
        return Verdict("survived", "", run)

    def _run(self, batch, program, usual_s, scratch):
        return test_cases.run_cases(batch, program, PATIENCE * usual_s + PATIENCE_S, scratch)


def _slices(tests, seconds, alone):
    """Programs with the tests to run in one process, in order: short slices first, then longer ones."""
    limits = iter(SLICES_S)
    limit = next(limits)
    batch, filled = [], 0.0
    later = []
    for case in tests:
        if not case.of_catch or case.name in alone:
            later.append(case)
            continue
        if batch and filled + seconds[case.name] > limit:
            yield from _by_program(batch)
            batch, filled = [], 0.0
            limit = next(limits, limit)
        batch.append(case)
        filled += seconds[case.name]
    yield from _by_program(batch)
    for case in later:
        yield case.program, [case]


def _by_program(batch):
    for program in sorted({case.program for case in batch}, reverse=True):
        yield program, [case for case in batch if case.program == program]


def draw(found, arguments, build):
    """The mutants in the order in which they are judged: a seed gives the same order for the same sources."""
    if arguments.since:
        changed = subprocess.run(["git", "diff", "--name-only", arguments.since, "--"], cwd=build.root, capture_output=True, text=True)
        if changed.returncode != 0:
            stop(changed.stderr.strip())
        found = [m for m in found if m.file in set(changed.stdout.split())]
    if arguments.only:
        unknown = set(arguments.only) - {m.file for m in found}
        if unknown:
            stop(f"no mutants in {', '.join(sorted(unknown))}")
        found = [m for m in found if m.file in arguments.only]
    if arguments.line:
        found = [m for m in found if m.line in arguments.line]
    order = list(found)
    random.Random(arguments.seed).shuffle(order)
    return order


def run(judge, order, count, explained, jobs, place):
    """Tests mutants until `count` are detected or survive. Returns them with their verdicts, in order."""
    lines = {}

    def lines_of(file):
        if file not in lines:
            with open(f"{judge.build.root}/{file}") as opened:
                lines[file] = opened.read().splitlines()
        return lines[file]

    results, in_flight, reasons = {}, {}, {}
    waiting = iter(enumerate(order))
    free = [f"{place}/worker{i}" for i in range(jobs)]
    for scratch in free:
        os.makedirs(scratch, exist_ok=True)
    started = time.monotonic()
    judged = 0
    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        while True:
            while free and judged + len(in_flight) < count:
                index, mutant = next(waiting, (None, None))
                if mutant is None:
                    break
                reason = explained.reason_of(mutant, lines_of(mutant.file))
                if reason:
                    reasons[index] = reason
                    continue
                scratch = free.pop()
                in_flight[pool.submit(judge.judge, mutant, scratch)] = (index, scratch)
            if not in_flight:
                break
            done, _ = concurrent.futures.wait(in_flight, return_when=concurrent.futures.FIRST_COMPLETED)
            for future in done:
                index, scratch = in_flight.pop(future)
                free.append(scratch)
                verdict = results[index] = future.result()
                judged += verdict.kind != "rejected"
                mutant = order[index]
                log(f"[{judged}/{min(count, len(order))}, {time.monotonic() - started:.0f} s] {verdict.kind:8} "
                    f"{mutant.file}:{mutant.line} {mutant.operator} {mutant.shown[:70]} "
                    f"({verdict.seconds:.0f} s, {verdict.tests} tests{': ' + verdict.words[:60] if verdict.words else ''})")  # fmt: skip
    for scratch in free:
        shutil.rmtree(scratch, ignore_errors=True)
    return results, reasons


def report(order, results, reasons, arguments, seconds):
    """Prints the table of survivors and the rate. Returns the exit code."""
    survivors = [(order[i], v) for i, v in sorted(results.items()) if v.kind == "survived"]
    seen = sum(v.kind == "seen" for v in results.values())
    rejected = sum(v.kind == "rejected" for v in results.values())
    if survivors:
        rows = [(f"{m.file}:{m.line}", m.function or m.declares, m.shown, v.words) for m, v in survivors]
        widths = [max(len(row[i]) for row in rows) for i in range(2)]
        print("\nsurvivors: changes that turn no test red")
        for where, function, change, note in sorted(rows):
            print(f"  {where:{widths[0]}}  {function:{widths[1]}}  {change}{f'   [{note}]' if note else ''}")
    total = seen + len(survivors)
    rate = 100.0 * seen / total if total else 100.0
    dead = sum(bool(v.words) for _, v in survivors)
    print(f"\nseen {seen} of {total} mutants: {rate:.1f} %; {len(survivors)} survived, {dead} in lines that no test runs")
    print(f"left out: {len(reasons)} that {LIST} explains, {rejected} that the compiler rejects; "
          f"seed {arguments.seed}, {seconds / 60:.1f} minutes")  # fmt: skip
    if arguments.at_least is not None and rate < arguments.at_least:
        print(f"fewer than the {arguments.at_least:g} % asked for")
        return 1
    return 0


def main():
    arguments = parse_arguments()
    count = sys.maxsize if arguments.count == "all" else int(arguments.count)
    place = f"{os.path.dirname(arguments.build)}/mutate"
    build = ReleaseBuild(arguments.root, arguments.build)
    sources, found = population(build, place, arguments.jobs)

    explained = explanations.Explained([])
    if os.path.exists(f"{build.root}/{LIST}"):
        with open(f"{build.root}/{LIST}") as file:
            text = file.read()
        try:
            explained = explanations.Explained(explanations.read_explanations(text, LIST), LIST)
            explained.check(found, lambda name: open(f"{build.root}/{name}").read().splitlines())
        except explanations.Stale as error:
            stop(f"stale explanations:\n{error}")

    order = draw(found, arguments, build)
    log(f"{len(found)} mutants in {len({m.file for m in found})} sources; {min(count, len(order))} to judge")
    if arguments.list:
        for mutant in order[:count]:
            print(f"{mutant.file}:{mutant.line}  {mutant.operator}  {mutant.function or mutant.declares}  {mutant.shown}")
        return 0

    cases = test_cases.read_cases(build)
    coverage = traced.find_coverage(build, sources, cases, f"{place}/traced", arguments.jobs, log)
    for name, words in coverage.red.items():
        log(f"left out, red without any mutant: {name}")
    started = time.monotonic()
    judge = Judge(build, cases, coverage, place, arguments.unchanged)
    results, reasons = run(judge, order, count, explained, arguments.jobs, place)
    with open(f"{place}/last_run.tsv", "w") as file:
        for index, verdict in sorted(results.items()):
            m = order[index]
            file.write(f"{verdict.kind}\t{m.file}:{m.line}\t{m.function}\t{m.operator}\t{m.shown}\t{verdict.seconds:.1f}\t"
                       f"{verdict.tests}\t{verdict.words.splitlines()[-1] if verdict.words else ''}\n")  # fmt: skip
    return report(order, results, reasons, arguments, time.monotonic() - started)


if __name__ == "__main__":
    sys.exit(main())
