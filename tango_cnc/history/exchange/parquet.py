"""Apache Parquet, the columns of the CSV with their types."""

from __future__ import annotations

from pathlib import Path

from ...records import InputError
from ..store import History
from ._rows import COLUMNS, rows

ENDINGS = (".parquet",)


def write(history: History, machine: str, file: Path, entry: int) -> None:
    """history, machine, file → written; `entry` is not used. Raises InputError without pyarrow."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ModuleNotFoundError:
        raise InputError("parquet: needs pyarrow; pip install 'tango-cnc[parquet]'") from None
    columns = list(zip(*rows(history, machine), strict=True)) or [()] * len(COLUMNS)
    file.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(pyarrow.table(dict(zip(COLUMNS, map(list, columns), strict=True))), file)
