#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Makes the docstrings of the Python module out of the comments of the public headers: docstrings.py OUT.cpp HEADER...

Keys are "Class.member" and "function", as in C++. Of overloads the first with a comment counts."""
import pathlib
import re
import sys

SCOPE = re.compile(r"(?:template <.*> )?(?:class|struct|enum class|enum|union) (?:\[\[\w+\]\] )?(\w+)")
CALL = re.compile(r"([\w~]+)\(")
NAMES = re.compile(r"(\w+)(?:\[\w+\])?\s*(?:=|,|;|\{|$)")


def snake(name):
    return re.sub(r"(?<=[a-z0-9])([A-Z])", lambda found: "_" + found.group(1).lower(), name).lower()


def plain(lines):
    """The words of a comment as Python's users read them."""
    text = "\n".join(lines).strip()
    text = re.sub(r"@param (\w+) +", r"\1: ", text)
    text = re.sub(r"\bk([A-Z]\w*)", lambda found: snake(found.group(1)), text)
    text = re.sub(r"\b([236]) x ([NM])\b", r"\2 x \1", text)  # In numpy a point is a row.
    return re.sub(r"\b([a-z]+[A-Z]\w*)\(", lambda found: snake(found.group(1)) + "(", text)


def names_in(code):
    """What a declaration declares."""
    before = code.split("{")[0].split("=")[0] if "(" not in code.split("=")[0] else code
    if "(" in before:
        for name in CALL.findall(before):
            if name not in ("if", "decltype", "sizeof", "for", "return"):
                return [name]
        return []
    code = re.sub(r"<[^<>]*(?:<[^<>]*>[^<>]*)*>", "", code)
    code = re.sub(r"\{[^{}]*\}|\([^()]*\)", "", code)
    head, *rest = re.split(r",(?![^\[]*\])", code.rstrip(";").strip())
    first = NAMES.search(head.strip() + ";")
    named = [first.group(1)] if first else []
    return named + [part.strip().split(" ")[0].split("=")[0].split("[")[0] for part in rest if part.strip()]


class Header:
    """Reads one header as clang-format lays it out: two columns for each open class."""

    def __init__(self, path, docs):
        self.docs, self.open, self.pending, self.last, self.code = docs, [], [], [], ""
        self.trailing = []
        for line in path.read_text().splitlines():
            self.line(line)

    def line(self, line):
        text = line.strip()
        indent = len(line) - len(line.lstrip())
        if text.startswith("///<"):
            for key in self.last:
                self.docs[key] = (self.docs.get(key, "") + " " + plain([text[4:].strip()])).strip()
            return
        if text.startswith("///"):
            self.pending.append(text[3:].removeprefix(" "))
            return
        code, _, said = text.partition("///<")
        code = code.partition("  // ")[0].strip()
        if not code:
            if not text.startswith("//"):
                self.pending = []
            return
        closes = self.open and text.startswith("}") and indent <= self.open[-1][1]
        if closes and self.code and self.open[-1][2]:  # The last enumerator, which has no comma.
            self.declared(self.code, indent + 2)
            self.code, self.trailing = "", []
        if not self.code and closes:
            self.open.pop()
            self.pending = []
            return
        expected = self.open[-1][1] + 2 if self.open else 0
        if not self.code and indent != expected:
            return
        self.code = (self.code + " " + code).strip()
        if said:
            self.trailing.append(said.strip())
        ends = re.search(r"[;{}:]$", code) or code.endswith(",") and self.open and self.open[-1][2]
        if ends and self.code.count("(") == self.code.count(")"):
            self.declared(self.code, indent if indent <= expected else expected)
            self.code, self.pending, self.trailing = "", [], []

    def declared(self, code, indent):
        scope = SCOPE.match(code)
        prefix = ".".join(name for name, _, _ in self.open)
        said = self.pending + self.trailing
        if code.startswith(("#", "namespace", "using", "public:", "private:", "protected:", "friend", "}")):
            return
        if scope and not code.startswith("enum") and (code.endswith(";") and "{" not in code):
            return  # A declaration to come.
        names = [scope.group(1)] if scope else names_in(re.sub(r"^(constexpr|static|virtual|inline|explicit|mutable) ", "", code))
        if self.open and self.open[-1][2]:
            names = re.findall(r"\b(k\w+)", code) or names
        self.last = [f"{prefix}.{name}" if prefix else name for name in names]
        for key in self.last:
            if said and key not in self.docs:
                self.docs[key] = plain(said)
        if scope and code.endswith("{"):
            self.open.append((scope.group(1), indent, code.startswith("enum")))


def literal(text):
    """A C++ string literal; long ones in pieces."""
    quoted = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{quoted}"'


def main():
    docs = {}
    for path in sys.argv[2:]:
        Header(pathlib.Path(path), docs)
    rows = "".join(f"    {{{literal(key)}, {literal(text)}}},\n" for key, text in sorted(docs.items()))
    pathlib.Path(sys.argv[1]).write_text(f"""// Made by docstrings.py.
#include <algorithm>
#include <cstring>
#include <iterator>
#include <stdexcept>
#include <string>

#include "binding.hpp"

namespace angio::python {{
namespace {{
struct Docstring {{
  const char* key;
  const char* text;
}};
constexpr Docstring kDocstrings[] = {{
{rows}}};
}}  // namespace

const char* doc(const std::string& key) {{
  const auto at = std::lower_bound(std::begin(kDocstrings), std::end(kDocstrings), key,
                                   [](const Docstring& d, const std::string& k) {{ return d.key < k; }});
  if (at == std::end(kDocstrings) || at->key != key) throw std::logic_error("no header has a comment on " + key);
  return at->text;
}}
}}  // namespace angio::python
""")


if __name__ == "__main__":
    main()
