"""goniod killed with -9 in a campaign, at random moments and at its k-th write to the session, then started again:
`gonioctl resume` completes the session; every committed row is there bit for bit, none is doubled, verify, reduce and
replay pass. SIGTERM ends it `interrupted`, and it can be resumed as well.

    SEED=n KILLS=k BUILD=build /usr/bin/python3 tests/crash/test_goniod_kill.py      (make crash N=k)
"""
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

sys.path.insert(0, "tests/support")
from goniod import BUILD, JOB_S, Goniod, write_job  # noqa: E402

SEED = int(os.environ.get("SEED") or time.time_ns() % 1_000_000)
KILLS = int(os.environ.get("KILLS") or 4)
AGAIN = 0.4  # the share of campaigns that are killed once more while they are being resumed


# ---- what a session holds ----

def rows_of(goniod, name):
    """Table -> its lines, in key order."""
    code, text, err = goniod.ctl("show", name, "--dump")
    assert code == 0, f"show --dump after a kill: {err}"
    rows = defaultdict(list)
    for line in text.splitlines():
        table, _, rest = line.partition("\t")
        rows[table].append(rest)
    return rows


def value(row, key):
    return next(cell.split("=", 1)[1] for cell in row.split("\t") if cell.startswith(key + "="))


def final_geometries(rows):
    """(theta_i, theta_v, which time) of the final points; fails where a step has two."""
    exposures = {value(r, "id"): r for r in rows["exposure"]}
    steps, found = set(), []
    for row in rows["point"]:
        if value(row, "provisional") != "0":
            continue
        exposure = exposures[value(row, "exposure_id")]
        step = value(exposure, "step")
        assert step not in steps, f"two final points of step {step}"
        steps.add(step)
        found.append((int(step), value(exposure, "theta_i_udeg"), value(exposure, "theta_v_udeg")))
    return sorted(found)


def check_kept(before, after):
    for table, lines in before.items():
        if table in ("exchange_request", "fact"):
            assert set(lines) <= set(after[table]), f"{table}: a row is gone"
        else:
            assert after[table][:len(lines)] == lines, f"{table}: committed rows have changed"
    for table, lines in after.items():
        assert len(set(lines)) == len(lines), f"{table}: a row is doubled"


def check_complete(goniod, name, reference):
    for words in (("verify", name), ("reduce", name, "--json"), ("replay", name, "--surface", "truth", "--json")):
        code, out, err = goniod.ctl(*words)
        assert code == 0, f"{words[0]} {name}: {err or out[:600]}"
    assert '"state":"done"' in goniod.order("show", name, "--json")
    assert final_geometries(rows_of(goniod, name)) == reference


# ---- killing ----

def resume_until_done(goniod, name, again):
    """Starts goniod and resumes; `again` may kill it once more. Returns how often it was started."""
    for start in range(1, 6):
        goniod.start()
        code, _, err = goniod.ctl("resume", name)
        if code != 0 and "is complete" in err:
            goniod.signal(signal.SIGTERM)
            return start
        assert code == 0, f"resume {name}: {err}"
        if start == 1 and again is not None:
            time.sleep(again)
            goniod.signal(signal.SIGKILL)
            continue
        assert goniod.wait_for_end() == "done", goniod.status()
        assert goniod.signal(signal.SIGTERM)[0] == 0
        return start
    raise AssertionError("five starts did not complete the session")


def run_anew(goniod, job):
    """The kill came before anything was measured: nothing is in the way of the same job."""
    goniod.start()
    goniod.order("run", job)
    assert goniod.wait_for_end() == "done"
    goniod.signal(signal.SIGTERM)


def recover(goniod, job, reference, again=None):
    names = goniod.names()
    if not names:  # it gets its name with its facts: whatever has one can be resumed
        run_anew(goniod, job)
        check_complete(goniod, goniod.names()[-1], reference)
        left = [p.name for p in goniod.sessions.iterdir() if ".part" in p.name]
        assert not left, f"half-made files stay behind: {left}"
        return "while its session was being made"
    before = rows_of(goniod, names[0])
    listed = goniod.order("sessions", "--sessions", goniod.sessions)
    assert "interrupted" in listed or " done " in listed, listed
    starts = resume_until_done(goniod, names[0], again)
    check_kept(before, rows_of(goniod, names[0]))
    check_complete(goniod, names[0], reference)
    assert goniod.names() == names
    return f"after {len(before['exposure'])} exposures, {starts} start{'s' * (starts > 1)}"


def start_job(goniod, job):
    goniod.start()
    goniod.order("run", job)


def kill_in_time(draw, job, reference, length_s):
    with tempfile.TemporaryDirectory() as folder:
        goniod = Goniod(folder)
        try:
            start_job(goniod, job)
            time.sleep(draw.uniform(0, length_s))
            goniod.signal(signal.SIGKILL)
            again = draw.uniform(0.05, length_s) if draw.random() < AGAIN else None
            return recover(goniod, job, reference, again)
        finally:
            goniod.close()


def kill_at_write(k, shim, job, reference):
    with tempfile.TemporaryDirectory() as folder:
        goniod = Goniod(folder, environment={"LD_PRELOAD": str(shim), "KILL_AT_WRITE": str(k)})
        try:
            start_job(goniod, job)
            assert goniod.end()[0] == -signal.SIGKILL, f"write {k} never came"
            goniod.environment.pop("LD_PRELOAD")
            return recover(goniod, job, reference)
        finally:
            goniod.close()


# ---- tests ----

def make_shim(folder):
    shim = Path(folder, "kill_at_write.so")
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", shim, "tests/crash/kill_at_write.c", "-ldl"], check=True)
    return shim


def measure_undisturbed(folder, job, shim):
    """Final geometries, seconds and writes of a campaign that nobody disturbs."""
    count = Path(folder, "count")
    environment = {"LD_PRELOAD": str(shim), "KILL_COUNT": str(count)} if shim else None
    goniod = Goniod(folder, environment=environment)
    try:
        start_job(goniod, job)
        begun = time.monotonic()
        assert goniod.wait_for_end() == "done"
        length_s = time.monotonic() - begun
        assert goniod.signal(signal.SIGTERM)[0] == 0
        rows = rows_of(goniod, goniod.names()[0])
        return final_geometries(rows), length_s, int(count.read_text()) if shim else 0
    finally:
        goniod.close()


def test_kill_at_random_moments(draw, job, reference, length_s, writes, shim):
    for n in range(KILLS):
        print(f"# killed {kill_in_time(draw, job, reference, length_s)}")


def test_kill_at_a_write(draw, job, reference, length_s, writes, shim):
    """The first writes make the file, the last close it: both ends always, the rest at random."""
    edges = [draw.randint(1, 60), writes - draw.randint(0, 3)]
    for k in edges + [draw.randint(61, writes - 4) for _ in range(max(KILLS - 2, 0))]:
        print(f"# at write {k} of {writes}: killed {kill_at_write(k, shim, job, reference)}")


def points_done(goniod):
    return (goniod.status()["points"] or {}).get("done", 0)


def interrupt(job, reference):
    """False: a busy machine let the campaign end before the signal was there."""
    with tempfile.TemporaryDirectory() as folder:
        goniod = Goniod(folder)
        try:
            start_job(goniod, job)
            end = time.monotonic() + JOB_S
            while points_done(goniod) < 4 and time.monotonic() < end:
                time.sleep(0.005)
            code, said = goniod.signal(signal.SIGTERM)
            assert code == 0, f"exit status {code}: {said}"
            name = goniod.names()[0]
            shown = goniod.order("show", name, "--json")
            if '"state":"done"' in shown:
                return False
            assert '"state":"interrupted"' in shown
            assert not list(goniod.sessions.glob("*-wal")), "an interrupted session is one file"
            print(f"# interrupted {recover(goniod, job, reference)}")
            return True
        finally:
            goniod.close()


def test_sigterm_interrupts(draw, job, reference, length_s, writes, shim):
    assert any(interrupt(job, reference) for _ in range(5)), "five campaigns ended before SIGTERM reached goniod"


def main():
    tests = [test_sigterm_interrupts, test_kill_at_random_moments, test_kill_at_a_write]
    print(f"1..{len(tests)}\n# seed {SEED}; repeat with SEED={SEED} KILLS={KILLS} BUILD={BUILD} "
          "/usr/bin/python3 tests/crash/test_goniod_kill.py")
    sanitized = b"__asan_init" in Path(BUILD, "goniod").read_bytes()  # wants to be the first library itself
    shim_folder = tempfile.mkdtemp()
    job = write_job(shim_folder)
    shim = None if sanitized or not shutil.which("cc") else make_shim(shim_folder)
    with tempfile.TemporaryDirectory() as folder:
        reference, length_s, writes = measure_undisturbed(folder, job, shim)
    print(f"# undisturbed: {len(reference)} points in {length_s:.2f} s, {writes} writes")
    failed = 0
    for n, test in enumerate(tests, 1):
        if test is test_kill_at_a_write and not shim:
            print(f"ok {n} # SKIP no preloading into this build")
            continue
        try:
            test(random.Random(SEED + n), job, reference, length_s, writes, shim)
            print(f"ok {n} - {test.__name__}", flush=True)
        except AssertionError as e:
            failed += 1
            print(f"not ok {n} - {test.__name__}\n# {str(e)[:1500]}", flush=True)
    shutil.rmtree(shim_folder)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
