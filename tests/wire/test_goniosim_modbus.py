"""mbpoll and pymodbus, which know nothing of goniod, read and move an axis of goniosim over TCP and RTU."""
import json
import os
import select
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback

BUILD = os.environ.get("BUILD", "build")
STATUS, POSITION, ALARM, COMMAND, DIRECT = 0x7E, 0xCC, 0x80, 0x7C, 0x58
MOVE, IN_POS = 0x2000, 0x4000
CONFIG = """
seed: 3
modbus: [tcp:0, rtu]
spectrometer: {listen: none}
axes:
  - {role: source, unit: 1, watchdog_ms: 0}
  - {role: sample, unit: 2, watchdog_ms: 0}
  - {role: holder, unit: 7, watchdog_ms: 0, no_coordinates: true}
"""


class Skip(Exception):
    pass


class Bench:
    def __init__(self, config=CONFIG):
        self.file = tempfile.NamedTemporaryFile("w", suffix=".yaml")
        self.file.write(config)
        self.file.flush()
        self.process = subprocess.Popen([f"{BUILD}/goniosim", "--config", self.file.name], stdout=subprocess.PIPE, text=True)
        endpoints = json.loads(self.process.stdout.readline())
        self.port = next(e.rsplit(":", 1)[1] for e in endpoints["modbus"] if e.startswith("tcp:"))
        self.pty = next(e[4:] for e in endpoints["modbus"] if e.startswith("rtu:"))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        assert self.process.wait(60) == 0
        self.process.stdout.close()
        self.file.close()


def mbpoll(bench, wire, unit, *arguments, patience_s=10):
    if not shutil.which("mbpoll"):
        raise Skip("mbpoll is not installed")
    link = ["-m", "tcp", "-p", bench.port] if wire == "tcp" else ["-m", "rtu", "-b", "115200", "-P", "none"]
    target = "127.0.0.1" if wire == "tcp" else bench.pty
    head, _, values = " ".join(map(str, arguments)).partition("--")
    command = ["mbpoll", *link, "-a", str(unit), "-0", "-q", "-o", str(patience_s), *head.split(), target]
    if values:
        command += ["--", *values.split()]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


def mbpoll_int(bench, wire, unit, register):
    done = mbpoll(bench, wire, unit, "-r", register, "-c", 1, "-t", "4:int", "-B", "-1")
    assert done.returncode == 0, done.stdout + done.stderr
    return int(done.stdout.split("]:")[1].split()[0])


def mbpoll_moves(wire):
    with Bench() as bench:
        done = mbpoll(bench, wire, 1, "-r", DIRECT, "-t", "4:int", "-B", "--", 0, 1, -1000, 4000, 40000, 40000, 1000, 1)
        assert done.returncode == 0, done.stdout + done.stderr
        deadline = time.monotonic() + 60
        while mbpoll_int(bench, wire, 1, STATUS) & (MOVE | IN_POS) != IN_POS:
            assert time.monotonic() < deadline
        assert mbpoll_int(bench, wire, 1, POSITION) == -1000
        assert mbpoll_int(bench, wire, 2, POSITION) == 0
        assert mbpoll(bench, wire, 1, "-r", 5000, "-c", 1, "-t", 4, "-1").returncode == 1  # exception 02
        assert mbpoll(bench, wire, 9, "-r", POSITION, "-c", 1, "-t", 4, "-1", patience_s=0.4).returncode == 1  # no such unit


def pymodbus_client(bench, wire):
    try:
        from pymodbus.client import ModbusSerialClient, ModbusTcpClient
    except ImportError:
        raise Skip("python3-pymodbus (with python3-serial-asyncio) is not installed")
    if wire == "tcp":
        return ModbusTcpClient("127.0.0.1", port=int(bench.port), timeout=10)
    return ModbusSerialClient(bench.pty, baudrate=115200, parity="N", bytesize=8, stopbits=1, timeout=10)


def s32(client, unit, register):
    reply = client.read_holding_registers(register, 2, slave=unit)
    assert not reply.isError(), reply
    value = reply.registers[0] << 16 | reply.registers[1]
    return value - (1 << 32) if value >> 31 else value


def words(*values):
    return [w for v in values for w in (v >> 16 & 0xFFFF, v & 0xFFFF)]


def moved_and_seen(client, steps):
    """False: a busy machine did not look before the motion was over."""
    assert not client.write_registers(DIRECT, words(0, 1, steps, 9000, 90000, 90000, 1000, 1), slave=2).isError()
    deadline, seen_moving = time.monotonic() + 60, False
    while s32(client, 2, POSITION) != steps or s32(client, 2, STATUS) & (MOVE | IN_POS) != IN_POS:
        seen_moving |= bool(s32(client, 2, STATUS) & MOVE)
        assert time.monotonic() < deadline
    return seen_moving


def pymodbus_moves(wire):
    with Bench() as bench:
        client = pymodbus_client(bench, wire)
        assert client.connect()
        assert any(moved_and_seen(client, steps) for steps in (2345, 4690) * 4)
        moved_and_seen(client, 2345)
        client.write_register(COMMAND + 1, 0x20, slave=2)  # STOP is a level: nothing moves while it is set
        client.write_registers(DIRECT, words(0, 1, 0, 9000, 90000, 90000, 1000, 1), slave=2)
        time.sleep(0.2)
        assert s32(client, 2, POSITION) == 2345
        client.write_registers(DIRECT, words(0, 1, 100, 9000, 90000, 90000, 1000, 1), slave=7)
        assert s32(client, 7, ALARM) == 0x4A  # no coordinates
        assert client.read_holding_registers(5000, 1, slave=1).exception_code == 2
        client.close()


def pymodbus_other_functions(wire):
    with Bench() as bench:
        client = pymodbus_client(bench, wire)
        from pymodbus.diag_message import ReturnQueryDataRequest
        assert client.connect()
        echo = client.execute(ReturnQueryDataRequest(0x1234, unit=1))
        assert not echo.isError() and 0x1234 in echo.message, echo
        if wire == "tcp":  # over RTU it is pymodbus 3.0.0 that fails
            both = client.readwrite_registers(read_address=STATUS, read_count=2, write_address=COMMAND,
                                              write_registers=[0, 0x20], unit=1)
            assert not both.isError() and both.registers[1] & IN_POS, both.registers
        client.close()


def late_replies():
    import socket
    with Bench(CONFIG + "reply_delay_ms: 150\n") as bench:
        wire = socket.create_connection(("127.0.0.1", int(bench.port)))
        start = time.monotonic()
        wire.sendall(bytes.fromhex("000100000006010300cc0002" "000200000006020300cc0002"))  # two requests at once
        wire.settimeout(60)
        data = b""
        while len(data) < 26:
            data += wire.recv(64)
        assert time.monotonic() - start >= 0.3  # one after the other
        assert data.hex() == "0001000000070103040000" "0000" "0002000000070203040000" "0000", data.hex()
        wire.close()


def with_crc(text):
    frame = bytes.fromhex(text)
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return frame + crc.to_bytes(2, "little")


def broken_frames_are_not_answered():
    import termios
    with Bench() as bench:
        fd = os.open(bench.pty, os.O_RDWR | os.O_NOCTTY)
        good = with_crc("010300800002")

        def ask(frame, wait_s=60):
            termios.tcflush(fd, termios.TCIFLUSH)
            os.write(fd, frame)
            return os.read(fd, 256) if select.select([fd], [], [], wait_s)[0] else b""

        def silent(frame):
            return ask(frame, 0.3) == b""
        assert ask(good)[:3] == b"\x01\x03\x04"
        assert silent(good[:-1] + b"\x00")  # CRC
        assert silent(good[:5]) and ask(good)[:3] == b"\x01\x03\x04"  # cut short; the gap ends it
        assert silent(bytes(300)) and ask(good)[:3] == b"\x01\x03\x04"  # longer than a frame can be
        os.close(fd)


TESTS = [
    ("mbpoll moves an axis over TCP", lambda: mbpoll_moves("tcp")),
    ("mbpoll moves an axis over RTU", lambda: mbpoll_moves("rtu")),
    ("pymodbus moves an axis over TCP", lambda: pymodbus_moves("tcp")),
    ("pymodbus moves an axis over RTU", lambda: pymodbus_moves("rtu")),
    ("pymodbus: echo and read-write over TCP", lambda: pymodbus_other_functions("tcp")),
    ("late replies come in order", late_replies),
    ("broken RTU frames are not answered", broken_frames_are_not_answered),
]


def main():
    failed = 0
    print(f"1..{len(TESTS)}")
    for number, (name, test) in enumerate(TESTS, 1):
        try:
            test()
            print(f"ok {number} - {name}")
        except Skip as reason:
            print(f"ok {number} - {name} # SKIP {reason}")
        except Exception:
            failed += 1
            print("".join(f"# {line}\n" for line in traceback.format_exc().splitlines()) + f"not ok {number} - {name}")
    return failed > 0


if __name__ == "__main__":
    sys.exit(main())
