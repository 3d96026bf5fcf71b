/* The table states x commands of docs/protocol.md is campaign_table, printed. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/campaign_table.h"
#include "proto/file.h"

#define DOCUMENT "docs/protocol.md"
#define BEGIN "<!-- table: build/tests/unit/test_protocol_table --write -->\n"
#define END "<!-- end of table -->\n"

/* Number of a sentence, counted from 1 in the order in which the table first says it. */
static int number_of(const char *why, const char **sentence, int *n) {
    for (int i = 0; i < *n; i++)
        if (strcmp(sentence[i], why) == 0)
            return i + 1;
    sentence[(*n)++] = why;
    return *n;
}

static void print_table(FILE *out) {
    const char *sentence[CAMPAIGN_STATES * COMMANDS];
    int n = 0;
    fprintf(out, "\n| state |");
    for (int c = 0; c < COMMANDS; c++)
        fprintf(out, " %s |", campaign_command_name(c));
    fprintf(out, "\n|---|");
    for (int c = 0; c < COMMANDS; c++)
        fprintf(out, "---|");
    for (int s = 0; s < CAMPAIGN_STATES; s++) {
        fprintf(out, "\n| `%s` |", campaign_state_name(s));
        for (int c = 0; c < COMMANDS; c++) {
            const struct campaign_rule *r = &campaign_table[s][c];
            if (r->allowed)
                fprintf(out, " %s |", campaign_state_name(r->next));
            else
                fprintf(out, " (%d) |", number_of(r->why, sentence, &n));
        }
    }
    fprintf(out, "\n\n");
    for (int i = 0; i < n; i++)
        fprintf(out, "%d. %s\n", i + 1, sentence[i]);
    fprintf(out, "\n");
}

static char *printed_table(void) {
    char *text;
    size_t size;
    FILE *out = open_memstream(&text, &size);
    print_table(out);
    fclose(out);
    return text;
}

/* The document in three parts: up to and with BEGIN, the table, from END on. */
static char *document(char **table, char **rest) {
    char *text, *begin, *end;
    size_t size;
    assert_int_equal(file_read(DOCUMENT, 1 << 20, &text, &size, NULL), 0);
    assert_non_null(begin = strstr(text, BEGIN));
    assert_non_null(end = strstr(begin, END));
    *table = begin + strlen(BEGIN);
    *rest = end;
    return text;
}

static void the_document_shows_the_table(void **state) {
    (void)state;
    char *table, *rest, *text = document(&table, &rest), *printed = printed_table();
    if ((size_t)(rest - table) != strlen(printed) || strncmp(table, printed, strlen(printed)) != 0)
        fail_msg("%s is out of date: build/tests/unit/test_protocol_table --write", DOCUMENT);
    free(printed);
    free(text);
}

static int write_table(void) {
    char *table, *rest, *text = document(&table, &rest), *printed = printed_table();
    FILE *out = fopen(DOCUMENT, "w");
    if (!out)
        return 1;
    fprintf(out, "%.*s%s%s", (int)(table - text), text, printed, rest);
    free(printed);
    free(text);
    return fclose(out) != 0;
}

int main(int argc, char **argv) {
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_document_shows_the_table)};
    if (argc > 1 && strcmp(argv[1], "--write") == 0)
        return write_table();
    return cmocka_run_group_tests(tests, NULL, NULL);
}
