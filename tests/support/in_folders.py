"""Runs the test_* functions of a module, each in a folder of its own, and prints TAP."""
import tempfile
from pathlib import Path


def run(module):
    """module: globals() of the tests; True if one failed."""
    tests = [(name, test) for name, test in module.items() if name.startswith("test_")]
    print(f"1..{len(tests)}")
    failed = False
    for number, (name, test) in enumerate(tests, 1):
        with tempfile.TemporaryDirectory() as folder:
            try:
                test(Path(folder))
                print(f"ok {number} - {name}", flush=True)
            except Exception as e:  # a test that breaks is a test that failed
                failed = True
                print(f"not ok {number} - {name}\n# {type(e).__name__} {e}", flush=True)
    return failed
