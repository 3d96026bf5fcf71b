#!/usr/bin/env bash
# Measures the figures of docs/bench-report.md and writes it.      run.sh BUILD REPORT
set -eu
export BUILD=$1
report=$2
version() { dpkg-query -W -f='${Package} ${Version}' "$1" 2>/dev/null || echo "$1 ?"; }

rows=$(mktemp)
trap 'rm -f "$rows"' EXIT
for bench in "$BUILD"/tests/bench/bench_*; do
    case $bench in *.o | *.d) continue ;; esac
    echo "$(basename "$bench") ..." >&2
    { "$bench" || echo "| $(basename "$bench") | | FAILED, status $? | missed |"; } | tee -a "$rows" >&2
done
load=$(cut -d' ' -f1-3 /proc/loadavg)
{
    echo "# Figures"
    echo
    echo "Written by \`make bench\` (tests/bench); every figure below is of this one run."
    echo
    echo "- date: $(date -u +%Y-%m-%dT%H:%MZ), commit $(git rev-parse --short HEAD 2>/dev/null || echo unknown)"
    echo "- CPU: $(sed -n 's/^model name\s*: //p' /proc/cpuinfo | head -1), $(nproc) of them; load average at the end $load"
    echo "- compiler: $(${CC:-gcc} --version | head -1), -O2; kernel $(uname -r)"
    echo "- libraries: $(version libmodbus5), $(version libusbredirparser1), $(version libsqlite3-0), $(version libuv1)," \
        "$(version libjansson4), $(version libceres3)"
    echo
    echo "| figure | to reach | measured | |"
    echo "|---|---|---|---|"
    cat "$rows"
    echo
    echo "Real time: the sum is formed in tests/bench/bench_realtime.c from the session's rows and the sheets' figures:"
    echo "trapezoid of the longest way of the axes at 20 deg/s and 40 deg/s^2, 0.1 s to settle, two polls of 50 ms, and"
    echo "(3 scans + 2 discards) x (integration time + read-out) a set; USB2000+ has no idle cycle. It is a shortened"
    echo "sweep: one incidence, 15 views 5 deg apart, with its two readings of the diffuser and its dark."
    echo "Stop orders: the time from the request at goniod's socket to the frame at the simulator's side of the wire."
} >"$report"
echo "$report" >&2
