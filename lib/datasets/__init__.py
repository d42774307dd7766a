"""Where programs, part graphs and masks come from: real or made sets where they were put, else what travels with lib/.

    chairs = shapeassembly("chair", split="train")     a sequence of ShapeAssembly Program
    flat = shapeassembly("chair", "train", "flat")     the same, rewritten without hierarchy: an ablation
    graphs = part_graphs("chair")                      a sequence of PartGraph
    random = csg_programs(2, split="train")            a sequence of CSG Program, and all their tokens
    masks = silhouettes(split="train")                 64x64 masks of furniture, without programs; logos() likewise
    mug = solid("mug")                                 one of ten everyday solids, as a tree of operations
    clouds = solid_clouds(split="train")               point clouds of solids; read_occnet(folder) of ShapeNet's
    mine = read_cloud("mug.obj")                       a shape of your own as a cloud
    chairs.source                                      "real", "made" or "embedded"
    print(chairs.describe())                           one sentence for the reader

The data root is ./data in the repository, or the folder that the environment variable SHAPE_PROGRAMS_DATA names.
Programs are read when they are first asked for, so a big set opens at once. What is embedded is the same on every
machine: hand-written ShapeAssembly examples and seeded variations of their sizes, the furniture maker's part graphs and
silhouettes, CSG programs of a seeded generator.
"""

from .base import CATEGORIES, REPOSITORY, DataError, DataSet, data_root
from .csg import SIZES as CSG_SIZES
from .csg import SPLITS as CSG_SPLITS
from .csg import TokenSet, csg_programs
from .graphs import GraphSet, part_graphs
from .images import SOURCES as IMAGE_SOURCES
from .images import ImageSet, logos, silhouettes
from .occnet import read_occnet
from .own_clouds import OwnCloud, read_cloud
from .programs import SPLITS, ProgramSet, example, example_text, examples, shapeassembly, vary
from .solid_clouds import SOURCES as CLOUD_SOURCES
from .solid_clouds import SolidSet, solid_clouds
from .solids import SOLIDS, solid

__all__ = [
    "CATEGORIES", "CLOUD_SOURCES", "CSG_SIZES", "CSG_SPLITS", "IMAGE_SOURCES", "REPOSITORY", "SOLIDS",
    "SPLITS", "DataError", "DataSet", "GraphSet", "ImageSet", "OwnCloud", "ProgramSet", "SolidSet",
    "TokenSet", "csg_programs", "data_root", "example", "example_text", "examples", "logos", "part_graphs",
    "read_cloud", "read_occnet", "shapeassembly", "silhouettes", "solid", "solid_clouds", "vary",
]  # fmt: skip
