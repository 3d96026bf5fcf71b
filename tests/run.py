"""Runs every test and closes with one line: N passed, N failed, N skipped.

A test is a program under BUILD/tests/{unit,fuzz,scenario,wire,replay,crash} or a test_*.py / test_*.sh under tests/.
Each prints TAP (testanything.org); a test that dies or prints no plan counts as one failure. Two run at a time.
    tests/run.py BUILD [WORD...]      only tests whose path holds one of the words
"""
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

LAYERS = ["unit", "fuzz", "scenario", "wire", "replay", "crash"]
LIMIT_S = 900  # of one test file; far beyond what a busy machine needs
SKIPPED = re.compile(r"(not )?ok\b.*#\s*skip", re.I)


def find_tests(build, words):
    found = []
    for layer in LAYERS:
        found += sorted(p for p in Path(build, "tests", layer).glob("test_*") if not p.suffix)
        found += sorted(Path("tests", layer).glob("test_*.py")) + sorted(Path("tests", layer).glob("test_*.sh"))
    return [p for p in found if not words or any(w in str(p) for w in words)]


def command(path):
    return {".py": ["/usr/bin/python3", str(path)], ".sh": ["bash", str(path)]}.get(path.suffix, [str(path)])


def run(path):
    env = dict(os.environ, CMOCKA_MESSAGE_OUTPUT="TAP", PYTHONUNBUFFERED="1")
    try:
        done = subprocess.run(command(path), env=env, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=LIMIT_S, errors="replace")
        return path, done.returncode, done.stdout
    except subprocess.TimeoutExpired as e:
        return path, -1, (e.stdout or b"").decode(errors="replace") + f"\nstopped after {LIMIT_S} s\n"


def count(code, text):
    passed = failed = skipped = 0
    for line in text.splitlines():
        if SKIPPED.match(line):
            skipped += 1
        elif re.match(r"not ok\b", line):
            failed += 1
        elif re.match(r"ok\b", line):
            passed += 1
    plan = sum(int(n) for n in re.findall(r"^1\.\.(\d+)", text, re.M))
    if failed == 0 and (code != 0 or plan != passed + skipped or plan == 0):
        failed += 1
    return passed, failed, skipped


def main():
    build, words = sys.argv[1], sys.argv[2:]
    total = [0, 0, 0]
    with ThreadPoolExecutor(max_workers=2) as pool:
        for path, code, text in pool.map(run, find_tests(build, words)):
            counts = count(code, text)
            total = [a + b for a, b in zip(total, counts)]
            print(f"{path}: {counts[0]} passed, {counts[1]} failed, {counts[2]} skipped", flush=True)
            if counts[1]:
                print(text)
            for line in text.splitlines():
                if SKIPPED.match(line) or line.startswith("# skipped: "):
                    print("   ", line)
    print(f"{total[0]} passed, {total[1]} failed, {total[2]} skipped")
    return 1 if total[1] or not total[0] else 0


if __name__ == "__main__":
    sys.exit(main())
