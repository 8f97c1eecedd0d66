"""A Dask scheduler, or many workers, in one process: `python -m benchmarks.dask_process ...`.

A scheduler prints its address. Both count the bytes that they send, end when their input does, and
so never outlive the program that started them.
"""

import asyncio
import contextlib
import logging
import subprocess
import sys
import threading
from collections.abc import Iterator

import dask
from distributed import Scheduler, Worker
from distributed.comm.tcp import TCP

from rover_planner.survey.cluster.client import SETTINGS

_sent, _counts = 0, False


def count_sent() -> int:
    """Return the bytes that Dask has sent from this process since `start_count`."""
    return _sent


def start_count() -> None:
    """Begin to count the bytes that Dask sends from this process."""
    global _counts
    if _counts:
        return
    _counts, write = True, TCP.write

    async def write_and_count(self, *words, **options):
        global _sent
        size = await write(self, *words, **options)
        _sent += size
        return size

    TCP.write = write_and_count


@contextlib.contextmanager
def open_process(*words: str) -> Iterator[subprocess.Popen]:
    """Start this file as a process with words; end it at the end."""
    process = subprocess.Popen(
        [sys.executable, "-m", "benchmarks.dask_process", *words],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.stdin.close()
        process.wait(timeout=60.0)


async def serve_scheduler(ended: threading.Event) -> None:
    """Serve a scheduler on any port of this machine."""
    async with Scheduler(host="127.0.0.1", port=0, dashboard_address=":0") as scheduler:
        print(scheduler.address, flush=True)
        await asyncio.to_thread(ended.wait)


async def serve_workers(address: str, count: int, ended: threading.Event) -> None:
    """Serve workers of one thread each."""
    workers = [
        Worker(address, nthreads=1, name=k, memory_limit=0, dashboard_address=":0")
        for k in range(count)
    ]
    for first in range(0, count, 50):
        await asyncio.gather(*workers[first : first + 50])
    print("ready", flush=True)
    await asyncio.to_thread(ended.wait)
    await asyncio.gather(*(worker.close(nanny=False) for worker in workers))


def main(words: list[str]) -> None:
    """Serve until the input ends."""
    start_count()
    dask.config.set(SETTINGS)
    ended = threading.Event()

    def wait_for_end() -> None:
        sys.stdin.read()
        ended.set()

    threading.Thread(target=wait_for_end, daemon=True).start()
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    if words[0] == "scheduler":
        asyncio.run(serve_scheduler(ended))
    else:
        asyncio.run(serve_workers(words[1], int(words[2]), ended))


if __name__ == "__main__":
    from benchmarks import dask_process  # the module that tasks count with, not this copy of it

    dask_process.main(sys.argv[1:])
