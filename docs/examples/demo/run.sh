#!/usr/bin/env bash
# The demo: four painted samples measured on the simulated goniometer through the real drivers, fitted and plotted.
#   run.sh BUILD [OUT]      BUILD holds goniod, gonioctl and goniorender; figures and sessions go to OUT (default BUILD/demo)
set -eu
build=$(cd "$1" && pwd)
out=${2:-$build/demo}
jobs=$(cd "$(dirname "$0")" && pwd)
export GONIOD_SOCKET="${TMPDIR:-/tmp}/goniod-demo-$$.sock" GONIOD_SESSIONS="$out/sessions"

rm -rf "$out"
mkdir -p "$GONIOD_SESSIONS"
"$build/goniod" --simulate --seed 1 --socket "$GONIOD_SOCKET" --sessions "$GONIOD_SESSIONS" 2>"$out/goniod.log" &
daemon=$!
trap 'kill "$daemon" 2>/dev/null; wait "$daemon" 2>/dev/null; rm -f "$GONIOD_SOCKET.lock"' EXIT
for _ in $(seq 100); do
    [ -S "$GONIOD_SOCKET" ] && break
    kill -0 "$daemon" 2>/dev/null || { cat "$out/goniod.log" >&2; exit 1; }
    sleep 0.1
done

echo "Four campaigns on the simulated goniometer, seed 1, in virtual time:"
"$build/gonioctl" run --wait "$jobs"/{acrylic-0,paper-0,paper-60,paper-90}.yaml >"$out/sessions.txt"
mapfile -t sessions <"$out/sessions.txt"
echo
echo "Fitted, against the truth of the simulator (pull = (fitted - true) / u):"
"$build/gonioctl" compare "${sessions[@]}" | tee "$out/table.txt"
echo
echo "Figures:"
"$build/gonioctl" plot "${sessions[@]}" -o "$out/figures"
"$build/gonioctl" compare --json "${sessions[@]}" >"$out/table.json"
/usr/bin/python3 - "$out/table.json" <<'PY'
import json, sys
pulls = [(abs(p["pull"]), s["sample"], name) for s in json.load(open(sys.argv[1]))
         for name, p in s["parameters"].items()]
worst = max(pulls)
print(f"largest |pull| of {len(pulls)}: {worst[0]:.2f} ({worst[1]} {worst[2]}); above 5 would be a failure")
sys.exit(worst[0] > 5)
PY
echo
echo "The paper's Fig. 8, from these sessions:"
"$build/goniorender" render "$jobs/../scenes/fig8.yaml" -o "$out/figures/fig8.png" --report "$out/fig8.json" \
    --session "water-0=$GONIOD_SESSIONS/${sessions[1]}.gonio" \
    --session "water-60=$GONIOD_SESSIONS/${sessions[2]}.gonio" \
    --session "water-90=$GONIOD_SESSIONS/${sessions[3]}.gonio" >"$out/fig8.txt"
echo "$out/figures/fig8.png"
/usr/bin/python3 "$jobs/trends.py" "$out/figures/fig8.png"
