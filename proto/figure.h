/*
 * figure.h — one figure: its data as .csv, the .gp that draws it, and what gnuplot made of it as .svg and .pdf.
 *
 * The .gp reads the .csv beside it, so that anyone can change it and run `gnuplot NAME.gp` again. Panels are data blocks
 * of the .csv (gnuplot's `index`, two blank lines apart; readers of CSV skip blank lines).
 * Errors     -ERR_IO a file cannot be written, or gnuplot is missing or failed (its own words are on stderr).
 * Checked    tests/scenario/test_plot.c
 */
#ifndef PROTO_FIGURE_H
#define PROTO_FIGURE_H

#include <stdio.h>

#include "proto/err.h"

struct figure {
    char dir[256], name[64];
    FILE *csv, *gp;
    int block; /* index of the data block being written */
};

int figure_begin(struct figure *f, const char *dir, const char *name, const char *csv_header, struct err *e);
/* Ends the present data block; the next row begins the next. */
void figure_next_block(struct figure *f);
/* Text of a title: quotes and line ends cannot break out of the script. Returns buffer. */
const char *figure_label(const char *text, char *buffer, size_t size);
/* `rows` x `columns` panels on one sheet of that many pixels. Panel by panel follow `set` and `plot` lines in f->gp. */
void figure_panels(struct figure *f, int rows, int columns, int width_px, int height_px);
int figure_end(struct figure *f, struct err *e);

#endif
