"""The same trials on many machines: chunks go to a Dask cluster, results come back in order (extra `fleet`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from ..records import InputError, LinkError
from .trials import Mapper


@contextmanager
def cluster(address: str, timeout: float = 10.0) -> Iterator[Mapper]:
    """tcp://host:port of a Dask scheduler → a `map` whose calls run on its workers.

    Raises InputError without the extra `fleet`, LinkError when nobody answers or a worker fails.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "--dask: the package 'distributed' is not installed; install it with: pip install 'tango-cnc[fleet]'"
        ) from None
    try:
        client = Client(address, timeout=timeout)
    except (OSError, ValueError) as error:
        raise LinkError(
            f"--dask {address}: no scheduler answers within {timeout:g} s ({error}); start one with 'dask scheduler'"
        ) from None
    try:
        if not client.scheduler_info()["workers"]:
            raise LinkError(f"--dask {address}: the scheduler has no workers; start some with 'dask worker {address}'")

        def spread(call: Callable[[int], Any], items: Iterable[int]) -> Iterable[Any]:
            # The study travels once to every worker, not once a chunk.
            shared = client.scatter(call, broadcast=True, hash=False)
            futures = [client.submit(_apply, shared, item, pure=False) for item in items]
            try:
                return list(client.gather(futures))
            except Exception as error:
                raise LinkError(f"--dask {address}: a worker failed: {error}; is the same tango-cnc installed there?") from error

        yield spread
    finally:
        client.close()


def _apply(call: Callable[[int], Any], item: int) -> Any:
    return call(item)
