#include "fit/render/crew.h"

#include <pthread.h>
#include <stdatomic.h>
#include <unistd.h>

#include "fit/render/progress.h"

#define THREADS_MAX 256

struct crew {
    int n;
    void (*piece)(void *work, int index);
    void *work;
    const volatile sig_atomic_t *cancel;
    atomic_int next, finished;
    pthread_mutex_t lock; /* of the progress bar */
    struct progress progress;
};

int crew_threads(int wanted) {
    int threads = wanted > 0 ? wanted : (int)sysconf(_SC_NPROCESSORS_ONLN);
    return threads < THREADS_MAX ? threads : THREADS_MAX;
}

static void *run_thread(void *argument) {
    struct crew *c = argument;
    while (!(c->cancel && *c->cancel)) {
        int index = atomic_fetch_add(&c->next, 1);
        if (index >= c->n) {
            break;
        }
        c->piece(c->work, index);
        int finished = atomic_fetch_add(&c->finished, 1) + 1;
        if (c->progress.on && pthread_mutex_trylock(&c->lock) == 0) {
            progress_show(&c->progress, finished / (double)c->n);
            pthread_mutex_unlock(&c->lock);
        }
    }
    return NULL;
}

int crew_run(int n, const struct render_options *options, void (*piece)(void *work, int index), void *work) {
    struct crew c = {.n = n, .piece = piece, .work = work, .cancel = options->cancel};
    pthread_t thread[THREADS_MAX];
    int started = 0, threads = crew_threads(options->threads);
    pthread_mutex_init(&c.lock, NULL);
    progress_start(&c.progress, options->progress);
    while (started < threads - 1 && pthread_create(&thread[started], NULL, run_thread, &c) == 0) {
        started++;
    }
    run_thread(&c);
    for (int i = 0; i < started; i++) {
        pthread_join(thread[i], NULL);
    }
    progress_end(&c.progress);
    pthread_mutex_destroy(&c.lock);
    return atomic_load(&c.finished);
}
