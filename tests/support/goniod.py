"""A goniod of the build in a process of its own, with its own socket and folder of sessions, asked through gonioctl."""
import json
import os
import signal
import subprocess
import time
from pathlib import Path

BUILD = Path(os.environ.get("BUILD", "build"))
GONIOD, GONIOCTL = (BUILD / "goniod").resolve(), (BUILD / "gonioctl").resolve()
CERTIFICATE = Path("docs/examples/demo/ptfe.csv")
START_S, JOB_S = 60, 300  # far beyond what a busy machine needs

JOB = """name: {name}
samples:
  - {{name: hg, holder: sample, paint: Hooker's Green, support: acrylic board, size_mm: [120, 80], water_percent: 0}}
geometry: {{theta_i_deg: {incidences}, theta_v_deg: {views}}}
mean_nm: [400, 700]
exposure: {{target: 0.8, min_ms: 4, max_ms: 5000, average: 3, dark_every_min: 10}}
reference: {{mode: {mode}, geometry: {{theta_i_deg: 45, theta_v_deg: 0}}, holder: reference,
            certificate: ptfe.csv, bracket_min: 4}}
fit: {{model: composite}}
"""


def write_job(folder, name="crash", incidences="[20, 40]", views="{from: -60, to: 60, step: 10}", mode="fixed"):
    path = Path(folder, name + ".yaml")
    path.write_text(JOB.format(name=name, incidences=incidences, views=views, mode=mode))
    Path(folder, "ptfe.csv").write_bytes(CERTIFICATE.read_bytes())
    return path


class Goniod:
    def __init__(self, folder, seed=1, environment=None):
        self.folder, self.seed = Path(folder), seed
        self.socket, self.sessions = self.folder / "socket", self.folder / "sessions"
        self.environment = dict(os.environ, **(environment or {}))
        self.process = None

    def start(self):
        self.process = subprocess.Popen(
            [GONIOD, "--simulate", "--seed", str(self.seed), "--socket", self.socket, "--sessions", self.sessions],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=self.environment)
        end = time.monotonic() + START_S
        while time.monotonic() < end and self.process.poll() is None:
            if self.ctl("status", "--json")[0] == 0:
                return self
            time.sleep(0.01)
        raise AssertionError(f"goniod did not start: {self.end()}")

    def ctl(self, *words):
        """In the folder itself: a session keeps the name of its job as it was given."""
        done = subprocess.run([GONIOCTL, *map(str, words), *self.where(words[0])], capture_output=True, text=True,
                              cwd=self.folder)
        return done.returncode, done.stdout, done.stderr

    def where(self, verb):
        offline = verb in ("show", "verify", "reduce", "replay", "export", "copy")
        return ("--sessions", self.sessions) if offline else ("--socket", self.socket)

    def order(self, *words):
        code, out, err = self.ctl(*words)
        assert code == 0, f"gonioctl {' '.join(map(str, words))}: {err or out}"
        return out

    def status(self):
        code, out, _ = self.ctl("status", "--json")
        return json.loads(out) if code == 0 else None

    def wait_for_end(self):
        """The state in which the campaign came to its end; None where goniod is gone."""
        end = time.monotonic() + JOB_S
        while time.monotonic() < end:
            status = self.status()
            if status is None or status["jobs_ended"]:
                return status and status["jobs_ended"][-1]["state"]
            time.sleep(0.02)
        raise AssertionError(f"the campaign did not end: {self.status()}")

    def names(self):
        return sorted(p.stem for p in self.sessions.glob("*.gonio"))

    def signal(self, number):
        self.process.send_signal(number)
        return self.end()

    def end(self):
        """Waits for its end: exit status (negative: the signal) and what it said."""
        try:
            said = self.process.communicate(timeout=START_S)[1]
        except subprocess.TimeoutExpired:
            self.process.kill()
            said = self.process.communicate()[1] + b" (stopped: it did not end)"
        return self.process.returncode, said.decode(errors="replace")

    def close(self):
        if self.process and self.process.poll() is None:
            self.signal(signal.SIGKILL)
