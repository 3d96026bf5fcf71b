/*
 * configuration.h — docs/configuration.md: every key of goniod.yaml and job.yaml, from the tables that read
 * them.
 *
 * `build/tests/unit/test_configuration --write` puts it there again after a table has changed.
 * Checked    tests/unit/test_configuration.c: the file is what this prints
 */
#ifndef DAEMON_CONFIGURATION_H
#define DAEMON_CONFIGURATION_H

#include <stdio.h>

void configuration_print(FILE *out);

#endif
