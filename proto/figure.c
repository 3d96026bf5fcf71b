#include "proto/figure.h"

#include <errno.h>
#include <spawn.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

extern char **environ;

static FILE *open_beside(const struct figure *f, const char *ending, struct err *e) {
    char path[400];
    snprintf(path, sizeof path, "%s/%s.%s", f->dir, f->name, ending);
    FILE *file = fopen(path, "w");
    if (!file)
        err_errno(e, ERR_IO, errno, "cannot write %s", path);
    return file;
}

int figure_begin(struct figure *f, const char *dir, const char *name, const char *csv_header, struct err *e) {
    memset(f, 0, sizeof *f);
    snprintf(f->dir, sizeof f->dir, "%s", dir);
    snprintf(f->name, sizeof f->name, "%s", name);
    f->csv = open_beside(f, "csv", e);
    f->gp = f->csv ? open_beside(f, "gp", e) : NULL;
    if (!f->gp) {
        if (f->csv)
            fclose(f->csv);
        return -ERR_IO;
    }
    fprintf(f->csv, "%s\n", csv_header);
    fprintf(
        f->gp,
        "# gnuplot %s.gp draws %s.svg and %s.pdf from %s.csv\n"
        "set datafile separator \",\"\nset datafile missing NaN\nset encoding utf8\n"
        "set key noautotitle samplen 1.5 font \",9\"\nset grid lc rgb \"#dddddd\"\nset tics font \",9\"\n"
        /* By default gnuplot clears a box behind each point that has an error bar, and the curve with it. */
        "set pointintervalbox 0.01\nset errorbars 0.3\n"
        "data = \"%s.csv\"\n",
        name, name, name, name, name);
    return 0;
}

void figure_next_block(struct figure *f) {
    fputs("\n\n", f->csv);
    f->block++;
}

const char *figure_label(const char *text, char *buffer, size_t size) {
    size_t n = 0;
    for (; *text && n + 1 < size; text++)
        if (*text != '"' && *text != '\\' && *text != '`' && (unsigned char)*text >= ' ')
            buffer[n++] = *text;
    buffer[n] = '\0';
    return buffer;
}

void figure_panels(struct figure *f, int rows, int columns, int width_px, int height_px) {
    fprintf(f->gp,
            "do for [terminal_name in \"svg pdf\"] {\n"
            "if (terminal_name eq \"svg\") { set terminal svg noenhanced size %d,%d background \"white\" "
            "font \"sans,11\"\n"
            "} else { set terminal pdfcairo noenhanced size %.2fin,%.2fin font \"sans,8\" }\n"
            "set output \"%s.\".terminal_name\n"
            "set multiplot layout %d,%d\n",
            width_px, height_px, width_px / 100.0, height_px / 100.0, f->name, rows, columns);
}

static int run_gnuplot(const struct figure *f, struct err *e) {
    char script[80];
    snprintf(script, sizeof script, "%s.gp", f->name);
    char *argv[] = {"gnuplot", script, NULL};
    pid_t pid;
    int status;
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addchdir_np(&actions, f->dir);
    int rc = posix_spawnp(&pid, "gnuplot", &actions, NULL, argv, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (rc != 0)
        return err_errno(e, ERR_IO, rc,
                         "cannot run gnuplot (package gnuplot-nox); %s.csv and %s.gp are written", f->name,
                         f->name);
    if (waitpid(pid, &status, 0) != pid || !WIFEXITED(status) || WEXITSTATUS(status) != 0)
        return err_set(e, ERR_IO, "gnuplot could not draw %s/%s", f->dir, script);
    return 0;
}

int figure_end(struct figure *f, struct err *e) {
    fputs("unset multiplot\nunset output\n}\n", f->gp);
    int bad = ferror(f->csv) | ferror(f->gp);
    bad |= fclose(f->csv);
    bad |= fclose(f->gp);
    if (bad)
        return err_errno(e, ERR_IO, errno, "cannot write %s/%s.csv and .gp", f->dir, f->name);
    return run_gnuplot(f, e);
}
