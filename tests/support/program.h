/*
 * program.h — runs the programs of the build in processes of their own and catches what they say.
 *
 * Programs are taken from $BUILD (default build). What a program prints goes to files, so that none can block on a
 * pipe nobody reads. Every wait has a limit; a program that outlasts it is killed and its status is -1.
 */
#ifndef TESTS_SUPPORT_PROGRAM_H
#define TESTS_SUPPORT_PROGRAM_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/types.h>

#define PROGRAM_WORDS 24

struct program {
    pid_t pid; /* 0: not running */
    FILE *out, *err;
};

struct said {
    int status; /* exit status; 128 + signal; -1: it did not end in time */
    char *out, *err;
};

/* words[0] is the program's name, NULL ends them. input: its stdin, or NULL for none. */
bool program_start(struct program *p, const char *const *words, const char *input);
bool program_runs(struct program *p);
/* Takes the program's end and all it said; frees p. */
void program_wait(struct program *p, int limit_ms, struct said *said);
void program_run(const char *const *words, const char *input, int limit_ms, struct said *said);
void said_free(struct said *said);

/* CLOCK_MONOTONIC, and a sleep, for tests that live beside real processes. */
int64_t real_us(void);
void real_sleep_ms(int ms);

#endif
