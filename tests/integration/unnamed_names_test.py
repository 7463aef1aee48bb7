#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Sources of a target are compiled as one. A function in the unnamed namespace of one source is then seen by the others: with the
same parameters it is the compiler's error, with others it may be called in place of what was meant. So no two sources of a target
have one name there. unnamed_names_test.py BUILD"""
import collections
import json
import pathlib
import re
import sys

TYPE = re.compile(r"(?:template.*)?(?:struct|class|enum class|enum|union) (\w+)\b(?!.*;$)")
OTHER = re.compile(r"(?:\[\[\w+\]\] )?[\w:<>,&*\s\[\]]*?[\s&*](\w+)\s?[(={;\[]")


def unnamed(source):
    """Names that are a source's own, in unnamed namespaces or constants, as clang-format lays them out: at the start of a line."""
    names, inside = set(), False
    for line in source.read_text().splitlines():
        if line == "namespace {":
            inside = True
        elif line == "}  // namespace":
            inside = False
        elif line.startswith("constexpr ") or inside and re.match(r"[\w\[]", line) and not re.match(r"template|using|namespace|return|TEST|INSTANTIATE", line):
            found = TYPE.match(line) or OTHER.match(line)
            if found:
                names.add(found.group(1))
    return names


def main():
    build = pathlib.Path(sys.argv[1])
    targets = collections.defaultdict(list)
    # Those that are compiled: a target that has become smaller leaves files of an earlier build behind.
    for command in json.loads(build.joinpath("compile_commands.json").read_text()):
        made = pathlib.Path(command["file"])
        if made.match("CMakeFiles/*.dir/Unity/unity_*.cxx"):
            targets[made.parent.parent] += [pathlib.Path(path) for path in re.findall(r'#include "([^"]+)"', made.read_text())]
    seen, wrong = 0, []
    for target, sources in targets.items():
        having = collections.defaultdict(list)
        for source in sources:
            for name in unnamed(source):
                seen += 1
                having[name].append(source.name)
        wrong += [f"{target.stem}: {name} stands in the unnamed namespaces of {', '.join(sorted(files))}"
                  for name, files in sorted(having.items()) if len(files) > 1 and name != "PrintTo"]
    print("\n".join(wrong) or f"{seen} names in {len(targets)} targets")
    # A build without any is not what is tested.
    return 1 if wrong or not targets and build.joinpath("CMakeCache.txt").read_text().find("UNITY_BUILD:BOOL=OFF") < 0 else 0


sys.exit(main())
