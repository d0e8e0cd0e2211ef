"""Templates of the program and of a shop → text; a mistake in a template of a shop is a sentence that names file and line."""

from __future__ import annotations

import shlex
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
from jinja2.bccache import Bucket
from jinja2.sandbox import SandboxedEnvironment

from ..nearest import printable
from ..records import InputError, TangoError

TEMPLATES = "templates"
SUFFIXES = (".html", ".typ", ".css", ".js")


class _Compiled(jinja2.BytecodeCache):
    """Templates of the program that have been compiled. Every page, with a shop's templates or without, takes them from here."""

    def __init__(self) -> None:
        self.found: dict[tuple[str, str], bytes] = {}

    def get_cache_key(self, name: str, filename: str | None = None) -> str:
        """→ the file of a template, so that a shop's template of the same name is another one."""
        return str(filename)

    def load_bytecode(self, bucket: Bucket) -> None:
        """bucket of a template → with its code, where its text has been compiled."""
        if code := self.found.get((bucket.key, bucket.checksum)):
            bucket.bytecode_from_string(code)

    def dump_bytecode(self, bucket: Bucket) -> None:
        """bucket of a template with its code → kept, where it is a page of the program; a shop's change, a PDF adds filters."""
        if _ours(bucket.key) and bucket.key.endswith(".html"):
            self.found[bucket.key, bucket.checksum] = bucket.bytecode_to_string()


OURS = tuple(Path(__file__).parents[1] / stage / TEMPLATES for stage in ("report", "web"))
COMPILED = _Compiled()


def _ours(file: str) -> bool:
    return any(Path(file).is_relative_to(folder) for folder in OURS)


def environment(folder: Path | None = None) -> jinja2.Environment:
    """folder of a shop with templates of its own, or None → where templates come from; what is inserted is escaped."""
    places: list[jinja2.BaseLoader] = [jinja2.PackageLoader("tango_cnc.report", TEMPLATES)]
    if folder is not None:
        if not folder.is_dir():
            raise InputError(f"--templates: found {folder}, which is no folder; allowed: a folder with templates or texts.toml")
        places.insert(0, jinja2.FileSystemLoader(folder))
    env = SandboxedEnvironment(  # a cell from elsewhere may name templates: they compute nothing beyond the page
        loader=jinja2.ChoiceLoader(places),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        bytecode_cache=COMPILED,
    )
    env.filters["shell"] = shlex.quote
    return env


def rendered(env: jinja2.Environment, name: str, context: Mapping[str, Any]) -> str:
    """environment, template, values → text. Raises InputError for a mistake in a template of a shop."""
    try:
        return env.get_template(name).render(**context)
    except jinja2.TemplateSyntaxError as error:
        where = f"{error.filename or error.name}:{error.lineno}"
        raise InputError(f"{where}: {printable(str(error.message))}; correct the template") from None
    except (jinja2.UndefinedError, jinja2.TemplateNotFound) as error:
        said, where = printable(str(error.message)), _where(error, name)
        raise InputError(f"{where}: {said}; allowed: what the template of the program uses (docs/report.md)") from None
    except UnicodeDecodeError:
        raise InputError(f"{name}: it is not UTF-8 text; save the template as UTF-8") from None
    except TangoError:
        raise
    except Exception as error:
        if not _of_a_shop(env):
            raise
        said, where = printable(str(error), 200), _where(error, name)
        raise InputError(f"{where}: {said} ({type(error).__name__}); correct the template, or one that it includes") from None


def _where(error: Exception, name: str) -> str:
    """what a template has raised, its name → file and line of the mistake: in a template of the shop where one had a part in it."""
    files = [(frame.filename, frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    made = [f"{file}:{line}" for file, line in files if Path(file).suffix in SUFFIXES and not _ours(file)]
    own = [f"{file}:{line}" for file, line in files if _ours(file)]
    return [name, *own, *made][-1]


def _of_a_shop(env: jinja2.Environment) -> bool:
    return isinstance(env.loader, jinja2.ChoiceLoader) and isinstance(env.loader.loaders[0], jinja2.FileSystemLoader)
