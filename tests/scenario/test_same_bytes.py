"""`gonioctl show S --dump` of one job, one seed and two goniods is the same text to the last byte, whatever the machine
was doing meanwhile; of another seed it is not."""
import hashlib
import signal
import subprocess
import sys
import tempfile

sys.path.insert(0, "tests/support")
from goniod import Goniod, write_job  # noqa: E402

MODES = ["fixed", "every_geometry"]


def dump(seed, mode, disturbed=False):
    with tempfile.TemporaryDirectory() as folder:
        goniod = Goniod(folder, seed=seed)
        try:
            goniod.start()
            job = write_job(folder, mode=mode, views="{from: -60, to: 60, step: 15}")
            goniod.order("run", job.name)
            while disturbed and goniod.status()["jobs_ended"] == []:
                subprocess.run(["sync", goniod.sessions], check=False)
            assert goniod.wait_for_end() == "done"
            goniod.signal(signal.SIGTERM)
            return goniod.order("show", goniod.names()[0], "--dump")
        finally:
            goniod.close()


def first_difference(a, b):
    for n, (x, y) in enumerate(zip(a.splitlines(), b.splitlines()), 1):
        if x != y:
            cells = next((p, q) for p, q in zip(x.split("\t"), y.split("\t")) if p != q)
            return f"line {n}, {x.split(chr(9))[0]}: {cells[0][:80]} and {cells[1][:80]}"
    return f"{len(a.splitlines())} and {len(b.splitlines())} lines"


def check(n, ok, name, why=""):
    print(f"{'ok' if ok else 'not ok'} {n} - {name}{'' if ok else chr(10) + '# ' + why}", flush=True)
    return ok


def main():
    print(f"1..{2 * len(MODES)}")
    good = True
    for i, mode in enumerate(MODES):
        one, two, other = dump(1, mode), dump(1, mode, disturbed=True), dump(2, mode)
        print(f"# {mode}: {len(one)} bytes, sha256 {hashlib.sha256(one.encode()).hexdigest()[:16]}")
        good &= check(2 * i + 1, len(one) > 100_000 and one == two, f"{mode}: one seed, the same bytes",
                      first_difference(one, two))
        counts = [{line.rsplit("\t", 1)[1] for line in text.splitlines() if line.startswith("exposure\t")}
                  for text in (one, other)]
        good &= check(2 * i + 2, not counts[0] & counts[1], f"{mode}: another seed, other counts in every exposure",
                      f"{len(counts[0] & counts[1])} of {len(counts[0])} are the same")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
