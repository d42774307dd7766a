"""OpenSCAD's own words: those that we write, and those that only the error messages know."""

KEYWORDS = {
    "module",
    "function",
    "if",
    "else",
    "for",
    "let",
    "each",
    "assert",
    "echo",
    "include",
    "use",
    "intersection_for",
}
OUR_MODULES = {
    "union", "intersection", "difference", "children", "multmatrix", "translate", "rotate", "mirror", "linear_extrude",
    "cube", "sphere", "cylinder", "square", "circle", "polygon",
}  # fmt: skip
OTHER_MODULES = KEYWORDS | {
    "scale", "resize", "offset", "color", "hull", "minkowski", "render", "projection", "rotate_extrude", "polyhedron",
    "text", "import", "surface", "group", "assign", "child", "parent_module", "import_dxf", "import_stl",
}  # fmt: skip
CONSTANTS = {"true", "false", "undef", "PI"}
OTHER_SYMBOLS = set("%^:.?<>!#") | {"<=", ">=", "==", "!=", "&&", "||"}
OUR_FUNCTIONS = {"endless"}  # but for the helpers, which are the same in all files
RESERVED = KEYWORDS | OUR_MODULES | OTHER_MODULES | CONSTANTS
