"""Several shapes one after the other as one file: an animated GIF for pages, a GLB for programs that show 3D.

    gif(shapes)            bytes of a GIF, all frames seen by one camera
    animated_glb(shapes)   bytes of a GLB with an animation: each shape is shown for its time, the others are hidden

glTF knows no film of meshes, and a cuboid of one shape need have no counterpart in the next. So every shape is a node
of its own, and the animation scales a node to 1 for its time and to 0 for the rest, without steps between (glTF 2.0
specification, sections 3.11 and 5.5: an animation sampler with STEP interpolation).
"""

import io
import json
import struct
from collections.abc import Sequence

import numpy as np
import trimesh
from PIL import Image

from lib.viewing.camera import Camera
from lib.viewing.figure import bounds_of, mesh_of
from lib.viewing.picture import render

SECONDS = 0.15  # a frame
FLOAT, GLB_JSON, GLB_BINARY = 5126, 0x4E4F534A, 0x004E4942  # constants of glTF 2.0


def frames(shapes: Sequence, pixels: int = 300, camera: Camera | None = None) -> list[np.ndarray]:
    """A picture of each shape on white, (pixels, pixels, 3) uint8, by one camera. Raises ValueError for no shapes."""
    shapes = list(shapes)
    if not shapes:
        raise ValueError("found no shapes; expected at least one frame")
    camera = camera or Camera(bounds=bounds_of(*shapes))
    return [_on_white(render(mesh_of(shape), camera, pixels)) for shape in shapes]


def gif(
    shapes: Sequence,
    seconds: float = SECONDS,
    pixels: int = 300,
    camera: Camera | None = None,
    there_and_back: bool = True,
) -> bytes:
    """An animated GIF that repeats for ever, a shape for so many seconds; IPython.display.Image(data) shows it.

    there_and_back  the way back is shown too, so that nothing jumps
    Raises ValueError for no shapes, and for a time below a hundredth of a second, the format's unit.
    """
    if not seconds >= 0.01:
        raise ValueError(f"found {seconds} seconds a frame; expected at least 0.01")
    pictures = [Image.fromarray(picture) for picture in frames(shapes, pixels, camera)]
    film = pictures + pictures[-2:0:-1] if there_and_back else pictures
    out = io.BytesIO()
    film[0].save(
        out, "GIF", save_all=True, append_images=film[1:], duration=round(seconds * 100) * 10, loop=0
    )
    return out.getvalue()


def animated_glb(shapes: Sequence, seconds: float = SECONDS) -> bytes:
    """A GLB file with one node a shape and an animation "film" that shows them in turn, each for so many seconds.

    Raises ValueError for no shapes, for one without faces, and for a time that is not positive.
    """
    meshes = [mesh_of(shape) for shape in shapes]
    if not meshes or not all(len(mesh.faces) for mesh in meshes) or not seconds > 0:
        raise ValueError(
            f"found {len(meshes)} shapes, {sum(not len(m.faces) for m in meshes)} without faces, {seconds} seconds "
            "each; expected at least one shape, all with faces, and a positive time"
        )
    scene = trimesh.Scene()
    for number, mesh in enumerate(meshes):
        scene.add_geometry(mesh, node_name=f"frame_{number}", geom_name=f"frame_{number}")
    document, binary = _unpacked(scene.export(file_type="glb"))
    return _packed(*_with_film(document, binary, len(meshes), seconds))


def _on_white(picture: np.ndarray) -> np.ndarray:
    opacity = picture[..., 3:] / 255.0
    return (picture[..., :3] * opacity + 255 * (1 - opacity) + 0.5).astype(np.uint8)


def _with_film(document: dict, binary: bytes, count: int, seconds: float) -> tuple[dict, bytes]:
    """A glTF document and its buffer, with the animation of `count` nodes named frame_0, frame_1, …"""
    node = {each.get("name"): number for number, each in enumerate(document["nodes"])}
    times = np.arange(count + 1, dtype="<f4") * np.float32(seconds)  # the last one holds the last frame
    samplers, channels, columns = [], [], [(times, "SCALAR")]
    first = len(document["accessors"])
    for number in range(count):
        shown = np.zeros((count + 1, 3), dtype="<f4")
        shown[number] = 1
        shown[-1] = shown[-2]
        columns.append((shown, "VEC3"))
        samplers.append({"input": first, "output": first + 1 + number, "interpolation": "STEP"})
        target = {"node": node[f"frame_{number}"], "path": "scale"}
        channels.append({"sampler": number, "target": target})
        _hide(document["nodes"][target["node"]], number > 0)
    for values, kind in columns:
        document["bufferViews"].append({"buffer": 0, "byteOffset": len(binary), "byteLength": values.nbytes})
        low, high = (np.atleast_1d(bound).tolist() for bound in (values.min(0), values.max(0)))
        view = len(document["bufferViews"]) - 1
        facts = {"componentType": FLOAT, "count": count + 1, "type": kind, "min": low, "max": high}
        document["accessors"].append({"bufferView": view, **facts})
        binary += values.tobytes()
    document["buffers"][0]["byteLength"] = len(binary)
    document["animations"] = [{"name": "film", "samplers": samplers, "channels": channels}]
    return document, binary


def _hide(node: dict, hidden: bool) -> None:
    """What a program shows that plays no animation: the first shape. A node that is animated may have no matrix."""
    node.pop("matrix", None)  # the identity: shapes stand where they are
    node["scale"] = [0.0, 0.0, 0.0] if hidden else [1.0, 1.0, 1.0]


def _unpacked(glb: bytes) -> tuple[dict, bytes]:
    """The JSON and the binary chunk of a GLB file; the latter has a length that is a multiple of 4."""
    length = struct.unpack_from("<I", glb, 12)[0]
    return json.loads(glb[20 : 20 + length]), glb[28 + length :]


def _packed(document: dict, binary: bytes) -> bytes:
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    total = 12 + 8 + len(text) + 8 + len(binary)
    head = b"glTF" + struct.pack("<II", 2, total) + struct.pack("<II", len(text), GLB_JSON)
    return head + text + struct.pack("<II", len(binary), GLB_BINARY) + binary
