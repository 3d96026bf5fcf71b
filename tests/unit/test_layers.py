"""A small tree with one breach of each kind: .ci/layers.py must name each, and nothing else."""
import subprocess
import sys
import tempfile
from pathlib import Path

LINT = Path(".ci/layers.py").resolve()

GOOD = """#include "proto/err.h"
#include <stdio.h>
int good(int x) {
    return x; /* time( in a comment, "sleep(" in a string */
}
const char *text(void) {
    return "sleep(1)";
}
"""

BREACHES = {
    "proto/up.c": ('#include "daemon/job.h"\n', "proto/up.c:1: proto/ may not include"),
    "drivers/side.c": ('#include "sim/sim.h"\n', "drivers/side.c:1: drivers/ may not include"),
    "sim/codec.c": ('#include "drivers/axis.h"\n', "sim/codec.c:1: sim/ may not include"),
    "daemon/job.c": ('#include "sim/sim.h"\n', "daemon/job.c:1: daemon/ may not include"),
    "daemon/db.c": ("#include <sqlite3.h>\n", "daemon/db.c:1: <sqlite3.h> belongs to proto"),
    "drivers/a.c": ("#include <libusb.h>\n", "drivers/a.c:1: one of 2 files"),
    "drivers/b.c": ("#include <libusb.h>\n", "drivers/b.c:1: one of 2 files"),
    "fit/solve.c": ("#include <ceres/ceres.h>\n", "fit/solve.c:1: <ceres/ceres.h> may stand in fit/*.cc only"),
    "fit/odd.c": ("#include <gsl/gsl_math.h>\n", "fit/odd.c:1: <gsl/gsl_math.h> is in no table"),
    "sim/tick.c": ("int f(void) {\n    return usleep(5);\n}\n", "sim/tick.c:2: usleep() is called here"),
    "proto/long.c": ("int x;\n" * 501, "proto/long.c:500: 501 lines"),
}

ALLOWED = {
    "proto/a.c": GOOD,
    "sim/link.c": '#include "drivers/clock.h"\n#include "fit/reflectance.h"\n#include <modbus/modbus.h>\n',
    "daemon/simulate.c": '#include "sim/sim.h"\n#include <uv.h>\n',
    "drivers/clock.c": "int now(void) {\n    return clock_gettime(0, 0);\n}\n",
    "fit/solve.cc": "#include <ceres/ceres.h>\n#include <vector>\n",
    "proto/store.c": "#include <sqlite3.h>\n",
}


def lint(files):
    with tempfile.TemporaryDirectory() as root:
        for name, text in files.items():
            path = Path(root, name)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        done = subprocess.run([sys.executable, LINT], cwd=root, capture_output=True, text=True)
        return done.returncode, done.stderr.splitlines()


def main():
    results = []
    code, found = lint(ALLOWED)
    results.append(("what is allowed passes", code == 0 and not found))
    code, found = lint({**ALLOWED, **{name: text for name, (text, _) in BREACHES.items()}})
    for name, (_, expected) in BREACHES.items():
        results.append((f"breach in {name}", any(line.startswith(expected) for line in found)))
    others = [line for line in found if not any(line.startswith(e) for _, e in BREACHES.values())]
    for line in others:
        print("#", line)
    results.append(("nothing else is named", code == 1 and not others))
    long_function = "int f(int x) {\n" + "    x++;\n" * 20 + "    return x;\n}\n"
    code, found = lint({"proto/a.c": long_function})
    results.append(("a median above 15 lines", code == 1 and "half of the functions" in "".join(found)))
    for i, (name, good) in enumerate(results, 1):
        print(f"{'ok' if good else 'not ok'} {i} - {name}")
    print(f"1..{len(results)}")


main()
