#include "sim/serve.h"

#include <errno.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#define BACKLOG 16

static int give_up(int fd, int cause, struct err *e, const char *what) {
    close(fd);
    return err_errno(e, cause == EADDRINUSE ? ERR_BUSY : ERR_IO, cause, "cannot listen on %s", what);
}

int serve_listen_tcp(int port, int *out, int *bound_port, struct err *e) {
    struct sockaddr_in a = {
        .sin_family = AF_INET, .sin_port = htons((uint16_t)port), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof a;
    int one = 1, fd = socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return err_errno(e, ERR_IO, errno, "cannot make a socket");
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    if (bind(fd, (struct sockaddr *)&a, sizeof a) != 0 || listen(fd, BACKLOG) != 0 ||
        getsockname(fd, (struct sockaddr *)&a, &size) != 0)
        return give_up(fd, errno, e, "127.0.0.1");
    *out = fd;
    *bound_port = ntohs(a.sin_port);
    return 0;
}

/* A socket that an earlier run left behind is in the way; anything else at that path is not ours to remove. */
static void remove_leftover(const char *path, const struct sockaddr_un *a) {
    struct stat st;
    if (lstat(path, &st) != 0 || !S_ISSOCK(st.st_mode))
        return;
    int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (probe >= 0 && connect(probe, (const struct sockaddr *)a, sizeof *a) != 0 && errno == ECONNREFUSED)
        unlink(path);
    if (probe >= 0)
        close(probe);
}

int serve_listen_unix(const char *path, int *out, struct err *e) {
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    if (strlen(path) >= sizeof a.sun_path)
        return err_set(e, ERR_INPUT, "the path %s is longer than a unix socket can have (%zu bytes)", path,
                       sizeof a.sun_path - 1);
    strcpy(a.sun_path, path);
    remove_leftover(path, &a);
    int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0)
        return err_errno(e, ERR_IO, errno, "cannot make a socket");
    if (bind(fd, (struct sockaddr *)&a, sizeof a) != 0 || listen(fd, BACKLOG) != 0)
        return give_up(fd, errno, e, path);
    *out = fd;
    return 0;
}

int serve_accept(int listener) {
    int one = 1, fd = accept4(listener, NULL, NULL, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (fd >= 0)
        setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &one,
                   sizeof one); /* 45 ms a query without: virtual-usb.md 4 */
    return fd;
}
