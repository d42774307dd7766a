"""Part graphs: PartNet's where their owner put them, else the furniture maker's, without end."""

from lib.extractor import PartGraphError
from lib.extractor.files import load, sources
from lib.furniture import make

from .base import CATEGORIES, DataError, DataSet, data_root

FURNITURE = 1000  # part graphs a category; the maker has no end of them
# StructureNet's folders.
PARTNET = {"chair": "chair_hier", "table": "table_hier", "storage": "storagefurniture_hier"}


class GraphSet(DataSet):
    """Part graphs; asking for one that is damaged raises PartGraphError."""

    def describe(self) -> str:
        """One sentence: how many part graphs, of what, and where they come from."""
        if self.source == "real":
            return f"{len(self)} {self.name} part graphs of PartNet."
        return f"{len(self)} {self.name} part graphs of the furniture maker (see lib.furniture)."


def part_graphs(category: str) -> GraphSet:
    """Part graphs of a category: PartNet's where its owner put them (data/partnet/chair_hier, …), else made ones.

    Raises DataError for another category, or for a PartNet folder without files.
    """
    if category not in CATEGORIES:
        raise DataError(f"unknown category {category!r}: choose one of {', '.join(CATEGORIES)}")
    folder = data_root() / "partnet" / PARTNET[category]
    if not folder.is_dir():
        names = [f"{category}-{seed:06d}" for seed in range(FURNITURE)]
        return GraphSet(
            names, lambda name: make(category, int(name.rpartition("-")[2])), "embedded", category
        )
    try:
        names = sources(folder)
    except PartGraphError as error:
        raise DataError(str(error)) from error
    if not names:
        raise DataError(f"{folder} holds no .json file; see python -m data_scripts.extract_programs --help")
    return GraphSet(names, lambda name: load(folder, name, category), "real", category)
