"""Finding a stump in a point cloud by search alone, without learning.

    cloud = sample_cloud(mesh, noise=0.005)     or PointCloud(points, normals)
    found = find_stump(cloud)                   found.stump, and what it was made of on the way
    solve(inside, target), greedy(...)          the matrices alone, for primitives that are known

The modules picture_* do the same for pictures and programs of the plane: known programs that are nearest to a picture
(picture_nearest), the best of a network's answers (picture_choice), and better numbers for them (picture_refining).
primitive_detection counts their primitives as detected objects. They are imported by their names.

A cloud in which nothing can be found raises CloudError, a search that cannot start SearchError.
"""

from .candidates import candidates, separate
from .clouds import CloudError, PointCloud, sample_cloud
from .detecting import Options, detect
from .finding import Found, find_stump
from .matrices import Matrices, SearchError, greedy, solve
from .pieces import pieces
from .probing import Probes, probes
from .surfaces import Surface

__all__ = [
    "CloudError", "Found", "Matrices", "Options", "PointCloud", "Probes", "SearchError", "Surface", "candidates",
    "detect", "find_stump", "greedy", "pieces", "probes", "sample_cloud", "separate", "solve",
]  # fmt: skip
