"""What several tests share of link session."""

from support.linkparts import MARK, FakeClock, Memory, job
from tango_cnc.link.journal import Journal, read_journal
from tango_cnc.link.protocols import dnc
from tango_cnc.link.session import Session
from tango_cnc.records import LinkError

GOOD = (
    "P1 H1 X20.0030 Y0.0000 Z50.0000 B0.0000 C0.0000",
    "P2 H1 X0.0000 Y30.0120 Z50.0000 B0.0000 C0.0000",
    "P3 H1 X-5.0000 Y5.0000 Z69.9980 B30.0000 C270.0000",
)


def printed(*records, begin=f"TANGO START {MARK} 3", end="TANGO END 3"):
    return b"".join(b"\x12" + record.encode() + b"\r\n\x14" for record in (begin, *records, end) if record)


def after_the_program(answer):
    """A control that answers when it has read the whole tape."""
    return lambda written: answer if written.endswith(b"M30\n%\n") else b""


class Run:
    """What one run left: what the watcher saw, the journal's entries, the error."""

    def __init__(self, tmp_path, answer, *, this_job=None, resume=False, watch=None, transcript=None, stop=lambda: False, **more):
        self.clock, self.steps = more.pop("clock", None) or FakeClock(), []
        this_job = this_job or job()
        journal = Journal(tmp_path / "run.journal", resume)
        self.line = Memory(self.clock, answer)
        session = Session(
            this_job,
            dnc.Client(this_job, {}),
            journal,
            watch or self.steps.append,
            clock=self.clock,
            now=more.pop("now", self.clock.now),
            transcript=transcript,
            stop=stop,
            **more,
        )
        self.error = ""
        try:
            session.run(self.line)
        except LinkError as error:
            self.error = str(error)
        journal.close()
        self.entries = read_journal(tmp_path / "run.journal")[0]

    def kinds(self, kind):
        return [entry for entry in self.entries if entry.kind == kind]
