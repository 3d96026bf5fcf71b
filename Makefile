# goniod: see README.md for the two commands that matter, `make demo` and `make check`.
# `make` builds and installs nothing; `make deps` names and installs the packages that are missing.

VERSION := 0.1.0
BUILD ?= build
SANITIZE ?=
CC ?= gcc
CXX ?= g++
FOLDERS := proto drivers fit sim daemon
C_LIBS := libmodbus libusb-1.0 libusbredirparser-0.5 sqlite3 libuv jansson libfyaml

# -ffp-contract=off: a result must not depend on whether the compiler fuses a multiply with an add.
COMMON := -O2 -g -Wall -Wextra -Werror -ffp-contract=off -MMD -MP -I. -D_GNU_SOURCE \
          -DGONIOD_VERSION='"$(VERSION)"' $(SANITIZE)
CFLAGS_ALL = -std=gnu17 $(COMMON) $(shell pkg-config --cflags $(C_LIBS)) $(CFLAGS)
CXXFLAGS_ALL = -std=c++17 $(COMMON) -isystem /usr/include/eigen3 $(CXXFLAGS)
LINK_LIBS = -Wl,--as-needed $(shell pkg-config --libs $(C_LIBS)) -lm -pthread
CERES_LIBS = -lceres -lglog

objects = $(patsubst %,$(BUILD)/%.o,$(basename $(filter-out %_main.c %_main.cc,$(wildcard $(1)/*.c $(1)/*.cc))))
LIBRARIES := $(foreach f,$(FOLDERS),$(BUILD)/lib$(f).a)
# Archives twice: daemon <- drivers <- proto is acyclic, but a test may name only the outermost.
ARCHIVES = $(BUILD)/libdaemon.a $(BUILD)/libsim.a $(BUILD)/libfit.a $(BUILD)/libdrivers.a $(BUILD)/libproto.a
MAINS := $(wildcard daemon/*_main.c sim/*_main.c fit/*_main.c)
PROGRAMS := $(patsubst %_main.c,$(BUILD)/%,$(notdir $(MAINS)))
TESTS := $(patsubst %.c,$(BUILD)/%,$(wildcard tests/unit/test_*.c tests/scenario/test_*.c tests/wire/test_*.c \
                                              tests/replay/test_*.c tests/crash/test_*.c))

all: $(PROGRAMS)

define archive
$(BUILD)/lib$(1).a: $(call objects,$(1))
	@rm -f $$@
	@$$(AR) rcs $$@ $$^
endef
$(foreach f,$(FOLDERS),$(eval $(call archive,$(f))))

$(BUILD)/%.o: %.c
	@mkdir -p $(@D)
	@echo "  CC  $<"
	@$(CC) $(CFLAGS_ALL) -c $< -o $@

$(BUILD)/%.o: %.cc
	@mkdir -p $(@D)
	@echo "  CXX $<"
	@$(CXX) $(CXXFLAGS_ALL) -c $< -o $@

# Only goniofit links Ceres: some bad input ends a process that holds it.
define program
$(BUILD)/$(patsubst %_main,%,$(notdir $(basename $(1)))): $(BUILD)/$(basename $(1)).o $(LIBRARIES)
	@echo "  LD  $$@"
	@$(if $(filter fit/%,$(1)),$$(CXX),$$(CC)) $$(SANITIZE) -o $$@ $$< $$(ARCHIVES) $$(LINK_LIBS) $(if $(filter fit/%,$(1)),$$(CERES_LIBS))
endef
$(foreach m,$(MAINS),$(eval $(call program,$(m))))

TEST_SUPPORT := $(patsubst %.c,$(BUILD)/%.o,$(wildcard tests/support/*.c))
$(BUILD)/tests/%: $(BUILD)/tests/%.o $(TEST_SUPPORT) $(LIBRARIES)
	@echo "  LD  $@"
	@$(CXX) $(SANITIZE) -o $@ $< $(TEST_SUPPORT) $(ARCHIVES) -Wl,--as-needed -lcmocka -lmpfr $(LINK_LIBS) $(CERES_LIBS)

tests: $(PROGRAMS) $(TESTS)

check: tests
	@BUILD=$(BUILD) /usr/bin/python3 tests/run.py $(BUILD)

clean:
	rm -rf $(BUILD)

.PHONY: all tests check clean
.SECONDARY:
-include $(shell find $(BUILD) -name '*.d' 2>/dev/null)
