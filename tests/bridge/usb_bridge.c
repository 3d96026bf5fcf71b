/* A USB device for libusb that is not there: usb_bridge LINK VID:PID[,denied|,busy] -- PROGRAM ARG...
 *
 * PROGRAM runs under umockdev, which shows it one USB spectrometer (spectrometer-ocean.md 2.1: one interface, bulk
 * endpoints 01, 82, 86, 81) and hands every usbfs request of its libusb to this process. Bulk transfers go on to LINK, a
 * usb_link of goniosim; so that goniod's link over libusb meets the same instrument as its link over usbredir.
 * denied: its node may be opened by nobody, and PROGRAM runs without root's right to open it all the same; busy: another
 * program has claimed its interface. SIGTERM is passed on; the exit status is PROGRAM's. */
#include <errno.h>
#include <fcntl.h>
#include <linux/capability.h>
#include <linux/usbdevice_fs.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <umockdev.h>
#include <unistd.h>

#include "drivers/usb_link.h"

#define NODE "/dev/bus/usb/001/002"
#define URBS 32
#define LOOK_MS 10
#define PACKET 512

struct urb {
    bool used, reported;
    UMockdevIoctlData *header, *buffer; /* the client's memory, as the mock hands it out */
    gulong address;                     /* in the client */
    struct usb_transfer t;
};

static struct {
    GMutex lock;
    struct clock clock;
    struct usb_link link;
    struct urb urb[URBS];
    int finished[URBS], n_finished; /* reported to the client when it reaps, in this order */
    int fifo;
    bool holds_back; /* a byte lies in the FIFO: the node does not look ready */
    bool gone;
    bool denied, busy;
} bridge;

static volatile sig_atomic_t child;

/* libusb waits until the node is writable. It is a FIFO of one page here, and a single byte fills it. */
static void show_ready(bool ready) {
    char byte = 0;
    if (ready && bridge.holds_back)
        bridge.holds_back = read(bridge.fifo, &byte, 1) != 1;
    else if (!ready && !bridge.holds_back)
        bridge.holds_back = write(bridge.fifo, &byte, 1) == 1;
}

static int kernel_status(int status) {
    switch (status) {
    case 0:
    case -EPIPE:
    case -EOVERFLOW:
        return status;
    case -ECANCELED:
        return -ENOENT;
    case -ENODEV:
        return -ESHUTDOWN;
    default:
        return -EPROTO;
    }
}

static void finish(struct urb *u, int status, size_t actual) {
    struct usbdevfs_urb *header = (struct usbdevfs_urb *)u->header->data;
    header->status = status;
    header->actual_length = (int)actual;
    if (actual > 0 && u->t.endpoint & 0x80)
        memcpy(u->buffer->data, u->t.data, actual);
    u->reported = true;
    bridge.finished[bridge.n_finished++] = (int)(u - bridge.urb);
    show_ready(true);
}

static void let_go(struct urb *u) {
    if (u->t.pending || !u->used || u->header)
        return;
    free(u->t.data);
    *u = (struct urb){.used = false};
}

/* ---- usbfs requests; in a thread of the mock ---- */

static int submit(UMockdevIoctlData *arg) {
    struct urb *u = bridge.urb;
    while (u < bridge.urb + URBS && u->used)
        u++;
    if (u == bridge.urb + URBS)
        return ENOMEM;
    UMockdevIoctlData *header = umockdev_ioctl_data_resolve(arg, 0, sizeof(struct usbdevfs_urb), NULL);
    const struct usbdevfs_urb *h = (const struct usbdevfs_urb *)header->data;
    size_t length = (size_t)h->buffer_length;
    *u = (struct urb){.used = true, .header = header, .address = header->client_addr};
    if (length > 0)
        u->buffer = umockdev_ioctl_data_resolve(header, offsetof(struct usbdevfs_urb, buffer), length, NULL);
    u->t = (struct usb_transfer){.endpoint = h->endpoint, .length = length, .data = calloc(1, length + 1)};
    if (length > 0 && !(h->endpoint & 0x80))
        memcpy(u->t.data, u->buffer->data, length);
    if (h->type != USBDEVFS_URB_TYPE_BULK)
        finish(u, -EPIPE, 0); /* there are no strings to ask for */
    else if (bridge.link.ops->submit(bridge.link.self, &u->t, NULL) < 0)
        finish(u, -ESHUTDOWN, 0);
    return 0;
}

/* At once, whatever the instrument does: the kernel does not wait for it either. */
static int discard(UMockdevIoctlData *arg) {
    gulong address = *(gulong *)arg->data;
    for (struct urb *u = bridge.urb; u < bridge.urb + URBS; u++)
        if (u->used && !u->reported && u->address == address) {
            bridge.link.ops->cancel(bridge.link.self, &u->t);
            finish(u, -ENOENT, 0);
            return 0;
        }
    return EINVAL;
}

static int reap(UMockdevIoctlData *arg) {
    if (bridge.n_finished == 0)
        return bridge.gone ? ENODEV : EAGAIN;
    struct urb *u = &bridge.urb[bridge.finished[0]];
    memmove(bridge.finished, bridge.finished + 1, sizeof *bridge.finished * (size_t)--bridge.n_finished);
    if (bridge.n_finished == 0 && !bridge.gone)
        show_ready(false);
    UMockdevIoctlData *pointer = umockdev_ioctl_data_resolve(arg, 0, sizeof(void *), NULL);
    umockdev_ioctl_data_set_ptr(pointer, 0, g_object_ref(u->header));
    g_object_unref(pointer);
    g_clear_object(&u->buffer);
    g_clear_object(&u->header);
    let_go(u);
    return 0;
}

static int clear_halt(UMockdevIoctlData *arg) {
    UMockdevIoctlData *endpoint = umockdev_ioctl_data_resolve(arg, 0, sizeof(unsigned), NULL);
    int rc = bridge.link.ops->clear_halt(bridge.link.self, endpoint->data[0], NULL);
    g_object_unref(endpoint);
    return rc < 0 ? ENODEV : 0;
}

static int capabilities(UMockdevIoctlData *arg) {
    UMockdevIoctlData *word = umockdev_ioctl_data_resolve(arg, 0, sizeof(uint32_t), NULL);
    *(uint32_t *)word->data = USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION |
                              USBDEVFS_CAP_NO_PACKET_SIZE_LIM | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
    g_object_unref(word);
    return 0;
}

static int request(gulong code, UMockdevIoctlData *arg) {
    bool reaps = code == USBDEVFS_REAPURB || code == USBDEVFS_REAPURBNDELAY;
    if (bridge.gone && !reaps)
        return ENODEV;
    switch ((unsigned)code) {
    case USBDEVFS_GET_CAPABILITIES:
        return capabilities(arg);
    case USBDEVFS_CLAIMINTERFACE:
        return bridge.busy ? EBUSY : 0;
    case USBDEVFS_RELEASEINTERFACE:
    case USBDEVFS_SETCONFIGURATION:
    case USBDEVFS_SETINTERFACE:
        return 0;
    case USBDEVFS_CLEAR_HALT:
        return clear_halt(arg);
    case USBDEVFS_RESET:
        return bridge.link.ops->reset(bridge.link.self, NULL) < 0 ? ENODEV : 0;
    case USBDEVFS_GETDRIVER:
        return ENODATA;
    case USBDEVFS_SUBMITURB:
        return submit(arg);
    case USBDEVFS_DISCARDURB:
        return discard(arg);
    case USBDEVFS_REAPURB:
    case USBDEVFS_REAPURBNDELAY:
        return reap(arg);
    default:
        return ENOTTY;
    }
}

static gboolean on_ioctl(UMockdevIoctlBase *base, UMockdevIoctlClient *client, gpointer unused) {
    gulong code = umockdev_ioctl_client_get_request(client);
    (void)base;
    (void)unused;
    g_mutex_lock(&bridge.lock);
    bool speed = code == USBDEVFS_GET_SPEED && !bridge.gone;
    int cause = speed ? 0 : request(code, umockdev_ioctl_client_get_arg(client));
    g_mutex_unlock(&bridge.lock);
    umockdev_ioctl_client_complete(client, cause ? -1 : speed ? 3 : 0, cause); /* 3: USB_SPEED_HIGH */
    return TRUE;
}

/* ---- the instrument's side ---- */

static void take_completions(void) {
    bridge.link.ops->reap(bridge.link.self);
    for (struct urb *u = bridge.urb; u < bridge.urb + URBS; u++) {
        if (!u->used || u->t.pending)
            continue;
        bridge.gone |= u->t.status == -ENODEV && !u->reported;
        if (!u->reported)
            finish(u, kernel_status(u->t.status), u->t.actual);
        let_go(u);
    }
}

static void serve_until_child_ends(int *status) {
    struct pollfd fd[4];
    while (waitpid(child, status, WNOHANG) == 0) {
        g_mutex_lock(&bridge.lock);
        take_completions();
        int n = bridge.gone ? 0 : bridge.link.ops->descriptors(bridge.link.self, fd, 4);
        g_mutex_unlock(&bridge.lock);
        poll(fd, (nfds_t)n, LOOK_MS);
    }
}

/* ---- the device as sysfs shows it ---- */

static void add_endpoint(GString *s, int address) {
    g_string_append_printf(s, "0705%02X02%02X%02X00", address, PACKET & 0xff, PACKET >> 8);
}

static char *describe(int vid, int pid) {
    GString *s = g_string_new("P: /devices/pci0000:00/0000:00:14.0/usb1/1-1\nN: bus/usb/001/002\n"
                              "E: DEVTYPE=usb_device\nE: DEVNAME=" NODE "\nE: SUBSYSTEM=usb\nE: BUSNUM=001\n"
                              "E: DEVNUM=002\nE: MAJOR=189\nE: MINOR=1\n"
                              "A: busnum=1\\n\nA: devnum=2\\n\nA: speed=480\\n\nA: bConfigurationValue=1\\n\n"
                              "A: bNumConfigurations=1\\n\nA: devpath=1\\n\n");
    g_string_append_printf(s, "A: idVendor=%04x\\n\nA: idProduct=%04x\\n\nH: descriptors=", vid, pid);
    g_string_append_printf(s,
                           "1201000200000040%02X%02X%02X%02X00010000"
                           "0001",
                           vid & 0xff, vid >> 8, pid & 0xff, pid >> 8);
    g_string_append(s, "09022E00010100C032"
                       "0904000004FF000000");
    add_endpoint(s, 0x01);
    add_endpoint(s, 0x82);
    add_endpoint(s, 0x86);
    add_endpoint(s, 0x81);
    g_string_append(s, "\n\n");
    return g_string_free(s, FALSE);
}

static void make_fifo(UMockdevTestbed *testbed) {
    char *path = g_build_filename(umockdev_testbed_get_root_dir(testbed), NODE, NULL);
    unlink(path);
    if (mkfifo(path, 0666) < 0)
        perror("usb_bridge: mkfifo");
    bridge.fifo = open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC);
    fcntl(bridge.fifo, F_SETPIPE_SZ, 4096);
    if (bridge.denied)
        chmod(path, 0);
    show_ready(false);
    g_free(path);
}

static UMockdevTestbed *make_device(int vid, int pid, UMockdevIoctlBase *handler) {
    GError *error = NULL;
    UMockdevTestbed *testbed = umockdev_testbed_new();
    char *text = describe(vid, pid);
    if (!umockdev_testbed_add_from_string(testbed, text, &error) ||
        !umockdev_testbed_attach_ioctl(testbed, NODE, handler, &error)) {
        fprintf(stderr, "usb_bridge: %s\n", error->message);
        exit(1);
    }
    g_free(text);
    make_fifo(testbed);
    return testbed;
}

static void pass_on(int signal_number) {
    if (child > 0)
        kill(child, signal_number);
}

static void start_child(char **argv) {
    signal(SIGTERM, pass_on);
    signal(SIGINT, pass_on);
    child = fork();
    if (child == 0) {
        setenv("LD_PRELOAD", "libumockdev-preload.so.0", 1);
        if (bridge.denied && geteuid() == 0) {
            prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0);
            prctl(PR_CAPBSET_DROP, CAP_DAC_READ_SEARCH, 0, 0, 0);
        }
        execv(argv[0], argv);
        perror(argv[0]);
        _exit(127);
    }
}

int main(int argc, char **argv) {
    struct err e = {0};
    unsigned vid, pid;
    int status = 0;
    if (argc < 5 || sscanf(argv[2], "%x:%x", &vid, &pid) != 2 || strcmp(argv[3], "--") != 0) {
        fprintf(stderr, "usage: usb_bridge LINK VID:PID[,denied|,busy] -- PROGRAM ARG...\n");
        return 2;
    }
    bridge.denied = strstr(argv[2], ",denied") != NULL;
    bridge.busy = strstr(argv[2], ",busy") != NULL;
    clock_init_real(&bridge.clock);
    if (usb_link_open(&bridge.link, argv[1], (uint16_t)vid, (uint16_t)pid, NULL, &bridge.clock, &e) < 0) {
        fprintf(stderr, "usb_bridge: %s\n", e.text);
        return 1;
    }
    UMockdevIoctlBase *handler = umockdev_ioctl_base_new();
    g_signal_connect(handler, "handle-ioctl", G_CALLBACK(on_ioctl), NULL);
    UMockdevTestbed *testbed = make_device((int)vid, (int)pid, handler);
    start_child(argv + 4);
    serve_until_child_ends(&status);
    umockdev_testbed_detach_ioctl(testbed, NODE, NULL);
    g_object_unref(handler);
    g_object_unref(testbed);
    bridge.link.ops->close(bridge.link.self);
    return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}
