"""From a shape's parts to the program that makes it (ShapeAssembly paper, section 5 and Appendix C).

    graph = PartGraph.read("43875.json", category="chair")
    extraction = extract(graph)            extract_many(graphs) for many
    extraction.program                     a canonical, validated ShapeAssembly program
    extraction.reason                      or why there is none
"""

from .errors import PartGraphError, RejectedError
from .extracting import Extraction, Options, extract, extract_many, stages
from .partgraph import Part, PartGraph

__all__ = [
    "Extraction", "Options", "Part", "PartGraph", "PartGraphError", "RejectedError", "extract", "extract_many", "stages",
]  # fmt: skip
