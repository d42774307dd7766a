"""What the ShapeAssembly paper prints in its Tables 2 to 6, and in the text of section 7.1.3 (Jones et al. 2020).

PAPER["chair"]["structurenet"]["rooted"] is 89.7. Methods and quantities have the names of our result files; what the
paper does not print is not there. Table 6 measures ways between random codes: its rows are "ours" here, too.

    Table 2   rooted, stable, fool (percent), frechet      Table 3   lines, reflect, translate, squeeze, macros_per_line
    Table 4   generalisation, coverage, variety (CD)       Table 5   leaves
    Table 6   geometric_step, program_step                 text      novel_percent

Some entries do not fit together: the shares of a chair's macros do not add up to the total in the rows "3D-PRNN" and
"Ground Truth". They are given as printed.
"""

METHODS = {  # name in our files -> name in the paper
    "3d_prnn": "3D-PRNN",
    "structurenet": "StructureNet",
    "flat": "Ours (Flat)",
    "no_order": "Ours (No Order)",
    "no_align": "Ours (No Align)",
    "no_macros": "Ours (No Macros)",
    "no_reject": "Ours (No Reject)",
    "ours": "Ours",
    "ground_truth": "Ground Truth",
    "validation": "Validation",
}
_ = None  # the paper prints a dash
_QUALITY = ("rooted", "stable", "fool", "frechet")
_TABLE_2 = {
    "chair": {
        "3d_prnn": (73.1, 50.9, 12.60, 39.30),
        "structurenet": (89.7, 74.9, 4.04, 64.79),
        "flat": (95.0, 60.0, 11.58, 77.45),
        "no_order": (82.4, 58.4, 12.36, 64.17),
        "no_align": (94.6, 84.6, 28.68, 29.32),
        "no_macros": (92.0, 77.9, 19.56, 36.78),
        "no_reject": (92.9, 79.7, 23.36, 20.63),
        "ours": (94.5, 84.7, 25.06, 22.34),
        "ground_truth": (100, 88.0, _, _),
    },
    "table": {
        "3d_prnn": (71.2, 29.4, 2.12, 140.07),
        "structurenet": (94.4, 76.8, 3.94, 173.35),
        "flat": (87.0, 66.0, 29.84, 148.63),
        "no_order": (84.5, 56.0, 27.38, 114.10),
        "no_align": (92.2, 61.5, 23.64, 46.64),
        "no_macros": (95.9, 85.0, 33.16, 53.21),
        "no_reject": (94.1, 76.4, 29.20, 52.78),
        "ours": (96.2, 85.9, 33.21, 49.07),
        "ground_truth": (100, 93.1, _, _),
    },
    "storage": {
        "3d_prnn": (44.8, 20.8, 4.62, 94.08),
        "structurenet": (96.2, 75.0, 5.04, 92.85),
        "flat": (95.9, 74.0, 7.44, 81.17),
        "no_order": (87.9, 63.4, 8.70, 107.42),
        "no_align": (89.7, 49.3, 11.04, 30.15),
        "no_macros": (87.5, 69.9, 5.92, 72.80),
        "no_reject": (94.3, 80.9, 11.66, 31.69),
        "ours": (95.3, 83.7, 13.50, 31.72),
        "ground_truth": (100, 87, _, _),
    },
}
_EDITABILITY = ("lines", "reflect", "translate", "squeeze", "macros_per_line")
_TABLE_3 = {
    "chair": {
        "3d_prnn": (15.7, 0.1100, 0.0020, 0.0240, 0.1430),
        "structurenet": (27.1, 0.0600, 0.0004, 0.0700, 0.1330),
        "ours": (20.4, 0.0880, 0.0054, 0.0920, 0.1860),
        "ground_truth": (24.4, 0.0800, 0.0090, 0.1130, 0.2070),
    },
    "table": {
        "3d_prnn": (13.1, 0.1300, 0.0010, 0.0680, 0.1990),
        "structurenet": (24.8, 0.0270, 0.0006, 0.0620, 0.0900),
        "ours": (19.0, 0.0990, 0.0002, 0.1440, 0.2440),
        "ground_truth": (20.0, 0.0950, 0.0050, 0.1450, 0.2460),
    },
    "storage": {
        "3d_prnn": (22.6, 0.0170, 0.0060, 0.0530, 0.0770),
        "structurenet": (30.7, 0.0390, 0.0040, 0.0770, 0.1200),
        "ours": (19.8, 0.0820, 0.0080, 0.1440, 0.2340),
        "ground_truth": (24.7, 0.0650, 0.0147, 0.1510, 0.2320),
    },
}
_VARIABILITY = ("generalisation", "coverage", "variety")
_TABLE_4 = {
    "chair": {
        "3d_prnn": (0.111, 0.123, 0.104),
        "structurenet": (0.104, 0.119, 0.087),
        "ours": (0.108, 0.118, 0.104),
        "validation": (0.105, _, 0.114),
    },
    "table": {
        "3d_prnn": (0.095, 0.130, 0.086),
        "structurenet": (0.129, 0.141, 0.0925),
        "ours": (0.101, 0.108, 0.102),
        "validation": (0.09, _, 0.099),
    },
    "storage": {
        "3d_prnn": (0.134, 0.132, 0.119),
        "structurenet": (0.129, 0.135, 0.107),
        "ours": (0.125, 0.129, 0.119),
        "validation": (0.11, _, 0.125),
    },
}
_COMPLEXITY = ("leaves",)
_TABLE_5 = {
    "chair": {"3d_prnn": (8.6,), "structurenet": (8.7,), "ours": (7.9,), "ground_truth": (9.7,)},
    "table": {"3d_prnn": (7.07,), "structurenet": (8.16,), "ours": (7.84,), "ground_truth": (8.4,)},
    "storage": {"3d_prnn": (10.6,), "structurenet": (12.3,), "ours": (8.4,), "ground_truth": (10.8,)},
}
_SMOOTHNESS = ("geometric_step", "program_step")
_TABLE_6 = {
    "chair": {"structurenet": (0.0384, 3.90), "ours": (0.0384, 1.33)},
    "table": {"structurenet": (0.0474, 4.75), "ours": (0.0389, 2.48)},
    "storage": {"structurenet": (0.0512, 4.29), "ours": (0.0482, 2.6)},
}
_NOVEL = ("novel_percent",)
_TEXT = {"chair": {"ours": (65,)}, "table": {"ours": (85,)}, "storage": {"ours": (53,)}}

PRINTED = {  # the paper's number of a table, "text" for its text -> quantities, {category: {method: numbers}}
    2: (_QUALITY, _TABLE_2),
    3: (_EDITABILITY, _TABLE_3),
    4: (_VARIABILITY, _TABLE_4),
    5: (_COMPLEXITY, _TABLE_5),
    6: (_SMOOTHNESS, _TABLE_6),
    "text": (_NOVEL, _TEXT),
}


def _by_name() -> dict[str, dict[str, dict[str, float]]]:
    """{category: {method: {quantity: number}}} of all tables together."""
    found: dict = {}
    for quantities, numbers in PRINTED.values():
        for category, rows in numbers.items():
            for method, row in rows.items():
                named = {
                    name: value for name, value in zip(quantities, row, strict=True) if value is not None
                }
                found.setdefault(category, {}).setdefault(method, {}).update(named)
    return found


PAPER = _by_name()
