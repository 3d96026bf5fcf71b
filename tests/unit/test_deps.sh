#!/usr/bin/env bash
# .ci/deps against a machine of our own making: dpkg-query, apt-get, id and sudo are scripts that tell what was
# asked of them.
set -u
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$work/ci" "$work/bin"
cp .ci/deps "$work/ci/"
cat >"$work/ci/packages" <<'TABLE'
# a comment
gcc       | build      | compiles
libuv1-dev| build,check| serves the socket
mbpoll    | check      | a master that is not ours
TABLE
log=$work/log
cat >"$work/bin/dpkg-query" <<'FAKE'
#!/bin/sh
for p in $INSTALLED; do printf 'install ok installed\t%s\n' "$p"; done
printf 'deinstall ok config-files\tmbpoll\n'
FAKE
cat >"$work/bin/apt-get" <<'FAKE'
#!/bin/sh
echo "apt-get $*" >>"$LOG"
case "$*" in *--print-uris*) echo 'Need to get 1234 kB of archives.' ;; esac
exit 0
FAKE
printf '#!/bin/sh\necho "$FAKE_UID"\n' >"$work/bin/id"
printf '#!/bin/sh\necho sudo >>"$LOG"\nexec "$@"\n' >"$work/bin/sudo"
chmod +x "$work"/bin/*
number=0

check() { # name, condition as a command
    local name=$1
    shift
    number=$((number + 1))
    if "$@"; then echo "ok $number - $name"; else echo "not ok $number - $name"; fi
}

deps() { # installed packages, uid, arguments
    : >"$log"
    out=$(PATH="$work/bin:$PATH" INSTALLED=$1 FAKE_UID=$2 LOG=$log bash "$work/ci/deps" "${@:3}" </dev/null 2>&1)
    rc=$?
}

deps "gcc libuv1-dev" 1000 build
check "nothing missing: silent" test "$rc$out$(cat "$log")" = 0
deps "gcc" 0 build check
check "names what is missing and why" grep -q 'libuv1-dev  *serves the socket' <<<"$out"
check "a package once removed is missing" grep -q 'mbpoll' <<<"$out"
check "each is named once" test "$(grep -c libuv1-dev <<<"$out")" = 1
check "does not name what is there" test "$(grep -c gcc <<<"$out")" = 0
check "says how much it loads" grep -q 'Need to get 1234 kB' <<<"$out"
check "goes on without a terminal" grep -q 'install -y .*--no-install-recommends libuv1-dev mbpoll' "$log"
check "root needs no sudo" test "$(grep -c sudo "$log")" = 0
deps "gcc" 1000 build
check "only what was asked for" test "$(grep -c mbpoll "$log")" = 0
check "sudo where not root" grep -q sudo "$log"
echo "1..$number"
