# SPDX-License-Identifier: GPL-3.0-or-later
"""The release build as the mutation run uses it: how each source is compiled, how each test program is linked.

A mutant is one more object: it is linked before the libraries, so that the linker leaves theirs out.
"""

import collections
import json
import os
import re
import shlex
import subprocess


class CannotBuild(Exception):
    """The compiler or the linker rejected the source; contains its output."""


def read_ninja(directory, *arguments):
    return subprocess.run(["ninja", "-C", directory, *arguments], check=True, capture_output=True, text=True).stdout


class ReleaseBuild:
    """Commands and dependencies of a build. root: source tree; directory: an up-to-date build directory."""

    def __init__(self, root, directory):
        self.root = root
        self.directory = directory
        self.compilers = {}  # source -> words of its command
        self.object_of = {}  # source -> object, relative to the directory
        self.sources_of = collections.defaultdict(list)
        with open(f"{directory}/compile_commands.json") as file:
            for entry in json.load(file):
                words = shlex.split(entry["command"])
                source = os.path.relpath(os.path.join(entry["directory"], entry["file"]), root)
                made = words[words.index("-o") + 1]
                if source in self.compilers and not source.startswith("tests/"):
                    continue
                self.compilers.setdefault(source, words)
                self.object_of.setdefault(source, made)
        self.source_of = {made: source for source, made in self.object_of.items()}
        self._links = {}
        self._users = None

    def compiler_words(self, source, precompiled=True):
        """The command that compiles the source, without its input and output."""
        words, kept = self.compilers[source], []
        skip = 0
        for i, word in enumerate(words):
            if skip:
                skip -= 1
            elif word in ("-o", "-c", "-MF", "-MT", "-MQ"):
                skip = 1
            elif word == "-include" and not precompiled:
                skip = 1
            elif word in ("-Werror", "-MD", "-MMD") or (word == "-Winvalid-pch"):
                pass
            elif os.path.basename(word) == "ccache" and i == 0:
                pass
            else:
                kept.append(word)
        return kept

    def clang_arguments(self, source):
        """Returns the options with which clang parses the source as gcc does."""
        return self.compiler_words(source, precompiled=False)[1:]

    def link_words(self, program):
        """The command that links bin/`program`; run it in the build directory."""
        if program not in self._links:
            for line in reversed(read_ninja(self.directory, "-t", "commands", f"bin/{program}").splitlines()):
                for command in line.split(" && "):
                    words = shlex.split(command)
                    if "-o" in words and words[words.index("-o") + 1] == f"bin/{program}":
                        self._links[program] = words[1:] if os.path.basename(words[0]) == "ccache" else words
                if program in self._links:
                    break
            else:
                raise CannotBuild(f"no command links bin/{program}")
        return self._links[program]

    def users_of(self, header):
        """The sources that read the header, directly or not."""
        if self._users is None:
            self._users = collections.defaultdict(set)
            made = None
            for line in read_ninja(self.directory, "-t", "deps").splitlines():
                if line[:1] not in (" ", ""):
                    made = line.split(":")[0]
                elif line.strip() and made in self.source_of:
                    read = os.path.relpath(os.path.join(self.directory, line.strip()), self.root)
                    if not read.startswith(".."):
                        self._users[read].add(self.source_of[made])
        return self._users.get(header, set())

    def compile(self, source, text_at, made, flags, instead=None):
        """Compiles the source, read from the file `text_at`, to the object `made`.

        instead: a directory whose headers are taken instead of the tree's. Raises CannotBuild.
        """
        words = self.compiler_words(source)
        if instead:
            words = words[:1] + ["-I", instead] + words[1:]
        self._run(words + flags + ["-o", made, "-c", text_at])

    def link(self, program, made, objects):
        """Links bin/`program` again as `made`, with these objects (source -> file) instead of the built ones."""
        words = list(self.link_words(program))
        in_front = []
        for source, file in objects.items():
            built = self.object_of[source]
            if built in words:
                words[words.index(built)] = file
            else:
                in_front.append(file)
        words[words.index("-o") + 1] = made
        first = next(i for i, word in enumerate(words) if word.endswith(".o"))
        self._run(words[:first] + in_front + words[first:] + ["-fuse-ld=mold"])

    def _run(self, words):
        done = subprocess.run(words, cwd=self.directory, capture_output=True, text=True)
        if done.returncode != 0:
            raise CannotBuild(f"{shlex.join(words)}\n{done.stdout}{done.stderr}")
