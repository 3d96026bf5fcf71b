"""What `gonioctl check JOB` expects of a paint is, within a factor of two, the u that the finished campaign states."""
import json
import shutil
import signal
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, "tests/support")
from goniod import Goniod  # noqa: E402

DEMO = Path("docs/examples/demo")
PAINTS = {"acrylic-0": "acrylic", "paper-90": "90 %"}  # the narrowest lobe of the published sets and the flattest
FACTOR = 2.0


def relative(of, parameters, kind):
    return {name: of[kind][name] / parameters[name] for name in ("S", "sigma", "gamma", "beta_prime", "n")}


def expected(goniod, job, paint):
    plan = json.loads(goniod.order("check", f"{job}.yaml", "--json"))
    sets = {one["name"]: one for one in plan["forecast"]["sets"]}
    return relative(sets[paint], sets[paint]["parameters"], "std")


def stated(goniod, job):
    """The paint of the bench has the published shape, and an S of its own."""
    goniod.order("run", f"{job}.yaml")
    assert goniod.wait_for_end() == "done"
    name = next(name for name in goniod.names() if job in name)
    estimate = json.loads(goniod.order("show", name, "--json"))["estimate"]
    return relative(estimate, estimate["parameters"], "std")


def test_the_campaign_states_what_was_expected(folder, job, paint):
    goniod = Goniod(folder)
    goniod.start()
    try:
        before, after = expected(goniod, job, paint), stated(goniod, job)
    finally:
        goniod.signal(signal.SIGTERM)
    for name, u in before.items():
        print(f"# {job} {name}: expected {u:.2e}, stated {after[name]:.2e}, ratio {u / after[name]:.2f}")
    for name, u in before.items():
        assert 1 / FACTOR < u / after[name] < FACTOR, (name, u, after[name])


def main():
    print(f"1..{len(PAINTS)}")
    failed = False
    for n, (job, paint) in enumerate(PAINTS.items(), 1):
        with tempfile.TemporaryDirectory() as folder:
            for file in DEMO.iterdir():
                shutil.copy(file, folder)
            try:
                test_the_campaign_states_what_was_expected(folder, job, paint)
                print(f"ok {n} {job}")
            except AssertionError as problem:
                failed = True
                print(f"not ok {n} {job}\n# {problem}")
    return failed


if __name__ == "__main__":
    sys.exit(main())
