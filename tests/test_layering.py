"""Who may import whom, how long a module may be, and what a language must never do. Read from the source, not run."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MODULES = sorted(path for folder in ("lib", "data_scripts") for path in (ROOT / folder).rglob("*.py"))
LANGUAGES = ["interpreters"]
GEOMETRY = ["models", "metrics", "extractor"]
MAY_IMPORT = {  # part of lib -> the parts it may import beside itself
    "interpreters": [],
    "extractor": ["metrics", *LANGUAGES],  # an extraction is validated by measuring it
    "models": LANGUAGES,
    "metrics": LANGUAGES,
    "finding": ["metrics", *LANGUAGES],
    "training": ["datasets", *GEOMETRY, *LANGUAGES],
    "viewing": [*GEOMETRY, "finding", *LANGUAGES],
    "exercises": [*GEOMETRY, *LANGUAGES],
    "furniture": ["extractor", *LANGUAGES],
    "datasets": ["extractor", "furniture", *LANGUAGES],
}
LANGUAGE_LIBRARIES = {
    "torch",
    "numpy",
    "jaxtyping",
    "trimesh",
    "manifold3d",
    "skimage",
} | {  # and of the standard library:
    *(
        "__future__",
        "abc",
        "collections",
        "contextlib",
        "copy",
        "dataclasses",
        "enum",
        "functools",
        "itertools",
    ),
    *("math", "numbers", "operator", "re", "string", "textwrap", "types", "typing", "warnings"),
}
UNSAFE_MODULES = {"pickle", "cPickle", "_pickle", "dill", "cloudpickle", "shelve", "marshal", "joblib.memory"}
UNSAFE_CALLS = {"eval", "exec", "compile", "__import__"}
LANGUAGE_CALLS = {"open", "print", "input"}
LONGEST = 350  # lines


def imports(tree: ast.AST, module: str) -> list[tuple[int, str]]:
    """(line, absolute dotted name) of everything `module` imports, relative imports resolved."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [(node.lineno, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            here = module.split(".")[: -node.level] if node.level else []
            base = ".".join([*here, *filter(None, [node.module])])
            found += [(node.lineno, f"{base}.{alias.name}") for alias in node.names]
    return found


def calls(tree: ast.AST) -> list[tuple[int, str]]:
    """(line, name) of every call such as f(...) or a.b(...), and "allow_pickle" where that is switched on."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            found.append((node.lineno, ast.unparse(node.func)))
            found += [(node.lineno, "allow_pickle") for key in node.keywords if key.arg == "allow_pickle"]
    return found


def import_problems(module: str, tree: ast.AST) -> list[str]:
    """What this module of lib imports against the plan."""
    part = module.split(".")[1] if "." in module else ""
    problems = []
    for line, name in imports(tree, module):
        top, *inner = name.split(".")
        other = inner[0] if inner else ""
        if top in ("data_scripts", "tests", "notebooks"):
            problems.append(f"line {line}: lib never imports {top}")
        elif top == "lib" and other != part and other not in MAY_IMPORT.get(part, []):
            problems.append(f"line {line}: lib.{part} may not import {name}")
        elif part == "interpreters" and top not in LANGUAGE_LIBRARIES | {"lib"}:
            problems.append(f"line {line}: a language may not import {top}")
    return problems


def safety_problems(module: str, tree: ast.AST) -> list[str]:
    """Anything that runs data as code; in a language, files and printing too."""
    forbidden = UNSAFE_CALLS | {"torch.load", "torch.save", "allow_pickle"}
    if module.startswith("lib.interpreters"):
        forbidden |= LANGUAGE_CALLS
    problems = [f"line {line}: {name}()" for line, name in calls(tree) if name in forbidden]
    problems += [
        f"line {line}: {name}" for line, name in imports(tree, module) if UNSAFE_MODULES & {*name.split(".")}
    ]
    return problems


def problems_of(module: str, source: str) -> list[str]:
    """Everything wrong with one module, given its dotted name and text."""
    tree = ast.parse(source)
    problems = safety_problems(module, tree)
    if module.startswith("lib"):
        problems += import_problems(module, tree)
    if (lines := source.count("\n")) > LONGEST:
        problems.append(f"{lines} lines: is it one idea? (at most {LONGEST})")
    return problems


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(ROOT)))
def test_module_keeps_the_plan(path):
    parts = path.relative_to(ROOT).with_suffix("").parts
    assert problems_of(".".join(parts), path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "module, source",
    [
        ("lib.interpreters.csg.run", "import matplotlib.pyplot as plt"),
        ("lib.interpreters.csg.run", "from pathlib import Path"),
        ("lib.interpreters.csg.run", "import socket"),
        ("lib.interpreters.csg.run", "from urllib import request"),
        ("lib.interpreters.csg.run", "text = open('a').read()"),
        ("lib.interpreters.csg.run", "print(1)"),
        ("lib.interpreters.csg.run", "def f():\n    from lib.viewing import picture"),
        ("lib.interpreters.csg.run", "from ...models import vae"),
        ("lib.metrics.chamfer", "from lib.models import vae"),
        ("lib.metrics.chamfer", "from lib import training"),
        ("lib.models.vae", "import lib.datasets"),
        ("lib.training.loop", "from lib.viewing.picture import picture"),
        ("lib.viewing.book", "from data_scripts import check_env"),
        ("lib.datasets", "import pickle"),
        ("lib.datasets", "from numpy import load\nload('a', allow_pickle=True)"),
        ("lib.models.vae", "import torch\ntorch.load('a')"),
        ("data_scripts.fetch", "eval('1')"),
        ("data_scripts.fetch", "exec('1')"),
        ("lib.viewing.book", "x = 1\n" * 351),
    ],
)
def test_the_checker_says_no(module, source):
    assert problems_of(module, source) != []


@pytest.mark.parametrize(
    "module, source",
    [
        (
            "lib.interpreters.csg.run",
            "import torch, math\nfrom lib.interpreters.cuboids import Cuboids\nfrom . import x",
        ),
        ("lib.training.loop", "from lib.models import vae\nfrom lib.metrics import chamfer\nmodel.eval()"),
        ("lib.viewing.book", "from pathlib import Path\nprint(open('a'))"),
        ("data_scripts.fetch", "from lib.datasets import DataError"),
    ],
)
def test_the_checker_says_yes(module, source):
    assert problems_of(module, source) == []
