"""Checks what no compiler knows: who includes whom, where a third-party header may stand, how long things are.

The tables below are the design's folder table; a breach is printed as file:line: sentence. Exit status 1 then.
"""
import re
import sys
from pathlib import Path
from statistics import median

FOLDERS = ["proto", "drivers", "fit", "sim", "daemon"]

# Folder -> folders whose headers it may include.
MAY_INCLUDE = {
    "proto": {"proto"},
    "drivers": {"drivers", "proto"},
    "fit": {"fit", "proto"},
    "fit/render": {"fit/render", "fit", "proto"},
    "sim": {"sim", "proto"},
    "daemon": {"daemon", "proto", "drivers", "fit"},
}
# Single headers beyond that.
MAY_ALSO = {
    "sim": {"drivers/clock.h", "drivers/modbus_link.h", "drivers/usb_link.h", "fit/reflectance.h"},
}
# The files of daemon/ that wire up --simulate, and so may include sim/.
SIMULATE = {"daemon/simulate.c", "daemon/simulate.h"}

# Third-party header -> folders, and how many files may include it (two where there is a client and a server).
THIRD_PARTY = {
    r"jansson\.h": ({"proto", "fit", "fit/render", "sim", "daemon"}, None),  # a data type: it stands in our own headers
    r"libfyaml\.h": ({"proto"}, 1),
    r"sqlite3\.h": ({"proto"}, 1),
    r"modbus/.*|modbus\.h": ({"drivers", "sim"}, 2),
    r"libusb-1\.0/.*|libusb\.h": ({"drivers"}, 1),
    r"usbredir.*\.h": ({"drivers", "sim"}, 2),
    r"uv\.h": ({"daemon", "sim"}, 2),
    r"ceres/.*|Eigen/.*|glog/.*": ({"fit"}, None),  # in .cc only, see below
    r"png\.h": ({"fit/render"}, 1),
    r"tiffio\.h": ({"fit/render"}, 1),
    r"lcms2.*\.h": ({"fit/render"}, 1),
    r"openexr\.h|OpenEXR/.*": ({"fit/render"}, 1),
    r"embree3/.*": ({"fit/render"}, 1),
}
LIBC = re.compile(r"""(assert|complex|ctype|dirent|dlfcn|endian|errno|fcntl|fenv|float|getopt|glob|grp|inttypes
    |libgen|limits|locale|malloc|math|netdb|poll|pthread|pwd|regex|sched|semaphore|setjmp|signal|spawn|stdalign|stdarg
    |stdatomic|stdbool|stddef|stdint|stdio|stdlib|stdnoreturn|string|strings|syslog|termios|time|unistd
    |(sys|net|netinet|arpa|linux)/[a-z0-9_]+)\.h$""", re.X)
LIBCXX = re.compile(r"[a-z_]+$")  # <vector>, <cmath>: no .h

LINES_MAX = 500
MEDIAN_MAX = 15

# "Nothing else reads a clock or sleeps": only drivers/clock.c may, and fit/stopwatch.c, which decides nothing. libuv's
# own loop time is left out: it paces what clients of the control socket are sent, and decides nothing on the bench.
CLOCK = re.compile(r"\b(clock_gettime|gettimeofday|clock_nanosleep|nanosleep|usleep|sleep|time|ftime|timespec_get"
                   r"|pthread_cond_timedwait|sem_timedwait|uv_hrtime|uv_sleep)\s*\(")

breaches = []


def breach(path, line, text):
    breaches.append(f"{path}:{line}: {text}")


def folder_of(path):
    parts = Path(path).parts
    return "fit/render" if parts[:2] == ("fit", "render") else parts[0]


def without_comments(text):
    """Comments and strings blanked, lines kept."""
    pattern = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"', re.S)
    return pattern.sub(lambda m: re.sub(r"[^\n]", " ", m.group()), text)


def check_own(path, line, header):
    folder = folder_of(path)
    target = folder_of(header)
    if target in MAY_INCLUDE[folder] or header in MAY_ALSO.get(folder, ()):
        return
    if target == "sim" and path in SIMULATE:
        return
    breach(path, line, f'{folder}/ may not include "{header}"')


def check_third_party(path, line, header, users):
    for pattern, (folders, _) in THIRD_PARTY.items():
        if not re.fullmatch(pattern, header):
            continue
        if folder_of(path) in folders:
            users.setdefault(pattern, {}).setdefault(path, line)
        else:
            breach(path, line, f"<{header}> belongs to {' and '.join(sorted(folders))}")
        if pattern.startswith("ceres") and not path.endswith(".cc"):
            breach(path, line, f"<{header}> may stand in fit/*.cc only")
        return
    if not LIBC.match(header) and not (path.endswith(".cc") and LIBCXX.match(header)):
        breach(path, line, f"<{header}> is in no table of .ci/layers.py")


def check_includes(path, text, users):
    for number, line in enumerate(text.splitlines(), 1):
        match = re.match(r'\s*#\s*include\s*([<"])([^>"]+)[>"]', line)
        if not match:
            continue
        if match[1] == '"':
            check_own(path, number, match[2])
        else:
            check_third_party(path, number, match[2], users)


def check_users(users):
    for pattern, (_, most) in THIRD_PARTY.items():
        files = users.get(pattern, {})
        if most and len(files) > most:
            for path, line in sorted(files.items()):
                breach(path, line, f"one of {len(files)} files that include this header; at most {most} may")


def check_clock(path, bare):
    if path in ("drivers/clock.c", "fit/stopwatch.c"):
        return
    for number, line in enumerate(bare.splitlines(), 1):
        match = CLOCK.search(line)
        if match:
            breach(path, number, f"{match[1]}() is called here; only drivers/clock.c reads a clock or sleeps")


def functions(bare):
    """(first line, lines) of each function: a body opens at the end of a line that starts in column 0."""
    start = opened = None
    for number, line in enumerate(bare.splitlines(), 1):
        if opened is None and re.match(r"[A-Za-z_]", line):
            start = number
        if opened is None and start and re.search(r"\)\s*\{\s*$", line):
            opened = start
        elif line.startswith("}"):
            if opened is not None:
                yield opened, number - opened + 1
            start = opened = None
        elif opened is None and line.rstrip().endswith(";"):
            start = None


def main():
    users, lengths = {}, []
    sources = [str(p) for f in FOLDERS for p in sorted(Path(f).rglob("*")) if p.suffix in (".c", ".h", ".cc")]
    for path in sources:
        text = Path(path).read_text()
        bare = without_comments(text)
        check_includes(path, text, users)
        check_clock(path, bare)
        if not path.endswith(".h"):
            lengths += [n for _, n in functions(bare)]
    check_users(users)
    for path in sources + [str(p) for p in sorted(Path("tests").rglob("*.[ch]"))]:
        count = len(Path(path).read_text().splitlines())
        if count > LINES_MAX:
            breach(path, LINES_MAX, f"{count} lines; a file has {LINES_MAX} at most")
    middle = median(lengths)
    if middle > MEDIAN_MAX:
        breach(".", 0, f"half of the functions are longer than {middle} lines; the median may be {MEDIAN_MAX}")
    for text in breaches:
        print(text, file=sys.stderr)
    print(f"{len(sources)} files, {len(lengths)} functions, median {middle:g} lines, longest {max(lengths)}")
    return 1 if breaches else 0


if __name__ == "__main__":
    sys.exit(main())
