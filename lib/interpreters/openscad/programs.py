"""CSG program <-> document: circle_1, square_2, … are the primitives, `shape` is the tree of operations.

    circle_1_center = [32, 32];  circle_1_radius = 28;
    module circle_1() circle_at(circle_1_center, circle_1_radius);
    module shape() difference() { circle_1(); square_2(); }
    plate() shape();                                    in the plane; in space just shape();

An operation with more than two children, which a person may write, is read from the left: A B C is (A B) C.
"""

from ..csg.errors import ProgramError
from ..csg.primitives import KINDS, Primitive
from ..csg.program import Operation, Program
from ..quoting import quoted
from .document import Assign, Call, Document, Module, Number, Text, call, vector
from .errors import ScadError
from .evaluating import Contents, only_child, without_children
from .frame import SEGMENTS
from .helpers import used

LANGUAGE = "CSG"
OPERATIONS = {"+": "union", "*": "intersection", "-": "difference"}
_SYMBOLS = {name: symbol for symbol, name in OPERATIONS.items()}
_SIZES = {"r": "radius", "s": "side", "h": "height"}  # of a primitive's fields; the others are its center
_PLATE = 8  # pixels: as high as the meshes of pictures
_HEADER = """CSG program {0}, for OpenSCAD. Lengths are in pixels, whole numbers; slicers take them for millimetres.
Pixel k lies from k - 1/2 to k + 1/2, and sizes mean what they mean there: see the helpers at the end. {1}
Change the parameters as you like."""
_AXES = {
    2: "In the program y grows down; `plate` turns it round (63 - y), so that from above one sees the picture.",
    3: "z is up.",
}


def write_program(program: Program) -> Document:
    """Without the helpers."""
    names = [f"{KINDS[p.kind].name}_{k}" for k, p in enumerate(program.primitives, start=1)]
    modules = [_module(name, primitive) for name, primitive in zip(names, program.primitives)]
    shape = Module("shape", (), (_tree(program, names),), above="---- The shape ----")
    parameters = _frame(program, used(modules))
    for name, primitive in zip(names, program.primitives):
        parameters += _numbers(name, primitive)
    drawn = call("shape") if program.dimensions == 3 else call("plate", children=(call("shape"),))
    header = _HEADER.format(_short(program.to_text()), _AXES[program.dimensions])
    first, *rest = modules
    first = Module(first.name, (), first.children, above="---- Primitives ----")
    return Document((*parameters, first, *rest, shape, drawn), header)


def _short(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:59]}…"


def _frame(program: Program, helpers: set[str]) -> list[Assign]:
    made = [
        Assign("language", Text(LANGUAGE), above="---- Parameters ----", note="tells the reader what this is")
    ]
    if "swollen" in helpers:
        made.append(Assign("$fn", Number(SEGMENTS), note="corners of a full circle, at least 3"))
    if program.dimensions == 2:
        made.append(Assign("height", Number(_PLATE), note="of the plate"))
    return made


def _arguments(name: str, kind: str) -> list[str]:
    """Names of the parameters of one primitive."""
    sizes = [f"{name}_{_SIZES[field]}" for field in KINDS[kind].fields if field in _SIZES]
    return [f"{name}_center", *sizes]


def _numbers(name: str, primitive: Primitive) -> list[Assign]:
    center, sizes = primitive.numbers[: primitive.dimensions], primitive.numbers[primitive.dimensions :]
    parameters = _arguments(name, primitive.kind)
    above = f"{name}: {primitive}"
    return [
        Assign(p, vector(n), above="" if k else above)
        for k, (p, n) in enumerate(zip(parameters, (center, *sizes)))
    ]


def _module(name: str, primitive: Primitive) -> Module:
    kind = KINDS[primitive.kind]
    return Module(name, (), (call(f"{kind.name}_at", *_arguments(name, primitive.kind)),))


def _tree(program: Program, names: list[str]) -> Call:
    stack, waiting = [], iter(names)
    for statement in program.statements:
        if isinstance(statement, Primitive):
            stack.append(call(next(waiting)))
        else:
            right = stack.pop()
            stack.append(call(OPERATIONS[statement.symbol], children=(stack.pop(), right)))
    return stack[0]


def read_program(file: Contents) -> Program:
    """Raises ScadError for a file that says no program."""
    if "shape" not in file.modules:
        raise ScadError("there is no module 'shape'", expected="the tree of operations")
    primitives = {name: _primitive(file, module) for name, module in file.modules.items() if name != "shape"}
    tree = only_child(file.modules["shape"])
    statements = _postfix(file, tree, primitives)
    file.drawn("plate" if statements[0].dimensions == 2 else "", "shape")
    try:
        return Program(tuple(statements))
    except ProgramError as error:
        raise ScadError(error.found, *tree.at, tree.name, error.expected) from None


def _primitive(file: Contents, module: Module) -> Primitive:
    drawn = without_children(only_child(module))
    kinds = {f"{kind.name}_at": kind for kind in KINDS.values()}
    if drawn.name not in kinds:
        raise ScadError(f"found {quoted(drawn.name)}", *drawn.at, drawn.name, " or ".join(kinds))
    kind = kinds[drawn.name]
    sizes = [field for field in kind.fields if field in _SIZES]
    center, *others = file.arguments(drawn, 1 + len(sizes))
    places = {**dict.fromkeys("xyz", center), **dict(zip(sizes, others))}
    numbers = [*file.numbers(center, kind.dimensions), *map(file.number, others)]
    try:
        return Primitive(kind.letters, tuple(int(n) if n.is_integer() else n for n in numbers))
    except ProgramError as error:  # it begins with the field that is wrong
        place = places[error.found.partition(" ")[0]]
        raise ScadError(
            f"{module.name}: {error.found}", *file.place(place), expected=error.expected
        ) from None


def _postfix(file: Contents, tree: Call, primitives: dict[str, Primitive]) -> list[Primitive | Operation]:
    """Without recursion: programs may be nested hundreds of times."""
    statements, waiting = [], [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, Operation):
            statements.append(node)
        elif node.name in _SYMBOLS:
            if not node.children:
                raise ScadError(
                    f"an empty {node.name}", *node.at, node.name, "primitives or operations in { }"
                )
            file.arguments(node, 0)
            first, *others = node.children
            for child in reversed(others):
                waiting += [Operation(_SYMBOLS[node.name]), child]
            waiting.append(first)
        elif node.name in primitives:
            file.module(node)
            statements.append(primitives[node.name])
        else:
            expected = "a primitive's module, or union, intersection, difference"
            raise ScadError(f"found {quoted(node.name)}", *node.at, node.name, expected)
    return statements
