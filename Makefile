# goniod: see README.md for the two commands that matter, `make demo` and `make check`.
# `make` builds and installs nothing; `make deps` names and installs the packages that are missing.
#
#   make                      the programs, in build/
#   make check                every test; closes with "N passed, N failed, N skipped"
#   make lint                 layout, mistakes, sizes, who includes whom
#   make asan                 every test under AddressSanitizer and UBSan, in build/asan
#   make crash N=200          goniod killed N times at random moments and N times in a write, and resumed
#   make bench                the figures, into docs/bench-report.md, docs/fit-report.md and docs/render-report.md
#   make bench-fit            docs/fit-report.md alone
#   make fuzz FUZZ_S=60       each fuzz target for so many seconds; FUZZ=yaml runs one
#   make pulls SEEDS=500      the demo's campaigns over many seeds: pulls of the estimates against the truth, and how
#                             many stated intervals hold it; LOG=FILE: a run that was cut goes on where it stood
#   make measured SEEDS=20    a measured surface over many seeds, with the draws of certificate and zeros in
#   make spread N=10000       so many fits of each published set: spread over the Cramer-Rao bound, bias, coverage
#   make install DESTDIR= PREFIX=/usr/local

VERSION := 0.1.0
BUILD ?= build
SANITIZE ?=
PREFIX ?= /usr/local
DESTDIR ?=
FUZZ_S ?= 60
N ?= 200
JOBS ?= $(shell nproc)
FOLDERS := proto drivers fit fit/render sim daemon
C_LIBS := libmodbus libusb-1.0 libusbredirparser-0.5 sqlite3 libuv jansson libfyaml

# -ffp-contract=off: a result must not depend on whether the compiler fuses a multiply with an add.
COMMON_FLAGS := -O2 -g -Wall -Wextra -Werror -ffp-contract=off -MMD -MP -I. -D_GNU_SOURCE \
                -DGONIOD_VERSION='"$(VERSION)"' -DPROFILE_DIR='"$(PREFIX)/share/goniod/profiles"' $(SANITIZE)
# Asked once, and only when something is compiled: `make deps` runs where there is no pkg-config yet.
PKG_CFLAGS = $(eval PKG_CFLAGS := $(shell pkg-config --cflags $(C_LIBS)))$(PKG_CFLAGS)
PKG_LIBS = $(eval PKG_LIBS := $(shell pkg-config --libs $(C_LIBS)))$(PKG_LIBS)
CFLAGS_ALL = -std=gnu17 $(COMMON_FLAGS) $(PKG_CFLAGS) $(CFLAGS)
CXXFLAGS_ALL = -std=c++17 $(COMMON_FLAGS) -isystem /usr/include/eigen3 $(CXXFLAGS)
LINK_LIBS = -Wl,--as-needed $(PKG_LIBS) -lm -pthread
CERES_LIBS = -lceres -lglog
RENDER_LIBS = -lpng -ltiff -llcms2 -lOpenEXRCore

objects = $(patsubst %,$(BUILD)/%.o,$(basename $(filter-out %_main.c %_main.cc,$(wildcard $(1)/*.c $(1)/*.cc))))
LIBRARIES := $(foreach f,$(FOLDERS),$(BUILD)/lib$(f).a)
# Archives twice: daemon <- drivers <- proto is acyclic, but a test may name only the outermost.
ARCHIVES = $(BUILD)/libdaemon.a $(BUILD)/libsim.a $(BUILD)/libfit/render.a $(BUILD)/libfit.a $(BUILD)/libdrivers.a $(BUILD)/libproto.a
MAINS := $(wildcard daemon/*_main.c sim/*_main.c fit/*_main.c fit/render/*_main.c)
PROGRAMS := $(patsubst %_main.c,$(BUILD)/%,$(notdir $(MAINS)))
TESTS := $(patsubst %.c,$(BUILD)/%,$(wildcard tests/unit/test_*.c tests/scenario/test_*.c tests/wire/test_*.c \
                                              tests/replay/test_*.c tests/crash/test_*.c))

all: $(PROGRAMS)

define archive
$(BUILD)/lib$(1).a: $(call objects,$(1))
	@mkdir -p $$(@D)
	@rm -f $$@
	@$$(AR) rcs $$@ $$^
endef
$(foreach f,$(FOLDERS),$(eval $(call archive,$(f))))

$(BUILD)/%.o: %.c
	@mkdir -p $(@D)
	@echo "  CC  $<"
	@$(CC) $(CFLAGS_ALL) -c $< -o $@

# Loops to be turned into vectors: no value depends on these (sqrt sets no errno, no trap is taken).
$(BUILD)/fit/reflectance_wide.o $(BUILD)/fit/products.o $(BUILD)/fit/render/path_carry.o: CFLAGS_ALL += -O3 -fno-math-errno -fno-trapping-math

$(BUILD)/%.o: %.cc
	@mkdir -p $(@D)
	@echo "  CXX $<"
	@$(CXX) $(CXXFLAGS_ALL) -c $< -o $@

# Only goniofit links Ceres: some bad input ends a process that holds it. Only goniorender writes pictures.
define program
$(BUILD)/$(patsubst %_main,%,$(notdir $(basename $(1)))): $(BUILD)/$(basename $(1)).o $(LIBRARIES)
	@echo "  LD  $$@"
	@$(if $(filter fit/goniofit%,$(1)),$$(CXX),$$(CC)) $$(SANITIZE) -o $$@ $$< $$(ARCHIVES) $$(LINK_LIBS) \
	    $(if $(filter fit/goniofit%,$(1)),$$(CERES_LIBS)) $(if $(filter fit/render/%,$(1)),$$(RENDER_LIBS))
endef
$(foreach m,$(MAINS),$(eval $(call program,$(m))))

TEST_SUPPORT := $(patsubst %,$(BUILD)/%.o,$(basename $(wildcard tests/support/*.c tests/support/*.cc)))
$(BUILD)/tests/%: $(BUILD)/tests/%.o $(TEST_SUPPORT) $(LIBRARIES)
	@echo "  LD  $@"
	@$(CXX) $(SANITIZE) -o $@ $< $(TEST_SUPPORT) $(ARCHIVES) -Wl,--as-needed -lcmocka -lmpfr $(LINK_LIBS) $(CERES_LIBS) $(RENDER_LIBS)

# Each fuzz target replays its corpus as one more test; `make fuzz` builds it with libFuzzer instead.
FUZZERS := $(patsubst tests/fuzz/fuzz_%.c,%,$(wildcard tests/fuzz/fuzz_*.c))
REPLAYS := $(FUZZERS:%=$(BUILD)/tests/fuzz/test_%)
$(BUILD)/tests/fuzz/test_%: $(BUILD)/tests/fuzz/fuzz_%.o $(BUILD)/tests/fuzz/replay.o $(LIBRARIES)
	@echo "  LD  $@"
	@$(CC) $(SANITIZE) -o $@ $(filter %.o,$^) $(ARCHIVES) $(LINK_LIBS) $(RENDER_LIBS)

# Small libraries that a test preloads into a program of ours.
PRELOADS := $(patsubst %.c,$(BUILD)/%.so,$(wildcard tests/preload/*.c))
$(BUILD)/tests/preload/%.so: tests/preload/%.c
	@mkdir -p $(@D)
	@echo "  SO  $@"
	@$(CC) -std=gnu17 $(COMMON_FLAGS) $(CFLAGS) -shared -fPIC -o $@ $< -ldl

# Shows goniod a USB device that is not there; its test skips where umockdev is missing, and under a sanitizer, whose
# run-time library would have to be loaded before umockdev's.
BRIDGES := $(if $(SANITIZE),,$(if $(shell pkg-config --exists umockdev-1.0 2>/dev/null && command -v umockdev-wrapper),$(BUILD)/tests/bridge/usb_bridge))
$(BUILD)/tests/bridge/usb_bridge: tests/bridge/usb_bridge.c $(LIBRARIES)
	@mkdir -p $(@D)
	@echo "  LD  $@"
	@$(CC) $(CFLAGS_ALL) $(shell pkg-config --cflags umockdev-1.0) -o $@ $< $(ARCHIVES) $(LINK_LIBS) \
	    $(shell pkg-config --libs umockdev-1.0)

tests: $(PROGRAMS) $(TESTS) $(REPLAYS) $(PRELOADS) $(BRIDGES)

# Figures that a machine under load would falsify: no part of check.
BENCHES := $(patsubst %.c,$(BUILD)/%,$(wildcard tests/bench/bench_*.c))
PEERS := $(BUILD)/tests/bench/fit_peers
bench:
	@.ci/deps build check bench
	@$(MAKE) --no-print-directory -j$(JOBS) all $(BENCHES) $(PRELOADS) $(PEERS)
	@bash tests/bench/run.sh $(BUILD) docs/bench-report.md
	@$(BUILD)/goniorender bench -o docs/render-report.md --csv docs/render-error.csv --plot docs/images/render-error.svg
	@$(BUILD)/goniofit bench -o docs

# The error-against-run-time report alone.
bench-fit:
	@.ci/deps build bench
	@$(MAKE) --no-print-directory -j$(JOBS) $(BUILD)/goniofit $(PEERS)
	@$(BUILD)/goniofit bench -o docs

$(PEERS).o: CFLAGS_ALL += $(shell pkg-config --cflags cminpack) -DCMINPACK_VERSION='"$(shell pkg-config --modversion cminpack)"'
$(PEERS): $(PEERS).o $(BUILD)/libfit.a $(BUILD)/libproto.a
	@echo "  LD  $@"
	@$(CC) $(SANITIZE) -o $@ $^ -lcminpack -lgsl -lgslcblas $(LINK_LIBS)

# Two calls of make: the libraries may only have come with the packages.
check:
	@.ci/deps build check
	@$(MAKE) --no-print-directory -j$(JOBS) tests
	@BUILD=$(BUILD) /usr/bin/python3 tests/run.py $(BUILD)

deps:
	@.ci/deps build check demo lint fuzz

lint:
	@.ci/deps build check lint
	@.ci/lint

asan:
	@.ci/deps build check
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=build/asan \
	    SANITIZE="-fsanitize=address,undefined -fno-sanitize-recover=all" tests
	@LSAN_OPTIONS=suppressions=$(CURDIR)/.ci/leaks:print_suppressions=0 BUILD=build/asan \
	    /usr/bin/python3 tests/run.py build/asan

crash:
	@.ci/deps build check
	@$(MAKE) --no-print-directory -j$(JOBS) tests
	@$(BUILD)/tests/crash/test_session_kill
	@$(BUILD)/tests/crash/test_campaign_kill
	@KILLS=$(N) BUILD=$(BUILD) /usr/bin/python3 tests/crash/test_goniod_kill.py

fuzz:
	@.ci/deps build fuzz
	@$(MAKE) --no-print-directory -j$(JOBS) BUILD=build/fuzz CC=clang CXX=clang++ CFLAGS=-Wno-error \
	    SANITIZE="-fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=all" fuzzers
	@.ci/fuzz $(FUZZ_S) $(or $(FUZZ),$(FUZZERS))

# Without Ceres (of libfit only the readers are linked): a target that needed it would measure Ceres.
FUZZ_ARCHIVES := $(BUILD)/libdaemon.a $(BUILD)/libfit/render.a $(BUILD)/libfit.a $(BUILD)/libdrivers.a $(BUILD)/libproto.a
fuzzers: $(FUZZERS:%=$(BUILD)/tests/fuzz/fuzz_%)
$(BUILD)/tests/fuzz/fuzz_%: $(BUILD)/tests/fuzz/fuzz_%.o $(FUZZ_ARCHIVES)
	@echo "  LD  $@"
	@clang $(SANITIZE) -fsanitize=fuzzer -o $@ $< $(FUZZ_ARCHIVES) $(LINK_LIBS) $(RENDER_LIBS)

# The installed programs look for profiles under PREFIX, so another PREFIX compiles that file again.
$(BUILD)/prefix: FORCE
	@mkdir -p $(@D)
	@echo '$(PREFIX)' | cmp -s - $@ || echo '$(PREFIX)' > $@
$(BUILD)/proto/profile.o $(BUILD)/tests/unit/test_profile.o: $(BUILD)/prefix

install: all
	install -d $(DESTDIR)$(PREFIX)/bin $(DESTDIR)$(PREFIX)/share/goniod/profiles $(DESTDIR)$(PREFIX)/share/doc/goniod
	install -d $(DESTDIR)$(PREFIX)/lib/udev/rules.d $(DESTDIR)$(PREFIX)/lib/systemd/system \
	    $(DESTDIR)$(PREFIX)/lib/sysusers.d
	set -e; for p in $(PROGRAMS); do install -m 755 $$p $(DESTDIR)$(PREFIX)/bin; done
	install -m 644 drivers/profiles/*.yaml $(DESTDIR)$(PREFIX)/share/goniod/profiles
	install -m 644 drivers/60-goniod.rules $(DESTDIR)$(PREFIX)/lib/udev/rules.d
	sed 's|@PREFIX@|$(PREFIX)|' daemon/goniod.service > $(DESTDIR)$(PREFIX)/lib/systemd/system/goniod.service
	install -m 644 daemon/goniod.sysusers $(DESTDIR)$(PREFIX)/lib/sysusers.d/goniod.conf
	install -m 644 LICENSE README.md $(DESTDIR)$(PREFIX)/share/doc/goniod
	cp -r docs $(DESTDIR)$(PREFIX)/share/doc/goniod

# Hooker's Green on board and paper, measured in virtual time.
demo:
	@.ci/deps build demo
	@$(MAKE) --no-print-directory -j$(JOBS) all
	@bash docs/examples/demo/run.sh $(BUILD)

# Judged as measurement.md 11 says; one seed again: FIRST=SEED SEEDS=1; also COMMON=with or without (both by default),
# MODE=fixed, FILLING=beam-in-view.
pulls: $(BUILD)/tests/scenario/test_pulls all
	@SEEDS=$(or $(SEEDS),500) FIRST=$(or $(FIRST),1) WORKERS=$(JOBS) CMOCKA_MESSAGE_OUTPUT=TAP $<

# Of reflection-model.md 4.3 c; 10,000 fits judge the figures themselves, fewer with room for their scatter.
spread: $(BUILD)/tests/unit/test_spread
	@SPREAD_FITS=$(if $(filter command line,$(origin N)),$(N),10000) CMOCKA_MESSAGE_OUTPUT=TAP $<

measured: $(BUILD)/tests/scenario/test_measured_surface all
	@SEEDS=$(or $(SEEDS),20) FIRST=$(or $(FIRST),1) DRAWS=1 $<

clean:
	rm -rf $(BUILD)

FORCE:
.PHONY: all bench bench-fit tests fuzzers check deps lint asan crash fuzz install demo pulls measured spread clean FORCE
.SECONDARY:
-include $(shell find $(BUILD) -name '*.d' 2>/dev/null)
