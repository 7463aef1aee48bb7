#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Checks the Markdown files against the repository and the built programs: documentation_test.py BIN_FOLDER [ROOT].

1. README.md is at most 150 lines and 12,288 bytes.
2. Each relative link and picture of each *.md exists, its anchor included.
3. In each `bash` block, and in each command in backquotes: build/bin/PROGRAM is a target; its options, those named in
   the line's comment included, are in its --help; files of the repository exist. Nothing of this is run but --help.
4. Each `cpp` block of README.md is literally part of an example that examples/CMakeLists.txt compiles.
5. The commands of README.md's sections with "tour" in their heading run one after the other in a temporary folder that
   holds links to examples/ and to the programs. Each ends with exit code 0 and takes at most SECONDS of processor
   time, which a busy host does not change, and all files under tour/ that the section names exist afterwards.

Prints one line for each fault; exit code 1 when there is one. Python's standard library only.
"""
import functools
import glob
import os
import pathlib
import re
import resource
import shlex
import subprocess
import sys
import tempfile
import time

MAX_LINES, MAX_BYTES = 150, 12288
SECONDS, PATIENCE = 30, 900  # Of one command of a tour: of processor time, and by the clock on a busy host.
OUTSIDE = {".git", "demo-output", "calibration-output", "tour"}  # Folders that are not the repository's.

faults = []


def fault(file, line, words):
    faults.append(f"{file}:{line}: {words}")


class Markdown:
    """A file's text, its fenced blocks as (language, first line, lines), and what stands outside of them."""

    def __init__(self, path, name):
        self.path, self.name = path, name
        self.text = path.read_text(encoding="utf-8")
        self.blocks, self.prose, block = [], [], None
        for number, line in enumerate(self.text.splitlines(), 1):
            fence = re.match(r"\s*```(\S*)", line)
            if fence and block is None:
                block = (fence.group(1), number + 1, [])
            elif fence:
                self.blocks.append(block)
                block = None
            elif block:
                block[2].append(line)
            else:
                self.prose.append((number, line))
        if block:
            fault(name, block[1] - 1, "a block of code has no end")

    def headings(self):
        """(line, level, title) of each heading."""
        for number, line in self.prose:
            found = re.match(r"(#{1,6})\s+(.*?)\s*#*$", line)
            if found:
                yield number, len(found.group(1)), found.group(2)

    def anchors(self):
        """The anchors that GitHub makes of the headings."""
        seen, anchors = {}, set()
        for _, _, title in self.headings():
            title = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", title)
            slug = re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")
            count = seen.get(slug, 0)
            seen[slug] = count + 1
            anchors.add(f"{slug}-{count}" if count else slug)
        return anchors | set(re.findall(r'<a (?:id|name)="([^"]+)"', self.text))

    def sections(self, word):
        """(first line, one after the last line) of the sections whose heading has the word."""
        headings = list(self.headings())
        for k, (first, level, title) in enumerate(headings):
            if word in title.lower():
                yield first, next((n for n, other, _ in headings[k + 1:] if other <= level), 10**9)


def markdown_files(root):
    for folder, folders, files in os.walk(root):
        folders[:] = sorted(f for f in folders if f not in OUTSIDE and not re.match(r"build(-|$)", f))
        for file in sorted(files):
            if file.endswith(".md"):
                path = pathlib.Path(folder, file)
                yield Markdown(path, str(path.relative_to(root)))


def check_size(readme):
    lines, size = len(readme.text.splitlines()), len(readme.text.encode("utf-8"))
    print(f"README.md: {lines} lines, {size} bytes")
    if lines > MAX_LINES or size > MAX_BYTES:
        fault(readme.name, 1, f"{lines} lines, {size} bytes: at most {MAX_LINES} and {MAX_BYTES}")


def check_links(document, documents):
    count = 0
    for number, line in document.prose:
        line = re.sub(r"`[^`]*`", "", line)
        targets = re.findall(r"\]\(\s*<?([^)\s>]+)", line) + re.findall(r'(?:src|href)="([^"]+)"', line)
        for target in targets:
            if re.match(r"[a-z][a-z0-9+.-]*:", target):
                continue
            count += 1
            file, _, anchor = target.partition("#")
            path = (document.path.parent / file).resolve() if file else document.path.resolve()
            if not path.exists():
                fault(document.name, number, f"{target}: there is no such file")
            elif anchor and path in documents and anchor not in documents[path].anchors():
                fault(document.name, number, f"{target}: there is no such heading")
            elif anchor and path not in documents:
                fault(document.name, number, f"{target}: an anchor in a file that is not Markdown")
    return count


def logical_lines(first, lines):
    """(line number, text) of commands, lines that end with a backslash joined."""
    number, text = first, ""
    for k, line in enumerate(lines):
        if not text:
            number = first + k
        text += line[:-1] + " " if line.endswith("\\") else line
        if not line.endswith("\\"):
            yield number, text
            text = ""
    if text:
        yield number, text


def commands(text):
    """The commands of one line as lists of words, and its comment."""
    quoted = re.sub(r"'[^']*'|\"[^\"]*\"", lambda found: "x" * len(found.group()), text)
    found = re.search(r"(^|\s)#", quoted)
    text, comment = (text[:found.start()], text[found.end():]) if found else (text, "")
    lexer = shlex.shlex(text, posix=True, punctuation_chars=True)
    lexer.whitespace_split, lexer.commenters = True, ""
    words, all_commands = [], []
    for word in list(lexer) + [";"]:
        if set(word) <= set("();<>|&"):
            if words:
                all_commands.append(words)
            words = []
        else:
            words.append(word)
    return all_commands, comment


class Programs:
    def __init__(self, root, folder):
        self.folder = folder
        self.targets = set()
        for file in root.rglob("CMakeLists.txt"):
            if not any(part.startswith("build") for part in file.relative_to(root).parts):
                self.targets |= set(re.findall(r"(?:add_executable|angio_add_program|angio_add_alias)\(([\w-]+)",
                                               file.read_text(encoding="utf-8")))
        self.absent = set()

    @functools.lru_cache(maxsize=None)
    def help(self, name, *sub_commands, flag="--help"):
        """What --help or --help-all prints; None when the program is not built here (an optional component)."""
        program = self.folder / name
        if not program.exists():
            self.absent.add(name)
            return None
        found = subprocess.run([program, *sub_commands, flag], capture_output=True, text=True, timeout=120, check=False)
        return found.stdout if found.returncode == 0 else ""

    def options(self, name, words):
        """The options of a program, or of the sub-command that the words name; None when it is not built here."""
        text, sub_commands = self.help(name), []
        if text is None:
            return None
        for word in words:
            listed = re.search(r"^Subcommands:\n((?:  .*\n?)+)", text, re.M)
            if not listed or not re.search(rf"^  {re.escape(word)}\b", listed.group(1), re.M):
                break
            sub_commands.append(word)
            text = self.help(name, *sub_commands)
        # Of a program with sub-commands it would have theirs as well.
        if "\nFurther options:" in text:
            text = self.help(name, *sub_commands, flag="--help-all")
        # What follows "Example:" is no list of options; and an option's description may name others.
        text = re.split(r"\nExamples?:", text)[0]
        lists = "\n".join(re.findall(r"^ +(-.*?)(?:  |$)", text, re.M))
        return set(re.findall(r"(?<![\w-])--[a-z][\w-]*", lists)) | {"--help", "--help-all"}


def check_program(programs, document, number, name, words, comment):
    if name not in programs.targets:
        fault(document.name, number, f"{name}: there is no such program")
        return
    if name.startswith(("example-", "test_")) or name == "angio-benchmark" and not words:
        return
    options = programs.options(name, words)
    if options is None:
        return
    asked = [word.split("=")[0] for word in words if re.match(r"--[a-z]", word)]
    for option in asked + re.findall(r"(?<![\w-])--[a-z][a-z-]*[a-z]", comment):
        if option not in options:
            fault(document.name, number, f"{name} {option}: its --help has no such option")


def check_paths(root, document, number, words):
    for word in words:
        for path in re.findall(r"(?:^|=|,)((?:\./)?(?:examples|modules|servo|calibration|tests|\.ci)/[^,]*|\./[\w-]+\.sh)", word):
            if not glob.glob(str(root / path)):
                fault(document.name, number, f"{path}: there is no such file")


def check_commands(root, programs, document):
    count = 0
    for language, first, lines in document.blocks:
        if language != "bash":
            continue
        for number, text in logical_lines(first, lines):
            in_line, comment = commands(text)
            for words in in_line:
                check_paths(root, document, number, words)
                found = next((k for k, word in enumerate(words) if word.startswith("build/bin/")), None)
                if found is not None:
                    count += 1
                    check_program(programs, document, number, words[found][len("build/bin/"):], words[found + 1:], comment)
    for number, line in document.prose:
        for text in re.findall(r"`([^`]+)`", line):
            if re.match(r"(build/bin/)?(angio|example)-[\w-]*\w(\s|$)", text):
                count += 1
                words = text.split()
                check_paths(root, document, number, words)
                check_program(programs, document, number, words[0].replace("build/bin/", ""), words[1:], "")
    return count


def check_examples(root, readme):
    compiled = re.findall(r"[\w/]+\.cpp", (root / "examples/CMakeLists.txt").read_text(encoding="utf-8"))
    sources = [(root / "examples" / source).read_text(encoding="utf-8") for source in compiled]
    blocks = [block for block in readme.blocks if block[0] == "cpp"]
    for _, first, lines in blocks:
        if not any("\n".join(lines) + "\n" in source for source in sources):
            fault(readme.name, first, "this block is part of no example that examples/CMakeLists.txt compiles")
    return len(blocks)


def processor_seconds():
    """Of all programs that were run and have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


def run_tour(root, folder, readme):
    """Runs the sections' commands. Their pictures and results are named in commands, comments and text."""
    ran = 0
    with tempfile.TemporaryDirectory(prefix="angio-tour-") as temporary:
        place = pathlib.Path(temporary)
        (place / "examples").symlink_to(root / "examples")
        (place / "build").mkdir()
        (place / "build/bin").symlink_to(folder)
        named = {}
        for begin, end in readme.sections("tour"):
            inside = [(first, lines) for language, first, lines in readme.blocks if language == "bash" and begin < first < end]
            texts = [(n, line) for n, line in readme.prose if begin < n < end]
            texts += [(first + k, line) for first, lines in inside for k, line in enumerate(lines)]
            for number, line in texts:
                for path in re.findall(r"(?<![\w/.-])tour/[\w./-]*\w", line):
                    named.setdefault(path, number)
            for first, lines in inside:
                for number, text in logical_lines(first, lines):
                    if not commands(text)[0]:
                        continue
                    ran += 1
                    began, used = time.monotonic(), processor_seconds()
                    try:
                        done = subprocess.run(["bash", "-c", text], cwd=place, stdin=subprocess.DEVNULL, timeout=PATIENCE,
                                              capture_output=True, text=True, errors="replace", check=False)
                    except subprocess.TimeoutExpired:
                        fault(readme.name, number, f"not done after {PATIENCE} s: {text}")
                        continue
                    used = processor_seconds() - used
                    print(f"{used:6.1f} s of processor, {time.monotonic() - began:6.1f} s  {text[:90]}", flush=True)
                    if used > SECONDS:
                        fault(readme.name, number, f"{used:.0f} s of processor time, at most {SECONDS}: {text}")
                    if done.returncode != 0:
                        fault(readme.name, number, f"exit code {done.returncode}: {text}\n{done.stdout}{done.stderr}")
        for path, number in named.items():
            if not (place / path).exists():
                fault(readme.name, number, f"{path}: is named, and no command has written it")
    if ran < 3:
        fault(readme.name, 1, "there is no section with \"tour\" in its heading that has commands")


def main():
    folder = pathlib.Path(sys.argv[1]).resolve()
    root = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else ".").resolve()
    documents = {document.path.resolve(): document for document in markdown_files(root)}
    readme = documents[root / "README.md"]
    programs = Programs(root, folder)
    check_size(readme)
    links = sum(check_links(document, documents) for document in documents.values())
    checked = sum(check_commands(root, programs, document) for document in documents.values())
    blocks = check_examples(root, readme)
    print(f"{len(documents)} Markdown files: {links} links, {checked} commands, {blocks} blocks of C++")
    if programs.absent:
        print("not built here, options not checked: " + ", ".join(sorted(programs.absent)))
    run_tour(root, folder, readme)
    for one in faults:
        print(one)
    print(f"{len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
