"""The engines that compute chunks: threads of this process, an executor of ``concurrent.futures``, or a Dask cluster."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from typing import Any

from ...base import checks
from ...base.interrupts import POLL, available
from ...errors import ArgumentError, DTypeError
from .axes import Chunk, Grid
from .portable import packed, sweep_chunk
from .task import Done, Task, run

#: Chunks that are under way or waiting, for each worker: enough that none waits for the next one.
CHUNKS_AHEAD = 2

Submit = Callable[[Chunk], "Future[tuple[Chunk, Done]]"]


class Engine:
    """Computes chunks, ``workers`` of them at once; ``here`` says whether threads of this process do.

    The user's argument is None, an ``Executor``, or a ``dask.distributed.Client``; threads of None are as many as there are
    cores.
    """

    def __init__(self, engine: Any, threads: int | None) -> None:
        self.here = engine is None
        self._executor: Any = None
        if engine is None:
            self.workers = available() if threads is None else checks.count("threads", threads, 1, 4096)
            return
        if threads is not None:
            raise ArgumentError("threads: works with threads of this process only, and engine= was given")
        if isinstance(engine, Executor):
            self._executor = engine
            self.workers = int(getattr(engine, "_max_workers", 0) or available())
        elif hasattr(engine, "get_executor") and hasattr(engine, "nthreads"):  # a client of Dask
            self._executor = engine.get_executor(pure=False)
            self.workers = max(1, sum(engine.nthreads().values()))
        else:
            raise DTypeError(
                f"engine: expected None, an executor of concurrent.futures or a client of dask.distributed, "
                f"got {type(engine).__name__}"
            )

    def compute(self, task: Task, grid: Grid, chunks: Iterable[Chunk]) -> Iterator[tuple[Chunk, Done]]:
        """The results of each chunk, as chunks end. If the iterator is closed early, running chunks are stopped or awaited."""
        if not isinstance(self._executor, ThreadPoolExecutor | None):
            package = packed(task)
            yield from self._all(chunks, lambda chunk: self._executor.submit(sweep_chunk, package, grid.values(chunk), chunk))
            return
        stop = threading.Event()

        def of(chunk: Chunk) -> tuple[Chunk, Done]:
            return chunk, run(task, grid.values(chunk), chunk.members, stop.is_set)

        pool: Any = ThreadPoolExecutor(self.workers, thread_name_prefix="sweep") if self.here else self._executor
        try:
            yield from self._all(chunks, lambda chunk: pool.submit(of, chunk))
        finally:
            stop.set()
            if self.here:
                pool.shutdown(wait=True, cancel_futures=True)

    def _all(self, chunks: Iterable[Chunk], submit: Submit) -> Iterator[tuple[Chunk, Done]]:
        waiting = iter(chunks)
        under_way: set[Future[tuple[Chunk, Done]]] = set()
        try:
            while True:
                while len(under_way) < CHUNKS_AHEAD * self.workers and (chunk := next(waiting, None)) is not None:
                    under_way.add(submit(chunk))
                if not under_way:
                    return
                # On Windows Ctrl-C does not interrupt a wait: it is heard after one.
                done, under_way = wait(under_way, timeout=POLL, return_when=FIRST_COMPLETED)
                for each in done:
                    yield each.result()
        finally:
            for each in under_way:
                each.cancel()
