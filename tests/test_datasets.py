"""lib.datasets: real programs where they were fetched, embedded ones elsewhere, and errors that name the place."""

import numpy as np
import pytest
import torch

from data_scripts import fetch_shapeassembly as fetching
from lib import datasets
from lib.datasets import CATEGORIES, DataError, shapeassembly
from lib.furniture import make
from lib.interpreters.shapeassembly import execute, parse

TEXT = """Assembly Program_0 {
\tbbox = Cuboid(1.0, 2.0, 1.0, True)
\tcube0 = Cuboid(1.0, 0.5, 1.0, True)
\tcube1 = Cuboid(0.1, 1.5, 0.1, True)
\tattach(cube0, bbox, 0.5, 1.0, 0.5, 0.5, 1.0, 0.5)
\tsqueeze(cube1, bbox, cube0, bot, 0.1, 0.1)
\treflect(cube1, X)
}
"""


@pytest.fixture
def no_real_data(tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "nothing"))


@pytest.fixture
def real_data(tmp_path, monkeypatch):
    """A folder as the fetch script leaves it, with three programs a category."""
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path))
    folder = tmp_path / "shapeassembly"
    for category in CATEGORIES:
        (folder / category).mkdir(parents=True)
        (folder / "splits" / category).mkdir(parents=True)
        number = CATEGORIES.index(category) + 1
        for i in (3, 1, 2):
            (folder / category / f"{number}{i}.txt").write_text(TEXT)
        (folder / "splits" / category / "train.txt").write_text(f"{number}3\n{number}1\n")
        (folder / "splits" / category / "val.txt").write_text(f"{number}2\n")
    return folder


# ---- embedded ----


@pytest.mark.parametrize("category", [*CATEGORIES, None])
@pytest.mark.parametrize("split", ["train", "val", None])
def test_embedded_sets_have_their_sizes(no_real_data, category, split):
    programs = shapeassembly(category, split)
    per_category = sum(
        size for name, size in datasets.programs.EMBEDDED_SIZES.items() if split in (name, None)
    )
    assert len(programs) == len(set(programs.ids)) == per_category * (1 if category else 3)
    assert programs.source == "embedded"
    assert "embedded" in programs.describe() and "fetch" in programs.describe()


def test_embedded_programs_run_and_are_the_same_every_time(no_real_data):
    first = shapeassembly(split="val")
    texts = [program.to_text() for program in first]
    datasets.programs._embedded.cache_clear()
    assert texts == [program.to_text() for program in shapeassembly(split="val")]
    assert all(len(execute(program).cuboids) > 1 for program in first)


def test_train_and_val_share_no_program(no_real_data):
    train = {program.to_text() for program in shapeassembly(split="train")}
    assert not train & {program.to_text() for program in shapeassembly(split="val")}


def test_a_variation_keeps_structure_and_equal_widths():
    program = parse(TEXT)
    other = datasets.vary(program, np.random.default_rng(0))
    assert other.structure == program.structure
    ratio = other.parameters() / program.parameters()
    sizes = [i for i, name in enumerate(program.parameter_names()) if ":Cuboid:" in name]
    by_axis = ratio[sizes].reshape(-1, 3)
    assert by_axis.std(dim=0).max() < 1e-3  # sizes are rounded to 4 decimals
    low, high = datasets.programs.SCALE_RANGE
    assert ((low - 1e-3 < by_axis) & (by_axis < high + 1e-3)).all()
    rest = torch.ones(len(ratio), dtype=torch.bool)
    rest[sizes] = False
    assert torch.equal(other.parameters()[rest], program.parameters()[rest])


def test_examples_have_a_first_line_that_describes_them():
    names = list(datasets.examples())
    assert names == sorted(names) and len(names) >= 12
    for name in names:
        text = datasets.example_text(name)
        assert text.startswith("# ") and parse(text) == datasets.example(name)


# ---- real ----


def test_real_programs_come_in_the_order_of_their_list(real_data):
    train = shapeassembly("table", "train")
    assert train.ids == ("23", "21") and train.source == "real"
    assert list(train) == [parse(TEXT)] * 2
    assert train.describe() == "2 real table train programs of the ShapeAssembly data set."
    assert shapeassembly("table").ids == ("23", "21", "22")
    assert len(shapeassembly()) == 9


def test_a_slice_is_a_set_and_an_index_is_a_program(real_data):
    programs = shapeassembly("chair")
    assert programs[:2].ids == programs.ids[:2] and programs[:2].source == "real"
    assert programs[-1] == parse(TEXT) and parse(TEXT) in programs
    with pytest.raises(IndexError):
        programs[3]


def test_unknown_names_are_answered_with_the_choices(no_real_data):
    with pytest.raises(DataError, match="'sofa'.*chair, table, storage"):
        shapeassembly("sofa")
    with pytest.raises(DataError, match="'test'.*train, val"):
        shapeassembly("chair", "test")
    with pytest.raises(DataError, match="unknown example 'spaceship': choose one of .*chair"):
        datasets.example("spaceship")


def test_a_corrupt_program_is_named_with_its_line(real_data):
    (real_data / "chair" / "13.txt").write_text(TEXT.replace("0.5, 1.0, True", "0.5, oops, True"))
    programs = shapeassembly("chair")
    assert programs[1] == parse(TEXT)  # the others still load
    with pytest.raises(DataError, match=r"chair/13\.txt.*line 3"):
        programs[0]


def test_a_program_that_is_not_text_is_named(real_data):
    (real_data / "chair" / "13.txt").write_bytes(TEXT.encode()[:60] + b"\xff\xfe")
    with pytest.raises(DataError, match=r"chair/13\.txt.*line 3.*text"):
        shapeassembly("chair")[0]


def test_a_missing_program_is_named_with_the_list_and_line(real_data):
    (real_data / "chair" / "11.txt").unlink()
    with pytest.raises(DataError, match=r"splits/chair/train\.txt, line 2: .*chair/11\.txt.*fetch"):
        shapeassembly("chair", "train")


def test_a_missing_list_is_named(real_data):
    (real_data / "splits" / "chair" / "val.txt").unlink()
    with pytest.raises(DataError, match=r"splits/chair/val\.txt.*fetch"):
        shapeassembly("chair")


def test_the_real_data_set(shared, tmp_path, monkeypatch):
    archive = shared / "data" / "shapeassembly-programs.tar.xz"
    if not archive.exists():
        pytest.skip(f"there is no {archive}")
    fetching.fetch(tmp_path, archive)
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path))
    assert [len(shapeassembly(category, "train")) for category in CATEGORIES] == [3339, 5762, 1435]
    assert [len(shapeassembly(category, "val")) for category in CATEGORIES] == [496, 774, 116]
    assert len(shapeassembly()) == 11_922
    chair = shapeassembly("chair", "val")[0]
    assert parse(chair.to_text()) == chair


def test_part_graphs_are_made_where_there_is_no_partnet(tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path))
    graphs = datasets.part_graphs("table")
    assert (graphs.source, len(graphs), graphs.ids[3]) == ("embedded", 1000, "table-000003")
    assert graphs[3].name == graphs[3:][0].name == "table-000003"
    assert graphs[3].to_json() == make("table", 3).to_json()
    assert "furniture maker" in graphs.describe()


def test_part_graphs_of_partnet_are_read_where_they_were_put(tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path))
    folder = tmp_path / "partnet" / "storagefurniture_hier"
    folder.mkdir(parents=True)
    with pytest.raises(DataError, match=r"no \.json file"):
        datasets.part_graphs("storage")
    make("storage", 5).write(folder / "46466.json")
    graphs = datasets.part_graphs("storage")
    assert (graphs.source, graphs.ids) == ("real", ("46466",))
    assert graphs[0].to_json() == make("storage", 5).to_json()
    assert graphs.describe() == "1 storage part graphs of PartNet."


def test_part_graphs_of_an_unknown_category():
    with pytest.raises(DataError, match="choose one of chair, table, storage"):
        datasets.part_graphs("lamp")


# ---- CSG programs ----


def test_csg_programs_are_made_on_the_spot(no_real_data):
    programs = datasets.csg_programs(2, length=5)
    assert programs.source == "embedded" and len(programs) == sum(datasets.csg.EMBEDDED.values())
    assert programs.tokens.shape == (len(programs), 6) and (programs.tokens[:, 5] == 399).all()
    assert len(programs[0]) == 5 and len(programs[3:7]) == 4 and "on the spot" in programs.describe()
    splits = [
        set(map(tuple, datasets.csg_programs(2, split, 5).tokens.tolist())) for split in datasets.CSG_SPLITS
    ]
    assert sum(map(len, splits)) == len(set.union(*splits)) == len(programs)


@pytest.fixture
def made_programs(tmp_path, monkeypatch):
    """A small made file; `change(name, tokens)` replaces one of its arrays."""
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path))
    arrays = {
        f"{split}_{length}": datasets.csg_programs(2, split, length)
        .tokens[:4, :length]
        .numpy()
        .astype(np.uint16)
        for split in datasets.CSG_SPLITS
        for length in datasets.CSG_SIZES[2]
    }
    (tmp_path / "csg").mkdir()

    def change(name=None, tokens=None):
        path = tmp_path / "csg" / "programs_2d.npz"
        np.savez_compressed(path, **arrays | ({name: tokens} if name else {}))
        return path

    change()
    return change


def test_csg_programs_are_read_where_they_were_made(made_programs):
    programs = datasets.csg_programs(2, "val", 5)
    assert programs.source == "made" and len(programs) == 4 and "made by" in programs.describe()
    assert len(datasets.csg_programs(2)) == 4 * 3 * 6


@pytest.mark.parametrize(
    "tokens, message",
    [
        (np.full((2, 3), 65535, np.uint16), "rows that are no programs"),
        (np.zeros((2, 3), np.uint16), "rows that are no programs"),
        (np.zeros((2, 4), np.uint16), r"expected uint16 \(programs, 3\)"),
        (np.zeros((2, 3), np.int64), r"expected uint16 \(programs, 3\)"),
    ],
)
def test_csg_programs_that_are_none(made_programs, tokens, message):
    made_programs("test_3", tokens)
    with pytest.raises(DataError, match=message):
        datasets.csg_programs(2, "test", 3)


def test_a_damaged_file_of_csg_programs_says_how_to_mend_it(made_programs):
    path = made_programs()
    path.write_bytes(path.read_bytes()[:500])
    with pytest.raises(DataError, match="damaged.*make_csg_programs --dimensions 2"):
        datasets.csg_programs(2, "test", 3)
    with path.open("wb") as file:
        np.save(file, np.zeros(3))  # another kind of file under that name
    with pytest.raises(DataError, match="damaged"):
        datasets.csg_programs(2, "test", 3)


@pytest.mark.parametrize(
    "arguments, message",
    [
        ((4,), "choose 2 or 3"),
        (("train",), r"did you mean split='train'\?"),
        ((2.0,), "choose 2 or 3"),
        ((2, "dev"), "unknown split 'dev'"),
        ((2, None, 4), "unknown length 4: choose one of 3, 5, 7, 9, 11, 13"),
        ((3, None, 9), "choose one of 3, 5, 7"),
        ((2, None, 3.0), "unknown length 3.0"),
    ],
)
def test_other_csg_programs_there_are_none(no_real_data, unchecked_shapes, arguments, message):
    with pytest.raises(DataError, match=message):
        datasets.csg_programs(*arguments)


def test_the_data_root_must_be_a_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SHAPE_PROGRAMS_DATA", str(tmp_path / "file"))
    (tmp_path / "file").write_text("")
    with pytest.raises(DataError, match="which is a file; expected a folder"):
        datasets.data_root()
