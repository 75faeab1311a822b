# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of mutants that no test can see, each with the reason: tests/mutants_explained.txt.

An entry has the fields file, function, line, mutation and reason; an empty line ends it; # begins a comment.
line is the text of the source line, mutation the change as the table of survivors shows it. `*` stands for every
change of the line, and `constant *` for every change by one operator. An entry whose line is no longer in that
function, or that matches no mutant, is stale and rejected.
"""

import dataclasses
import re

FIELDS = ("file", "function", "line", "mutation", "reason")


class Stale(Exception):
    """An entry no longer matches the source; says which."""


@dataclasses.dataclass
class Explanation:
    file: str
    function: str
    line: str
    mutation: str
    reason: str
    at: int  # line of the list
    used: int = 0


def flat(text):
    return re.sub(r"\s+", " ", text).strip()


def read_explanations(text, name="mutants_explained.txt"):
    """All entries of the list. Raises Stale on one that is incomplete or has an unknown field."""
    found, fields, at = [], {}, 0
    last = None
    for number, line in enumerate(text.splitlines() + [""], 1):
        if line.startswith("#"):
            continue
        if not line.strip():
            if fields:
                missing = [f for f in FIELDS if not fields.get(f) and f != "function"]
                if missing:
                    raise Stale(f"{name}:{at}: the entry has no {', '.join(missing)}")
                found.append(Explanation(*(flat(fields.get(f, "")) for f in FIELDS), at))
            fields, last = {}, None
            continue
        match = re.match(r"([a-z]+):\s*(.*)", line)
        if match and match.group(1) in FIELDS:
            last = match.group(1)
            if not fields:
                at = number
            if last in fields:
                raise Stale(f"{name}:{number}: the entry has a second {last}; an empty line ends an entry")
            fields[last] = match.group(2)
        elif last and line.startswith(" "):
            fields[last] += " " + line.strip()
        else:
            raise Stale(f"{name}:{number}: the line begins with none of {', '.join(FIELDS)}")
    return found


class Explained:
    """Says which mutants are explained. lines_of(file): the lines of a source. mutants_of(file): its mutants."""

    def __init__(self, entries, name="mutants_explained.txt"):
        self.name = name
        self.by_file = {}
        for entry in entries:
            self.by_file.setdefault(entry.file, []).append(entry)

    def check(self, mutants, lines_of):
        """Raises Stale, with all entries that match no mutant of the sources."""
        wrong = []
        for file, entries in self.by_file.items():
            ours = [m for m in mutants if m.file == file]
            for entry in entries:
                try:
                    lines = lines_of(file)
                except OSError:
                    wrong.append(f"{self.name}:{entry.at}: there is no file {file}")
                    continue
                if not any(self._matches(entry, m, lines) for m in ours):
                    what = "is not in it" if entry.line not in map(flat, lines) else "has no such mutation"
                    wrong.append(f"{self.name}:{entry.at}: {file}: the line '{entry.line}' {what}")
        if wrong:
            raise Stale("\n".join(wrong))

    def reason_of(self, mutant, lines):
        """Why no test can see the mutant; empty if it has no entry. lines: of its source."""
        for entry in self.by_file.get(mutant.file, []):
            if self._matches(entry, mutant, lines):
                return entry.reason
        return ""

    @staticmethod
    def _matches(entry, mutant, lines):
        if entry.function != mutant.function or entry.line != flat(lines[mutant.line - 1]):
            return False
        return entry.mutation in ("*", f"{mutant.operator} *", mutant.shown)
