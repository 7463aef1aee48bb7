#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Writes the type stubs of the built module: stubs.py BUILD/python OUT.pyi"""
import inspect
import pathlib
import re
import sys

HEAD = """# SPDX-License-Identifier: GPL-2.0-or-later
# Written by stubs.py from the built module.
from typing import Any, Callable, ClassVar, Dict, Iterator, List, Optional, Tuple, Type, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray
"""
ARRAY = re.compile(r"numpy\.ndarray\[numpy\.(\w+?)(?:\[[^\]]*\])?(?:, flags\.[\w.]+)*\]")
SIGNATURE = re.compile(r"^(\w*)\((.*)\) -> (.+)$")
SETTABLE = "Fields by their names; the others keep their defaults."


def python_type(text, given):
    """A type as pybind11 writes it, for what is given to a function or comes back."""
    text = ARRAY.sub("ArrayLike" if given else r"NDArray[np.\1]", text)
    text = text.replace("numpy.ndarray", "ArrayLike" if given else "NDArray[Any]")
    text = re.sub(r"\bangio\._angio\.", "", text)
    text = re.sub(r"\b(object|handle)\b", "Any", text)
    text = re.sub(r"\bfunction\b", "Callable[..., Any]", text)
    text = re.sub(r"\bdict\b", "Dict[Any, Any]", text)
    text = re.sub(r"\btuple\b", "Tuple[Any, ...]", text)
    return re.sub(r"\blist\b", "List[Any]", text)


def parts(text):
    """Splits at commas outside of brackets and quotes."""
    depth, quoted, part = 0, False, ""
    for c in text:
        quoted ^= c == "'"
        depth += 0 if quoted else (c in "[(<{") - (c in "])>}")
        if c == "," and not depth and not quoted:
            yield part.strip()
            part = ""
        else:
            part += c
    if part.strip():
        yield part.strip()


def argument(text):
    name, _, rest = text.partition(": ")
    if not rest:
        return text
    kind, _, default = rest.partition(" = ")
    if not default:
        return f"{name}: {python_type(kind, True)}"
    plain = re.fullmatch(r"None|True|False|-?[\d.e+-]+|'[^']*'|\[('[^']*'(, '[^']*')*)?\]", default)
    kind = python_type(kind, True)
    if default == "None" and not kind.startswith(("Optional", "Any")):
        kind = f"Optional[{kind}]"
    return f"{name}: {kind} = {default if plain else '...'}"


def docstring(text, indent):
    text = inspect.cleandoc(text or "").replace("\\", "\\\\").replace('"""', "'''")
    lines = [indent + line if line else "" for line in text.split("\n")]
    return indent + '"""' + "\n".join(lines)[len(indent):] + '"""\n' if text else ""


def fields_of(owner):
    """The fields that can be set, as arguments."""
    for name, member in vars(owner).items():
        if isinstance(member, property) and member.fset:
            taken = SIGNATURE.match((member.fset.__doc__ or "").strip().split("\n")[0])
            yield f"{name}: {python_type(list(parts(taken.group(2)))[1].partition(': ')[2], True)} = ..."


def function(name, described, indent, owner=None, static=False):
    """A function of which pybind11 wrote the docstring; of overloads each."""
    text = described.__doc__ or ""
    lines = text.strip().split("\n")
    overloads = re.findall(r"^\d+\. (.+)$\n\n?((?:(?!^\d+\. ).*\n?)*)", text, re.M) if len(lines) > 1 and lines[1] == "Overloaded function." else []
    if not overloads:
        overloads = [(lines[0], "\n".join(lines[1:]))]
    out = ""
    for signature, said in overloads:
        found = SIGNATURE.match(signature)
        if not found:  # Of a class that only C++ makes.
            continue
        arguments = [argument(part) for part in parts(found.group(2))]
        if owner and not static:
            arguments = ["self"] + arguments[1:]
        if SETTABLE in said:
            arguments = ["self", "*"] + list(fields_of(owner))
        arguments = [re.sub(r"^\*(\w+)$", r"*\1: Any", part) if part not in ("*",) else part for part in arguments]
        result = python_type(found.group(3), False)
        decorators = (f"{indent}@overload\n" if len(overloads) > 1 else "") + (f"{indent}@staticmethod\n" if static else "")
        body = docstring(said, indent + "    ")
        out += f"{decorators}{indent}def {name}({', '.join(arguments)}) -> {result}:" + (f"\n{body}" if body else " ...\n")
    return out


def is_enum(cls):
    return hasattr(cls, "__members__")


def cls_stub(cls, indent=""):
    bases = "(ValueError)" if issubclass(cls, Exception) else ""
    out = f"{indent}class {cls.__name__}{bases}:\n" + docstring(own_doc(cls), indent + "    ")
    inner = indent + "    "
    body = ""
    if is_enum(cls):
        for name in cls.__members__:
            body += f"{inner}{name}: ClassVar[{cls.__qualname__.split('.')[-1]}]\n"
        body += f"{inner}def __init__(self, value: int) -> None: ...\n{inner}def __int__(self) -> int: ...\n"
        body += f"{inner}@property\n{inner}def name(self) -> str: ...\n{inner}@property\n{inner}def value(self) -> int: ...\n"
        return out + body
    for name, member in vars(cls).items():
        if inspect.isclass(member):
            body += cls_stub(member, inner)
        elif isinstance(member, property):
            getter = SIGNATURE.match((member.fget.__doc__ or "").strip().split("\n")[0])
            kind = python_type(getter.group(3), False) if getter else "Any"
            body += f"{inner}@property\n{inner}def {name}(self) -> {kind}:"
            said = docstring(member.__doc__, inner + "    ")
            body += f"\n{said}" if said else " ...\n"
            if member.fset:
                taken = SIGNATURE.match((member.fset.__doc__ or "").strip().split("\n")[0])
                value = python_type(list(parts(taken.group(2)))[1].partition(": ")[2], True)
                body += f"{inner}@{name}.setter\n{inner}def {name}(self, value: {value}) -> None: ...\n"
        elif isinstance(member, staticmethod):
            body += function(name, member.__func__, inner, cls, static=True)
        elif callable(member) and shown(name):
            body += function(name, member, inner, cls)
    return out + (body or f"{inner}...\n")


def own_doc(cls):
    return cls.__doc__ if not is_enum(cls) else (cls.__doc__ or "").split("\n\nMembers:")[0]


def shown(name):
    hidden = {"__new__", "__repr__", "__getstate__", "__setstate__", "__hash__", "__copy__", "__deepcopy__"}
    return not name.startswith("_") or (name.startswith("__") and name.endswith("__") and name not in hidden)


def stub(module):
    out = HEAD
    for name, member in sorted(vars(module).items()):
        if name.startswith("_") or inspect.ismodule(member):
            continue
        if inspect.isclass(member):
            out += "\n" + cls_stub(member)
        elif callable(member):
            out += "\n" + function(name, member, "")
        elif isinstance(member, dict):
            out += f"\n{name}: Dict[str, Type[Any]]\n"
        else:
            out += f"\n{name}: Tuple[Type[Any], ...]\n"
    return out.replace("Type, Union\n", "Type, Union, overload\n") if "@overload" in out else out


if __name__ == "__main__":
    sys.path.insert(0, sys.argv[1])
    import angio

    pathlib.Path(sys.argv[2]).write_text(stub(angio))
