#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Writes the pages of the API reference: pages.py ROOT MODULES OUT.

MODULES lists "name folder used used ..." one module a line. OUT gets, in Doxygen's comments, the top README as the main
page and a group for each module: its README, or, where it has none, its words in CONTRIBUTING.md's table of modules.
Links to modules and to public headers become links of the reference. Links to other files become their text.
"""
import os
import pathlib
import re
import sys


def slug(title):
    """A heading's anchor, as GitHub makes it."""
    title = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", title)
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


class Pages:
    def __init__(self, root, modules):
        self.root, self.modules = root, modules
        self.by_folder = {folder: name for name, folder, _ in modules}
        self.table = self.words_of_modules()

    def words_of_modules(self):
        """What CONTRIBUTING.md's table says of each folder. A row of several folders has as many parts, or one text."""
        found = {}
        for line in (self.root / "CONTRIBUTING.md").read_text(encoding="utf-8").splitlines():
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            if not line.startswith("| [") or len(cells) != 2:
                continue
            links = re.findall(r"\]\(([^)#]+)\)", cells[0])
            parts = cells[1].split("; ")
            for k, link in enumerate(links):
                folder = re.sub(r"/README\.md$", "", link)
                found[folder] = (cells[1] if len(parts) != len(links) else parts[k], "CONTRIBUTING.md")
        return found

    def target(self, page, link):
        """Where a link of a page leads within the reference, or None."""
        file, _, anchor = link.partition("#")
        path = os.path.normpath(os.path.join(os.path.dirname(page), file)) if file else page
        if path == "README.md":
            return "index"
        folder = re.sub(r"/README\.md$", "", path)
        if folder in self.by_folder:
            return self.by_folder[folder] + ("_" + anchor if anchor else "")
        header = re.match(r"(.+)/include/(angio/.+\.hpp)$", path)
        return header.group(2) if header and header.group(1) in self.by_folder else None

    def words(self, page, text):
        """A line outside of code, its links as the reference's."""
        def link(found):
            words, to = found.groups()
            if re.match(r"[a-z][a-z0-9+.-]*:", to):
                return found.group(0)
            there = self.target(page, to)
            return f"[{words.strip('`')}](@ref {there})" if there else words
        text = re.sub(r"!\[([^\]]*)\]\(([^)]*)\)", lambda found: f"!\0{found[1]}\1{os.path.basename(found[2])}\2", text)
        text = re.sub(r"\[((?:`[^`]*`|[^\]`])*)\]\(([^)]*)\)", link, text)
        text = re.sub("!\0(.*?)\1(.*?)\2", r"![\1](\2)", text)
        return re.sub(r"^\*([^*].*[^*])\*$", r"\1", text)  # A picture's words; Doxygen sees no emphasis around code.

    def comment(self, page, prefix, lines):
        """The lines of a Markdown page as Doxygen's."""
        code = False
        for line in lines:
            if re.match(r"\s*```", line):
                code = not code
            elif not code:
                heading = re.match(r"#(#+)\s+(.*?)\s*$", line)  # One level up: the page's own is its title.
                line = self.words(page, line)
                if heading:
                    line = f"{heading[1]} {heading[2].replace('`', '')} {{#{prefix}_{slug(heading[2])}}}"
            yield f"/// {line}".rstrip()

    def main_page(self):
        lines = (self.root / "README.md").read_text(encoding="utf-8").splitlines()
        yield "/// @mainpage " + lines[0].lstrip("# ")
        yield from self.comment("README.md", "index", lines[1:])

    def group(self, name, folder, used):
        readme = f"{folder}/README.md"
        if (self.root / readme).exists():
            title, *lines = (self.root / readme).read_text(encoding="utf-8").splitlines()
            title, page = title.lstrip("# "), readme
        elif folder in self.table:
            words, page = self.table[folder]
            title, lines = name, [words[0].upper() + words[1:] + "."]
        else:
            sys.exit(f"{folder}: has no README.md, and CONTRIBUTING.md's table of modules does not name it")
        yield f"/// @defgroup {name} {title}"
        yield "///"
        yield f"/// Component `{name}`, namespace `angio::{name}`."
        if used:
            yield "/// It uses " + ", ".join(f"[{module}](@ref {module})" for module in used) + "."
        yield "///"
        yield from self.comment(page, name, lines)


def main():
    root, listed, out = (pathlib.Path(argument) for argument in sys.argv[1:])
    modules = []
    for line in listed.read_text(encoding="utf-8").splitlines():
        name, folder, *used = line.split()
        modules.append((name, folder, used))
    pages = Pages(root, modules)
    comments = [pages.main_page()] + [pages.group(*module) for module in modules]
    out.write_text("\n\n".join("\n".join(comment) for comment in comments) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
