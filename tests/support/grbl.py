"""What several tests share of link grbl."""

from tango_cnc.link.client import Ended, Failed, Task
from tango_cnc.link.protocols.grbl import Client


def driven(made, one, until=None, arrives=lambda line: line, text="", before=lambda sent: (), **options):
    """plan, control, line after which the PC dies, what arrives of a line, program, lines before an answer, options
    → events, every line that was sent.
    """
    numbers = tuple(touch.number for touch in made.touches)
    client = Client(Task(made, text, "M", made.machine.names, (99.0,) * (len(numbers) + 1), numbers), {"orient": "m19", **options})
    events, sent = [], []
    while not any(isinstance(event, Ended | Failed) for event in events):
        asked = client.bytes_to_send(1 << 16).decode("ascii")
        assert asked, "it waits for a line that nobody sends"
        sent.append(asked.strip())
        if until and until(sent):
            one.line(asked.strip())
            break
        answer = one.report() if asked == "?" else one.line(arrives(asked.strip()))
        answer = [*before(sent), *answer]
        events += client.receive("".join(f"{line}\r\n" for line in answer).encode("ascii"))
    return events, sent
