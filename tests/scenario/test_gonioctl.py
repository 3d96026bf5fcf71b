"""gonioctl as a person uses it: several jobs in one order, names as they are listed, files that exist, a narrow terminal."""
import fcntl
import json
import os
import pty
import struct
import subprocess
import sys
import tempfile
import termios

sys.path.insert(0, "tests/support")
from goniod import GONIOCTL, Goniod, write_job  # noqa: E402

SMALL = dict(incidences="[20]", views="[0, 40]")


def several_jobs_are_one_order(goniod):
    good = write_job(goniod.folder, "good", **SMALL)
    bad = write_job(goniod.folder, "bad", incidences="[120]", views="[0]")
    for second in (bad.name, "absent.yaml"):
        code, _, err = goniod.ctl("run", good.name, second)
        assert code == 2 and "nothing was started" in err and "job 1" not in err, err
    assert goniod.status()["state"] == "idle" and not goniod.status()["queue"]


def one_object_on_stdout(goniod):
    write_job(goniod.folder, "good", **SMALL)
    jobs = json.loads(goniod.order("run", "--wait", "--json", "good.yaml", "good.yaml"))["jobs"]
    assert [job["state"] for job in jobs] == ["done", "done"] and jobs[1]["job"] == jobs[0]["job"] + 1, jobs
    assert [s for job in jobs for s in job["sessions"]] == goniod.names(), jobs
    assert goniod.status()["job"] == {"number": jobs[1]["job"], "name": "good"}


def a_session_is_resumed_by_the_name_that_is_listed(goniod):
    write_job(goniod.folder, "good", **SMALL)
    goniod.order("run", "--wait", "good.yaml")
    listed = goniod.names()[0] + ".gonio"
    code, _, err = goniod.ctl("resume", listed)
    assert code == 1 and "is complete: there is nothing to resume" in err, err


def a_spectrum_is_never_lost_to_a_file(goniod):
    goniod.order("spectrum", "--exposure", 10, "-o", "first.csv")
    first = (goniod.folder / "first.csv").read_bytes()
    code, _, err = goniod.ctl("spectrum", "--exposure", 10, "-o", "first.csv")
    assert code == 1 and "nothing is overwritten" in err, err
    code, _, err = goniod.ctl("spectrum", "--exposure", 10, "-o", "absent/first.csv")
    assert code == 1 and "No such file or directory" in err, err
    assert (goniod.folder / "first.csv").read_bytes() == first


def the_lamp_is_told_as_it_is(goniod):
    for option, lamp in (("--json", True), ("--dark", False)):
        goniod.order("spectrum", "--exposure", 10, option)
        assert goniod.status()["lamp"] is lamp
    assert "lamp off" in goniod.order("status")


def what_could_not_be_printed_is_an_error(goniod):
    done = subprocess.run([GONIOCTL, "status", "--socket", goniod.socket], stdout=open("/dev/full", "w"),
                          stderr=subprocess.PIPE, text=True)
    assert done.returncode == 1 and "No space left" in done.stderr, done


def progress_fits_the_terminal(goniod):
    write_job(goniod.folder, "long", incidences="[20, 40, 60]", views="{from: -80, to: 80, step: 5}")
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 40, 0, 0))
    run = subprocess.Popen([GONIOCTL, "run", "--wait", "long.yaml", "--socket", goniod.socket], cwd=goniod.folder,
                           stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=theirs)
    os.close(theirs)
    shown = b""
    try:
        while piece := os.read(ours, 4096):
            shown += piece
    except OSError:  # EIO: the terminal's other end is closed
        pass
    assert run.wait() == 0, shown
    bars = [line for line in shown.decode().replace("\033[K", "").split("\r") if line.startswith("[")]
    assert bars and all(len(bar) < 40 for bar in bars), bars


TESTS = [several_jobs_are_one_order, one_object_on_stdout, a_session_is_resumed_by_the_name_that_is_listed,
         a_spectrum_is_never_lost_to_a_file, the_lamp_is_told_as_it_is, what_could_not_be_printed_is_an_error,
         progress_fits_the_terminal]


def main():
    print(f"1..{len(TESTS)}")
    failed = False
    for number, test in enumerate(TESTS, 1):
        with tempfile.TemporaryDirectory() as folder:
            goniod, said = Goniod(folder).start(), ""
            try:
                test(goniod)
            except AssertionError as e:
                said = str(e) or "an assertion"
            goniod.close()
        failed |= bool(said)
        print(f"{'not ok' if said else 'ok'} {number} - {test.__name__.replace('_', ' ')}")
        print("".join(f"# {line}\n" for line in said.splitlines()), end="")
    return failed


sys.exit(main())
