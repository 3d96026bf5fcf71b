"""Bad input as a person meets it: through the programs, on the command line. Each must get a sentence that says where,
what was expected and what to do, the right exit status, and no crash; nothing may be started or lost.

USB without permission, and in use by another program: wire/test_libusb_wire.c, which can pretend a USB.
"""
import json
import os
import re
import shutil
import socketserver
import sqlite3
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

BUILD = os.path.abspath(os.environ.get("BUILD", "build"))
EXAMPLES = Path("docs/examples").absolute()
LIMIT_S = 300
JOB = """\
name: small
samples: [{name: a, holder: sample, paint: Hooker's Green, support: drawing paper, size_mm: [60, 40]}]
geometry: {theta_i_deg: [40], theta_v_deg: {from: -20, to: 60, step: 20}}
reference: {mode: fixed, geometry: {theta_i_deg: 45, theta_v_deg: 0}, holder: reference, certificate: ptfe.csv}
fit: {model: composite}
"""
TEN_IN_JOB = """\
nam: x
name: "a/b"
samples:
  - {name: a, holder: sample, size_mm: [60]}
  - {name: a, size_mm: [40, 40]}
geometry: {theta_i_deg: [10, 95], theta_v_deg: {from: -80, to: 80, step: -5}, mirror_step: 1}
mean_nm: [700, 400]
exposure: {target: 1.8, min_ms: 10, max_ms: 5, average: 0}
reference: {mode: everywhere, geometry: {theta_i_deg: 45}, certificate: ptfe.csv}
fit: {model: phong}
"""
TEN_IN_CONFIG = """\
spectrometre: {model: usb2000plus}
spectrometer: {model: usb2001, link: usb3}
shutter: lamp
lamp: {warm_up_min: -3}
optics: {beam_mm: 20, view_mm: 0, filing: view-in-beam}
axes:
  source: {profile: om-az, unit: 300, limits_deg: [140, -70]}
  sample: {profile: om-az, link: "rtu:/dev/ttyUSB0", unit: one}
  tilt: manual
acess: {}
"""


class Place:
    """A folder with a goniod's socket and sessions in it."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.running = []
        self.env = dict(os.environ, LC_ALL="C", GONIOD_SOCKET=f"{folder}/g.sock", GONIOD_SESSIONS=f"{folder}/s")
        (self.folder / "ptfe.csv").write_text((EXAMPLES / "certificate.csv").read_text())

    def write(self, name, text):
        (self.folder / name).write_text(text)
        return name

    def run(self, program, *args, **more):
        return subprocess.run([f"{BUILD}/{program}", *args], cwd=self.folder, env=self.env, text=True, errors="replace",
                              stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=LIMIT_S,
                              **more)

    def start(self, *args, socket=None, **more):
        """A goniod in the background, when it answers."""
        env = dict(self.env, GONIOD_SOCKET=socket or self.env["GONIOD_SOCKET"])
        daemon = subprocess.Popen([f"{BUILD}/goniod", *args], cwd=self.folder, env=env, stdin=subprocess.DEVNULL,
                                  stderr=subprocess.DEVNULL, **more)
        self.running.append(daemon)
        end = time.monotonic() + LIMIT_S
        while daemon.poll() is None and time.monotonic() < end:
            if subprocess.run([f"{BUILD}/gonioctl", "status"], env=env, capture_output=True).returncode == 0:
                return daemon
            time.sleep(0.05)
        raise AssertionError("goniod does not answer")

    def goniosim(self, bench=""):
        self.write("sim.yaml", bench)
        option = ["--config", "sim.yaml"] if bench else []
        sim = subprocess.Popen([f"{BUILD}/goniosim", *option], cwd=self.folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               text=True)
        self.running.append(sim)
        return json.loads(sim.stdout.readline())

    def end(self):
        for process in reversed(self.running):
            process.terminate()
            if process.wait(LIMIT_S) != 0:
                raise AssertionError(f"{process.args[0]} ended with {process.returncode}")
        self.running = []


def said(done, status, *parts):
    """What is wrong with an answer: its exit status, words that are missing, or no word of goniod at all."""
    found = [f"exit status {done.returncode}, expected {status}"] if done.returncode != status else []
    found += [f"nothing about '{p}'" for p in parts if not re.search(p, done.stdout)]
    return [f"{' '.join(map(str, done.args[1:]))[:80]}: {', '.join(found)}: {done.stdout[:300]}"] if found else []


def files_that_are_none(place):
    """(name, words)"""
    (place.folder / "directory.yaml").mkdir()
    (place.folder / "noise.yaml").write_bytes(os.urandom(10_000_000))
    (place.folder / "small-noise.yaml").write_bytes(os.urandom(100_000))
    place.write("empty.yaml", "")
    return [("empty.yaml", "empty"), ("directory.yaml", "directory"), ("noise.yaml", "longer than"),
            ("small-noise.yaml", "small-noise.yaml"), ("absent.yaml", "cannot open absent.yaml")]


def a_config_that_is_none(place):
    found = []
    for name, words in files_that_are_none(place):
        found += said(place.run("goniod", "--check-config", "--config", name), 2, words)
        found += said(place.run("goniod", "--config", name), 2, words)
    done = place.run("goniod", "--check-config", "--config", place.write("ten.yaml", TEN_IN_CONFIG))
    found += said(done, 2, "did you mean 'spectrometer'")
    lines = [line for line in done.stdout.splitlines() if re.search(r"ten\.yaml:\d+:\d+: ", line)]
    found += [f"{len(lines)} mistakes have a place: {done.stdout}"] if len(lines) < 10 else []
    found += [f"no place: {line}" for line in done.stdout.splitlines() if line not in lines]
    text = (EXAMPLES / "goniod.yaml").read_text()
    found += said(place.run("goniod", "--check-config", "--config", place.write("good.yaml", text)), 0)
    place.write("profile.yaml", text.replace("om-az", "om-ax"))
    return found + said(place.run("goniod", "--check-config", "--config", "profile.yaml"), 2, "no profile 'om-ax'")


def a_command_line_that_is_none(place):
    found = []
    for args in [["--sed", "3"], ["--simulate", "--seed", "x"], ["--simulate", "--seed", "-3"], ["start"], ["--seed", "3"]]:
        found += said(place.run("goniod", *args), 2, "usage: goniod")
    found += said(place.run("goniod", "--simulate", "--sessions", "no/such/folder"), 1, "no/such/folder", "folder above")
    found += said(place.run("goniod", "--simulate", "--socket", "no/such.sock"), 1, "no/such.sock")
    found += said(place.run("goniod", "--simulate", "--socket", "x" * 120), 2, "longer than")
    found += said(place.run("goniod", "--bench", "x.yaml"), 2, "--bench belongs to --simulate")
    found += said(place.run("goniod", "--simulate", "--bench", "absent.yaml"), 2, "absent.yaml")
    place.write("truth.yaml", "holder:\n  - {name: sample, deg: 0, brdf: absent.brdf, paint: Cadmium Red}\n  - {nam: x}\n")
    found += said(place.run("goniod", "--simulate", "--bench", "truth.yaml"), 2, r"truth\.yaml:3:\d+", "did you mean 'name'")
    place.write("truth.yaml", "holder:\n  - {name: sample, deg: 0, brdf: absent.brdf}\n")
    found += said(place.run("goniod", "--simulate", "--bench", "truth.yaml", "--check-config"), 2, "absent.brdf")
    found += said(place.run("goniosim", "--certificate", "ptfe.csv"), 1, "ptfe.csv: exists already; nothing is overwritten")
    found += said(place.run("gonioctl", "shwo"), 2, "did you mean 'show'")
    found += said(place.run("gonioctl", "show", "--dmup"), 2, "no option --dmup")
    found += said(place.run("gonioctl", "move", "source"), 2, "needs AXIS DEG")
    found += said(place.run("gonioctl", "move", "source", "ten"), 2, "not an angle")
    return found + said(place.run("gonioctl", "status"), 1, "no goniod answers", "start goniod")


def a_job_that_is_none(place):
    place.start("--simulate")
    found = []
    for name, words in files_that_are_none(place):
        found += said(place.run("gonioctl", "check", name), 2, words, "nothing was started")
        found += said(place.run("gonioctl", "run", name), 2, words, "nothing was started")
    done = place.run("gonioctl", "run", place.write("ten.yaml", TEN_IN_JOB))
    lines = [line for line in done.stdout.splitlines() if re.search(r"ten\.yaml:\d+:\d+: ", line)]
    found += said(done, 2, "did you mean 'name'", "mistakes; nothing was started")
    found += [f"{len(lines)} mistakes have a place: {done.stdout}"] if len(lines) < 10 else []
    return found + nothing_started(place)


def nothing_started(place):
    status = json.loads(place.run("gonioctl", "status", "--json").stdout)
    begun = status["state"] != "idle" or status["queue"] or list((place.folder / "s").glob("*.gonio"))
    return ["something was started"] if begun else []


def edited(place, name, *changes):
    text = JOB
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return place.write(name, text)


def a_job_that_cannot_be(place):
    place.start("--simulate")
    certificate = (EXAMPLES / "certificate.csv").read_text()
    place.write("other.csv", certificate.replace("geometry: 45:0", "geometry: 0:45"))
    place.write("short.csv", re.sub(r"^[34]80,.*\n", "", certificate, flags=re.M))
    place.write("old.csv", certificate.replace("2030-", "2025-"))
    place.write("empty.csv", "")
    cases = [
        ([("[40]", "[20]"), ("{from: -20, to: 60, step: 20}", "[-20]")], ["no geometry is left", "blind zone"]),
        ([("[60, 40]", "[2, 2]")], ["no geometry is left", "footprint|sample"]),
        ([("ptfe.csv", "other.csv")], ["theta_i 0, theta_v 45", "not of 45, 0"]),
        ([("ptfe.csv", "short.csv")], ["580 .. 780 nm"]),
        ([("ptfe.csv", "old.csv")], ["valid until 2025-11-03", "accept_expired"]),
        ([("ptfe.csv", "empty.csv")], ["empty"]),
        ([("ptfe.csv", "absent.csv")], ["absent.csv"]),
        ([("ptfe.csv", ".")], ["directory"]),
        ([("holder: sample", "holder: sampel")], ["did you mean 'sample'"]),
        ([("Hooker's Green", "Hooker's Grin")], ["Hooker's Grin", "Cadmium Red"]),
    ]
    found = []
    for changes, words in cases:
        done = place.run("gonioctl", "run", edited(place, "case.yaml", *changes))
        found += said(done, 2, "nothing was started", r"case\.yaml:\d+:\d+|empty\.csv", *words)
    partly = place.run("gonioctl", "check", edited(place, "part.yaml", ("[40]", "[40, 89]")))
    return found + said(partly, 0, "Refused", "89:") + nothing_started(place)


def orders_that_cannot_be(place):
    place.start("--simulate")
    found = []
    for args, status, words in [
            (["move", "tilt", "3"], 2, "no axis"), (["move", "source", "400"], 2, "outside the limits.*-70 .. 140 deg"),
            (["move", "source", "1e99"], 2, "no angle"), (["home", "sampel"], 2, "no axis"),
            (["spectrum", "--average", "0"], 2, "above 0"), (["spectrum", "--average", "1e99"], 2, "too long"),
            (["spectrum", "--exposure", "1e9"], 2, "outside"), (["spectrum", "--exposure", "0.01"], 2, "outside"),
            (["pause"], 1, "no campaign is running"), (["continue"], 1, "nothing waits"),
            (["resume"], 1, "no campaign is paused"), (["resume", "../x"], 2, "not by a path"),
            (["resume", "x"], 2, "no session x")]:
        found += said(place.run("gonioctl", *args), status, words)
    return found


def sessions_that_are_none(place):
    place.start("--simulate")
    good = place.run("gonioctl", "run", "--wait", edited(place, "job.yaml")).stdout
    name = re.search(r"^(small_a_\S+)$", good, re.M).group(1)
    folder = place.folder / "s"
    whole = (folder / f"{name}.gonio").read_bytes()
    (folder / "cut.gonio").write_bytes(whole[:len(whole) // 2])
    (folder / "empty.gonio").write_bytes(b"")
    (folder / "text.gonio").write_text("not a session\n")
    (folder / "folder.gonio").mkdir()
    sqlite3.connect(folder / "other.gonio").execute("CREATE TABLE a (b)").connection.close()
    found = []
    for bad, words in [("cut", "truncated"), ("empty", "is empty"), ("text", "not a goniod session"),
                       ("folder", "not a file"), ("other", "another program"), ("absent", "no session absent")]:
        verbs = [["show"], ["verify"], ["reduce"], ["compare"], ["export", "--format", "csv", "-o", "x.csv"], ["resume"]]
        for verb in verbs:
            found += said(place.run("gonioctl", verb[0], bad, *verb[1:]), 2, words)
        found += said(place.run("gonioctl", "copy", bad, "y.gonio"), 2, words)
    listed = place.run("gonioctl", "sessions")
    found += said(listed, 0, f"{name}.* done", "cut.gonio +unreadable .*truncated")
    found += said(place.run("gonioctl", "copy", name, "s/text.gonio"), 1, "exists already")
    found += said(place.run("gonioctl", "resume", name), 1, "nothing to resume")
    made = [p.name for p in place.folder.iterdir() if p.name in ("x.csv", "y.gonio")]
    return found + ([f"left behind: {made}"] if made or (folder / f"{name}.gonio").read_bytes() != whole else [])


def a_full_disk(place):
    """A limit on the size of files is reported by the kernel where a full disk is: in the middle of a write."""
    place.write("long.yaml", JOB.replace("step: 20", "step: 2"))
    place.start("--simulate", preexec_fn=lambda: __import__("resource").setrlimit(
        __import__("resource").RLIMIT_FSIZE, (1_500_000, 1_500_000)))
    done = place.run("gonioctl", "run", "--wait", "long.yaml")
    found = said(done, 1, "failed: .*(full|large|space|disk)")
    status = json.loads(place.run("gonioctl", "status", "--json").stdout)
    found += [] if status["state"] == "failed" and status["lamp"] is False else [f"not parked: {status}"]
    place.end()
    name = next((place.folder / "s").glob("*.gonio")).stem
    found += said(place.run("gonioctl", "verify", name), 0, "sound")
    place.start("--simulate")
    found += said(place.run("gonioctl", "resume", name), 0)
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        ended = json.loads(place.run("gonioctl", "status", "--json").stdout)["jobs_ended"]
        if ended:
            return found + ([] if ended[0]["state"] == "done" else [f"resumed: {ended}"])
        time.sleep(0.1)
    return found + ["the resumed campaign does not end"]


def a_disk_that_is_full(place):
    """A file system of 3 MB of its own; where none may be mounted, the limit on files above is all that is tested."""
    disk = place.folder / "disk"
    disk.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", disk], capture_output=True).returncode:
        print("# no right to mount: the full disk is only imitated by a limit on the size of files")
        return []
    try:
        place.write("long.yaml", JOB.replace("step: 20", "step: 2"))
        place.env["GONIOD_SESSIONS"] = str(disk / "s")
        place.start("--simulate")
        found = said(place.run("gonioctl", "run", "--wait", "long.yaml"), 1, "failed: .*no space left for the session")
        status = json.loads(place.run("gonioctl", "status", "--json").stdout)
        found += [] if status["state"] == "failed" and status["lamp"] is False else [f"not parked: {status}"]
        # Nothing of the next session fits either: it must not leave a name behind.
        before = sorted(p.name for p in (disk / "s").glob("*.gonio"))
        (disk / "ballast").write_bytes(b"")
        with open(disk / "ballast", "wb", buffering=0) as ballast:
            while ballast_grows(ballast):
                pass
        found += said(place.run("gonioctl", "run", "--wait", "long.yaml"), 1, "no space left|disk")
        after = sorted(p.name for p in (disk / "s").glob("*.gonio"))
        found += [f"left behind: {set(after) - set(before)}"] if after != before else []
        (disk / "ballast").unlink()
        place.end()
        return found + said(place.run("gonioctl", "verify", before[0][:-6]), 0, "sound")
    finally:
        subprocess.run(["umount", "-l", disk], check=True)


def ballast_grows(ballast):
    try:
        return ballast.write(b"x" * 4096) > 0
    except OSError:
        return False


def a_network_file_system(place):
    env = dict(place.env, LD_PRELOAD=f"{BUILD}/tests/preload/network.so", NETWORK_FOLDER="/net")
    for folder in ("net", "local"):
        (place.folder / folder).mkdir()
    if "libasan" in subprocess.run(["ldd", f"{BUILD}/goniod"], capture_output=True, text=True).stdout:
        print("# under a sanitizer nothing may be loaded before its library")
        return []
    command = [f"{BUILD}/goniod", "--simulate", "--sessions", str(place.folder / "net")]
    done = subprocess.run(command, env=env, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=LIMIT_S)
    found = said(done, 2, "lies on NFS", "local disk", "--sessions")
    return found + ([f"left behind: {list((place.folder / 'net').iterdir())}"] if any((place.folder / "net").iterdir()) else [])


class OtherDrive(socketserver.BaseRequestHandler):
    """A drive that is no AZ: it refuses every register it has not (exception 2), and has none of theirs."""

    def handle(self):
        while len(head := self.request.recv(7, 0x100)) == 7:  # MSG_WAITALL
            number, _, length, unit = struct.unpack(">HHHB", head)
            function = self.request.recv(length - 1, 0x100)[0]
            self.request.sendall(struct.pack(">HHHBBB", number, 0, 3, unit, function | 0x80, 2))


def another_drive(place):
    sim = place.goniosim()
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), OtherDrive) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        bus = f"tcp:127.0.0.1:{server.server_address[1]}"
        found = ask_bench(place, bench("usb2000plus", sim["spectrometer"], bus),
                          (["devices"], 0, ["unit 1 .*refuses \\(exception 2", "right profile"]),
                          (["move", "source", "3"], 1, ["right profile"]))
        server.shutdown()
    return found


def bench(spectrometer, link, bus, unit=1, serial=""):
    return f"""\
spectrometer: {{model: {spectrometer}, link: "{link}"{serial}}}
lamp: {{warm_up_min: 0}}
optics: {{beam_mm: 20, view_mm: 3}}
axes:
  source: {{profile: om-az, link: "{bus}", unit: {unit}, parity: N, limits_deg: [-70, 140], blind_deg: 8}}
  sample: {{profile: om-az, link: "{bus}", unit: 2, parity: N, limits_deg: [-85, 85]}}
holder: {{profile: om-az, link: "{bus}", unit: 3, parity: N, limits_deg: [-5, 185], positions: {{sample: 0, reference: 90}}}}
"""


def ask_bench(place, config, *questions):
    place.write("bench.yaml", config)
    daemon = place.start("--config", "bench.yaml")
    found = []
    for args, status, words in questions:
        found += said(place.run("gonioctl", *args), status, *words)
    daemon.terminate()
    if daemon.wait(LIMIT_S) != 0:
        found.append(f"goniod ended with {daemon.returncode}")
    place.running.remove(daemon)
    return found


def instruments_that_do_not_answer(place):
    sim = place.goniosim()
    usb, bus = sim["spectrometer"], next(m for m in sim["modbus"] if m.startswith("tcp:"))
    light = ["spectrum", "--exposure", "10", "-o", "x.csv"]
    nowhere = "tcp:127.0.0.1:1"
    found = ask_bench(place, bench("usb2000plus", "usbredir:" + nowhere, bus),
                      (light, 1, [nowhere, "refused"]), (["devices"], 0, [f"{nowhere}.*refused", "unit 1 .*answers"]))
    found += ask_bench(place, bench("usb2000plus", "usb", bus), (light, 1, ["no spectrometer 2457:101e on USB", "cable"]))
    found += ask_bench(place, bench("usb4000", usb, bus), (light, 1, ["2457:101e, expected 2457:1022", "wrong model"]))
    found += ask_bench(place, bench("usb2000plus", usb, bus, serial=", serial: NONE"),
                       (light, 1, ["serial number USB2\\+SIM001, goniod.yaml asks for NONE"]))
    found += ask_bench(place, bench("usb2000plus", usb, bus, unit=9),
                       (["devices"], 0, ["unit 9 .*did not answer", "unit number", "unit 2 .*answers"]))
    found += ask_bench(place, bench("usb2000plus", usb, nowhere), (["move", "source", "3"], 1, [nowhere, "refused"]))
    return found + ask_bench(place, bench("usb2000plus", usb, "rtu:/dev/no-such-tty"),
                             (["where"], 1, ["/dev/no-such-tty", "plugged in"]))


def a_spectrometer_without_its_calibration(place):
    found = []
    for state, words in [("blank", ["EEPROM slot 1 ", "blank or damaged", "by the maker"]),
                         ("corrupt", ["EEPROM reach", "expected to ascend", "damaged"])]:
        sim = place.goniosim(f"spectrometer: {{eeprom: {state}}}\n")
        bus = next(m for m in sim["modbus"] if m.startswith("tcp:"))
        found += ask_bench(place, bench("usb2000plus", sim["spectrometer"], bus),
                           (["spectrum", "--exposure", "10", "-o", "x.csv"], 1, words), (["devices"], 0, words[:1]))
        found += ["a spectrum was written all the same"] if (place.folder / "x.csv").exists() else []
        place.end()
    return found


def drives_in_trouble(place):
    """A limit switch in the way, whose alarm stays until a person has looked; then a unit that answers nothing."""
    sim = place.goniosim("axes:\n  - {role: source, unit: 1, switch_low_deg: -30, switch_high_deg: 10, watchdog_ms: 8000}\n"
                         "  - {role: sample, unit: 2, watchdog_ms: 8000}\n  - {role: holder, unit: 3, watchdog_ms: 8000}\n")
    bus = next(m for m in sim["modbus"] if m.startswith("tcp:"))
    found = ask_bench(place, bench("usb2000plus", sim["spectrometer"], bus),
                      (["move", "source", "3"], 1, ["position is not known", "gonioctl home source"]),
                      (["home", "source"], 0, []), (["move", "source", "20"], 1, ["alarm 6[67]h"]),
                      (["devices"], 0, ["unit 1 .*answers, with alarm 6[67]h: ", "unit 2 .*answers"]))
    place.end()
    sim = place.goniosim("axes:\n  - {role: source, unit: 1}\n  - {role: sample, unit: 2, mute: true}\n"
                         "  - {role: holder, unit: 3}\n")
    bus = next(m for m in sim["modbus"] if m.startswith("tcp:"))
    return found + ask_bench(place, bench("usb2000plus", sim["spectrometer"], bus),
                             (["devices"], 0, ["unit 2 .*did not answer", "unit 3 .*answers"]),
                             (["move", "sample", "3"], 1, ["axis sample: unit 2 .*did not answer", "power", "unit number"]),
                             (["check", edited(place, "job.yaml")], 0, ["Before the start:", "gonioctl commission source",
                                                                        "gonioctl commission holder"]),
                             (["run", "--wait", "job.yaml"], 1, ["commission"]))


def two_daemons(place, wire="rtu:"):
    sim = place.goniosim()
    bus = next(m for m in sim["modbus"] if m.startswith(wire))
    place.write("bench.yaml", bench("usb2000plus", sim["spectrometer"], bus))
    place.start("--config", "bench.yaml")
    other = ["--sessions", str(place.folder / "s2")]
    found = said(place.run("goniod", "--config", "bench.yaml", *other), 1, "another goniod serves", "--socket")
    found += said(place.run("goniod", "--config", "bench.yaml", "--socket", "h.sock"), 1, "another goniod measures into",
                  "--sessions")
    found += said(place.run("gonioctl", "where"), 0)
    found += said(place.run("gonioctl", "spectrum", "--exposure", "10", "-o", "x.csv"), 0)
    socket = str(place.folder / "h.sock")
    place.start("--config", "bench.yaml", "--socket", socket, *other, socket=socket)
    found += said(place.run("gonioctl", "where", "--socket", socket), 1, "in use by another goniod")
    found += said(place.run("gonioctl", "spectrum", "--socket", socket, "-o", "y.csv"), 1, "another program")
    return found + said(place.run("gonioctl", "where"), 0)


def two_daemons_over_tcp(place):
    return two_daemons(place, "tcp:")


TESTS = [a_config_that_is_none, a_command_line_that_is_none, a_job_that_is_none, a_job_that_cannot_be,
         orders_that_cannot_be, sessions_that_are_none, a_full_disk, a_disk_that_is_full, a_network_file_system,
         instruments_that_do_not_answer, another_drive, a_spectrometer_without_its_calibration, drives_in_trouble, two_daemons,
         two_daemons_over_tcp]


def main():
    words = sys.argv[1:]
    tests = [t for t in TESTS if not words or t.__name__ in words]
    print(f"1..{len(tests)}")
    failed = False
    for number, test in enumerate(tests, 1):
        folder = tempfile.mkdtemp()
        place = Place(folder)
        try:
            found = test(place)
            place.end()
        except (AssertionError, OSError, AttributeError, StopIteration, ValueError, subprocess.TimeoutExpired) as e:
            found = [f"{type(e).__name__}: {e}"]
            for process in place.running:
                process.kill()
        shutil.rmtree(folder)
        failed |= bool(found)
        print(f"{'not ok' if found else 'ok'} {number} - {test.__name__.replace('_', ' ')}")
        for f in found[:20]:
            print("# " + f.replace("\n", "\n#   "))
    return failed


sys.exit(main())
