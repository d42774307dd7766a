"""From a shape's parts to the program that makes it (ShapeAssembly paper, section 5 and Appendix C).

graph = PartGraph.read("43875.json", category="chair")
extraction = extract(graph)            extract_many(graphs) for many
extraction.program                     a canonical, validated ShapeAssembly program
extraction.reason                      or why there is none

stages(graph)                          the part graph after each step of rearranging it
survey(regularise(graph).root, graph.category)     what is found out about each block: contacts, groups, order

The JSON format of the files is described in `parsing`.
"""

from .errors import PartGraphError, PartGraphWarning, RejectedError
from .extracting import Extraction, extract, extract_many
from .facts import BlockFacts, Group
from .files import load, read_many, sources
from .options import Options
from .partgraph import Part, PartGraph
from .regularising import regularise, stages
from .surveying import survey
from .validating import REASONS

__all__ = [
    "REASONS", "BlockFacts", "Extraction", "Group", "Options", "Part", "PartGraph", "PartGraphError",
    "PartGraphWarning", "RejectedError", "extract", "extract_many", "load", "read_many", "regularise",
    "sources", "stages", "survey",
]  # fmt: skip
