"""A still picture of a mesh: one ray per sample, the first face it meets, a soft sky above.

Casting rays (trimesh's engine, Embree where it is installed) decides what hides what exactly, also where boxes run
through one another; matplotlib's own 3D axes cannot, they sort whole faces. A picture is made in three steps, each
one function: `first_faces` (which face does each sample see?), `outline` (where do parts and creases end?) and
`daylight` (how much of the sky does each pixel see?). `render` puts them together.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.ndimage import gaussian_filter, map_coordinates, maximum_filter, minimum_filter
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from lib.viewing.camera import Camera

SAMPLES = 2  # samples a pixel and a direction: 2 x 2 rays are averaged into one pixel
CREASE = np.cos(np.radians(25))  # faces of one part that meet flatter than this show no line between them
STEP = 0.02  # a jump in depth larger than this share of the scene's radius shows a line
NOWHERE = -1  # the face of a sample that meets nothing; also the LAST row of every table by face
INK = 0.32  # lines have the colour of their part, this dark
KEY_LIGHT = np.array([-0.35, 0.75, 0.56])  # unit, from the upper left front


@dataclass(frozen=True)
class Faces:
    """What the picture needs to know of each face of a mesh. Every table has one row more than there are faces:
    the last one, which index -1 also names, stands for the empty background.

    normals (f+1, 3) unit, towards the eye; offsets (f+1,) = normal . any point of the face;
    parts (f+1,) int: faces of one connected body of one colour; colors (f+1, 3) in 0..1.
    """

    normals: np.ndarray
    offsets: np.ndarray
    parts: np.ndarray
    colors: np.ndarray


def describe_faces(mesh: trimesh.Trimesh, camera: Camera) -> Faces:
    """The tables of `Faces` for a mesh. A face without area gets the normal 0 and is lit as if it lay flat."""
    triangles = np.asarray(mesh.triangles)  # (f, 3, 3)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    towards = ((camera.eye - triangles[:, 0]) * normals).sum(axis=1, keepdims=True)
    normals = np.where(towards < 0, -normals, normals)  # a box of negative size is inside out
    colors = np.asarray(mesh.visual.face_colors)[:, :3]
    return Faces(
        np.vstack([normals, np.zeros((1, 3))]),
        np.append((normals * triangles[:, 0]).sum(axis=1), 0.0),
        np.append(label_parts(mesh.faces, colors), NOWHERE),
        np.vstack([colors / 255.0, np.zeros((1, 3))]).astype(np.float32),
    )


def label_parts(faces: np.ndarray, colors: np.ndarray) -> np.ndarray:
    """A number for each face (f,): equal where faces hang together through vertices and share their colour."""
    count = int(faces.max()) + 1
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    _, body = connected_components(coo_matrix((np.ones(len(ends)), ends.T), shape=(count, count)))
    return np.unique(np.column_stack([body[faces[:, 0]], colors]), axis=0, return_inverse=True)[1].ravel()


def first_faces(mesh: trimesh.Trimesh, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """The face each ray meets first, (n,) int, -1 for none. `origins` is (n, 3) or one point (3,)."""
    return mesh.ray.intersects_first(np.broadcast_to(origins, directions.shape), directions)


def outline(seen: np.ndarray, faces: Faces, camera: Camera, directions: np.ndarray) -> np.ndarray:
    """Samples that lie on a line of the drawing, (r, r) bool: where two neighbours see different parts, faces that
    meet at a sharp angle, or one part at two depths. `seen` is (r, r), the face of each sample."""
    resolution, lines = len(seen), np.zeros(seen.size, dtype=bool)
    number = np.arange(seen.size).reshape(seen.shape)
    for one, other in ((number[:, :-1], number[:, 1:]), (number[:-1], number[1:])):
        one, other = one.ravel(), other.ravel()
        changed = seen.ravel()[one] != seen.ravel()[other]
        one, other = one[changed], other[changed]
        a, b = seen.ravel()[one], seen.ravel()[other]
        sharp = (faces.normals[a] * faces.normals[b]).sum(axis=1) < CREASE
        # Lengthen b's ray until it meets the plane of face a: on a smooth surface that is about where it met b.
        gap = travel(b, faces, camera, directions[other]) - travel(a, faces, camera, directions[other])
        drawn = (faces.parts[a] != faces.parts[b]) | sharp | (np.abs(gap) > STEP * camera.radius)
        lines[one[drawn]] = lines[other[drawn]] = True
    return lines.reshape(resolution, resolution)


def travel(face: np.ndarray, faces: Faces, camera: Camera, directions: np.ndarray) -> np.ndarray:
    """The depth at which each ray from the eye meets the plane of its face, (n,), world units."""
    normals = faces.normals[face]
    slope = (normals * directions).sum(axis=1)
    return (faces.offsets[face] - normals @ camera.eye) / np.where(np.abs(slope) < 1e-9, -1e-9, slope)


def sky(count: int = 18) -> np.ndarray:
    """(count, 3) unit vectors spread evenly over the upper half of the sky (a golden-angle spiral)."""
    height = 1 - (np.arange(count) + 0.5) / count * 0.9
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    flat = np.sqrt(1 - height**2)
    return np.stack([flat * np.cos(turn), height, flat * np.sin(turn)], axis=1)


def daylight(
    mesh: trimesh.Trimesh, points: np.ndarray, normals: np.ndarray, reach: float, turn=None
) -> np.ndarray:
    """The light of the sky at each of (n, 3) points with its normal: (n, 2), what arrives and what could at most.

    turn: (n,) int in 0..8; a point then asks only every ninth star, starting there. `pool` puts neighbours together.
    """
    stars = sky()
    strength = np.maximum(normals @ stars.T, 0.0)  # (n, s)
    if turn is not None:
        strength[np.arange(len(stars)) % 9 != turn[:, None]] = 0.0
    at, star = np.nonzero(strength > 0.05)
    start = points[at] + 2e-3 * reach * normals[at]  # a little above the face, or it would shade itself
    free = first_faces(mesh, start, stars[star]) == NOWHERE
    weight = strength[at, star]
    return np.stack([np.bincount(at, w, minlength=len(points)) for w in (weight * free, weight)], axis=1)


def pool(light: np.ndarray, plane: np.ndarray) -> np.ndarray:
    """Sum of light (p, p, 2) over the 3 x 3 neighbours of each pixel that lie on the same plane (p, p)."""
    total = np.zeros_like(light)
    for shift in np.ndindex(3, 3):
        move = (shift[0] - 1, shift[1] - 1)
        total += np.roll(light, move, axis=(0, 1)) * (np.roll(plane, move, axis=(0, 1)) == plane)[..., None]
    return total


def render(mesh: trimesh.Trimesh, camera: Camera, pixels: int = 300, shadow: bool = True) -> np.ndarray:
    """The picture of a mesh with face colours: (pixels, pixels, 4) uint8 RGBA on a transparent background.

    The picture covers `camera.window`. With `shadow` the floor below the camera's bounds is shaded where the mesh
    hides the sky. Faces with a coordinate that is not finite are left out; an empty mesh gives an empty picture.
    """
    mesh = finite(mesh)
    if len(mesh.faces) == 0:
        return np.zeros((pixels, pixels, 4), dtype=np.uint8)
    faces, directions = describe_faces(mesh, camera), camera.directions(pixels)
    seen = first_faces(mesh, camera.eye, directions).reshape(pixels, pixels)
    image = _paint(mesh, faces, camera, seen, _bright(mesh, faces, camera, seen, directions))
    if shadow:
        image[..., 3] += (1 - image[..., 3]) * _floor(mesh, camera, pixels)
    image[..., :3] /= np.maximum(image[..., 3:], 1e-6)
    return (np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)


def _paint(mesh, faces: Faces, camera: Camera, seen: np.ndarray, bright: np.ndarray) -> np.ndarray:
    """Faces in their light, and lines: (p, p, 4) float32, colour times opacity (which may be averaged), opacity."""
    pixels = len(seen)
    directions = camera.directions(pixels * SAMPLES)
    seen = _refine(mesh, camera, seen, directions)
    sun = 0.74 + 0.26 * (faces.normals @ KEY_LIGHT).astype(np.float32)
    tone = np.where(outline(seen, faces, camera, directions), INK, sun[seen] * _finer(bright))
    image = np.empty((*seen.shape, 4), dtype=np.float32)
    image[..., :3] = faces.colors[seen] * tone[..., None]
    image[..., 3] = seen != NOWHERE
    return image.reshape(pixels, SAMPLES, pixels, SAMPLES, 4).mean(axis=(1, 3))


def _finer(values: np.ndarray) -> np.ndarray:
    """Values of pixels (p, p) as values of their samples (r, r)."""
    return values.repeat(SAMPLES, axis=0).repeat(SAMPLES, axis=1)


def _refine(mesh, camera: Camera, seen: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """The face of each sample (r, r), from that of each pixel (p, p). Only pixels with a neighbour that sees another
    face are looked at again: most samples lie in the middle of a face, and rays are what a picture costs."""
    busy = maximum_filter(seen, 3) != minimum_filter(seen, 3)
    samples = _finer(seen)
    again = _finer(busy)
    samples[again] = first_faces(mesh, camera.eye, directions[again.ravel()])
    return samples


def _bright(mesh, faces: Faces, camera: Camera, seen: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """How much of its colour each pixel (p, p) keeps in the shade of other parts, 1 is all of it."""
    hit = np.flatnonzero(seen != NOWHERE)
    face, ways = seen.ravel()[hit], directions[hit]
    points = camera.eye + travel(face, faces, camera, ways)[:, None] * ways
    row, column = np.divmod(hit, len(seen))
    light = np.zeros((*seen.shape, 2), dtype=np.float32)
    turn = row % 3 * 3 + column % 3  # each 3 x 3 pixels share out the stars among themselves
    light.reshape(-1, 2)[hit] = daylight(mesh, points, faces.normals[face], camera.radius, turn)
    arrives, possible = np.moveaxis(pool(light, faces.offsets[seen].round(9)), 2, 0)
    return np.where(possible > 0, 0.62 + 0.38 * arrives / np.maximum(possible, 1e-6), 1.0).astype(np.float32)


def _floor(mesh: trimesh.Trimesh, camera: Camera, pixels: int, cells: int = 40) -> np.ndarray:
    """How dark the floor under the camera's bounds is: (pixels, pixels), 0 where it sees the whole sky or is not seen.

    The shade is found on a coarse grid of cells on the floor and smoothed there, so it is soft and costs little.
    """
    low, high = np.asarray(camera.bounds, dtype=float)
    start, span = (camera.target - 1.2 * camera.radius)[[0, 2]], 2.4 * camera.radius
    spots = (np.array(list(np.ndindex(cells, cells))) + 0.5) / cells
    points = np.insert(start + spots * span, 1, low[1], axis=1)
    light = daylight(mesh, points, np.tile([0.0, 1.0, 0.0], (len(points), 1)), camera.radius)
    dark = 1 - light[:, 0] / light[:, 1]
    fade = np.clip(2.6 * (1 - 2 * np.linalg.norm(spots - 0.5, axis=1)), 0, 1)
    dark = gaussian_filter((dark * fade).reshape(cells, cells), 1.2, mode="constant")
    ways = camera.directions(pixels)
    # A ray that does not point down falls on the floor very far away.
    fall = (low[1] - camera.eye[1]) / np.minimum(ways[:, 1], -1e-6)
    place = (camera.eye + fall[:, None] * ways)[:, [0, 2]]
    dark = map_coordinates(dark, ((place - start) / span * cells - 0.5).T, order=1).reshape(pixels, pixels)
    above_edge = np.clip(np.arange(pixels, 0, -1) / (0.12 * pixels), 0, 1)  # it ends softly, not at the frame
    return 0.5 * above_edge[:, None] * dark


def finite(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh itself, or a copy without the faces that have a coordinate that is not a number."""
    good = np.isfinite(mesh.triangles).all(axis=(1, 2)) if len(mesh.faces) else np.ones(0, dtype=bool)
    if good.all():
        return mesh
    colors = np.asarray(mesh.visual.face_colors)[good]
    return trimesh.Trimesh(np.nan_to_num(mesh.vertices), mesh.faces[good], face_colors=colors, process=False)
