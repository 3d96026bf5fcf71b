"""The Python example of docs/session-format.md, taken from the document as it stands, must run on a real session;
and its words on checksums are enough to compute them."""
import os
import re
import sqlite3
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

BUILD = os.environ.get("BUILD", "build")


def example():
    text = Path("docs/session-format.md").read_text()
    return re.search(r"```python\n(.*?)```", text, re.S).group(1)


def encoded(value):
    if value is None:
        return b"n"
    if not isinstance(value, (str, bytes)):
        return b"i" + struct.pack("<q", int(value)) if value == int(value) else b"d" + struct.pack("<d", value)
    data = value.encode() if isinstance(value, str) else value
    return (b"t" if isinstance(value, str) else b"b") + struct.pack("<q", len(data)) + data


def rows_with_right_checksum(session):
    """Right ones, all."""
    db, right, rows = sqlite3.connect(session), 0, 0
    for (table,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchall():
        cursor = db.execute(f"SELECT * FROM {table}")
        first = cursor.description[0][0] == "id"
        for row in cursor:
            rows += 1
            right += zlib.crc32(b"".join(encoded(v) for v in row[first:-1])) == row[-1]
    return right, rows


def main():
    print("1..4")
    code = example()
    lines = [line for line in code.splitlines() if line.strip()]
    print("ok 1 - the example is short" if len(lines) <= 12 else f"not ok 1 - the example has {len(lines)} lines")
    with tempfile.TemporaryDirectory() as folder:
        session = os.path.join(folder, "example.gonio")
        subprocess.run([f"{BUILD}/tests/unit/test_session", "--make", session], check=True)
        n_right, rows = rows_with_right_checksum(session)
        done = subprocess.run([sys.executable, "-c", code, session], capture_output=True, text=True)
    words = done.stdout.split("\n")
    right = done.returncode == 0 and words[0] == "0.1.0"
    print("ok 2 - it runs" if right else f"not ok 2 - {done.stdout}{done.stderr}")
    # Two final points with 81 - 11 bands each (row_point leaves out every seventh band).
    complete = words[-2:-1] == ["140 values"] and sum("beta(550 nm)" in w for w in words) == 2
    print("ok 3 - it prints every value" if complete else f"not ok 3 - {done.stdout}")

    print("ok 4 - checksums" if n_right == rows > 100 else f"not ok 4 - {n_right} of {rows} checksums are right")


main()
