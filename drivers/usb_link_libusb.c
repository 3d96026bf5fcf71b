/* The kernel's USB through libusb's asynchronous calls. libusb gets a buffer of the link's own, so that a
 * transfer that the kernel will not give back can be given up without leaving it a pointer into the caller.
 */
#include "drivers/usb_link.h"

#include <errno.h>
#include <libusb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "proto/units.h"

#define INTERFACE 0     /* the only one of these devices (spectrometer-ocean.md 2.1) */
#define CONFIGURATION 1 /* likewise */
#define RULE "drivers/60-goniod.rules"
#define VENDOR_OCEAN_OPTICS 0x2457 /* spectrometer-ocean.md 1 */
#define VENDOR_OCEAN_INSIGHT 0x0999

struct kernel {
    libusb_context *context;
    libusb_device_handle *handle;
    struct clock *clock;
    bool gone;
    char path[64];
    struct slot *slots; /* every transfer libusb still holds, abandoned ones too */
};

struct slot {
    struct slot *next;
    struct kernel *kernel;
    struct usb_transfer *t; /* NULL: given up, libusb still owns the slot */
    struct libusb_transfer *usb;
    int64_t abandon_us;
    uint8_t data[];
};

static enum err_code code_of(int usb) {
    switch (usb) {
    case LIBUSB_ERROR_ACCESS:
        return ERR_PERMISSION;
    case LIBUSB_ERROR_BUSY:
        return ERR_BUSY;
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND:
        return ERR_LINK;
    case LIBUSB_ERROR_NO_MEM:
        return ERR_NOMEM;
    default:
        return ERR_IO;
    }
}

static int fail(struct err *e, int usb, const char *what, const char *path) {
    enum err_code code = code_of(usb);
    const char *advice = "";
    if (code == ERR_PERMISSION)
        advice = ": install the udev rule " RULE " (make install does), then plug it in again";
    else if (code == ERR_BUSY)
        advice = ": another program has it, end that one first";
    return err_set(e, code, "cannot %s the spectrometer on USB%s%s: %s%s", what, *path ? " " : "", path,
                   libusb_strerror(usb), advice);
}

static int status_of(const struct libusb_transfer *usb) {
    switch (usb->status) {
    case LIBUSB_TRANSFER_COMPLETED:
        return 0;
    case LIBUSB_TRANSFER_TIMED_OUT:
        return -ETIMEDOUT;
    case LIBUSB_TRANSFER_CANCELLED:
        return -ECANCELED;
    case LIBUSB_TRANSFER_STALL:
        return -EPIPE;
    case LIBUSB_TRANSFER_OVERFLOW:
        return -EOVERFLOW;
    case LIBUSB_TRANSFER_NO_DEVICE:
        return -ENODEV;
    default:
        return -EIO;
    }
}

static void complete(struct slot *s, int status, size_t actual) {
    struct usb_transfer *t = s->t;
    s->t = NULL;
    if (actual && t->endpoint & 0x80)
        memcpy(t->data, s->data, actual);
    t->status = status;
    t->actual = actual;
    t->completed_us = clock_stamp(s->kernel->clock);
    t->pending = false;
}

static void free_slot(struct slot *s) {
    struct slot **at = &s->kernel->slots;
    while (*at != s)
        at = &(*at)->next;
    *at = s->next;
    libusb_free_transfer(s->usb);
    free(s);
}

static void LIBUSB_CALL on_complete(struct libusb_transfer *usb) {
    struct slot *s = usb->user_data;
    int status = status_of(usb);
    if (status == -ENODEV)
        s->kernel->gone = true;
    if (s->t)
        complete(s, status, (size_t)usb->actual_length);
    free_slot(s);
}

static struct slot *new_slot(struct kernel *k, struct usb_transfer *t) {
    struct slot *s = calloc(1, sizeof *s + t->length);
    if (!s)
        return NULL;
    *s = (struct slot){.kernel = k, .t = t, .usb = libusb_alloc_transfer(0), .abandon_us = CLOCK_NEVER};
    if (!s->usb) {
        free(s);
        return NULL;
    }
    if (!(t->endpoint & 0x80))
        memcpy(s->data, t->data, t->length);
    libusb_fill_bulk_transfer(s->usb, k->handle, t->endpoint, s->data, (int)t->length, on_complete, s, 0);
    s->next = k->slots;
    k->slots = s;
    return s;
}

static int submit(void *self, struct usb_transfer *t, struct err *e) {
    struct kernel *k = self;
    if (k->gone)
        return err_set(e, ERR_LINK, "the spectrometer is gone from USB: check its cable and its power");
    struct slot *s = new_slot(k, t);
    if (!s)
        return err_set(e, ERR_NOMEM, "no memory for a USB transfer of %zu bytes", t->length);
    t->status = 0;
    t->actual = 0;
    t->submitted_us = clock_stamp(k->clock);
    int rc = libusb_submit_transfer(s->usb);
    if (rc != 0) {
        free_slot(s);
        k->gone = k->gone || rc == LIBUSB_ERROR_NO_DEVICE;
        return fail(e, rc, "send to", k->path);
    }
    t->pending = true;
    return 0;
}

static void reap(void *self) {
    struct kernel *k = self;
    struct timeval none = {0};
    libusb_handle_events_timeout_completed(k->context, &none, NULL);
    int64_t now = clock_stamp(k->clock);
    for (struct slot *s = k->slots; s; s = s->next)
        if (s->t && (k->gone || s->abandon_us <= now))
            complete(s, k->gone ? -ENODEV : -ECANCELED, 0);
}

static void cancel(void *self, struct usb_transfer *t) {
    struct kernel *k = self;
    for (struct slot *s = k->slots; s; s = s->next)
        if (s->t == t && s->abandon_us == CLOCK_NEVER) {
            s->abandon_us = clock_stamp(k->clock) + USB_LINK_ABANDON_US;
            libusb_cancel_transfer(s->usb);
        }
}

static int clear_halt(void *self, uint8_t endpoint, struct err *e) {
    struct kernel *k = self;
    int rc = libusb_clear_halt(k->handle, endpoint);
    return rc == 0 ? 0 : fail(e, rc, "clear a halted endpoint of", k->path);
}

static int reset(void *self, struct err *e) {
    struct kernel *k = self;
    int rc = libusb_reset_device(k->handle); /* claims the interface again by itself */
    if (rc == LIBUSB_ERROR_NOT_FOUND || rc == LIBUSB_ERROR_NO_DEVICE)
        k->gone = true; /* it came back as another device: only opening again finds it */
    return rc == 0 ? 0 : fail(e, rc, "reset", k->path);
}

static int64_t due_us(void *self) {
    const struct kernel *k = self;
    int64_t due = CLOCK_NEVER;
    for (const struct slot *s = k->slots; s; s = s->next)
        if (s->t && s->abandon_us < due)
            due = s->abandon_us;
    return due;
}

static int descriptors(void *self, struct pollfd *fd, int max) {
    struct kernel *k = self;
    const struct libusb_pollfd **list = libusb_get_pollfds(k->context);
    int n = 0;
    for (int i = 0; list && list[i] && n < max; i++)
        fd[n++] = (struct pollfd){.fd = list[i]->fd, .events = list[i]->events};
    libusb_free_pollfds(list);
    return n;
}

static bool all_given_back(void *arg) {
    return ((struct kernel *)arg)->slots == NULL;
}

/* libusb must hold no transfer when its context goes; a kernel that keeps one for longer costs a little
 * memory instead of a crash. */
static void close_kernel(void *self) {
    struct kernel *k = self;
    for (struct slot *s = k->slots; s; s = s->next) {
        if (s->t)
            complete(s, -ENODEV, 0);
        libusb_cancel_transfer(s->usb);
    }
    struct bench bench;
    bench_init(&bench, k->clock);
    bench_add(&bench,
              &(struct bench_service){
                  .name = "usb", .self = k, .due_us = due_us, .run = reap, .descriptors = descriptors});
    if (k->slots)
        bench_wait(&bench, clock_stamp(k->clock) + USB_LINK_CANCEL_MS * US_PER_MS, all_given_back, k, NULL);
    if (k->slots)
        return;
    if (k->handle) {
        libusb_release_interface(k->handle, INTERFACE);
        libusb_close(k->handle);
    }
    if (k->context)
        libusb_exit(k->context);
    free(k);
}

static const struct usb_link_ops OPS = {
    .submit = submit,
    .reap = reap,
    .cancel = cancel,
    .clear_halt = clear_halt,
    .reset = reset,
    .due_us = due_us,
    .descriptors = descriptors,
    .close = close_kernel,
};

static void path_of(libusb_device *device, char *path, size_t size) {
    uint8_t port[8]; /* USB allows a depth of 7 */
    int n = libusb_get_port_numbers(device, port, sizeof port);
    int used = snprintf(path, size, "%d", libusb_get_bus_number(device));
    for (int i = 0; i < n; i++)
        used += snprintf(path + used, size - used, "%c%d", i ? '.' : '-', port[i]);
}

static void describe(libusb_device *device, struct usb_device_info *info) {
    struct libusb_device_descriptor d;
    memset(info, 0, sizeof *info);
    if (libusb_get_device_descriptor(device, &d) != 0)
        return;
    info->vid = d.idVendor;
    info->pid = d.idProduct;
    path_of(device, info->path, sizeof info->path);
    struct libusb_config_descriptor *c = NULL;
    if (libusb_get_config_descriptor(device, 0, &c) != 0)
        return;
    const struct libusb_interface *interface = &c->interface[INTERFACE];
    int n = c->bNumInterfaces && interface->num_altsetting ? interface->altsetting[0].bNumEndpoints : 0;
    for (int i = 0; i < n; i++) {
        const struct libusb_endpoint_descriptor *p = &interface->altsetting[0].endpoint[i];
        if ((p->bmAttributes & 3) == LIBUSB_TRANSFER_TYPE_BULK)
            info->max_packet[(p->bEndpointAddress & 0x80 ? 16 : 0) + (p->bEndpointAddress & 15)] =
                p->wMaxPacketSize;
    }
    libusb_free_config_descriptor(c);
}

static void read_serial(libusb_device *device, libusb_device_handle *handle, struct usb_device_info *info) {
    struct libusb_device_descriptor d;
    if (libusb_get_device_descriptor(device, &d) == 0 && d.iSerialNumber)
        libusb_get_string_descriptor_ascii(handle, d.iSerialNumber, (unsigned char *)info->serial,
                                           sizeof info->serial);
}

static int claim(libusb_device_handle *handle) {
    int configuration = 0;
    int rc = libusb_get_configuration(handle, &configuration);
    /* Setting it again would reset the endpoints of a device that another program may hold. */
    if (rc == 0 && configuration != CONFIGURATION)
        rc = libusb_set_configuration(handle, CONFIGURATION);
    return rc ? rc : libusb_claim_interface(handle, INTERFACE);
}

struct search {
    uint16_t vid, pid;
    const char *serial;
    libusb_device *match[16];
    int n, others; /* others: of the same maker, another model */
    char paths[160];
};

static bool named(libusb_device *device, const char *name) {
    struct usb_device_info info;
    libusb_device_handle *handle = NULL;
    describe(device, &info);
    if (strcmp(info.path, name) == 0)
        return true;
    if (libusb_open(device, &handle) != 0)
        return false;
    read_serial(device, handle, &info);
    libusb_close(handle);
    return strcmp(info.serial, name) == 0;
}

static void find_candidates(libusb_device **list, struct search *s) {
    size_t used = 0;
    for (int i = 0; list[i]; i++) {
        struct usb_device_info info;
        describe(list[i], &info);
        if (info.vid != s->vid)
            continue;
        if (info.pid != s->pid) {
            s->others++;
        } else if (s->n < 16) {
            s->match[s->n++] = list[i];
            if (used < sizeof s->paths)
                used += snprintf(s->paths + used, sizeof s->paths - used, "%s%s", s->n > 1 ? ", " : "",
                                 info.path);
        }
    }
}

/* One device of the model is taken as it is: its EEPROM says whether it is the one. Of several, `serial` must
 * name a bus path or the serial number in the USB descriptor. */
static int choose(struct search *s, libusb_device **chosen, struct err *e) {
    if (s->n == 0)
        return err_set(e, ERR_DEVICE, "no spectrometer %04x:%04x on USB%s: check cable, power, and model",
                       s->vid, s->pid, s->others ? " (another model of the same maker is there)" : "");
    *chosen = s->match[0];
    if (s->n == 1)
        return 0;
    for (int i = 0; s->serial && i < s->n; i++)
        if (named(s->match[i], s->serial)) {
            *chosen = s->match[i];
            return 0;
        }
    return err_set(e, ERR_DEVICE,
                   "%d spectrometers %04x:%04x are on USB: set spectrometer.serial to the bus path of one "
                   "(%s)",
                   s->n, s->vid, s->pid, s->paths);
}

static int open_chosen(struct kernel *k, libusb_device *device, struct usb_device_info *info, struct err *e) {
    describe(device, info);
    memcpy(k->path, info->path, sizeof k->path);
    int rc = libusb_open(device, &k->handle);
    if (rc != 0)
        return fail(e, rc, "open", info->path);
    rc = claim(k->handle);
    if (rc != 0)
        return fail(e, rc, "claim", info->path);
    read_serial(device, k->handle, info);
    return 0;
}

int usb_link_open_libusb(struct usb_link *link, uint16_t vid, uint16_t pid, const char *serial,
                         struct clock *clock, struct err *e) {
    struct kernel *k = calloc(1, sizeof *k);
    if (!k)
        return err_set(e, ERR_NOMEM, "no memory for the USB link");
    k->clock = clock;
    struct search search = {.vid = vid, .pid = pid, .serial = serial};
    libusb_device **list = NULL, *chosen = NULL;
    int rc = libusb_init(&k->context);
    if (rc != 0)
        rc = fail(e, rc, "look for", "");
    else if (libusb_get_device_list(k->context, &list) < 0)
        rc = err_set(e, ERR_IO, "cannot list the USB devices of this machine");
    if (rc == 0) {
        find_candidates(list, &search);
        rc = choose(&search, &chosen, e);
    }
    if (rc == 0)
        rc = open_chosen(k, chosen, &link->info, e);
    if (list)
        libusb_free_device_list(list, 1);
    if (rc) {
        close_kernel(k);
        return rc;
    }
    link->ops = &OPS;
    link->self = k;
    return 0;
}

static void examine(libusb_device *device, struct usb_found *found) {
    libusb_device_handle *handle = NULL;
    describe(device, &found->info);
    int rc = libusb_open(device, &handle);
    found->can_open = rc != LIBUSB_ERROR_ACCESS;
    found->busy = rc == LIBUSB_ERROR_BUSY;
    if (rc != 0)
        return;
    read_serial(device, handle, &found->info);
    rc = libusb_claim_interface(handle, INTERFACE);
    found->busy = rc == LIBUSB_ERROR_BUSY;
    if (rc == 0)
        libusb_release_interface(handle, INTERFACE);
    libusb_close(handle);
}

int usb_link_list(struct usb_found *found, int max, struct err *e) {
    libusb_context *context = NULL;
    libusb_device **list = NULL;
    int rc = libusb_init(&context), n = 0;
    if (rc != 0)
        return err_set(e, ERR_IO, "cannot look at USB: %s", libusb_strerror(rc));
    if (libusb_get_device_list(context, &list) < 0) {
        libusb_exit(context);
        return err_set(e, ERR_IO, "cannot list the USB devices of this machine");
    }
    for (int i = 0; list[i] && n < max; i++) {
        struct libusb_device_descriptor d;
        if (libusb_get_device_descriptor(list[i], &d) != 0)
            continue;
        if (d.idVendor == VENDOR_OCEAN_OPTICS || d.idVendor == VENDOR_OCEAN_INSIGHT) {
            memset(&found[n], 0, sizeof found[n]);
            examine(list[i], &found[n++]);
        }
    }
    libusb_free_device_list(list, 1);
    libusb_exit(context);
    return n;
}
