"""What several tests share of link modbus."""

import asyncio
import contextlib
import threading

from pymodbus import FramerType
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from sim_controller.protocols.modbus import REQUEST, SIZE
from tango_cnc.link.layout import STANDARD


def edited(tmp_path, old, new):
    text = STANDARD.read_text()
    assert old in text
    file = tmp_path / "own.yaml"
    file.write_text(text.replace(old, new))
    return str(file)


@contextlib.contextmanager
def served(device, spoil):
    """registers of a control, what is done to a copy of them before it is read → the address of a real server in front of them."""
    loop, ready, found = asyncio.new_event_loop(), threading.Event(), []

    async def asked(code, start, address, count, words, values):
        """One request, before it is answered: six arguments, as pymodbus 3.16 calls it."""
        begun = device.look() if values is None else device.write(address, [int(value) for value in values])
        if begun:
            device.execute()
        words[:] = device.words if values is not None or address >= REQUEST else spoil(list(device.words))

    async def listen():
        simulated = SimDevice(id=1, simdata=[SimData(0, count=SIZE, datatype=DataType.REGISTERS)], action=asked)
        server = ModbusTcpServer(simulated, framer=FramerType.SOCKET, address=("127.0.0.1", 0))
        await server.serve_forever(background=True)
        found.extend(server.transport.sockets[0].getsockname()[:2])
        ready.set()

    def serve():
        asyncio.set_event_loop(loop)
        loop.run_until_complete(listen())
        loop.run_forever()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    assert ready.wait(10), "the server does not start"
    try:
        yield f"modbus+tcp://{found[0]}:{found[1]}/1"
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join(5)
