"""One thread for many small tensor operations: on several, they would mostly wait for one another."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def one_thread() -> Iterator[None]:
    """PyTorch works on one thread within; afterwards on as many as before. (On a busy machine, this can be 30 times
    faster: threads that wait for a core keep the others waiting.)"""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
