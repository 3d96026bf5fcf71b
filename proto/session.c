#include "proto/session_internal.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <linux/magic.h>
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

/* Magic numbers that linux/magic.h of Debian 12 does not name, from statfs(2). */
#define MAGIC_CIFS 0xFF534D42UL
#define MAGIC_SMB2 0xFE534D42UL
#define MAGIC_CEPH 0x00C36400UL
#define MAGIC_FUSE 0x65735546UL

#define READERS_LOOK 100 /* times: session_is_written holds the lock for an instant */

const char *session_network_filesystem(unsigned long magic) {
    static const struct {
        unsigned long magic;
        const char *name;
    } known[] = {
        {NFS_SUPER_MAGIC, "NFS"},   {SMB_SUPER_MAGIC, "SMB"}, {MAGIC_CIFS, "CIFS"},  {MAGIC_SMB2, "SMB2"},
        {MAGIC_CEPH, "Ceph"},       {MAGIC_FUSE, "FUSE"},     {V9FS_MAGIC, "9P"},    {AFS_SUPER_MAGIC, "AFS"},
        {CODA_SUPER_MAGIC, "Coda"}, {NCP_SUPER_MAGIC, "NCP"}, {AFS_FS_MAGIC, "AFS"},
    };
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++)
        if (known[i].magic == (magic & 0xFFFFFFFFUL))
            return known[i].name;
    return NULL;
}

static int check_filesystem(const char *path, struct err *e) {
    char folder[PATH_MAX];
    snprintf(folder, sizeof folder, "%s", path);
    struct statfs fs;
    if (statfs(dirname(folder), &fs) < 0) {
        int saved_errno = errno;
        return err_errno(e, ERR_IO, saved_errno, "%s: the folder of the session cannot be used", path);
    }
    const char *name = session_network_filesystem((unsigned long)fs.f_type);
    if (name)
        return err_set(
            e, ERR_INPUT,
            "%s: lies on %s, where a session cannot be kept safe while it is written; choose a folder on a "
            "local disk (--sessions DIR) and copy the closed session afterwards",
            path, name);
    return 0;
}

static uint32_t big_endian(const uint8_t *b) {
    return (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
}

/* Offsets of the database header: sqlite.org/fileformat.html, 1.3. */
static int judge_header(const char *path, const uint8_t *header, ssize_t n, int64_t size, struct err *e) {
    if (size == 0)
        return err_set(e, ERR_INPUT, "%s: is empty; a session was expected", path);
    if (n < 100 || memcmp(header, "SQLite format 3", 16) != 0)
        return err_set(e, ERR_INPUT, "%s: is not a goniod session (no database header)", path);
    int64_t page = header[16] << 8 | header[17];
    int64_t whole = (page == 1 ? 65536 : page) * (int64_t)big_endian(header + 28);
    char log[PATH_MAX];
    snprintf(log, sizeof log, "%s-wal", path);
    bool logged = access(log, F_OK) == 0;
    if (size < whole && !logged)
        return err_set(e, ERR_INPUT,
                       "%s: is truncated: %lld bytes of %lld are left; take it from its copy or backup", path,
                       (long long)size, (long long)whole);
    if (big_endian(header + 68) != SESSION_APPLICATION_ID && !logged)
        return err_set(e, ERR_INPUT, "%s: is a database of another program, not a goniod session", path);
    return 0;
}

int session_check_header(const char *path, struct err *e) {
    uint8_t header[100];
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    if (fd < 0) {
        int saved_errno = errno;
        return err_errno(e, saved_errno == EACCES ? ERR_PERMISSION : ERR_IO, saved_errno,
                         "cannot open session %s", path);
    }
    struct stat st;
    fstat(fd, &st);
    ssize_t n = S_ISREG(st.st_mode) ? pread(fd, header, sizeof header, 0) : 0;
    close(fd);
    if (!S_ISREG(st.st_mode))
        return err_set(e, ERR_INPUT, "%s: is not a file; a session was expected", path);
    return judge_header(path, header, n, st.st_size, e);
}

/* The lock lies beside the session, not on it: closing any descriptor of the database file would drop
 * SQLite's own locks on it. It is deleted while held, so whoever gets it checks that it still has its name.
 */
static int take_lock(struct session *s, struct err *e) {
    char name[PATH_MAX];
    snprintf(name, sizeof name, "%s-lock", s->path);
    for (;;) {
        struct stat held, named;
        s->lock_fd = open(name, O_RDWR | O_CREAT | O_CLOEXEC, 0644);
        if (s->lock_fd < 0) {
            int saved_errno = errno;
            return err_errno(e, saved_errno == EACCES ? ERR_PERMISSION : ERR_IO, saved_errno,
                             "cannot lock session %s", s->path);
        }
        int failed = flock(s->lock_fd, LOCK_EX | LOCK_NB);
        for (int k = 0; failed && k < READERS_LOOK; k++) {
            sched_yield();
            failed = flock(s->lock_fd, LOCK_EX | LOCK_NB);
        }
        if (failed)
            return err_set(e, ERR_BUSY, "%s: another goniod is writing this session; wait for it or stop it",
                           s->path);
        if (stat(name, &named) == 0 && fstat(s->lock_fd, &held) == 0 && named.st_ino == held.st_ino)
            return 0;
        close(s->lock_fd);
    }
}

bool session_is_written(const struct session *s) {
    char name[PATH_MAX];
    snprintf(name, sizeof name, "%s-lock", s->path);
    int fd = open(name, O_RDONLY | O_CLOEXEC);
    bool held = fd >= 0 && flock(fd, LOCK_SH | LOCK_NB) < 0;
    if (fd >= 0)
        close(fd);
    return held;
}

static void drop_lock_of(const char *path, int fd) {
    char name[PATH_MAX + 8];
    snprintf(name, sizeof name, "%s-lock", path);
    unlink(name);
    close(fd);
}

static void drop_lock(struct session *s) {
    drop_lock_of(s->path, s->lock_fd);
    s->lock_fd = -1;
}

static void remove_part(const char *part) {
    char journal[PATH_MAX + 16];
    snprintf(journal, sizeof journal, "%s-journal", part);
    unlink(journal);
    unlink(part);
}

static int new_session(struct session **out, const char *path, bool read_only, struct err *e) {
    struct session *s = calloc(1, sizeof *s);
    if (!s || !(s->path = strdup(path))) {
        free(s);
        return err_set(e, ERR_NOMEM, "%s: out of memory", path);
    }
    s->lock_fd = -1;
    s->read_only = read_only;
    *out = s;
    return 0;
}

static void free_session(struct session *s, bool locked) {
    store_close(s->store);
    if (s->name && locked)
        remove_part(s->path);
    if (locked)
        drop_lock(s);
    else if (s->lock_fd >= 0)
        close(s->lock_fd);
    free(s->path);
    free(s->name);
    free(s);
}

static int begin_writing(struct session *s, struct err *e) {
    return store_exec(s->store,
                      "PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON;"
                      "PRAGMA wal_autocheckpoint = 1000",
                      e);
}

/* Beside its place, hidden: no list of sessions shows it. */
static int part_path(const char *path, char part[PATH_MAX], struct err *e) {
    const char *slash = strrchr(path, '/'), *file = slash ? slash + 1 : path;
    int n = snprintf(part, PATH_MAX, "%.*s.%s.part", (int)(file - path), path, file);
    return n < PATH_MAX ? 0 : err_set(e, ERR_USAGE, "%s: the name is too long", path);
}

/* The name itself must survive a loss of power, not only what the file holds. */
static void sync_folder(const char *path) {
    char folder[PATH_MAX];
    snprintf(folder, sizeof folder, "%s", path);
    int fd = open(dirname(folder), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd >= 0) {
        fsync(fd);
        close(fd);
    }
}

/* File systems of memory sticks know no hard links, those of networks no such renaming. */
int session_rename(const char *from, const char *to, struct err *e) {
    if (renameat2(AT_FDCWD, from, AT_FDCWD, to, RENAME_NOREPLACE) == 0)
        return 0;
    int saved_errno = errno;
    if (saved_errno == EINVAL || saved_errno == ENOSYS) {
        if (link(from, to) == 0) {
            unlink(from);
            return 0;
        }
        saved_errno = errno;
    }
    if (saved_errno == EEXIST)
        return err_set(e, ERR_BUSY, "%s: exists already; a session is never overwritten", to);
    return err_errno(e, ERR_IO, saved_errno, "cannot name the session %s", to);
}

/* One journal beside it, no log: nobody reads it yet. The lock is taken; what a kill left under this name goes. */
static int make_part(struct session *s, struct err *e) {
    remove_part(s->path);
    int fd = open(s->path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    int saved_errno = errno;
    if (fd < 0)
        return err_errno(e, saved_errno == EACCES ? ERR_PERMISSION : ERR_IO, saved_errno,
                         "cannot create session %s", s->name);
    close(fd);
    int rc = store_open(&s->store, s->path, false, e);
    if (rc == 0)
        rc = store_exec(s->store, "PRAGMA synchronous = FULL; PRAGMA foreign_keys = ON", e);
    return rc == 0 ? session_make_schema(s->store, e) : rc;
}

int session_create(struct session **out, const char *path, struct err *e) {
    struct session *s = NULL;
    char part[PATH_MAX];
    int rc = access(path, F_OK) == 0
                 ? err_set(e, ERR_BUSY, "%s: exists already; a session is never overwritten", path)
                 : check_filesystem(path, e);
    if (rc == 0)
        rc = part_path(path, part, e);
    if (rc == 0)
        rc = new_session(&s, part, false, e);
    if (rc < 0)
        return rc;
    s->name = strdup(path);
    rc = s->name ? take_lock(s, e) : err_set(e, ERR_NOMEM, "%s: out of memory", path);
    bool locked = rc == 0;
    if (rc == 0)
        rc = make_part(s, e);
    if (rc < 0) {
        free_session(s, locked);
        return rc;
    }
    s->user_version = SESSION_USER_VERSION;
    *out = s;
    return 0;
}

static int open_named(struct session *s, struct err *e) {
    struct store *store = NULL;
    int rc = store_open(&store, s->path, false, e);
    if (rc < 0)
        return rc;
    store_close(s->store);
    s->store = store;
    return begin_writing(s, e);
}

/* What was committed under the hidden name becomes a session. */
static int take_name(struct session *s, struct err *e) {
    char *part = s->path;
    int part_fd = s->lock_fd;
    s->path = s->name;
    int rc = take_lock(s, e);
    if (rc == 0) {
        rc = session_rename(part, s->name, e);
        if (rc < 0)
            drop_lock(s);
    }
    if (rc < 0) {
        s->path = part;
        s->lock_fd = part_fd;
        return rc;
    }
    s->name = NULL;
    drop_lock_of(part, part_fd);
    free(part);
    sync_folder(s->path);
    return open_named(s, e);
}

void session_sweep(const char *folder) {
    DIR *dir = opendir(folder);
    static const char end[] = ".gonio.part";
    for (const struct dirent *d; dir && (d = readdir(dir));) {
        char path[PATH_MAX];
        size_t n = strlen(d->d_name);
        if (d->d_name[0] != '.' || n < sizeof end || strcmp(d->d_name + n - (sizeof end - 1), end) != 0)
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, d->d_name);
        struct session s = {.path = path, .lock_fd = -1};
        if (take_lock(&s, NULL) == 0) {
            remove_part(path);
            drop_lock(&s);
        } else if (s.lock_fd >= 0) {
            close(s.lock_fd);
        }
    }
    if (dir)
        closedir(dir);
}

static int check_version(struct session *s, struct err *e) {
    int64_t application = 0, version = 0;
    int rc = store_number(s->store, "PRAGMA application_id", 0, &application, e);
    if (rc == 0)
        rc = store_number(s->store, "PRAGMA user_version", 0, &version, e);
    if (rc < 0)
        return rc;
    if (application != SESSION_APPLICATION_ID)
        return err_set(e, ERR_INPUT, "%s: is not a goniod session, or its making was cut short", s->path);
    if (version > SESSION_USER_VERSION)
        return err_set(e, ERR_INPUT,
                       "%s: was written by a newer goniod (format %d, this one reads up to %d); update",
                       s->path, (int)version, SESSION_USER_VERSION);
    s->user_version = (int)version;
    return 0;
}

/* A session that was cut off, read by someone who may not write beside it. */
static int name_unreadable(const struct session *s, int rc, struct err *e) {
    char log[PATH_MAX];
    snprintf(log, sizeof log, "%s-wal", s->path);
    if (rc != -ERR_IO || !s->read_only || access(log, F_OK) < 0)
        return rc;
    err_clear(e);
    return err_set(
        e, ERR_PERMISSION,
        "%s: was cut off while it was written, and you may not put its log right; run gonioctl verify once "
        "as the user that runs goniod",
        s->path);
}

/* A journal left by a kill is rolled back by whoever may write, here under the writer's lock and without writing a row.
 * Returns 0 where it was. */
static int put_right(struct session *s) {
    struct store *writer = NULL;
    int64_t application = 0;
    int rc = take_lock(s, NULL);
    if (rc == 0) {
        rc = store_open(&writer, s->path, false, NULL);
        if (rc == 0)
            rc = store_number(writer, "PRAGMA application_id", 0, &application, NULL);
        store_close(writer);
        drop_lock(s);
    } else if (s->lock_fd >= 0) {
        close(s->lock_fd);
    }
    s->lock_fd = -1;
    return rc;
}

static int check_readable(struct session *s, struct err *e) {
    struct err first = {0};
    int rc = check_version(s, &first);
    if (rc == -ERR_PERMISSION && s->read_only && put_right(s) == 0) {
        err_clear(&first);
        rc = check_version(s, &first);
    }
    if (rc < 0 && e && e->code == ERR_NONE)
        *e = first;
    return name_unreadable(s, rc, e);
}

int session_open(struct session **out, const char *path, bool read_only, struct err *e) {
    struct session *s = NULL;
    bool locked = false;
    int rc = session_check_header(path, e);
    if (rc == 0 && !read_only)
        rc = check_filesystem(path, e);
    if (rc == 0)
        rc = new_session(&s, path, read_only, e);
    if (rc < 0)
        return rc;
    if (!read_only) {
        rc = take_lock(s, e);
        locked = rc == 0;
    }
    if (rc == 0)
        rc = store_open(&s->store, path, read_only, e);
    if (rc == 0)
        rc = check_readable(s, e);
    if (rc == 0 && !read_only)
        rc = begin_writing(s, e);
    if (rc == 0 && !read_only && s->user_version < SESSION_USER_VERSION)
        rc = session_make_schema(s->store, e);
    if (rc < 0) {
        free_session(s, locked);
        return rc;
    }
    if (!read_only)
        s->user_version = SESSION_USER_VERSION;
    *out = s;
    return 0;
}

int session_close(struct session *s, struct err *e) {
    int rc = 0;
    if (!s)
        return 0;
    if (!s->read_only) {
        if (store_in_transaction(s->store))
            rc = session_commit(s, e);
        if (!s->name)
            store_settle(s->store);
    }
    free_session(s, !s->read_only);
    return rc;
}

int session_begin(struct session *s, struct err *e) {
    s->spoilt = false;
    return store_exec(s->store, "BEGIN IMMEDIATE", e);
}

int session_commit(struct session *s, struct err *e) {
    if (s->spoilt || !store_in_transaction(s->store)) {
        session_rollback(s);
        return err_set(e, ERR_STATE,
                       "%s: nothing was stored, because an earlier row of the same transaction failed",
                       s->path);
    }
    int rc = store_exec(s->store, "COMMIT", e);
    if (rc < 0)
        session_rollback(s);
    return rc == 0 && s->name ? take_name(s, e) : rc;
}

void session_rollback(struct session *s) {
    if (store_in_transaction(s->store))
        store_exec(s->store, "ROLLBACK", NULL);
    s->n_requests = s->next_request = 0; /* some of them may just have been rolled back */
    s->spoilt = false;
}
