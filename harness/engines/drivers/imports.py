"""What Python files import from outside their own folder: argv names them; prints {"roots": [...], "unknown": [...]}.

They are read and never run. Modules of Python itself are left out, and what lies below the folders of the files, which is looked
at anyway. What others import is followed wherever it lies; what only a file of one's own imports and nobody finds is `unknown`.
"""

import ast
import importlib.util
import json
import os
import pathlib
import re
import sys

IMPORT = re.compile(r"^[ \t]*(?:from[ \t]+([A-Za-z_]\w*)|import[ \t]+([\w., \t]+))", re.MULTILINE)
# Of more sources of others than this the imports are not followed.
MOST = 5000


def top(name):
    return name.split(".")[0]


def of_others(text):
    found = IMPORT.findall(text)
    return {top(name.split()[0]) for one, several in found for name in (several or one).split(",") if name.split()}


def of_own(path, text):
    """Names that a file imports, those outside `try` only in the second set, after adding the folders that it adds to sys.path."""
    names, needed, unknown = set(), set(), []
    guarded = set()
    known = {"os": os, "sys": sys, "pathlib": pathlib, "Path": pathlib.Path, "__file__": path}
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Try):
            guarded.update(id(inner) for inner in ast.walk(node))
    for node in ast.walk(tree):
        found = []
        if isinstance(node, ast.Import):
            found = [top(alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            found = [top(node.module)]
        elif isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            if called in ("sys.path.insert", "sys.path.append", "path.insert", "path.append", "site.addsitedir"):
                try:
                    place = eval(compile(ast.Expression(node.args[-1]), path, "eval"), dict(known))  # noqa: S307
                    sys.path.insert(0, os.path.join(os.getcwd(), os.fspath(place)))
                except Exception:
                    unknown.append(f"sys.path by {os.path.basename(path)}:{node.lineno}")
            elif called.split(".")[-1] in ("import_module", "__import__") and node.args:
                if isinstance(node.args[0], ast.Constant) and isinstance(node.args[0].value, str):
                    found = [top(node.args[0].value)]
                else:
                    unknown.append(f"{called} by {os.path.basename(path)}:{node.lineno}")
        names.update(found)
        if id(node) not in guarded:
            needed.update(found)
    return names, needed, unknown


def places(name):
    """Folders or the file of a module; none where it is built in, None where nobody finds it."""
    try:
        spec = importlib.util.find_spec(name)
    except (ImportError, ValueError, AttributeError):
        return None
    if spec is None:
        return None
    if spec.submodule_search_locations is not None:
        return list(spec.submodule_search_locations)
    return [spec.origin] if spec.origin and os.path.isfile(spec.origin) else []


def sources(place):
    if os.path.isfile(place):
        return [place] if place.endswith(".py") else []
    return sorted(str(file) for file in pathlib.Path(place).rglob("*.py"))


def main(files):
    own = {os.path.dirname(os.path.abspath(file)) for file in files} | {os.getcwd()}
    sys.path[:] = sorted(own) + [place for place in sys.path if place]
    waiting = [(os.path.abspath(file), True) for file in files]
    seen, roots, unknown, followed = set(sys.stdlib_module_names), [], [], 0
    read = set()
    while waiting:
        path, is_own = waiting.pop(0)
        if path in read:
            continue
        read.add(path)
        with open(path, encoding="utf-8", errors="replace") as file:
            text = file.read()
        if is_own:
            names, needed, more = of_own(path, text)
            unknown += more
        else:
            names, needed = of_others(text), set()
        for name in sorted(names - seen):
            found = places(name)
            if found is None:
                unknown += [f"{name} by {os.path.basename(path)}"] if name in needed else []
                continue
            seen.add(name)
            for place in map(os.path.abspath, found):
                is_near = any(place == folder or place.startswith(folder + os.sep) for folder in own)
                if not is_near:
                    roots.append(place)
                inner = sources(place)
                followed += len(inner)
                if followed > MOST:
                    unknown.append(f"what {name} imports: it is too large")
                else:
                    waiting += [(file, is_near) for file in inner]
    json.dump({"roots": sorted(set(roots)), "unknown": sorted(set(unknown))}, sys.stdout)


main(sys.argv[1:])
