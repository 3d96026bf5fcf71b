"""docs/protocol.md against a running goniod: every example line by line, the Python client, the socat line, the fields.

An answer must have the keys and the JSON types that the document shows, no more and no fewer; "..." in the document
stands for whatever else there may be.
"""
import json
import os
import re
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

BUILD = os.environ.get("BUILD", "build")
DOCUMENT = Path("docs/protocol.md").read_text()
CERTIFICATE = Path("docs/examples/demo/ptfe.csv").read_text()
JOB = """\
name: small
samples: [{name: a, holder: sample, paint: Hooker's Green, support: drawing paper, size_mm: [60, 40]}]
geometry: {theta_i_deg: [20, 40, 60], theta_v_deg: {from: -20, to: 60, step: 5}}
reference: {mode: every_geometry, geometry: {theta_i_deg: 45, theta_v_deg: 0}, holder: reference, certificate: ptfe.csv}
fit: {model: composite}
"""
LIMIT_S = 300  # far beyond what a busy machine needs
TRIES = 8      # of what a campaign may be too quick for, where the machine is slow to ask


class Client:
    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(LIMIT_S)
        self.socket.connect(path)
        self.lines = self.socket.makefile("rw", encoding="utf-8")
        self.events = []

    def ask(self, line):
        self.lines.write(line + "\n")
        self.lines.flush()
        while True:
            answer = json.loads(self.lines.readline())
            if "id" in answer:
                return answer
            self.events.append(answer)

    def call(self, method, **params):
        return self.ask(json.dumps({"jsonrpc": "2.0", "id": 0, "method": method, "params": params}))

    def await_state(self, *states):
        end = time.monotonic() + LIMIT_S
        while time.monotonic() < end:
            status = self.call("status")["result"]
            if status["state"] in states:
                return status
            time.sleep(0.005)
        raise AssertionError(f"the state is {status['state']} ({status['why']}), not one of {states}")

    def await_begun(self, number):
        end = time.monotonic() + LIMIT_S
        while time.monotonic() < end:
            job = self.call("status")["result"]["job"]
            if job and job["number"] >= number:
                return
            time.sleep(0.005)
        raise AssertionError(f"job {number} has not begun")

    def run(self):
        files = [{"name": "ptfe.csv", "text": CERTIFICATE}]
        return self.call("run", job={"name": "job.yaml", "text": JOB}, files=files)["result"]["job"]


REST = ("idle", "done", "aborted", "failed")
ACTIVE = ("preparing", "running")


def running(client):
    for _ in range(TRIES):
        status = client.await_state(*REST, *ACTIVE, "paused")
        if status["state"] in ACTIVE:
            return status
        if status["state"] == "paused":
            client.call("resume")
        else:
            number = client.run()
            client.call("continue")
            client.await_begun(number)
    raise AssertionError(f"{TRIES} campaigns ended before they were seen to run")


def paused(client):
    for _ in range(TRIES):
        running(client)
        client.call("pause", now=True)
        if client.await_state("paused", *REST)["state"] == "paused":
            return
    raise AssertionError(f"{TRIES} campaigns ended before they could be paused")


def at_rest(client):
    if client.call("status")["result"]["state"] not in REST:
        client.call("abort")
    client.await_state(*REST)


def measuring(client):
    """Something of every field is there: a point, a session, axes that have been read."""
    running(client)
    end = time.monotonic() + LIMIT_S
    while time.monotonic() < end:
        status = running(client)
        if status["points"] and status["points"]["done"] > 3 and "temperature_c" in status["spectrometer"]:
            return
    raise AssertionError("no point within the time")


def job_waits(client):
    at_rest(client)
    client.run()
    client.run()
    client.await_state(*ACTIVE)
    client.call("abort")
    client.await_state("aborted")


BEFORE = {"status": measuring, "pause": running, "abort": running, "stop": running, "continue": job_waits,
          "where": at_rest, "run": at_rest, "home": at_rest, "devices": at_rest, "spectrum": at_rest,
          "commission": at_rest}


def kind(value):
    if isinstance(value, bool):
        return "bool"
    return "number" if isinstance(value, (int, float)) else type(value).__name__


def differences(shown, real, path="answer"):
    """Where the real answer has not the shape that the document shows."""
    if shown is None or real is None:
        return []
    if kind(shown) != kind(real):
        return [f"{path} is {kind(real)}, the document shows {kind(shown)}"]
    if isinstance(shown, list):
        return [d for r in real for d in differences(shown[0], r, path + "[]")] if shown and shown[0] != "..." else []
    if not isinstance(shown, dict):
        return []
    found = [f"{path}.{k} is missing" for k in shown if k != "..." and k not in real]
    if "..." not in shown:
        found += [f"{path}.{k} is not in the document" for k in real if k not in shown]
    for key in shown.keys() & real.keys():
        found += differences(shown[key], real[key], f"{path}.{key}")
    return found


def examples():
    """(request, answer shown), in the document's order."""
    for block in re.findall(r"```json\n(.*?)```", DOCUMENT, re.S):
        lines = block.splitlines()
        for request, answer in zip(lines[::2], lines[1::2]):
            assert request.startswith("> ") and answer.startswith("< "), request
            yield request[2:], json.loads(answer[2:])


def check_example(client, request, shown):
    sent = json.loads(request)
    params = sent.get("params", {})
    if params.get("job", {}).get("text") == "JOB":
        params["job"]["text"] = JOB
        params["files"][0]["text"] = CERTIFICATE
    if sent["method"] == "resume":
        at_rest(client) if "session" in params else paused(client)
    elif not (sent["method"] == "commission" and "answer" in params):
        BEFORE.get(sent["method"], lambda c: None)(client)
    real = client.ask(json.dumps(sent))
    before = BEFORE.get(sent["method"])
    for _ in range(TRIES):
        if before != running or "error" in shown or real.get("error", {}).get("data", {}).get("code") != "state":
            break
        before(client)  # the campaign had ended meanwhile
        real = client.ask(json.dumps(sent))
    found = differences(shown, real)
    if "error" in shown and "error" in real:
        if (shown["error"]["code"], shown["error"]["data"]["code"]) != (real["error"]["code"], real["error"]["data"]["code"]):
            found.append(f"error is {real['error']}")
    return [f"{request[:100]}: {f}" for f in found]


def fields(value, path=""):
    """Names of all fields, as the document's table writes them."""
    if isinstance(value, list):
        return {f for v in value for f in fields(v, path)}
    if not isinstance(value, dict):
        return set()
    found = set()
    for key, inner in value.items():
        name = f"{path}.*.{key}" if path == "axes_of" else f"{path}.{key}" if path else key
        if path == "axes":
            found |= {f"axes.*.{k}" for k in inner}
            continue
        found |= {name} | (set() if name == "estimates.estimate" else fields(inner, name))
    return found


def all_examples(path):
    client = Client(path)
    found = [d for request, shown in examples() for d in check_example(client, request, shown)]
    documented = {json.loads(r)["method"] for r, _ in examples()}
    for m in client.call("methods")["result"]:
        if m["name"] not in documented:
            found.append(f"{m['name']} has no example")
    return found


def every_field(path):
    client = Client(path)
    table = DOCUMENT.split("## Fields of the status")[1].split("## States")[0]
    told = {f for row in re.findall(r"^\| (`.*?) \|", table, re.M) for f in re.findall(r"`([^`]+)`", row)}
    seen, end = set(), time.monotonic() + LIMIT_S
    number = client.run()
    client.run()
    while time.monotonic() < end:
        status = client.call("status")["result"]
        seen |= fields(status)
        if number in [j["number"] for j in status["jobs_ended"]] and not told - seen:
            break
    return [f"{f} is never seen" for f in told - seen] + [f"{f} is not in the table" for f in seen - told]


def every_event(path):
    client = Client(path)
    table = DOCUMENT.split("## Events")[1].split("## Fields")[0]
    told = set(re.findall(r"^\| `(\w+)`", table, re.M))
    client.call("watch")
    number = client.run()
    kinds = set()
    while True:
        event = json.loads(client.lines.readline())
        assert event["method"] == "event" and "id" not in event
        kinds.add(event["params"]["event"])
        if event["params"]["event"] == "end" and event["params"]["number"] == number:
            break
    kinds |= {e["params"]["event"] for e in client.events}
    found = [f"event {k} is not in the document" for k in kinds - told]
    return found + [f"no event {k}" for k in {"state", "point", "end", "queue"} - kinds]


def python_client(path):
    code = re.search(r"```python\n(.*?)```", DOCUMENT, re.S).group(1)
    folder = Path(path).parent
    (folder / "job.yaml").write_text(JOB)
    (folder / "ptfe.csv").write_text(CERTIFICATE)
    command = [sys.executable, "-c", code]
    env = dict(os.environ, GONIOD_SOCKET=path)
    good = subprocess.run(command + ["job.yaml", "ptfe.csv"], cwd=folder, env=env, capture_output=True, text=True, timeout=LIMIT_S)
    (folder / "job.yaml").write_text("nme: x\n")
    bad = subprocess.run(command + ["job.yaml", "ptfe.csv"], cwd=folder, env=env, capture_output=True, text=True, timeout=LIMIT_S)
    found = [] if len(code.splitlines()) <= 26 else ["it is not short"]
    if good.returncode != 0 or "end done" not in good.stdout:
        found.append(f"it failed: {good.stdout}{good.stderr}")
    if bad.returncode == 0 or "did you mean 'name'" not in bad.stderr:
        found.append(f"a bad job: {bad.stdout}{bad.stderr}")
    return found


def socat_line(path):
    line = re.search(r"```sh\n(.*?)\n```", DOCUMENT, re.S).group(1)
    found = []
    for method in ["status", "where"]:      # the one answered at once, the other by the campaign's thread
        Client(path).await_state(*REST)
        done = subprocess.run(["bash", "-c", line.replace("status", method)], env=dict(os.environ, GONIOD_SOCKET=path),
                              capture_output=True, text=True, timeout=LIMIT_S)
        if done.returncode != 0 or "result" not in json.loads(done.stdout or "{}"):
            found.append(f"{method}: {done.stdout}{done.stderr}")
    return found


def await_goniod(daemon, path):
    while daemon.poll() is None:
        try:
            return Client(path).socket.close()
        except OSError:
            time.sleep(0.01)


TESTS = [all_examples, every_field, every_event, python_client, socat_line]


def main():
    print(f"1..{len(TESTS)}")
    failed = False
    for number, test in enumerate(TESTS, 1):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "g.sock")
            daemon = subprocess.Popen([f"{BUILD}/goniod", "--simulate", "--socket", path, "--sessions", f"{folder}/s"],
                                      stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            try:
                await_goniod(daemon, path)
                found = test(path)
            except Exception as e:  # whatever it is, goniod has to be ended
                found = [f"{type(e).__name__}: {e}"]
            daemon.terminate()
            if daemon.wait(LIMIT_S) != 0:
                found.append(f"goniod ended with {daemon.returncode}")
        failed |= bool(found)
        print(f"{'not ok' if found else 'ok'} {number} - {test.__name__.replace('_', ' ')}")
        for f in found[:20]:
            print(f"# {f}")
    return failed


sys.exit(main())
