"""The Python example of docs/session-format.md, taken from the document as it stands, must run on a real session."""
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

BUILD = os.environ.get("BUILD", "build")


def example():
    text = Path("docs/session-format.md").read_text()
    return re.search(r"```python\n(.*?)```", text, re.S).group(1)


def main():
    print("1..3")
    code = example()
    lines = [line for line in code.splitlines() if line.strip()]
    print("ok 1 - the example is short" if len(lines) <= 12 else f"not ok 1 - the example has {len(lines)} lines")
    with tempfile.TemporaryDirectory() as folder:
        session = os.path.join(folder, "example.gonio")
        subprocess.run([f"{BUILD}/tests/unit/test_session", "--make", session], check=True)
        done = subprocess.run([sys.executable, "-c", code, session], capture_output=True, text=True)
    words = done.stdout.split("\n")
    right = done.returncode == 0 and words[0] == "0.1.0"
    print("ok 2 - it runs" if right else f"not ok 2 - {done.stdout}{done.stderr}")
    # Two final points with 81 - 11 bands each (row_point leaves out every seventh band).
    complete = words[-2:-1] == ["140 values"] and sum("beta(550 nm)" in w for w in words) == 2
    print("ok 3 - it prints every value" if complete else f"not ok 3 - {done.stdout}")


main()
