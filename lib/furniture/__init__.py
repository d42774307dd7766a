"""The furniture maker: an endless, seeded source of labelled part graphs of chairs, tables and storage furniture.

    graph = make("chair", seed=42)             a PartGraph, named "chair-000042"
    graphs = make_many("table", 100)           seeds 0 to 99
    structure(graph)                           nested labels: what it is apart from sizes
    dense_surface(graph, 2000)                 points on turned legs, pillows, bent backs … inside the boxes

It stands in for PartNet where that cannot be fetched: the same labels, hierarchies of two to four levels, and the
same troubles (boxes that overlap or miss by a little, slanted parts, parts within parts). Everything is made up by
a few rules and a random generator; nothing here was measured on real furniture.
"""

from .maker import make, make_many, structure
from .surfaces import dense_mesh, dense_surface, surface

__all__ = ["dense_mesh", "dense_surface", "make", "make_many", "structure", "surface"]
