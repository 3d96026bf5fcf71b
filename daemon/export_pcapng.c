/* pcapng: the exchanges as a capture that Wireshark opens (pcapng: draft-ietf-opsawg-pcapng). */
#include <string.h>

#include "daemon/verb_export.h"

#define SECTION_HEADER 0x0A0D0D0Au
#define INTERFACE_DESCRIPTION 1u
#define ENHANCED_PACKET 6u
#define ENDIAN_MARK 0x1A2B3C4Du
#define LINKTYPE_USER0 147
#define FRAME_MAX 300
#define LINKS_MAX 16

struct capture {
    FILE *out;
    int64_t utc_less_clock_us;
    int n_links;
    char link[LINKS_MAX][96];
    int64_t packets;
};

static void put32(FILE *out, uint32_t value) {
    fwrite(&value, sizeof value, 1, out);
}

/* Type, length, body padded to 32 bits, length again. */
static void put_block(FILE *out, uint32_t type, const void *body, size_t size) {
    static const char zeros[4];
    size_t padding = (4 - size % 4) % 4;
    uint32_t length = (uint32_t)(12 + size + padding);
    put32(out, type);
    put32(out, length);
    fwrite(body, 1, size, out);
    fwrite(zeros, 1, padding, out);
    put32(out, length);
}

static void put_section(FILE *out) {
    const uint32_t body[] = {ENDIAN_MARK, 1 /* version 1.0 */, 0xFFFFFFFFu, 0xFFFFFFFFu /* length unknown */};
    put_block(out, SECTION_HEADER, body, sizeof body);
}

/* One interface a bus, with its name (option 2); the default unit of time stamps is a microsecond. */
static void put_interface(FILE *out, const char *name) {
    uint8_t body[8 + 4 + 96 + 4] = {0};
    const uint16_t link_type = LINKTYPE_USER0, option = 2, length = (uint16_t)strlen(name);
    const uint32_t snap = FRAME_MAX;
    memcpy(body, &link_type, 2);
    memcpy(body + 4, &snap, 4);
    memcpy(body + 8, &option, 2);
    memcpy(body + 10, &length, 2);
    memcpy(body + 12, name, length);
    put_block(out, INTERFACE_DESCRIPTION, body, 12 + (length + 3u) / 4 * 4 + 4);
}

static int interface_of(struct capture *c, const char *name) {
    for (int i = 0; i < c->n_links; i++)
        if (strcmp(c->link[i], name) == 0)
            return i;
    if (c->n_links == LINKS_MAX)
        return LINKS_MAX - 1;
    snprintf(c->link[c->n_links], sizeof c->link[0], "%s", name);
    put_interface(c->out, c->link[c->n_links]);
    return c->n_links++;
}

static uint16_t crc16(const uint8_t *bytes, size_t size) {
    uint16_t crc = 0xFFFF; /* Modbus over serial line 1.02, 6.2.2 */
    for (size_t i = 0; i < size; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 1 ? (uint16_t)(crc >> 1 ^ 0xA001) : (uint16_t)(crc >> 1);
    }
    return crc;
}

static void put_packet(struct capture *c, int interface, int64_t us, const void *bytes, size_t size) {
    struct {
        uint32_t interface, high, low, captured, original;
        uint8_t frame[FRAME_MAX];
    } body;
    if (size == 0 || size + 2 > FRAME_MAX)
        return;
    uint64_t at = (uint64_t)(us + c->utc_less_clock_us);
    body.interface = (uint32_t)interface;
    body.high = (uint32_t)(at >> 32);
    body.low = (uint32_t)at;
    body.captured = body.original = (uint32_t)size + 2;
    memcpy(body.frame, bytes, size);
    uint16_t crc = crc16(bytes, size);
    body.frame[size] = (uint8_t)crc;
    body.frame[size + 1] = (uint8_t)(crc >> 8);
    put_block(c->out, ENHANCED_PACKET, &body, 20 + size + 2);
    c->packets++;
}

static int put_exchange(void *arg, const struct exchange *x) {
    struct capture *c = arg;
    int interface = interface_of(c, x->link);
    put_packet(c, interface, x->sent_us, x->request, x->request_size);
    put_packet(c, interface, x->done_us, x->reply, x->reply_size);
    return 0;
}

int export_pcapng(struct session *s, FILE *out, struct err *e) {
    struct session_summary summary;
    struct capture c = {.out = out};
    int rc = session_get_summary(s, &summary, e);
    if (rc < 0)
        return rc;
    c.utc_less_clock_us = summary.first_utc_us - summary.first_us;
    put_section(out);
    rc = session_each_exchange(s, put_exchange, &c, e);
    if (rc == 0 && c.packets == 0)
        rc = err_set(e, ERR_STATE, "the session holds no exchange of a bus");
    return rc;
}
