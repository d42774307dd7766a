"""The batch machine: runs the compiled attach instructions of many blocks at once.

State: one row per cuboid (size, center, axes), with a leading dimension for parameter vectors. Each step takes
the instructions of one group, gathers the rows they touch, calls the function of their case and scatters the
result back. Nothing here depends on how many programs there are; gradients flow through every step.
"""

import torch
from jaxtyping import Float
from torch import Tensor

from ..cuboids import Cuboids
from .attaching import move, orient_and_extend, stretch_and_turn
from .compiling import FIRST_PARAMETER, GROW, MORE_EARLIER, MOVE, Compiler, Group, Table
from .growing import grow


class Machine:
    """Cuboids of all blocks, each in the frame of its own block, for `variants` parameter vectors."""

    def __init__(self, compiler: Compiler, parameters: Float[Tensor, "variants p"]):
        self.parameters = parameters
        self.device = parameters.device
        constants = parameters.new_tensor([0.0, 0.5, 1.0]).expand(len(parameters), FIRST_PARAMETER)
        self.values = torch.cat([constants, parameters], 1)
        size = self.values[:, self._index(compiler.sizes).reshape(-1, 3)]
        eye = torch.eye(3, dtype=size.dtype, device=self.device)
        self.state = Cuboids(size, torch.zeros_like(size), eye.repeat(*size.shape[:2], 1, 1))
        self.build = compiler.build_table()
        self.copy = compiler.copy_table(self.build)
        self._run_all(compiler)

    def _run_all(self, compiler: Compiler) -> None:
        built, copied = len(self.build.order), len(self.copy.order)
        empty = self.values.new_zeros(len(self.values), built + copied, 3)
        # What every attach left behind: local points of both cuboids, and the target, frozen at that moment.
        self.points, self.targets = empty.repeat(1, 2, 1), empty
        self._run(self.build, 0, self._written_points)
        if compiler.clones:
            clones, sources = self._index(compiler.clones), self._index(compiler.sources)
            self.state.size[:, clones] = self.state.size[:, sources]
        self._run(self.copy, built, self._copied_points)

    def _run(self, table: Table, offset: int, points) -> None:
        columns = {name: self._index(column) for name, column in table.columns.items()}
        for group in table.groups:
            rows = {name: column[group.start : group.stop] for name, column in columns.items()}
            still = self._rows(rows["still"])
            point, still_point = points(rows, still)
            numbers = slice(offset + group.start, offset + group.stop)
            self._attach(group, rows["moved"], still, point, still_point, numbers)

    def _written_points(self, rows: dict[str, Tensor], still: Cuboids) -> tuple[Tensor, Tensor]:
        """Attachment points as the program's text gives them."""
        names = [rows[name] for name in ("x1", "y1", "z1", "x2", "y2", "z2")]
        return self.values[:, torch.stack(names, -1)].flatten(0, 1).split(3, dim=-1)

    def _copied_points(self, rows: dict[str, Tensor], still: Cuboids) -> tuple[Tensor, Tensor]:
        """Attachment points of a clone: its source's, mirrored or shifted (paper, Appendix B).

        Quirk: the partner is the source's own partner, never that one's mirror image; a place that falls outside
        it is clamped to its surface.
        """
        point = self.points[:, 2 * rows["copied"]].flatten(0, 1)
        place = self._rows(rows["source"]).world(point)
        axis = torch.nn.functional.one_hot(rows["axis"], 3).to(place).repeat(len(self.values), 1)
        mirror = axis * rows["mirrored"].repeat(len(self.values))[:, None]
        share = rows["step"].to(place) / rows["steps"]
        distance = (self.values[:, rows["distance"]] * share).flatten()[:, None]
        shift = axis * self._rows(rows["bbox"]).size * distance
        place = place * (1 - 2 * mirror) + shift
        return point * (1 - 2 * mirror) + mirror, still.local(place).clamp(0, 1)

    def _attach(
        self, group: Group, moved: Tensor, still: Cuboids, point: Tensor, still_point: Tensor, numbers: slice
    ) -> None:
        cuboid, target = self._rows(moved), still.world(still_point)
        if group.case == MOVE:
            result = move(cuboid, point, target)
        elif group.case == GROW:
            result = grow(cuboid, still)
        else:
            result = self._turn(group, cuboid, point, target)
        self.state.size[:, moved] = self._split(result.size, moved)
        self.state.center[:, moved] = self._split(result.center, moved)
        self.state.axes[:, moved] = self._split(result.axes, moved)
        self.points[:, 2 * numbers.start : 2 * numbers.stop : 2] = self._split(point, moved)
        self.points[:, 2 * numbers.start + 1 : 2 * numbers.stop : 2] = self._split(still_point, moved)
        self.targets[:, numbers] = self._split(target, moved)

    def _turn(self, group: Group, cuboid: Cuboids, point: Tensor, target: Tensor) -> Cuboids:
        earlier = self._index(group.earlier)
        known = (earlier >= 0).repeat(len(self.values), 1)
        earlier = earlier.clamp(min=0)
        points, places = self.points[:, earlier].flatten(0, 1), self.targets[:, earlier // 2].flatten(0, 1)
        if group.case == MORE_EARLIER:
            return orient_and_extend(cuboid, point, target, points, places, known)
        return stretch_and_turn(cuboid, point, target, points[:, 0], places[:, 0])

    def _rows(self, rows: Tensor) -> Cuboids:
        """State of some cuboids, (variants * rows, …)."""
        taken = self.state[:, rows]
        return Cuboids(taken.size.flatten(0, 1), taken.center.flatten(0, 1), taken.axes.flatten(0, 1))

    def _split(self, tensor: Tensor, rows: Tensor) -> Tensor:
        return tensor.unflatten(0, (len(self.values), len(rows)))

    def _index(self, numbers) -> Tensor:
        return torch.as_tensor(numbers, dtype=torch.long, device=self.device)
