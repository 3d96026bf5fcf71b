/*
 * laboratory.h — a laboratory in processes: goniosim on real wires, goniod with the real clock, gonioctl.
 *
 * Everything lies in one folder under /tmp and on loopback, unix sockets and pseudo terminals. The angles are short
 * (the diffuser 15 deg beside the sample on the holder), so that a campaign takes seconds. A failure here fails the
 * test.
 */
#ifndef TESTS_SUPPORT_LABORATORY_H
#define TESTS_SUPPORT_LABORATORY_H

#include "tests/support/program.h"
#include "tests/support/sim_process.h"

#define LABORATORY_SAMPLE_PAINT "Hooker's Green"
#define LABORATORY_SAMPLE_SUPPORT "acrylic board"

struct laboratory_choice {
    const char *model;        /* NULL: usb2000plus */
    bool rtu;                 /* the axes on the pseudo terminal instead of TCP */
    bool usb_tcp;             /* the spectrometer over TCP instead of a unix socket */
    const char *spectrometer; /* a link instead of goniosim's own, or NULL */
    const char *modbus;       /* likewise (a tap in front of it) */
    bool manual_holder;       /* a person changes sample and diffuser (in words: the bench does not notice) */
    int stall_ms;             /* > 0: goniod's disk can be stalled so long */
    bool not_commissioned;    /* else drives.json says that it is */
    const char *bridged;      /* VID:PID: goniod runs behind usb_bridge, config link "usb" */
    const char *goniod_option; /* one more word for goniod, or NULL */
};

struct laboratory {
    struct laboratory_choice choice;
    char dir[64], socket[96], sessions[96], config[96];
    char sim_yaml[1024]; /* endpoints fixed, so that a restarted goniosim is found again */
    struct sim_process sim;
    char modbus[96], spectrometer[160]; /* links as in the config */
    struct program goniod;
};

/* The folder, goniosim, certificate and config; goniod starts with laboratory_goniod_start. */
void laboratory_open(struct laboratory *l, const struct laboratory_choice *choice);
/* Ends what still runs and removes the folder. */
void laboratory_close(struct laboratory *l);

/* Writes the config for the links as they are now; laboratory_open has done it once. */
void laboratory_write_config(struct laboratory *l);
void laboratory_goniod_start(struct laboratory *l); /* returns when its socket answers */
/* Ends goniod and gives its status as in struct said; what it said on stderr is printed if the status is another. */
void laboratory_goniod_stop(struct laboratory *l, int signal, int expected);
/* The next sync of goniod's disk stalls; returns when it has begun to, false after limit_ms. */
bool laboratory_stall(struct laboratory *l, int limit_ms);
void laboratory_sim_restart(struct laboratory *l);

/* Writes DIR/job.yaml: one sample, `mode` of the reference, geometry as in the job ("theta_i_deg: [30], ..."). */
void laboratory_job(struct laboratory *l, const char *geometry, const char *mode, const char *exposure);

/* Runs gonioctl; words end with NULL. */
__attribute__((sentinel)) void laboratory_ctl(struct laboratory *l, struct said *said, const char *input,
                                              ...);
/* Likewise, must end with this status and say this on stdout or stderr. */
__attribute__((sentinel)) void laboratory_expect(struct laboratory *l, int status, const char *part,
                                                 const char *input, ...);
bool laboratory_ctl_begin(struct laboratory *l, struct program *p, const char *const *words);
/* Waits until `gonioctl status --json` holds this text (compact JSON); fails after limit_ms. */
void laboratory_await(struct laboratory *l, const char *text, int limit_ms);
/* The path of a session from the output of `run --wait`. */
void laboratory_session_path(const struct laboratory *l, const char *said, char path[256], char name[160]);

#endif
