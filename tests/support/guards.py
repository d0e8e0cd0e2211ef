"""What several tests share of link guards."""

from sim_controller.motion import Motion
from sim_controller.protocols.modbus import (
    BEGUN,
    CONFIRMED,
    ECHO,
    HEARD,
    LONG,
    RECORD,
    REQUEST,
    STATUS,
    TICKET,
    Registers,
)
from support.linkfaults import scene
from support.linkparts import MARK as NAME
from support.linkparts import job
from tango_cnc.link.protocols.modbus import Client

MARKED = [0, int(NAME[:4], 16), int(NAME[4:], 16)]


def played(options, happens, words, keeps=(), most=30):
    """options of the client, what happens to the registers before each look, where the run has begun → its events, its requests"""
    client, events, requests = Client(job(), options), [], []
    for _ in range(most):
        request = client.bytes_to_send(1000).decode().split()
        if not request:
            break
        requests.append(request[0])
        code, address, *values = map(int, request)
        if code == 16:
            for register, value in enumerate(values, address):
                words[register] = words[register] if register in keeps else value
            if address == REQUEST:
                words[ECHO : ECHO + LONG], words[TICKET] = words[REQUEST : REQUEST + LONG], words[TICKET] + 1
            elif words[CONFIRMED] == words[TICKET] != words[BEGUN]:
                words[BEGUN], words[STATUS] = words[TICKET], 1
            answer = [16, address, len(values)]
        else:
            happens(words, len(requests))
            answer = [3, *words[address : address + values[0]]]
        events += client.receive((" ".join(map(str, answer)) + "\n").encode())
    return events, requests


def resting(**changed):
    words = list(Registers(Motion(scene()[2])).words)
    for name, value in changed.items():
        words[{"status": STATUS, "record": RECORD, "heard": HEARD}[name]] = value
    return words


PROGRAM = {"run": "program"}
