/* Runs a fuzz target over its stored corpus, tests/fuzz/corpus/NAME, where this program is called test_NAME:
 * what once broke it stays a test. Prints TAP, one line for each file. */
#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/file.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static int replay(const char *path) {
    char *text = NULL;
    size_t size = 0;
    struct err e = {0};
    if (file_read(path, 64 << 20, &text, &size, &e) != 0) {
        printf("# %s\n", e.text);
        return -1;
    }
    LLVMFuzzerTestOneInput((const uint8_t *)text, size);
    free(text);
    return 0;
}

int main(int argc, char **argv) {
    (void)argc;
    const char *base = strrchr(argv[0], '/');
    char folder[256], path[600];
    snprintf(folder, sizeof folder, "tests/fuzz/corpus/%s", (base ? base + 1 : argv[0]) + strlen("test_"));
    struct dirent **entry;
    int n = scandir(folder, &entry, NULL, alphasort), done = 0;
    for (int i = 0; i < n; i++) {
        if (entry[i]->d_name[0] != '.') {
            snprintf(path, sizeof path, "%s/%s", folder, entry[i]->d_name);
            int rc = replay(path); /* a crash or a sanitizer ends the process here */
            printf("%s %d - %s\n", rc == 0 ? "ok" : "not ok", ++done, path);
        }
        free(entry[i]);
    }
    if (n >= 0)
        free(entry);
    printf("1..%d\n", done);
    return done > 0 ? 0 : 1;
}
