"""goniofit bench --quick: runs, and writes a report that names its figures; no times are judged here."""
import csv
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BUILD = ROOT / os.environ.get("BUILD", "build")


def check(number, name, good, note=""):
    print(f"{'ok' if good else 'not ok'} {number} - {name}")
    if not good:
        print(f"# {note}")
    return good


def bench(folder, others):
    words = ["bench", "--quick", "-o", folder, "--others", others, "--scipy", "/nowhere", "--data", "/nowhere"]
    return subprocess.run([BUILD / "goniofit", *words], cwd=ROOT, capture_output=True, text=True, timeout=300)


def others(folder):
    """Another solver's program: its record stands in the report; what is no record is refused."""
    program = Path(folder) / "others"
    program.write_text("#!/bin/sh\necho 'MINPACK lmder,plain,cold,123.25,1.0,1'\n")
    program.chmod(0o700)
    run = bench(folder, program)
    row = [line for line in (Path(folder) / "fit-report.md").read_text().splitlines() if "MINPACK lmder | plain" in line]
    if run.returncode or not row or "123.2" not in row[0]:
        return False, run.stderr + str(row)
    program.write_text("#!/bin/sh\necho nonsense\n")
    run = bench(folder, program)
    return run.returncode != 0 and "which is no record" in run.stderr, run.stderr


def main():
    with tempfile.TemporaryDirectory() as folder:
        run = bench(folder, "/nowhere")
        print("1..6")
        good = check(1, "bench_ends_well", run.returncode == 0, run.stderr)
        report = Path(folder) / "fit-report.md"
        text = report.read_text() if report.exists() else ""
        wanted = ["commit", "CPU", "compiler", "at least 5", "at least 3", "at most 0.4", "at most 100", "TinySolver",
                  "convergence_3.svg", "points.svg", "bands.svg"]
        missing = [w for w in wanted if w not in text]
        good &= check(2, "the_report_names_its_figures", not missing, missing)
        good &= check(3, "what_was_not_run_is_not_called_met", "not measured | not met" in text, text[:2000])
        rows = []
        path = Path(folder) / "fit-report" / "convergence_0.csv"
        if path.exists():
            rows = [r for r in csv.reader(path.open()) if r]
        solvers = {r[0] for r in rows[1:]}
        good &= check(4, "each_solver_leaves_a_trace",
                      solvers == {"TinySolver", "Solver dense QR", "Solver normal Cholesky"}, rows[:3])
        # Each ends at the optimum: its last distance is under 1e-3 u.
        last = {r[0]: float(r[4]) for r in rows[1:]}
        good &= check(5, "every_solver_ends_at_the_optimum", last and max(last.values()) < 1e-3, last)
        good &= check(6, "others_are_read_as_they_print", *others(folder))
        return 0 if good else 1


sys.exit(main())
