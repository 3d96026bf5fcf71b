#!/usr/bin/env bash
# make install into an empty folder: everything has its place, nothing points at the source tree.
set -u
build=${BUILD:-build}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
number=0

check() { # name, condition as a command
    local name=$1
    shift
    number=$((number + 1))
    if "$@" >/dev/null; then echo "ok $number - $name"; else echo "not ok $number - $name"; fi
}

# MAKEFLAGS of an outer make must not reach this one; -o all: the programs are being tested as they are.
env -u MAKEFLAGS -u MAKELEVEL make -s -o all BUILD="$build" DESTDIR="$work" install >"$work/log" 2>&1
check "make install ends well" test $? = 0
sed 's/^/# /' "$work/log"
root=$work/usr/local
for file in share/goniod/profiles/om-az.yaml lib/udev/rules.d/60-goniod.rules lib/sysusers.d/goniod.conf \
    lib/systemd/system/goniod.service share/doc/goniod/LICENSE share/doc/goniod/README.md \
    share/doc/goniod/docs/protocol.md share/doc/goniod/docs/examples/job.yaml; do
    check "$file" test -s "$root/$file"
done
for program in $(cd "$build" && find . -maxdepth 1 -type f -perm -u+x -printf '%f ' 2>/dev/null); do
    check "bin/$program" test -x "$root/bin/$program"
done
# From another folder, and from where nothing but the installed files can be found.
check "the installed goniod finds its profiles" \
    env -C / "$root/bin/goniod" --simulate --check-config
check "the unit starts the installed program" grep -q '^ExecStart=/usr/local/bin/goniod ' \
    "$root/lib/systemd/system/goniod.service"
check "no placeholder is left" test "$(grep -rl '@PREFIX@' "$root" | wc -l)" = 0
if command -v systemd-analyze >/dev/null; then
    sed "s|/usr/local/bin/goniod|/bin/true|" "$root/lib/systemd/system/goniod.service" >"$work/goniod.service"
    check "systemd accepts the unit" test -z "$(systemd-analyze verify "$work/goniod.service" 2>&1 | grep goniod)"
else
    number=$((number + 1))
    echo "ok $number - systemd accepts the unit # skip systemd-analyze is not here"
fi
echo "1..$number"
