# SPDX-License-Identifier: GPL-2.0-or-later
"""The type stubs say all that the module has, and no more; and everything has a docstring."""
import ast
import inspect
import pathlib

import angio

# What every object has, or nobody calls.
HIDDEN = {"__new__", "__repr__", "__getstate__", "__setstate__", "__hash__", "__copy__", "__deepcopy__", "__module__", "__doc__"}


def members_of_stub(node):
    names = set()
    for item in node.body:
        if isinstance(item, (ast.FunctionDef, ast.ClassDef)):
            names.add(item.name)
        elif isinstance(item, ast.AnnAssign):
            names.add(item.target.id)
    return names


def arguments_of_stub(function):
    return [argument.arg for argument in function.args.args + function.args.kwonlyargs]


def test_stubs_are_complete():
    tree = ast.parse(pathlib.Path(angio.__path__[0], "__init__.pyi").read_text())
    shown = {name: member for name, member in vars(angio).items() if not name.startswith("_") and not inspect.ismodule(member)}
    assert members_of_stub(tree) == set(shown)
    for node in tree.body:
        if not isinstance(node, ast.ClassDef) or node.name == "InputError" or hasattr(shown[node.name], "__members__"):
            continue
        members = {name for name in vars(shown[node.name]) if name not in HIDDEN and not name.startswith("__pybind11")}
        if not shown[node.name].__init__.__doc__.startswith("__init__("):  # Only C++ makes it.
            members.discard("__init__")
        assert members_of_stub(node) == members, node.name
    # Arguments too, of one with a bit of everything, and of one whose fields are its arguments.
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    assert arguments_of_stub(functions["pose_error"]) == ["tree", "camera", "estimate", "truth", "displacements", "true_displacements"]
    state = next(node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == "CArmState")
    made = next(node for node in state.body if getattr(node, "name", "") == "__init__")
    assert set(arguments_of_stub(made)) == {"self", "time_us", "sequence", "joints", "velocity"}


def test_everything_has_a_docstring():
    for name, member in vars(angio).items():
        if name.startswith("_") or not callable(member):
            continue
        text = (member.__doc__ or "").split("\n\n", 1)
        assert len(text) == 2 or inspect.isclass(member) and text[0], name
