"""The paper's Fig. 8 from sessions that goniod measured itself: the demo's three waters at fewer angles, fitted, rendered
as in the demo, and judged by the demo's own program."""
import re
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, "tests/support")
from goniod import BUILD, CERTIFICATE, Goniod  # noqa: E402

DEMO = Path("docs/examples/demo")
SCENES = Path("docs/examples/scenes")
WATERS = (0, 60, 90)
FEWER = {r"theta_i_deg: \[.*?\]": "theta_i_deg: [20, 45, 60]", r"step: 5": "step: 20", r"mirror_step_deg: 1": "mirror_step_deg: 3",
         r"average: 4": "average: 2"}


def measure(folder):
    """Name of the session of each water."""
    Path(folder, "ptfe.csv").write_bytes(CERTIFICATE.read_bytes())
    for water in WATERS:
        text = (DEMO / f"paper-{water}.yaml").read_text()
        for old, new in FEWER.items():
            text, n = re.subn(old, new, text, count=1)
            assert n == 1, f"{old} is not in the demo's job"
        Path(folder, f"paper-{water}.yaml").write_text(text)
    goniod = Goniod(folder)
    try:
        goniod.start()
        names = goniod.order("run", "--wait", *(f"paper-{water}.yaml" for water in WATERS)).split()
        goniod.signal(signal.SIGTERM)
        assert len(names) == len(WATERS), names
        return [goniod.sessions / f"{name}.gonio" for name in names]
    finally:
        goniod.close()


def trends(folder, sessions):
    """Exit status and words of the demo's program about the picture of these sessions."""
    for other in SCENES.glob("*.csv"):
        Path(folder, other.name).write_bytes(other.read_bytes())
    scene = Path(folder, "fig8.yaml")
    scene.write_text((SCENES / "fig8.yaml").read_text().replace("grid: 4", "grid: 1"))
    words = [f"--session=water-{water}={session}" for water, session in zip(WATERS, sessions)]
    picture = Path(folder, "fig8.png")
    subprocess.run([BUILD / "goniorender", "render", scene, "-o", picture, *words], check=True, capture_output=True)
    done = subprocess.run([sys.executable, DEMO / "trends.py", picture], capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def difference(folder, sessions):
    """Exit status and words of `goniorender diff` between the first and the last of these sessions."""
    scene = Path(folder, "water.yaml")
    scene.write_text((SCENES / "water.yaml").read_text())
    done = subprocess.run([BUILD / "goniorender", "diff", scene, f"--session=paint={sessions[0]}",
                           f"--other-session=paint={sessions[-1]}", "-o", Path(folder, "d.png")], capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def check(n, ok, name, why=""):
    print(f"{'ok' if ok else 'not ok'} {n} - {name}", flush=True)
    if not ok:
        print("\n".join("# " + line for line in why.splitlines()))
    return ok


def main():
    print("1..3")
    with tempfile.TemporaryDirectory() as folder:
        sessions = measure(folder)
        code, words = trends(folder, sessions)
        fine = check(1, code == 0, "with water the saturation falls and the highlight weakens", words)
        code, words = trends(folder, sessions[::-1])
        fine = check(2, code == 1 and "NOT fall" in words and "NOT weaken" in words,
                     "of waters in the wrong order the program says so", words) and fine
        code, words = difference(folder, sessions)
        print("\n".join("# " + line for line in words.splitlines()))
        fine = check(3, code == 0 and re.search(r"mean [1-9]", words), "the paint dry and wet look different", words) and fine
    return not fine


if __name__ == "__main__":
    sys.exit(main())
