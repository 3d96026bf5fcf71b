#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "proto/file.h"
#include "proto/profile.h"

static struct profile p;

static void load(const char *name) {
    struct err_list errors = {0};
    if (profile_load(name, &p, &errors)) {
        char text[800];
        for (size_t i = 0; i < errors.n; i++)
            print_message("# %s\n", err_format(&errors.item[i], text, sizeof text));
        fail_msg("%s was refused", name);
    }
    err_list_free(&errors);
}

/* The om-az numbers, written down again from the drive's register table. */
static void om_az_is_complete(void **state) {
    (void)state;
    load("om-az");
    assert_string_equal(p.id, "om-az");
    assert_int_equal(p.evidence, PROFILE_SOURCES_ONLY);
    assert_int_equal(profile_parities[p.link.parity], 'E');
    assert_int_equal(p.link.gap_ms, 3);
    assert_int_equal(p.reg[p.reg_position].addr, 0xCC);
    assert_int_equal(p.reg[p.reg_demand].addr, 0xC6);
    assert_int_equal(p.bit[p.bit_moving].mask, 0x2000);
    assert_int_equal(p.bit[p.bit_moving].is, 0x2000);
    assert_int_equal(p.bit_valid, -1);
    assert_int_equal(p.watchdog.drive_ms, 1000);
    assert_int_equal(p.n_done, 4);
    assert_true(p.done[0].negate && p.done[0].mask == 0x2000);
    assert_true(p.accept[1].demand && p.accept[1].reg == p.reg_demand);
    assert_true(profile_alarm_revokes(&p, 0x4A));
    assert_true(profile_alarm_needs_person(&p, 0x66));
    assert_non_null(strstr(profile_alarm_text(&p, 0x85), "watchdog"));
    assert_non_null(strstr(profile_alarm_text(&p, 0x7777), "unknown"));
    assert_int_equal(profile_raw_speed(&p), 2000);
    assert_int_equal(profile_raw_accel(&p), 4000);
    for (int i = 0; i < PROFILE_SEQS; i++)
        if (i != PROFILE_DISABLE && i != PROFILE_SET_ZERO)
            assert_true(p.seq[i].present);
    assert_int_equal(strlen(p.hash), 16);
}

static void a_move_of_om_az_is_one_frame(void **state) {
    (void)state;
    load("om-az");
    const struct profile_seq *move = &p.seq[PROFILE_MOVE_ABS];
    assert_int_equal(move->n, 2);
    assert_int_equal(move->step[0].verb, PROFILE_WAIT);
    assert_int_equal(move->step[0].condition[0].mask, 0x20);
    assert_int_equal(move->step[1].addr, 0x58);
    assert_int_equal(move->step[1].n_words, 8);
    assert_true(move->step[1].wide);
    assert_int_equal(move->step[1].word[2].variable, PROFILE_TARGET);
    assert_int_equal(move->step[1].word[7].constant, 1);
}

/* A drive of another family: halves of the target, a user unit, a ladder to enable, raw conditions. */
static const char OTHER[] =
    "id: cia402\nvendor: Some\nevidence: bench\norder: {word: lo_hi}\n"
    "link: {kind: tcp, gap_ms: 0, max_write: 20}\n"
    "scale: {steps_per_deg: 10, sign: -1, speed: {kind: rpm, factor: 3.0}, accel: {kind: ms_per_1000rpm}}\n"
    "speed_deg_s: 10\naccel_deg_s2: 20\n"
    "reg: {cw: {addr: 6000, type: u16}, stat: {addr: 5000, type: u16}, pos: {addr: 5002, type: s32}}\n"
    "status: {enabled: {reg: stat, mask: 0x006F, is: 0x0027}, inpos: {reg: stat, mask: 0x0400},\n"
    "         ack: {reg: stat, mask: 0x1000}}\n"
    "done: {all: [inpos, '!ack']}\naccept: {any: [ack, {readback: stat, mask: 0x0100}], within_ms: 200}\n"
    "seq:\n"
    "  enable: {replay: safe, steps: [{w: 6000, u16: [6], fc: 6}, {wait: {reg: stat, mask: 0x6F, is: 0x21}, "
    "ms: 500}]}\n"
    "  move_abs: {replay: unsafe, steps: [{w: 6002, u16: [$target.lo, $target.hi, $speed]}, {pulse: cw, "
    "mask: 0x10, hold_ms: 5}]}\n"
    "  stop: {replay: safe, steps: [{w: 6000, u16: [0x010F]}, {delay: 10}, {expect: {inpos: 1}}]}\n"
    "  abort: {replay: safe, steps: [{w: 6000, u16: [2]}]}\n"
    "watchdog: {drive_ms: 0}\nsettle_ms: 100\nu_repeat_deg: 0.01\nu_transmission_deg: 0.01\n";

static int read_text(const char *text, struct err_list *errors) {
    return profile_read_text("test.yaml", text, strlen(text), &p, errors);
}

static void another_family_fits_the_same_form(void **state) {
    (void)state;
    struct err_list errors = {0};
    int result = read_text(OTHER, &errors);
    if (result)
        print_message("# %s:%d: %s\n", errors.item[0].file, errors.item[0].line, errors.item[0].text);
    assert_int_equal(result, 0);
    const struct profile_step *move = p.seq[PROFILE_MOVE_ABS].step;
    assert_int_equal(move[0].word[0].half, PROFILE_LO);
    assert_int_equal(move[0].word[1].half, PROFILE_HI);
    assert_int_equal(move[1].verb, PROFILE_PULSE);
    assert_int_equal(p.seq[PROFILE_ENABLE].step[1].condition[0].is, 0x21);
    assert_int_equal(p.seq[PROFILE_ENABLE].step[0].function, 6);
    assert_int_equal(p.seq[PROFILE_STOP].step[2].verb, PROFILE_EXPECT);
    assert_int_equal(profile_raw_speed(&p), 30);
    assert_int_equal(profile_raw_accel(&p), 16667); /* 60 rpm/s: 1000 rpm after 16.667 s */
    assert_int_equal(p.bit_moving, -1);
    assert_false(p.accept[1].demand);
}

static void words_go_both_ways_in_the_drives_order(void **state) {
    (void)state;
    uint16_t words[2];
    load("om-az");
    assert_int_equal(profile_encode(&p, true, -1000, words), 2);
    assert_int_equal(words[0], 0xFFFF);
    assert_int_equal(words[1], 0xFC18);
    assert_int_equal(profile_decode(&p, PROFILE_S32, words), -1000);
    assert_true(profile_decode(&p, PROFILE_U32, words) == 0xFFFFFC18);
    assert_int_equal(profile_decode(&p, PROFILE_S16, words + 1), -1000);
    assert_int_equal(profile_decode(&p, PROFILE_U16, words), 0xFFFF);
    p.low_word_first = 1;
    profile_encode(&p, true, 0x80000001, words);
    assert_int_equal(words[0], 1);
    assert_int_equal(words[1], 0x8000);
    assert_int_equal(profile_encode(&p, false, 7, words), 1);
}

static char *replaced(const char *what, const char *by) {
    const char *at = strstr(OTHER, what);
    assert_non_null(at);
    char *text = calloc(1, sizeof OTHER + strlen(by));
    memcpy(text, OTHER, at - OTHER);
    strcat(strcat(text, by), at + strlen(what));
    return text;
}

/* Each mistake in one place of an otherwise good profile, and a word its sentence must hold. */
static void mistakes_are_named(void **state) {
    (void)state;
    static const struct {
        const char *what, *by, *word;
    } CASES[] = {
        {"reg: stat, mask: 0x0400", "reg: sta, mask: 0x0400", "no register 'sta'"},
        {"pos: {addr", "position: {addr", "reg.pos"},
        {"inpos: {reg", "in_position: {reg", "neither moving nor inpos"},
        {"all: [inpos,", "all: [inpso,", "no status bit 'inpso'"},
        {"abort: {", "set_zero: {", "seq.abort is missing"},
        {"stop: {replay: safe", "stop: {replay: unsafe", "seq.stop must be replay: safe"},
        {"max_write: 20", "max_write: 2", "max_write"},
        {"$speed]", "$sped]", "unknown value $sped"},
        {"{delay: 10}", "{delay: 10, set: cw}", "exactly one of"},
        {", hold_ms: 5", "", "pulse needs mask and hold_ms"},
        {"{delay: 10}", "{delay: 10, mask: 3}", "mask and hold_ms belong to"},
        {"{delay: 10}", "{delay: 10, fc: 6}", "fc belong to w"},
        {", hold_ms: 5", ", hold_ms: 5, soft: true", "ms and soft belong to wait"},
        {"u16: [2]}", "u16: [2], ms: 5}", "ms and soft belong to wait"},
        {"is: 0x21}, ms: 500", "is: 0x21}", "wait needs ms"},
        {"move_abs:", "move_asb:", "did you mean 'move_abs'"},
        {"speed_deg_s: 10", "speed_deg_s: 10\nmax_speed_deg_s: 5", "above max_speed_deg_s"},
        {"settle_ms: 100", "settle_ms: 100\nlimits: {low_deg: 10, high_deg: -10}", "limits.low_deg"},
        {"settle_ms: 100", "settle_ms: 100\nbacklash_deg: 0.01", "backlash_deg"},
        {"vendor: Some", "vendor: Some\nbackslash_deg: 1", "backlash_deg"},
        {"[$target.lo, $target.hi", "[$target, 0", "$target is 32 bit wide"},
        {"speed: {kind: rpm, factor: 3.0}", "speed: {kind: rpm, factor: 30000}", "does not fit into 16 bit"},
        {"speed: {kind: rpm, factor: 3.0}", "speed: {kind: rpm, factor: 1e9}", "2147483647"},
        {"kind: ms_per_1000rpm}", "kind: user, factor: 1e-6}", "accel_deg_s2 by scale.accel"},
        {"u16: [6], fc: 6", "u16: [6, 7], fc: 6", "fc: 6 writes one"},
        {"sign: -1", "sign: 0", "scale.sign"},
        {"max_write: 20", "fc_write: 10", "fc_write is 6 or 16"},
        {"any: [ack, {readback: stat, mask: 0x0100}]", "any: [{readback: stat}]", "either equals"},
    };
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        struct err_list errors = {0};
        char *text = replaced(CASES[i].what, CASES[i].by);
        assert_int_equal(read_text(text, &errors), -ERR_INPUT);
        bool named = false;
        for (size_t k = 0; k < errors.n; k++)
            named |= strstr(errors.item[k].text, CASES[i].word) != NULL;
        if (!named)
            fail_msg("'%s': no mistake says '%s', the first says '%s'", CASES[i].by, CASES[i].word,
                     errors.n ? errors.item[0].text : "nothing");
        err_list_free(&errors);
        free(text);
    }
}

static void the_hash_follows_the_text(void **state) {
    (void)state;
    struct err_list errors = {0};
    read_text(OTHER, &errors);
    char first[17];
    strcpy(first, p.hash);
    char *text = replaced("settle_ms: 100", "settle_ms: 101");
    read_text(text, &errors);
    assert_string_not_equal(first, p.hash);
    read_text(OTHER, &errors);
    assert_string_equal(first, p.hash);
    free(text);
    err_list_free(&errors);
}

static void an_unknown_profile_says_where_it_looked(void **state) {
    (void)state;
    struct err_list errors = {0};
    assert_int_equal(profile_load("om-zz", &p, &errors), -ERR_INPUT);
    assert_non_null(strstr(errors.item[0].text, PROFILE_DIR));
    err_list_free(&errors);
    memset(&errors, 0, sizeof errors);
    assert_true(profile_load("/nonexistent/x.yaml", &p, &errors) < 0);
    err_list_free(&errors);
}

/* docs/profiles.md ends with what the tables say. */
static void the_document_is_what_the_tables_say(void **state) {
    (void)state;
    char *printed, *text;
    size_t printed_size, size;
    FILE *out = open_memstream(&printed, &printed_size);
    profile_print_reference(out);
    fclose(out);
    assert_int_equal(file_read("docs/profiles.md", 1 << 20, &text, &size, NULL), 0);
    if (size < printed_size || strcmp(text + size - printed_size, printed) != 0)
        fail_msg(
            "docs/profiles.md is out of date: build/tests/unit/test_profile --print gives its last part");
    free(printed);
    free(text);
}

int main(int argc, char **argv) {
    if (argc == 2 && strcmp(argv[1], "--print") == 0) {
        profile_print_reference(stdout);
        return 0;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(om_az_is_complete),
        cmocka_unit_test(a_move_of_om_az_is_one_frame),
        cmocka_unit_test(another_family_fits_the_same_form),
        cmocka_unit_test(words_go_both_ways_in_the_drives_order),
        cmocka_unit_test(mistakes_are_named),
        cmocka_unit_test(the_hash_follows_the_text),
        cmocka_unit_test(the_document_is_what_the_tables_say),
        cmocka_unit_test(an_unknown_profile_says_where_it_looked),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
