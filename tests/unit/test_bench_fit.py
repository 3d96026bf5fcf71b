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


def main():
    with tempfile.TemporaryDirectory() as folder:
        run = subprocess.run([BUILD / "goniofit", "bench", "--quick", "-o", folder, "--others", "/nowhere", "--scipy",
                              "/nowhere", "--data", "/nowhere"], cwd=ROOT, capture_output=True, text=True, timeout=300)
        print("1..5")
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
        return 0 if good else 1


sys.exit(main())
