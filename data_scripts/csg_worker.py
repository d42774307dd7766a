"""A worker of make_csg_programs: makes one chunk of random programs."""

import numpy as np

from data_scripts.parallel import end_with
from lib.interpreters.csg import sample_many

Chunk = tuple[int, int, int]  # dimensions, tokens of a program, number of the chunk


def make_chunk(seed: int, chunk: Chunk, programs: int, parent: int | None = None) -> tuple[Chunk, np.ndarray]:
    """The chunk and its tokens (programs, length) uint16, which depend on nothing but the arguments."""
    end_with(parent)
    dimensions, length, _ = chunk
    tokens = sample_many(np.random.default_rng([seed, *chunk]), programs, length, dimensions)
    return chunk, tokens.numpy().astype(np.uint16)
