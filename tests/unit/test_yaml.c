#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "proto/yaml_table.h"

struct part {
    char name[8];
    double size;
};

struct thing {
    char title[16];
    double factor;
    bool factor_given;
    int address, mode;
    bool on;
    double list[4];
    int n_list;
    int pair[2], n_pair;
    char word[3][6];
    int n_word;
    struct part main_part;
    struct part part[2];
    int n_part;
    double custom;
    char *notes;
};

static int read_span(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    struct thing *t = object;
    double from, to;
    if (!yaml_is_map(node) || !yaml_find(node, "from") || !yaml_find(node, "to")) {
        yaml_error(r, node, "a span is written {from: A, to: B}");
        return -ERR_INPUT;
    }
    if (yaml_read_double(r, yaml_find(node, "from"), &from) ||
        yaml_read_double(r, yaml_find(node, "to"), &to))
        return -ERR_INPUT;
    t->custom = to - from;
    return 0;
}

static int read_notes(struct yaml_reader *r, const struct yaml_node *node, void *object) {
    (void)r;
    ((struct thing *)object)->notes = yaml_node_json(node);
    return 0;
}

#define AT(field) struct thing, field
#define PART(field) struct part, field
static const char *const modes[] = {"fixed", "per_incidence", "every_geometry", NULL};
static const struct yaml_key part_keys[] = {
    YAML_TEXT("name", PART(name), .required = true),
    YAML_NUMBER("size", PART(size), 0, INFINITY, .unit = "mm", .default_text = "2.5"),
    {0}};
static const struct yaml_key keys[] = {
    YAML_TEXT("title", AT(title), .required = true, .doc = "what it is called"),
    YAML_NUMBER("factor", AT(factor), -1, 1, YAML_SETS(AT(factor_given)), .default_text = "0.25"),
    YAML_INTEGER("address", AT(address), 0, 65535),
    YAML_WORD("mode", AT(mode), modes),
    YAML_FLAG("on", AT(on)),
    YAML_NUMBERS("list", AT(list), AT(n_list), 0, 100),
    YAML_INTEGERS("pair", AT(pair), AT(n_pair), 0, 0, .minimum = 2, .default_text = "[400, 700]"),
    YAML_TEXTS("words", AT(word), AT(n_word)),
    YAML_PART("main", part_keys, .offset = offsetof(struct thing, main_part)),
    YAML_PARTS("parts", AT(part), AT(n_part), part_keys),
    YAML_OWN("span", read_span),
    YAML_OWN("notes", read_notes),
    {0}};

static int read_thing(const char *text, struct thing *t, struct err_list *errors) {
    memset(t, 0, sizeof *t);
    return yaml_read_text("t.yaml", text, strlen(text), keys, t, errors);
}

static void expect_error(const char *text, int line, int column, const char *part) {
    struct thing t;
    struct err_list errors = {0};
    assert_int_equal(read_thing(text, &t, &errors), -ERR_INPUT);
    if (errors.n != 1 || errors.item[0].line != line || errors.item[0].column != column ||
        !strstr(errors.item[0].text, part))
        for (size_t i = 0; i < errors.n; i++)
            print_error("%d:%d: %s\n", errors.item[i].line, errors.item[i].column, errors.item[i].text);
    assert_int_equal(errors.n, 1);
    assert_int_equal(errors.item[0].line, line);
    assert_int_equal(errors.item[0].column, column);
    assert_non_null(strstr(errors.item[0].text, part));
    err_list_free(&errors);
    free(t.notes);
}

static void block_and_flow_give_the_same(void **state) {
    (void)state;
    const char *forms[] = {
        "title: lamp\naddress: 0x007C\nmode: every_geometry\non: true\nlist:\n  - 1\n  - 2.5e1\n"
        "words: [ab, \"c d\"]\nmain:\n  name: x\nparts:\n  - name: p\n    size: 4\n  - {name: q}\n"
        "span:\n  from: 1\n  to: 3\nnotes:\n  applicator: 100 um\n  n: 3\n",
        "{title: lamp, address: 124, mode: every_geometry, on: true, list: [1, 25],\n words: [ab, 'c d'], "
        "main: {name: x},\n parts: [{name: p, size: 4}, {name: q}], span: {from: 1, to: 3},\n"
        " notes: {applicator: 100 um, n: 3}}\n",
        "\xEF\xBB\xBFtitle: lamp\r\naddress: +124\r\nmode: every_geometry\r\non: true\r\nlist: [1, 25.]\r\n"
        "words: [ab, c d]\r\nmain: {name: x}\r\nparts: [{name: p, size: 4}, {name: q}]\r\n"
        "span: {from: 1, to: 3}\r\nnotes: {applicator: 100 um, n: 3}   # why\r\n",
    };
    for (size_t i = 0; i < sizeof forms / sizeof *forms; i++) {
        struct thing t;
        struct err_list errors = {0};
        int rc = read_thing(forms[i], &t, &errors);
        for (size_t k = 0; k < errors.n; k++)
            print_error("form %zu %d:%d: %s\n", i, errors.item[k].line, errors.item[k].column,
                        errors.item[k].text);
        assert_int_equal(rc, 0);
        assert_string_equal(t.title, "lamp");
        assert_int_equal(t.address, 124);
        assert_int_equal(t.mode, 2);
        assert_true(t.on);
        assert_int_equal(t.n_list, 2);
        assert_true(t.list[0] == 1 && t.list[1] == 25);
        assert_int_equal(t.n_word, 2);
        assert_string_equal(t.word[1], "c d");
        assert_int_equal(t.n_part, 2);
        assert_true(t.part[0].size == 4 && t.part[1].size == 2.5 && t.main_part.size == 2.5);
        assert_true(t.factor == 0.25 && !t.factor_given);
        assert_true(t.n_pair == 2 && t.pair[1] == 700);
        assert_true(t.custom == 2);
        assert_string_equal(t.notes, "{\"applicator\": \"100 um\", \"n\": 3}");
        free(t.notes);
    }
}

static void every_mistake_in_one_pass(void **state) {
    (void)state;
    static const struct {
        int line, column;
        const char *part;
    } expected[] = {
        {1, 1, "'title' is missing: what it is called"},
        {1, 9, "factor is 1.5; it must be from -1 to 1"},
        {2, 1, "unknown key 'adress'; did you mean 'address'?"},
        {3, 7, "did you mean 'every_geometry'?"},
        {4, 5, "on must be true or false, not 'yes'"},
        {5, 11, "list[1] must be a number, not 'two'"},
        {5, 16, "list[2] is 101; it must be from 0 to 100"},
        {6, 7, "pair has 1 items; it must have from 2 to 2"},
        {7, 9, "words[0] is 6 bytes long; at most 5 fit"},
        {8, 1, "main must be a mapping (key: value), not nothing"},
        {9, 1, "the key 'factor' stands here a second time; it was first given in line 1"},
        {11, 5, "the key 'parts[0].name' is missing"},
        {11, 11, "parts[0].size is -3; it must be at least 0 mm"},
        {12, 8, "a span is written"},
    };
    struct thing t;
    struct err_list errors = {0};
    assert_int_equal(
        read_thing("factor: 1.5\nadress: 5\nmode: evry_geometry\non: yes\nlist: [1, two, 101]\n"
                   "pair: [1]\nwords: [abcdef]\nmain: \nfactor: 2\nparts:\n  - size: -3\nspan:  {}\n",
                   &t, &errors),
        -ERR_INPUT);
    for (size_t i = 0; i < errors.n; i++) {
        if (errors.n == 14 && errors.item[i].line == expected[i].line &&
            errors.item[i].column == expected[i].column && strstr(errors.item[i].text, expected[i].part))
            continue;
        print_error("%zu: %d:%d: %s\n", i, errors.item[i].line, errors.item[i].column, errors.item[i].text);
        fail();
    }
    assert_int_equal(errors.n, 14);
    assert_string_equal(errors.item[0].file, "t.yaml");
    err_list_free(&errors);
}

static void wrong_types_are_named(void **state) {
    (void)state;
    expect_error("title: [a]\n", 1, 8, "title must be text, not a list");
    expect_error("title: ''\n", 1, 8, "title must not be empty");
    expect_error("title: t\nfactor: '0.5'\n", 2, 9, "the quoted text '0.5' (leave the quotes out)");
    expect_error("title: t\nfactor: .nan\n", 2, 9, "must be a number");
    expect_error("title: t\nfactor: 0,5\n", 2, 9, "must be a number");
    expect_error("title: t\naddress: 1.5\n", 2, 10, "must be a whole number");
    expect_error("title: t\naddress: 0x1FFFF\n", 2, 10, "from 0 to 65535");
    expect_error("title: t\naddress: 99999999999999999999\n", 2, 10, "must be a whole number");
    expect_error("title: t\nlist: 5\n", 2, 7, "must be a list of numbers");
    expect_error("title: t\nparts: [5]\n", 2, 9, "parts[0] must be a mapping");
    expect_error("title: t\nzzz: 5\n", 2, 1, "known here: title, factor");
    expect_error("title: t\nspan: {from: a, to: 2}\n", 2, 14, "span must be a number, not 'a'");
    expect_error("just words\n", 1, 1, "the file must be a mapping");
}

static void what_is_no_yaml_gets_one_sentence(void **state) {
    (void)state;
    expect_error("", 0, 0, "the file is empty");
    expect_error("# only a comment\n", 0, 0, "the file is empty");
    expect_error("title: [1, 2\n", 2, 1, "this is no YAML");
    expect_error("title: a\n\tfactor: 1\n", 2, 1, "a tab indents this line");
    expect_error("main:\n  name: a\n  \tb: [\n", 3, 3, "a tab indents this line");
    expect_error("title: &a x\n", 1, 9, "anchors");
    expect_error("title: x\nmode: *a\n", 2, 8, "aliases");
    expect_error("title: !!str x\n", 1, 8, "tags");
    expect_error("title: x\n---\ntitle: y\n", 2, 1, "second document");
    expect_error("? [a, b]\n: 1\n", 1, 3, "a key must be a plain word");
    expect_error("title: \"a\\0b\"\n", 1, 9, "NUL");
    expect_error("title: caf\xE9\n", 1, 11, "0xE9");
    expect_error("title: a\nfactor: \x01\n", 2, 9, "0x01");
}

static void nothing_reaches_stderr(void **state) {
    (void)state;
    char path[] = "/tmp/test_yaml_XXXXXX";
    int saved = dup(2), fd = mkstemp(path);
    dup2(fd, 2);
    struct thing t;
    struct err_list errors = {0};
    read_thing("a: [1, 2\nb: }", &t, &errors);
    dup2(saved, 2);
    struct stat st;
    fstat(fd, &st);
    unlink(path);
    close(fd);
    close(saved);
    assert_int_equal(st.st_size, 0);
    assert_int_equal(errors.n, 1);
    err_list_free(&errors);
}

static double seconds_since(const struct timespec *start) {
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now); /* the machine may be busy with other tests */
    return (double)(now.tv_sec - start->tv_sec) + 1e-9 * (double)(now.tv_nsec - start->tv_nsec);
}

#ifdef __SANITIZE_ADDRESS__
#define LIMIT_S 10
#else
#define LIMIT_S 2
#endif

/* Each text is as large as the reader takes; each must be answered quickly and shortly. */
static void hostile_texts_end_soon(void **state) {
    (void)state;
    const char *pieces[] = {"[",     "{a: ",       "a: 1\n",      "- ",   "- - - ", "? ",           "x",
                            "\"",    "'a' ",       ": ",          "# c ", "[[],",   "a\n",          "{",
                            "a: b ", "- {a: 1}\n", "list: [1]\n", "!a ",  "&a *a ", "title: a\n\n", "|\n "};
    struct timespec start;
    char *text = malloc(YAML_BYTES_MAX + 1);
    for (size_t i = 0; i < sizeof pieces / sizeof *pieces; i++) {
        size_t size = 0, step = strlen(pieces[i]);
        for (; size + step <= YAML_BYTES_MAX; size += step)
            memcpy(text + size, pieces[i], step);
        struct thing t = {0};
        struct err_list errors = {0};
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &start);
        assert_int_equal(yaml_read_text("t.yaml", text, size, keys, &t, &errors), -ERR_INPUT);
        double took = seconds_since(&start);
        if (took > LIMIT_S)
            print_error("'%s' repeated took %.1f s\n", pieces[i], took);
        assert_true(took < LIMIT_S);
        assert_in_range(errors.n, 1, ERR_LIST_OF_FILE);
        err_list_free(&errors);
        free(t.notes);
    }
    free(text);
}

static void files_that_are_none(void **state) {
    (void)state;
    struct thing t = {0};
    struct err_list errors = {0};
    assert_int_equal(yaml_read_file("/tmp", keys, &t, &errors), -ERR_INPUT);
    assert_non_null(strstr(errors.item[0].text, "this is a directory"));
    assert_int_equal(yaml_read_file("/nonexistent.yaml", keys, &t, &errors), -ERR_IO);
    assert_non_null(strstr(errors.item[1].text, "No such file"));
    assert_int_equal(yaml_read_file("/dev/zero", keys, &t, &errors), -ERR_INPUT);
    char path[] = "/tmp/test_yaml_XXXXXX";
    int fd = mkstemp(path);
    char block[4096];
    uint32_t noise = 1;
    for (size_t i = 0; i < sizeof block; i++)
        block[i] = (char)((noise = noise * 1664525u + 1013904223u) >> 24);
    for (int i = 0; i < 10 * 256; i++)
        assert_int_equal(write(fd, block, sizeof block), sizeof block);
    close(fd);
    assert_int_equal(yaml_read_file(path, keys, &t, &errors), -ERR_INPUT);
    assert_non_null(strstr(errors.item[3].text, "longer than 1048576 bytes"));
    unlink(path);
    assert_int_equal(errors.n, 4);
    err_list_free(&errors);
}

static void places_of_what_was_written(void **state) {
    (void)state;
    struct thing t = {0};
    struct err_list errors = {0};
    struct yaml_places places = {0};
    const char *text = "title: x\nlist: [1,\n  7]\nparts:\n  - name: p\n    size: 4\n";
    assert_int_equal(yaml_read_text_places("t.yaml", text, strlen(text), keys, &t, &errors, &places), 0);
    const struct yaml_place *place = yaml_place_find(&places, "parts[0].size");
    assert_non_null(place);
    assert_true(place->line == 6 && place->column == 5);
    place = yaml_place_find(&places, "list[1]");
    assert_non_null(place);
    assert_true(place->line == 3 && place->column == 3);
    assert_null(yaml_place_find(&places, "factor"));
    yaml_places_free(&places);
}

static void the_nearest_name(void **state) {
    (void)state;
    const char *const names[] = {"holder", "paint", "size_mm", "zz", NULL};
    assert_string_equal(yaml_nearest("hodler", names), "holder");
    assert_string_equal(yaml_nearest("size", (const char *const[]){"sizes", NULL}), "sizes");
    assert_null(yaml_nearest("support", names));
    assert_null(yaml_nearest("za", names));
    assert_null(yaml_nearest("", names));
}

static void the_reference_names_every_key(void **state) {
    (void)state;
    char *text = NULL;
    size_t size = 0;
    FILE *out = open_memstream(&text, &size);
    yaml_print_reference(out, "thing", keys);
    fclose(out);
    assert_non_null(strstr(text, "| `title` | text |  | required | what it is called |"));
    assert_non_null(strstr(text, "| `parts[].size` | number | at least 0 mm | `2.5` |"));
    assert_non_null(strstr(text, "one of `fixed`, `per_incidence`, `every_geometry`"));
    free(text);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(block_and_flow_give_the_same),
        cmocka_unit_test(every_mistake_in_one_pass),
        cmocka_unit_test(wrong_types_are_named),
        cmocka_unit_test(what_is_no_yaml_gets_one_sentence),
        cmocka_unit_test(nothing_reaches_stderr),
        cmocka_unit_test(hostile_texts_end_soon),
        cmocka_unit_test(files_that_are_none),
        cmocka_unit_test(places_of_what_was_written),
        cmocka_unit_test(the_nearest_name),
        cmocka_unit_test(the_reference_names_every_key),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
