"""How long pages take with 200 machines and 10 000 nights, how fifty follow a run, and what 10 000 requests leave in memory.

    python benchmarks/serve.py [--quick] [--requests N] [--minutes N] [--folder DIR] [--alarms tenth|every] [--own]

A server of its own process is asked over a real socket. The floor beside each number is `/healthz` of the same server; beside
the clock stands the processor time of the server, which other programs on the computer do not make longer. Of the machines one in
ten (with `--alarms every` each) was knocked ten nights ago, and nobody has answered. With --own every machine has a folder with a
cell and a history of its own. With --folder the nights are written once and found again the next time.

Last, somebody with a sign-in decides about alarms and looks at Machines and Alarms after each decision, and then for some minutes
every seven seconds, when what was kept of these pages is old: the worst of these looks tells whether one waits for something.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import selectors
import shutil
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from support.nights import knock, night
from support.server import PASSWORD, Recorded, cell

from tango_cnc.history import opened
from tango_cnc.web.users import add_user

PORT = 18_026
FOLLOWERS = 50
DECISIONS = 14
APART = 7.0  # s between two looks: what is kept of a page for five seconds is old
LOOKS = ("/", "/alarms")
FORM = re.compile(
    r'action="(/machine/[^"]+/decide)".*?name="csrf" value="([^"]+)".*?name="alarm" value="([^"]+)".*?"seen" value="(\d+)"', re.S
)
KNOCKED = {"tenth": 10, "every": 1}  # one machine of so many


def dated(ago: int) -> dict[str, str]:
    """days before now → dates of a night: pages leave out nights that the clock of this computer dates in the future."""
    start = (datetime.now(UTC) - timedelta(days=ago)).replace(microsecond=0)
    stamps = {"start_utc": start, "end_utc": start + timedelta(seconds=250)}
    return {"night": f"{start:%Y-%m-%d}"} | {key: f"{moment:%Y-%m-%dT%H:%M:%SZ}" for key, moment in stamps.items()}


def fleet(folder: Path, machines: int, nights: int, knocked: int, own: bool) -> None:
    """One history of all machines, or of each its own in a cell of its own, with records as a night writes them; parameters as many
    as a machine of five axes has.

    The last of the nights is of this day.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with contextlib.ExitStack() as stack:
        shared = None if own else stack.enter_context(opened(folder / "fleet.db"))
        for m in range(machines):
            name = f"machine {m:03d}"
            hit = nights - 10 if m % knocked == 1 % knocked else nights
            found = dated(nights - 1 - hit)["night"]
            alarm = knock(found) | {"id": f"{m}-1", "night": found}
            with (
                contextlib.nullcontext(shared)
                if shared
                else opened(cell(folder / f"cell{m:03d}", name, []) / "history.db") as history
            ):
                for i in range(nights):
                    more = {"alarms": [alarm]} if i == hit else {"standing": [alarm]} if i > hit else {}
                    verdict = "changed" if more else "good"
                    record = night(name, i, verdict, **more, **dated(nights - 1 - i))
                    base = record["parameters"]["EX0C"]
                    record["parameters"] |= {f"P{k:02d}": base for k in range(20)}
                    history.add_night(record, None)
    (folder / "written").write_text("")


def resident(pid: int) -> float:
    """pid → MB in memory."""
    text = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    return int(re.findall(r"VmRSS:\s+(\d+)", text)[0]) / 1024


def spent(pid: int) -> float:
    """pid → ms of the processors so far, of all its threads."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return 1e3 * (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def timed(call: Callable[[], httpx.Response], count: int) -> tuple[float, float]:
    """call, how often → median and 95 % quantile, ms."""
    seconds = []
    for _ in range(count):
        began = time.perf_counter()
        answer = call()
        seconds.append(time.perf_counter() - began)
        assert answer.status_code in (200, 304), answer.text[:300]
    return 1e3 * float(np.median(seconds)), 1e3 * float(np.quantile(seconds, 0.95))


def followed(port: int, run: Recorded, steps: int) -> tuple[float, float]:
    """port, run, steps → median and 95 % quantile of what one of fifty followers, who ask at once, waits for a step, ms.

    Plain sockets, watched by one thread: fifty clients of Python would take as much of a processor as the server does.
    """
    clients = [socket.create_connection(("127.0.0.1", port)) for _ in range(FOLLOWERS)]
    seconds: list[float] = []
    for _ in range(steps):
        run.touch(drift=1.0)
        seconds += _asked(clients, b"GET /machine/HU40T-like/run/step HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        time.sleep(0.3)
    for client in clients:
        client.close()
    return 1e3 * float(np.median(seconds)), 1e3 * float(np.quantile(seconds, 0.95))


def _asked(clients: list[socket.socket], request: bytes) -> list[float]:
    """connections, request → s until each has its whole answer."""
    began, had, seconds = {}, dict.fromkeys(clients, b""), []
    with selectors.DefaultSelector() as ready:
        for client in clients:
            ready.register(client, selectors.EVENT_READ)
            began[client] = time.perf_counter()
            client.sendall(request)
        while len(seconds) < len(clients):
            for key, _ in ready.select(60):
                client = key.fileobj
                assert isinstance(client, socket.socket)
                had[client] += client.recv(1 << 20)
                head, whole, body = had[client].partition(b"\r\n\r\n")
                if whole and len(body) >= int(re.findall(rb"(?i)content-length: (\d+)", head)[0]):
                    assert head.startswith(b"HTTP/1.1 200"), head
                    seconds.append(time.perf_counter() - began[client])
                    ready.unregister(client)
    return seconds


def asked_of(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """→ what was asked for on the command line."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true", help="a tenth of everything")
    parser.add_argument("--requests", type=int, default=10_000, help="after which the memory is looked at again [default: 10000]")
    parser.add_argument("--minutes", type=float, default=10.0, help="of looks at the end [default: 10]")
    parser.add_argument("--folder", type=Path, help="where the nights are kept for the next time [default: nowhere]")
    parser.add_argument("--alarms", choices=list(KNOCKED), default="tenth", help="on which machines [default: one in ten]")
    parser.add_argument("--own", action="store_true", help="a cell and a history for each machine")
    return parser.parse_args(arguments)


def read(client: httpx.Client, pid: int) -> None:
    """client of a server that has just started, its process → prints what its first answers take until it shows the machines."""
    began, cpu, first = time.perf_counter(), spent(pid), ""
    while (answer := client.get("/")).status_code == 503:
        first = first or f"the first page took {1e3 * (time.perf_counter() - began):.0f} ms and says that machines are read; "
        time.sleep(0.5)
    assert answer.status_code == 200, answer.text[:300]
    seconds = time.perf_counter() - began
    print(f"{'start':34} {first}the list is there after {seconds:.1f} s ({1e-3 * (spent(pid) - cpu):.1f} s of a processor)")


def one_more(root: Path, own: bool, nights: int) -> None:
    """A night of one machine, as another program adds it while the server is at work."""
    with opened(root / "cell003" / "history.db" if own else root / "fleet.db") as history:
        record = night("machine 003", nights, "good", **dated(0))
        history.add_night(record, None)


def pages(client: httpx.Client, pid: int, floor: float, paths: Sequence[tuple[str, str]], change: Callable[[], None]) -> None:
    """client, process, ms of the floor, pages, what another program writes → prints what each page takes after a pause, then."""
    for label, path in paths:
        time.sleep(5.5)  # what was kept of it is old now
        if label.endswith("written"):
            change()
        cpu = [spent(pid)]
        first = timed(lambda path=path: client.get(path), 1)  # type: ignore[misc]
        cpu.append(spent(pid))
        warm = timed(lambda path=path: client.get(path), 20)  # type: ignore[misc]
        cpu.append(spent(pid))
        print(
            f"{label:34} {first[0]:7.1f} ms at first ({cpu[1] - cpu[0]:.0f} ms of a processor), then {warm[0]:.1f} ms "
            f"({(cpu[2] - cpu[1]) / 20:.1f} ms); {first[0] / floor:.0f} and {warm[0] / floor:.1f} times the floor"
        )


@contextlib.contextmanager
def served(*more: str) -> Iterator[tuple[httpx.Client, int]]:
    """what `tango serve` is called with → a client of it, and its process."""
    command = [sys.executable, "-m", "tango_cnc", "serve", *more, "--port", str(PORT)]
    server = subprocess.Popen(command, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"}, stdout=subprocess.DEVNULL)
    try:
        client = httpx.Client(base_url=f"http://127.0.0.1:{PORT}", timeout=600)
        for _ in range(600):
            try:
                client.get("/healthz")
                break
            except httpx.TransportError:
                time.sleep(0.1)
        yield client, server.pid
    finally:
        server.terminate()
        server.wait()


def looks(label: str, taken: Sequence[tuple[float, float]]) -> None:
    """label, (s, ms of a processor) of each look → prints the median and the worst of both."""
    clock, cpu = (np.array(column) for column in zip(*taken, strict=True))
    own = f"({np.median(cpu):.0f} and {cpu.max():.0f} ms of a processor)"
    print(
        f"{label:34} {1e3 * np.median(clock):7.1f} ms, worst {1e3 * clock.max():.0f} ms {own}; "
        f"{len(taken)} looks, load {os.getloadavg()[0]:.1f}"
    )


def decided(root: Path, own: bool, users: Path, minutes: float) -> None:
    """a copy of the nights, whether each machine has its own, users, minutes → prints looks after decisions and as time passes."""
    add_user(users, "ann", PASSWORD, "operate")
    where = ["-C", str(root)] if own else ["--history", str(root / "fleet.db")]
    with served("--users", str(users), *where) as (client, pid):

        def look(path: str) -> tuple[tuple[float, float], str]:
            began, cpu = time.perf_counter(), spent(pid)
            answer = client.get(path)
            assert answer.status_code == 200, answer.text[:300]
            return (time.perf_counter() - began, spent(pid) - cpu), answer.text

        client.post("/sign-in", data={"user": "ann", "password": PASSWORD, "next": "/"})
        while client.get("/").status_code == 503:
            time.sleep(0.5)
        after: list[tuple[float, float]] = []
        text = client.get("/alarms").text
        for number in range(DECISIONS):
            if (form := FORM.search(text)) is None:  # --quick has fewer alarms
                break
            address, *fields = form.groups()
            fields_ = dict(zip(("csrf", "alarm", "seen"), fields, strict=True)) | {"action": "repaired"}
            assert client.post(address, data=fields_).status_code == 303
            for path in LOOKS[:: 1 if number % 2 else -1]:
                taken, shown = look(path)
                after.append(taken)
                text = shown if path == "/alarms" else text
        looks("a look after a decision", after)
        until, passing = time.monotonic() + 60 * minutes, []
        while time.monotonic() < until:
            time.sleep(APART)
            passing.append(look(LOOKS[len(passing) % 2])[0])
        looks(f"a look within {minutes:g} minutes", passing)


def main() -> None:
    asked = asked_of()
    machines, nights, requests = (20, 20, 1000) if asked.quick else (200, 50, asked.requests)
    kept = tempfile.TemporaryDirectory() if asked.folder is None else contextlib.nullcontext(str(asked.folder))
    with kept as place, tempfile.TemporaryDirectory() as live:
        root = Path(place) / f"{machines}-{asked.alarms}{'-own' if asked.own else ''}"
        if not (root / "written").exists():
            began = time.perf_counter()
            fleet(root, machines, nights, KNOCKED[asked.alarms], asked.own)
            print(f"{machines * nights} nights of {machines} machines written in {time.perf_counter() - began:.0f} s")
        own = cell(Path(live) / "live", records=[])
        (own / "history.db").unlink()
        run = Recorded(own)
        run.begin()
        for _ in range(200):
            run.touch()
        where = ["-C", str(root)] if asked.own else ["--history", str(root / "fleet.db")]
        with served("-C", str(own), *where) as (client, pid):
            read(client, pid)
            floor = timed(lambda: client.get("/healthz"), 200)
            print(f"{'/healthz (floor)':34} {floor[0]:7.1f} ms, 95 % {floor[1]:7.1f} ms")
            slug = "machine-001-" + re.findall(r"machine-001-([0-9a-f]+)", client.get("/").text)[0]
            one = f"/machine/{slug}"
            paths = [("fleet", "/"), ("fleet, a night was written", "/"), ("machine", one), ("trend", f"{one}/trend")]
            paths += [
                ("one parameter", f"{one}/trend?parameter=EX0C"),
                ("a night", f"{one}/night/{1 if asked.own else nights + 1}"),
            ]
            paths += [("nights", f"{one}/nights"), ("alarms", "/alarms"), ("alarms, a night was written", "/alarms")]
            pages(client, pid, floor[0], paths, lambda: one_more(root, asked.own, nights))
            steps = 4 if asked.quick else 20
            began_cpu = spent(pid)
            step = followed(PORT, run, steps)
            each = (spent(pid) - began_cpu) / steps / FOLLOWERS
            print(
                f"{f'step of a run, {FOLLOWERS} followers':34} {step[0]:7.1f} ms, 95 % {step[1]:7.1f} ms; "
                f"{each:.2f} ms of a processor each"
            )
            for i in range(500):
                client.get(("/", one, "/machine/HU40T-like/run")[i % 3])
            before = resident(pid)
            for i in range(requests):
                client.get(("/", one, "/machine/HU40T-like/run", "/nothing", f"{one}/trend")[i % 5])
            print(f"memory over {requests} requests: {before:.1f} → {resident(pid):.1f} MB; load {os.getloadavg()[0]:.1f}")
        copy = Path(live) / "copy"
        shutil.copytree(root, copy)
        decided(copy, asked.own, Path(live) / "users.json", asked.minutes / 10 if asked.quick else asked.minutes)


if __name__ == "__main__":
    main()
