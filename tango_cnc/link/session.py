"""One conversation with a controller: the only loop that waits, and the only place where client, trust and journal meet."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TextIO

import numpy as np

from ..plan import last_motion
from ..records import LinkError, Machine
from . import entries
from .client import Asked, Begun, Client, Ended, Event, Failed, Identified, Refused, Task, Touched
from .entries import Again, End, Identity, Reading, RefusedRecord
from .journal import Journal
from .secrets import without
from .transport import Lost, Transport
from .transport._line import reason
from .transport._refused import RefusedError
from .trust import Believed, Distrust, Leeway, judge, next_in_order

POLL = 0.25  # s, the longest wait for bytes: Ctrl-C and the silence of the control are noticed this soon
BLOCKED = 0.01  # s between attempts while the line takes no bytes
BANNER = re.compile(rb"\bGrbl\w* ", re.IGNORECASE)
STOOD_STILL = 10.0  # s between two looks; nothing that is done between them takes as long, however bad line and disk are
TIMED = (entries.StartMark, Reading, Again, RefusedRecord)
REFUSALS = 10  # records in a row that are not believed


@dataclass(frozen=True)
class News:
    """What the person at the machine sees: touches done of all, s since the start mark, the last deviation, a remark.

    `drift` is how far a facet has moved along its normal since it was first touched with the rotary axes where they are now.
    """

    done: int
    total: int
    time: float
    deviation: float | None = None  # µm
    remark: str | None = None
    touch: int | None = None
    facet: str | None = None
    status: str | None = None
    drift: float | None = None  # µm, positive outwards


class Unwanted(LinkError):
    """The person at the computer has ended it: neither the control nor the line is to blame."""


class Moved(LinkError):
    """A repeated touch says that what is still to be measured does not go together with what was."""


class Transcript:
    """What went over the line, as text: `-> ` sent, `<- ` received, `.. ` seconds; the tests replay such files.

    A file that takes no more (a full disk, a stick that was pulled out) ends the transcript, never the run.
    """

    def __init__(self, out: TextIO | None, clock: Callable[[], float], hidden: tuple[str, ...] = ()) -> None:
        self._out, self._clock, self._last, self._hidden = out, clock, clock(), hidden
        self.lost = ""  # why nothing more is written

    def add(self, mark: str, data: bytes) -> None:
        """'->' or '<-', bytes → a line of the transcript."""
        if self._out is None or not data:
            return
        now = self._clock()
        text = without(data, self._hidden).decode("latin-1").encode("unicode_escape").decode("ascii")
        waited = f".. {now - self._last:.3f}\n" if now - self._last >= 0.001 else ""
        self._last = now
        try:
            self._out.write(f"{waited}{mark} {text}\n")
        except (OSError, ValueError) as error:
            self._out, self.lost = None, reason(error)


def listen(
    transport: Transport,
    hello: bytes,
    seconds: float,
    clock: Callable[[], float],
    enough: Callable[[bytes], bool] = lambda got: False,
) -> bytes:
    """open transport, what to say first, s, monotonic clock, when it is enough → all that came in that time. Raises Lost.

    What has been reset by being opened (grbl behind USB) did not hear: after its banner everything is said once more.
    """
    until = clock() + seconds
    got, left_to_say = b"", hello
    while (left := until - clock()) > 0 and not enough(got):
        left_to_say = left_to_say[transport.write(left_to_say) :] if left_to_say else b""
        new = transport.read(min(left, BLOCKED if left_to_say else POLL))
        if hello and BANNER.search(new):
            left_to_say = hello
        got += new
    return got


class Session:
    """Runs one task to its end mark; every reading is in the journal before another byte is sent."""

    def __init__(
        self,
        task: Task,
        client: Client,
        journal: Journal,
        watch: Callable[[News], None],
        *,
        clock: Callable[[], float],
        now: Callable[[], datetime] = lambda: datetime.now(UTC),
        leeway: Leeway | None = None,
        transcript: TextIO | None = None,
        stop: Callable[[], int] = lambda: 0,
        boot: str = "",
        hidden: tuple[str, ...] = (),
        sensors: Callable[[], Mapping[str, float | None]] = dict,
    ) -> None:
        """task, its client and journal, who watches; `clock` is monotonic, `now` the time of day, `stop` the user's wishes.

        `boot` names the start of this computer from which `clock` counts; words that are `hidden` do not go into the transcript.
        """
        self._task, self._client, self._journal, self._watch = task, client, journal, watch
        self._clock, self._now, self._leeway = clock, now, leeway or Leeway()
        self._transcript, self._stop = Transcript(transcript, clock, hidden), stop
        self._boot, self._sensors = boot, sensors
        self._touches = {touch.number: touch for touch in task.plan.touches}
        self._directions = last_motion(task.plan)
        self._zero: float | None = None  # clock at the time zero of the readings
        self._place = 0  # of the touch that is due, in task.numbers
        self._accepted = self._taken = 0  # touches; bytes that the line has taken
        self._doubts = 0
        self._ended = self._told = self._leaving = False
        self._first = {
            _pose(task.plan.machine, entry.facet, entry.position): entry.deviation_um
            for entry in reversed(journal.entries)
            if isinstance(entry, Reading) and entry.deviation_um is not None
        }

    def run(self, transport: Transport) -> None:
        """open transport → returns when every touch of the task is in the journal and the end mark has come.

        Raises LinkError when the line or the control fails, when the user stops the run, and when records were not believed;
        the journal then ends with the reason and holds everything measured before.
        """
        try:
            self._converse(transport)
            missing = self._missing()
            if missing:
                raise LinkError(f"the program ran to its end, but {missing} not believed or not received")
        except LinkError as error:
            raise type(error)(self._stopped(str(error))) from None
        self._journal.add(End(True, "end mark", _stamp(self._now()), stands=True))

    def _missing(self) -> str:
        got = {entry.touch for entry in self._journal.entries if isinstance(entry, Reading)}
        numbers = [str(number) for number in self._task.original if number not in got]
        shown = ", ".join(numbers[:10]) + (f" and {len(numbers) - 10} more" if len(numbers) > 10 else "")
        return (
            f"the record{'s' if len(numbers) > 1 else ''} of touch {shown} {'were' if len(numbers) > 1 else 'was'}"
            if numbers
            else ""
        )

    def _stopped(self, why: str) -> str:
        """why → what the person has to know, after it is in the journal."""
        with contextlib.suppress(LinkError):  # a disk that takes nothing more is the reason itself
            self._journal.add(End(False, why, _stamp(self._now()), stands=self._ended))
        quiet = (self._client.sent[0] == 0 or not self._taken) and self._zero is None
        warning = "" if quiet else " The control may still execute what it has received: look at the machine."
        done, of = self._accepted, len(self._task.numbers)
        due = f", touch {self._task.original[self._place]} was due" if self._place < of else ""
        of_what = " of the resumed program are recorded, beside those of before" if self._task.again else " are recorded"
        return f"{why}{'' if why.endswith('?') else '.'} {done} of {of} touches{of_what}{due}.{warning}"

    def _converse(self, transport: Transport) -> None:
        last = self._clock()
        waiting = b""
        while not self._ended:
            self._stopping()
            lost: Lost | None = None
            data, taken = b"", 0
            waiting = waiting or self._client.bytes_to_send(transport.chunk)
            try:
                taken = transport.write(waiting) if waiting else 0
                wait = 0.0 if taken else BLOCKED if waiting else POLL
            except Lost as error:
                lost, wait = error, POLL  # what came before the line was lost is still read
            try:
                data = transport.read(wait)
            except Lost as error:
                lost = error
            self._transcript.add("->", waiting[:taken])
            self._transcript.add("<-", data)
            self._lost()
            waiting = waiting[taken:]
            self._taken += taken
            moment = self._clock()
            if data:
                self._handle(self._client.receive(data))
            elif lost:
                cut = [event for event in self._client.closed() if not isinstance(event, Failed)]
                self._handle([*cut, Failed(str(lost))])
            self._passed(moment - last)
            last = moment
            self._tell()

    def _lost(self) -> None:
        """Says once that the transcript cannot be continued."""
        if why := self._transcript.lost:
            self._transcript.lost = ""
            what = f"the transcript ends here: {why}; the run goes on"
            self._watch(News(self._accepted, len(self._task.numbers), self._time(), None, what))

    def _passed(self, seconds: float) -> None:
        """s between two looks → what the waiting means. Raises LinkError where this computer has not looked for too long to go on.

        Of a control that runs its program alone everything can still be read that it said meanwhile: that was not its silence.
        """
        if seconds > STOOD_STILL and self._client.drives:
            raise LinkError(
                f"this computer stood still for {seconds:.0f} s (suspended, or stopped with Ctrl-Z): nobody knows what happened at "
                "the machine meanwhile"
            )
        self._handle(self._client.elapsed(min(seconds, STOOD_STILL)))

    def _stopping(self) -> None:
        """Raises LinkError when the user wants an end and the client cannot draw the probe clear first, or is not to."""
        wishes = int(self._stop())
        if not wishes:
            return
        if wishes > 1 or not (self._leaving or self._client.stop()):
            raise Unwanted("stopped by the user")
        if not self._leaving:
            self._leaving = True
            self._watch(
                News(self._accepted, len(self._task.numbers), self._time(), None, "stopping: the probe is drawn clear first")
            )

    def _tell(self) -> None:
        """Says once that it is now the control's turn: somebody may have to press its button."""
        sent, total = self._client.sent
        if sent == total and self._zero is None and not self._told:
            self._told = True
            done = f"the program is sent ({total} bytes): start it at the control"
            self._watch(News(0, len(self._task.numbers), 0.0, None, self._client.advice or done))

    def _handle(self, events: Sequence[Event]) -> None:
        for event in events:
            if isinstance(event, Touched):
                self._touched(event)
            elif isinstance(event, Refused):
                self._doubt(event.why, event.text)
            elif isinstance(event, Begun):
                self._begun()
            elif isinstance(event, Identified):
                self._identified(event.text)
            elif isinstance(event, Asked):
                self._watch(News(self._accepted, len(self._task.numbers), self._time(), None, event.text))
            elif isinstance(event, Ended):
                self._ended = True
            elif isinstance(event, Failed) and not self._ended:
                raise (RefusedError if event.wrong else Unwanted if self._leaving else LinkError)(event.why)

    def _identified(self, text: str) -> None:
        """Raises LinkError where a run is resumed at a control that calls itself otherwise; nothing has been asked for yet.

        It does so once: a new version may do what the old one did, and a wrong character may have been in what it said before.
        """
        before = [entry.text for entry in self._journal.entries if isinstance(entry, Identity)]
        self._journal.add(Identity(text))
        if before and text not in before:
            raise LinkError(
                f"the control says it is {text!r}, and the run was begun at {before[0]!r}: readings of two machines do not go "
                "together. Only if it is the same machine, resume once more"
            )

    def _begun(self) -> None:
        moment, today = self._clock(), self._now()
        first = next((entry for entry in self._journal.entries if isinstance(entry, entries.StartMark)), None)
        before = max((entry.time_s for entry in self._journal.entries if isinstance(entry, TIMED)), default=0.0)
        self._zero = moment - max(_since(first, self._boot, moment, today), before)
        self._journal.add(entries.StartMark(_stamp(today), round(self._time(), 3), self._boot or None, round(moment, 3)))
        self._watch(News(0, len(self._task.numbers), self._time()))

    def _time(self) -> float:
        return self._clock() - self._zero if self._zero is not None else 0.0

    def _touched(self, event: Touched) -> None:
        try:
            place = next_in_order(event.number, self._task.numbers, self._place)
            judged = judge(event, self._touches[event.number], self._task.plan.machine, self._leeway)
        except Distrust as doubt:
            self._doubt(str(doubt), event.text)
            return
        if place < self._task.again:
            self._repeated(place, judged)
            entry = None
        else:
            entry = self._store(place, self._touches[event.number].facet, judged, event.text)
        self._place, self._doubts = place + 1, 0
        self._accepted += 1
        self._watch(
            news_of(entry, self._accepted, len(self._task.numbers))
            if entry
            else News(self._accepted, len(self._task.numbers), self._time(), judged.deviation)
        )

    def _store(self, place: int, facet: str, judged: Believed, text: str) -> Reading:
        deviation = None if judged.deviation is None else round(judged.deviation, 3)
        position = tuple(float(value) for value in judged.position)
        pose = _pose(self._task.plan.machine, facet, position)
        first = None if deviation is None else self._first.setdefault(pose, deviation)
        drift = None if first is None or deviation is None or first == deviation else round(deviation - first, 3)
        entry = Reading(
            touch=self._task.original[place],
            facet=facet,
            position=position,
            time_s=round(self._time(), 3),
            status=judged.status,
            deviation_um=deviation,
            drift_um=drift,
            direction=tuple(int(sense) for sense in self._directions[place]),
            record=text,
            temperatures=None if self._client.late else dict(self._sensors()) or None,
        )
        self._journal.add(entry)
        return entry

    def _repeated(self, place: int, judged: Believed) -> None:
        """Raises LinkError when a facet is not where it was before the run stopped."""
        number = self._task.original[place]
        before = next(e.position for e in self._journal.entries if isinstance(e, Reading) and e.touch == number)
        linear = [axis.kind == "linear" for axis in self._task.plan.machine.axes]
        moved = float(np.linalg.norm((judged.position - np.array(before))[linear])) if judged.status == "ok" else None
        self._journal.add(Again(number, judged.status, moved, round(self._time(), 3)))
        if moved is None or moved > self._leeway.moved:
            found = judged.status if moved is None else f"{moved * 1e3:.0f} µm away"
            raise Moved(
                f"touch {number} was repeated and is {found}, {self._leeway.moved * 1e3:.0f} µm are allowed: the machine or its "
                "table is not as it was before the run stopped, and its readings do not go together. Run without --resume"
            )

    def _doubt(self, why: str, text: str) -> None:
        self._journal.add(RefusedRecord(why, text, round(self._time(), 3)))
        self._doubts += 1
        remark = f"not believed: {text!r}: {why}"
        self._watch(News(self._accepted, len(self._task.numbers), self._time(), None, remark))
        if self._doubts >= REFUSALS:
            raise LinkError(
                f"{REFUSALS} records in a row were not believed; the last one {text!r}: {why}. Check the settings of the line"
            )


def news_of(entry: Reading, done: int, total: int) -> News:
    """reading of a journal, touches done of all → what is shown of it."""
    remark = None if entry.status == "ok" else f"touch {entry.touch}: {entry.status}"
    return News(done, total, entry.time_s, entry.deviation_um, remark, entry.touch, entry.facet, entry.status, entry.drift_um)


def _pose(machine: Machine, facet: str, position: Sequence[float]) -> tuple[str, ...]:
    """facet, (k,) mm rad → what must be the same for two touches to be comparable: the facet, how table and spindle are turned."""
    turned = (f"{v:.3f}" for v, axis in zip(position, machine.axes, strict=True) if axis.kind != "linear")
    return (facet, *turned)


def _since(first: entries.StartMark | None, boot: str, moment: float, today: datetime) -> float:
    """first start mark of the run, start of this computer, its clock s, time of day → s since then.

    The clock that nobody sets counts as long as the computer has not been started anew; only then the time of day does.
    """
    if first is None:
        return 0.0
    if boot and first.boot == boot and first.clock_s is not None:
        return moment - first.clock_s + first.time_s
    return (today - datetime.fromisoformat(first.utc)).total_seconds()


def _stamp(moment: datetime) -> str:
    return moment.isoformat(timespec="milliseconds")
