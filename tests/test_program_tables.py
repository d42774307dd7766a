"""The paper's Tables 2 to 6 are the paper's, our rows stand in the right place, and what is not there is named."""

import json
import re

import matplotlib.pyplot as plt
import pytest

from lib.metrics.chamfer import PAPER as PAPER_DISTANCES
from lib.metrics.interpolation import PAPER as PAPER_STEPS
from lib.metrics.programs import PAPER_GROUND_TRUTH
from lib.viewing.paper_numbers import METHODS, PAPER, PRINTED
from lib.viewing.program_tables import (
    CATEGORIES,
    NAMES,
    PANELS,
    TABLES,
    ResultError,
    dots_figure,
    load_rows,
    not_measured,
    ours,
    over_seeds,
    provenance,
    table,
)

ROW = {"category": "chair", "method": "ours", "samples": 12, "seed": 3, "data": "real", "date": "2020-01-01",
       "commit": "abc1234", "code": "c0de", "weights": "we1947", "rooted": 91.25, "stable": 66.0, "fool": 7.125,
       "frechet": 12.5, "lines": 17.04, "generalisation": 0.1111, "coverage": None,
       "rejected_percent": 21.3}  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    """Three rows of chairs."""
    truth = {"category": "chair", "method": "ground_truth", "stable": 88.0, "rooted": 100.0}
    steps = {"category": "chair", "method": "interpolation", "geometric_step": 0.0311, "program_step": 1.04}
    for row in (ROW, truth, steps):
        (tmp_path / f"chair_{row['method']}.json").write_text(json.dumps(row))
    return tmp_path


def line_of(text: str, name: str) -> list[str]:
    """The numbers and dashes of the first line that begins with a name."""
    line = next(line for line in text.splitlines() if line.strip().startswith(name.ljust(15)))
    return line.strip().removeprefix(name).split()


def test_the_numbers_are_those_that_the_metrics_know():
    for category in CATEGORIES:
        truth, theirs = PAPER[category]["ground_truth"], PAPER_GROUND_TRUTH[category]
        assert (truth["lines"], truth["leaves"]) == (theirs.lines, theirs.leaves)
        assert {macro: truth[macro] for macro in theirs.macros} == theirs.macros
        for method, name in {"ours": "model", "validation": "validation"}.items():
            known = {
                key: value
                for key, value in vars(PAPER_DISTANCES[category][name]).items()
                if value is not None
            }
            assert {key: PAPER[category][method][key] for key in known} == known
        step = PAPER_STEPS[category]
        assert (step.geometric, step.program) == tuple(PAPER[category]["ours"][k] for k in PRINTED[6][0])


def test_the_numbers_are_those_of_the_papers_text(shared):
    """Each row of Tables 2 to 6, found in the paper's text by its method, with its numbers in order."""
    path = shared / "papers" / "shapeassembly.txt"
    if not path.is_file():
        pytest.skip(f"no {path}")
    lines = [[cell.strip() for cell in line.strip(" |").split("|")] for line in path.read_text().splitlines()]
    found = {tuple(cells[1:] if cells[0].lower() in CATEGORIES else cells) for cells in lines}
    rows = {(cells[0], *(None if cell in "——-" else float(cell) for cell in cells[1:] if cell)) for cells in found
            if all(re.fullmatch(r"[\d.]+|—|", cell) for cell in cells[1:])}  # fmt: skip
    count = 0
    for name, (_, categories) in PRINTED.items():
        for methods in categories.values():
            for method, numbers in methods.items() if name != "text" else ():
                count += 1
                assert (METHODS[method], *numbers) in rows, (name, method, numbers)
    assert count == 27 + 12 + 12 + 12 + 6


def test_the_macros_of_each_row_add_up_but_for_two():
    """The paper cuts digits off, so a total may be a few thousandths more than what is printed of its parts."""
    wrong = [
        (category, method)
        for category, rows in PRINTED[3][1].items()
        for method, (_, *macros, total) in rows.items()
        if abs(total - sum(macros)) > 0.003
    ]
    assert wrong == [("chair", "3d_prnn"), ("chair", "ground_truth")]


def test_every_paper_row_is_named_and_has_its_number():
    for number, layout in TABLES.items():
        for category in CATEGORIES:
            part = table(number, {}, [category])
            assert part in table(number, {}) or category != CATEGORIES[0]  # the first part of the whole
            for method in layout.methods:
                numbers = [PAPER[category].get(method, {}).get(quantity) for quantity in layout.columns]
                forms = [form for _, form in layout.columns.values()]
                expected = ["-" if n is None else format(n, form) for n, form in zip(numbers, forms)]
                told = line_of(part, NAMES[method])[::2]
                if "stable_of_real" in layout.columns:  # the one column that is computed
                    del told[2], expected[2]
                assert told == expected


def test_our_numbers_stand_beside_the_papers(folder):
    rows = load_rows(folder)
    two = table(2, rows, ["chair"])
    assert line_of(two, "Ours") == "94.5 91.2 84.7 66.0 0.963 0.750 - - 25.06 7.12 22.34 12.50".split()
    assert line_of(two, "Ours (Flat)") == "95.0 - 60.0 - 0.682 - - - 11.58 - 77.45 -".split()
    assert line_of(two, "Ground Truth") == "100.0 100.0 88.0 88.0 1.000 1.000".split() + ["-"] * 6
    assert line_of(table(4, rows), "Ours") == "0.108 0.111 0.118 - 0.104 - 65 -".split()
    assert line_of(table(6, rows), "Ours") == "0.0384 0.0311 1.33 1.04".split()
    assert ours(rows, "table", "ours", "rooted") is None and "91.2" not in table(
        2, rows, ["table", "storage"]
    )


def test_columns_are_under_their_headings():
    for number in TABLES:
        widths = {len(line) for line in table(number, {}).splitlines()[1:]}
        assert len(widths) == 1 and widths.pop() <= 112


def test_nothing_measured(tmp_path):
    rows = load_rows(tmp_path / "nowhere")
    assert provenance(rows) == "no row has been measured yet"
    told = not_measured(rows)
    assert len(told.splitlines()) == 1 + 3 * 11
    assert "measure_program_vae table\n" in told and "storage --method interpolation" in told
    assert "chair --method flat --weights runs/chair-flat/program_vae.safetensors" in told
    assert "prnn" not in told.lower() and "structurenet" not in told.lower()


def test_what_was_measured_is_told(folder):
    rows = load_rows(folder)
    told = not_measured(rows)
    assert "chair --method ground_truth" not in told and "chair --method interpolation" not in told
    assert len(told.splitlines()) == 1 + 3 * 11 - 3
    facts = line_of(provenance(rows), "chair    Ours")
    assert facts == ["12", "3", "real", "2020-01-01", "abc1234", "c0de", "we1947", "21.3%"]
    everything = {
        c: dict.fromkeys([*TABLES[2].methods, "validation", "interpolation"], ROW) for c in CATEGORIES
    }
    assert not_measured(everything) == ""


@pytest.mark.parametrize(
    "content, said",
    [
        ("{", "not a result"),
        ("[1]", "found list"),
        ('{"category": "chair", "method": "flat"}', "found ('chair', 'flat'); expected ('table', 'ours')"),
        ('{"category": "table", "method": "ours", "rooted": "96"}', "rooted is '96'; expected a number"),
        ('{"category": "table", "method": "ours", "lines": true}', "lines is True; expected a number"),
    ],
)
def test_a_file_that_is_no_result(content, said, tmp_path):
    (tmp_path / "table_ours.json").write_text(content)
    with pytest.raises(ResultError, match=re.escape(said)) as told:
        load_rows(tmp_path)
    assert "table_ours.json" in str(told.value)


def test_seeds_stand_side_by_side(folder):
    first, other = load_rows(folder), {"chair": {"ours": {"seed": 7, "rooted": 50.0, "stable": 44.0}}}
    told = over_seeds([first, other], "ours")
    assert line_of(told, "Ours") == "paper seed 3 seed 7".split()
    assert line_of(told, "chair    % rooted") == "94.5 91.2 50.0".split()
    assert line_of(told, "chair    ÷ real") == "0.963 0.750 0.500".split()  # by the real shapes of the first
    assert line_of(told, "storage  % novel") == "53 - -".split()
    assert "seed -" in over_seeds([{}, {}])


def test_the_figure_shows_both(folder):
    bare, filled = dots_figure({}), dots_figure(load_rows(folder))
    axes = [ax for ax in filled.axes if ax.get_title()]
    assert [ax.get_title() for ax in axes] == list(PANELS.values())
    drawn = [sum(len(ax.lines) for ax in figure.axes) for figure in (bare, filled)]
    # rooted, stable ÷ real, fool, generalisation and lines of one row, rooted and stable ÷ real of the ground truth:
    # each a mark, and a line to the paper's
    assert drawn[1] - drawn[0] == 2 * 7
    assert not plt.get_fignums()  # closed: a notebook shows it once
