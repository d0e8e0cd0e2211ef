"""Of a dialect that somebody is adding, each failure says which file describes the control on which its programs run, and who
reads them back."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import pytest

from support.few import new


def unlike(parameters: dict[str, Any]) -> dict[str, str]:
    """parameters of a case → {dialect: why the file of its simulated control is missing, not looked up, or of another control}."""
    from support.dialects import EVERY
    from support.namedcontrols import complaint

    given = sorted({value for value in parameters.values() if isinstance(value, str) and value in EVERY})
    return {name: said for name in given if (said := complaint(name))}


REFUSED = "The program is not the plan"  # the end of what the read-back says of a statement that it does not know


def reader(name: str) -> str:
    """dialect → who reads its programs back, and what a statement that this reader does not know means."""
    from postprocessors import load

    language = load(name).language
    return (
        f"postprocessors/{name}.py: the reader of tango_cnc/readback/languages/ named {language} refuses its program. A word that "
        f"{language} has not, such as another one for printing, makes it another language, with a reader and a simulated "
        "control of its own (docs/dialects.md, Writing one)"
    )


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A touch that is missing, a silent control, a wrong number: none of these failures says that the control is another one."""
    report = yield
    parameters = getattr(getattr(item, "callspec", None), "params", {})
    if report.failed and any(isinstance(value, str) for value in parameters.values()):
        from support.dialects import EVERY

        shown, told = str(report.longrepr), unlike(parameters)
        said = [(f"the simulated control of {name}", text) for name, text in told.items() if text not in shown]
        read = {name for name in parameters.values() if REFUSED in shown and isinstance(name, str) and name in {*EVERY} & new()}
        report.sections += [*said, *((f"the language of {name}", reader(name)) for name in sorted(read))]
    return report
