"""How benchmarks time a function and note what it stands for, as tests/bench_report.py reads it."""

import torch


def timed(
    benchmark,
    function,
    what: str,
    *,
    data: str,
    count: int = 1,
    rounds: int = 7,
    authors: float | None = None,
):
    """The function's result. what, data: words for the table; count: of programs or shapes in a call;
    authors: the seconds that each takes the authors' program, where that is known."""
    result = benchmark.pedantic(function, rounds=rounds, warmup_rounds=2)
    benchmark.extra_info.update(what=what, count=count, authors_seconds_each=authors, data=data)
    benchmark.extra_info.update(torch=torch.__version__, threads=torch.get_num_threads())
    return result
