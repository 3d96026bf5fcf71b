#include "daemon/verbs.h"

const struct verb VERBS[] = {
    {"check", verb_check, "JOB", "prints the plan of a job, or all its mistakes; nothing moves", true},
    {"run", verb_run, "JOB... [--wait]", "queues jobs; --wait shows progress, Ctrl-C detaches", true},
    {"queue", verb_queue, "", "jobs that wait", true},
    {"status", verb_status, "", "what goniod does now, with the age of each reading", true},
    {"watch", verb_watch, "", "events as they come, one JSON object a line", true},
    {"pause", verb_pause, "[--now]", "after the current exposure set; --now drops it", true},
    {"resume", verb_resume, "[SESSION]", "the paused campaign, or a session that was cut off", true},
    {"abort", verb_abort, "", "stops every axis, shuts the shutter, ends the campaign", true},
    {"continue", verb_continue, "", "says that what a hold asked for has been done", true},
    {"devices", verb_devices, "", "what answers on USB and on each bus", true},
    {"where", verb_where, "", "where each axis stands", true},
    {"home", verb_home, "AXIS", "homes an axis", true},
    {"move", verb_move, "AXIS DEG", "moves an axis to an angle", true},
    {"stop", verb_stop, "", "stops every axis now", true},
    {"spectrum", verb_spectrum, "[--average N] [--exposure MS] [-o FILE.csv]", "takes a spectrum", true},
    {"commission", verb_commission, "AXIS", "checks a profile on a live unit, step by step, with small moves",
     true},
    {"plot", verb_plot, "SESSION... [-o DIR]", "figures as .svg, .pdf, .csv and .gp", false},
    {"compare", verb_compare, "SESSION...", "fitted parameters with u, and the truth where it is known",
     false},
    {0}};
