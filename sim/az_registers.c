#include "sim/az_registers.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Addresses, bits and codes: stage-modbus.md 1.2 to 1.7. */
enum {
    REG_DIRECT = 0x0058,
    REG_TRIGGER = 0x0066,
    REG_DIRECT_END = 0x0068,
    REG_COMMAND = 0x007C,
    REG_STATUS = 0x007E,
    REG_ALARM = 0x0080,
    REG_COMM_ERROR = 0x00AC,
    REG_DEMAND = 0x00C6,
    REG_POSITION = 0x00CC,
    REG_SPEED_RPM = 0x00CE,
    REG_SPEED_HZ = 0x00D0,
    REG_TORQUE = 0x00D6,
    REG_DRIVER_TEMP = 0x00F8,
    REG_MOTOR_TEMP = 0x00FA,
    REG_INTERNAL = 0x0178,
    REG_ALARM_RESET = 0x0180,
    REG_CLEAR_HISTORY = 0x0184,
    REG_PRESET = 0x018A,
    REG_LIMIT_HIGH = 0x0388,
    REG_LIMIT_LOW = 0x038A,
    REG_PRESET_POSITION = 0x038C
};

enum {
    BIT_ZHOME = 1 << 4,
    BIT_STOP = 1 << 5,
    BIT_FREE = 1 << 6,
    BIT_ALM_RST = 1 << 7,
    STATUS_HOME_END = 1 << 4,
    STATUS_READY = 1 << 5,
    STATUS_ALARM = 1 << 7,
    STATUS_MOVE = 1 << 13,
    STATUS_IN_POS = 1 << 14
};

enum {
    ALARM_NO_COORDINATES = 0x4A,
    ALARM_HARD_LIMIT = 0x66,
    ALARM_SOFT_LIMIT = 0x67,
    ALARM_BAD_DATA = 0x70,
    ALARM_COMM_TIMEOUT = 0x85
};

enum { BAD_FUNCTION = 1, BAD_ADDRESS = 2, BAD_COUNT = 3, BAD_VALUE = 4 };

#define SETTLE_US 30000   /* of the feedback after the profile's end: IN-POS waits for it */
#define SPEED_MAX 4000000 /* Hz */
#define ACCEL_MAX 1000000000
#define STEPS_PER_MOTOR_REV 2000.0 /* 0.01 deg/step through 18:1 */

struct order { /* the direct data, from REG_DIRECT on */
    int32_t number, type, position, speed, accel, decel, current, trigger, destination;
};

static int32_t item(const struct az_unit *u, int addr) {
    return (int32_t)((uint32_t)u->image[addr] << 16 | u->image[addr + 1]);
}

static void put_item(struct az_unit *u, int addr, int32_t value) {
    u->image[addr] = (uint16_t)((uint32_t)value >> 16);
    u->image[addr + 1] = (uint16_t)value;
}

static bool alarmed(const struct az_unit *u, int64_t now_us) {
    return u->alarm != 0 && now_us >= u->alarm_us;
}

static void raise_alarm(struct az_unit *u, int code, int64_t when_us) {
    u->alarm = code;
    u->alarm_us = when_us;
    memmove(u->history + 1, u->history, sizeof u->history - sizeof u->history[0]);
    u->history[0] = code;
}

/* Whatever limit lies on the way stops the motion there, with its alarm once it is reached. */
static void watch_limits(struct az_unit *u, int64_t now_us) {
    double soft_high = item(u, REG_LIMIT_HIGH), soft_low = item(u, REG_LIMIT_LOW);
    const struct az_config *c = &u->config;
    if (u->coordinates && (soft_high != 0 || soft_low != 0)) {
        int64_t high = plant_halt_at(&u->plant, now_us, soft_high);
        int64_t low = plant_halt_at(&u->plant, now_us, soft_low);
        if (high != INT64_MAX || low != INT64_MAX)
            raise_alarm(u, ALARM_SOFT_LIMIT, high < low ? high : low);
    }
    if (c->hard_low < c->hard_high) {
        int64_t high = plant_halt_at(&u->plant, now_us, c->hard_high);
        int64_t low = plant_halt_at(&u->plant, now_us, c->hard_low);
        if (high != INT64_MAX || low != INT64_MAX)
            raise_alarm(u, ALARM_HARD_LIMIT, high < low ? high : low);
    }
}

static void go(struct az_unit *u, int64_t now_us, int64_t start_us, const struct plant_order *o) {
    if (u->alarm != 0 && !alarmed(u, now_us))
        u->alarm = 0; /* the limit ahead belonged to the motion that is replaced */
    u->order_us = now_us;
    plant_move(&u->plant, start_us, o);
    watch_limits(u, start_us);
}

static int check_order(const struct order *o) {
    if (o->type < 1 || o->type > 3 || o->speed == 0 || o->speed < -SPEED_MAX || o->speed > SPEED_MAX)
        return BAD_VALUE;
    if (o->accel < 1 || o->accel > ACCEL_MAX || o->decel < 1 || o->decel > ACCEL_MAX)
        return BAD_VALUE;
    return o->current < 0 || o->current > 1000 || o->destination < 0 || o->destination > 1 ? BAD_VALUE : 0;
}

static int execute(struct az_unit *u, int64_t now_us) {
    struct order o;
    for (int i = 0; i < (int)(sizeof o / sizeof(int32_t)); i++)
        ((int32_t *)&o)[i] = item(u, REG_DIRECT + 2 * i);
    int bad = check_order(&o);
    if (bad)
        return bad;
    uint16_t command = u->image[REG_COMMAND + 1];
    if (alarmed(u, now_us) || (command & (BIT_STOP | BIT_FREE)))
        return 0; /* STOP is a level: the order is taken and nothing moves; no exception says so */
    if (o.type == 1 && !u->coordinates) {
        raise_alarm(u, ALARM_NO_COORDINATES, now_us);
        return 0;
    }
    int32_t from = o.type == 2   ? u->plant.target_steps
                   : o.type == 3 ? (int32_t)lround(plant_motor_steps(&u->plant, now_us))
                                 : 0;
    int64_t target = (int64_t)from + o.position;
    if (target < INT32_MIN || target > INT32_MAX) {
        raise_alarm(u, ALARM_BAD_DATA, now_us);
        return 0;
    }
    int64_t start_us = now_us + PLANT_START_US;
    if (o.destination == 1 && plant_end_us(&u->plant) > start_us)
        start_us = plant_end_us(&u->plant);
    go(u, now_us, start_us, &(struct plant_order){(int32_t)target, abs(o.speed), o.accel, o.decel});
    return 0;
}

static void home(struct az_unit *u, int64_t now_us) {
    if (alarmed(u, now_us))
        return;
    u->coordinates = true;
    const struct az_config *c = &u->config;
    go(u, now_us, now_us + PLANT_START_US,
       &(struct plant_order){0, c->home_speed, c->home_accel, c->home_accel});
}

static void stop(struct az_unit *u, int64_t now_us) {
    int32_t decel = item(u, REG_DIRECT + 10);
    plant_stop(&u->plant, now_us, decel > 0 ? decel : u->config.home_accel);
    if (u->alarm != 0 && !alarmed(u, now_us))
        u->alarm = 0;
    watch_limits(u, now_us);
}

static void command_edges(struct az_unit *u, int64_t now_us, uint16_t before) {
    uint16_t now = u->image[REG_COMMAND + 1], rising = now & (uint16_t)~before;
    if (rising & BIT_ALM_RST)
        u->alarm = 0;
    if (rising & (BIT_STOP | BIT_FREE))
        stop(u, now_us);
    if ((rising & BIT_ZHOME) && !(now & (BIT_STOP | BIT_FREE)))
        home(u, now_us);
}

static uint32_t status(const struct az_unit *u, int64_t now_us) {
    const struct plant *p = &u->plant;
    bool moving = plant_moving(p, now_us), alarm = alarmed(u, now_us);
    bool held = u->image[REG_COMMAND + 1] & (BIT_STOP | BIT_FREE);
    bool under_way = plant_end_us(p) > now_us && u->order_us + PLANT_START_US <= now_us;
    bool settled = !moving && !under_way &&
                   (now_us >= plant_end_us(p) + SETTLE_US || now_us < u->order_us + PLANT_START_US);
    uint32_t bits = moving ? STATUS_MOVE : 0;
    if (settled)
        bits |= STATUS_IN_POS;
    if (!moving && !under_way && !alarm && !held)
        bits |= STATUS_READY;
    if (alarm)
        bits |= STATUS_ALARM;
    if (u->coordinates && !moving && plant_motor_steps(p, now_us) == 0)
        bits |= STATUS_HOME_END;
    return bits;
}

static int32_t internal_outputs(const struct az_unit *u, int64_t now_us) {
    double at = plant_motor_steps(&u->plant, now_us);
    int32_t high = item(u, REG_LIMIT_HIGH), low = item(u, REG_LIMIT_LOW), bits = 0;
    if (u->coordinates && (high != 0 || low != 0))
        bits |= (at >= high ? 1 : 0) | (at <= low ? 2 : 0);
    return bits | (u->coordinates ? 1 << 2 | 1 << 3 | 1 << 4 : 0);
}

static int32_t value(const struct az_unit *u, int64_t now_us, int addr) {
    const struct plant *p = &u->plant;
    if (addr > REG_ALARM && addr <= REG_ALARM + 2 * AZ_HISTORY)
        return u->history[(addr - REG_ALARM) / 2 - 1];
    switch (addr) {
    case REG_STATUS:
        return (int32_t)status(u, now_us);
    case REG_ALARM:
        return alarmed(u, now_us) ? u->alarm : 0;
    case REG_DEMAND:
    case REG_POSITION:
        return (int32_t)lround(plant_motor_steps(p, now_us));
    case REG_SPEED_HZ:
        return (int32_t)lround(plant_speed(p, now_us));
    case REG_SPEED_RPM:
        return (int32_t)lround(plant_speed(p, now_us) * 60 / STEPS_PER_MOTOR_REV);
    case REG_TORQUE:
        return plant_moving(p, now_us) ? 180 : 20;
    case REG_DRIVER_TEMP:
        return 352;
    case REG_MOTOR_TEMP:
        return 318;
    case REG_INTERNAL:
        return internal_outputs(u, now_us);
    default:
        return item(u, addr);
    }
}

static bool writable(int addr) {
    return (addr >= REG_DIRECT && addr < REG_DIRECT_END + 2) || (addr >= 0x0074 && addr < REG_STATUS) ||
           (addr >= REG_ALARM_RESET && addr < 0x0194) || (addr >= 0x02A2 && addr < 0x02A4) ||
           (addr >= 0x0380 && addr < REG_PRESET_POSITION + 2);
}

static int take_effect(struct az_unit *u, int64_t now_us, int first, int last, const uint16_t *before) {
    bool all = first <= REG_TRIGGER + 1 && last >= REG_TRIGGER + 1 && item(u, REG_TRIGGER) == 1;
    int64_t single =
        -(int64_t)item(u, REG_TRIGGER); /* 1 = current ... 7 = data number, back from the trigger */
    bool one = single >= 1 && single <= 7 && first <= REG_TRIGGER - 2 * single + 1 &&
               last >= REG_TRIGGER - 2 * single + 1;
    int bad = all || one ? execute(u, now_us) : 0;
    if (bad)
        return bad;
    if (first <= REG_COMMAND + 1 && last >= REG_COMMAND + 1)
        command_edges(u, now_us, before[REG_COMMAND + 1]);
    if (last >= REG_ALARM_RESET + 1 && before[REG_ALARM_RESET + 1] == 0 && u->image[REG_ALARM_RESET + 1] == 1)
        u->alarm = 0;
    if (first <= REG_CLEAR_HISTORY + 1 && last >= REG_CLEAR_HISTORY + 1 &&
        u->image[REG_CLEAR_HISTORY + 1] == 1)
        memset(u->history, 0, sizeof u->history);
    if (last >= REG_PRESET + 1 && before[REG_PRESET + 1] == 0 && u->image[REG_PRESET + 1] == 1) {
        plant_init(&u->plant, u->plant.key, u->plant.u_repeat_deg, u->plant.lost_motion_deg,
                   item(u, REG_PRESET_POSITION));
        u->coordinates = true;
    }
    return 0;
}

static int write_words(struct az_unit *u, int64_t now_us, int addr, int count, const uint8_t *words) {
    for (int i = 0; i < count; i++)
        if (!writable(addr + i))
            return BAD_ADDRESS;
    uint16_t before[AZ_SPACE];
    memcpy(before, u->image, sizeof before);
    for (int i = 0; i < count; i++)
        u->image[addr + i] = (uint16_t)(words[2 * i] << 8 | words[2 * i + 1]);
    return take_effect(u, now_us, addr, addr + count - 1, before);
}

static int read_words(const struct az_unit *u, int64_t now_us, int addr, int count, uint8_t *out) {
    if (addr + count > AZ_SPACE)
        return BAD_ADDRESS;
    for (int i = 0; i < count; i++) {
        uint32_t v = (uint32_t)value(u, now_us, (addr + i) & ~1);
        uint16_t word = (uint16_t)((addr + i) & 1 ? v : v >> 16);
        out[2 * i] = (uint8_t)(word >> 8);
        out[2 * i + 1] = (uint8_t)word;
    }
    return 0;
}

static int get16(const uint8_t *b) {
    return b[0] << 8 | b[1];
}

static size_t reply_read(struct az_unit *u, int64_t now_us, const uint8_t *pdu, size_t size, uint8_t *reply,
                         int *bad) {
    int count = size == 5 ? get16(pdu + 3) : 0;
    if (count < 1 || count > 125) {
        *bad = BAD_COUNT;
        return 0;
    }
    reply[1] = (uint8_t)(2 * count);
    *bad = read_words(u, now_us, get16(pdu + 1), count, reply + 2);
    return 2 + 2 * (size_t)count;
}

static size_t reply_write(struct az_unit *u, int64_t now_us, const uint8_t *pdu, size_t size, uint8_t *reply,
                          int *bad) {
    bool one = pdu[0] == 6;
    int count = one ? 1 : size >= 6 ? get16(pdu + 3) : 0;
    if (count < 1 || count > 123 || size != (one ? 5 : 6 + 2 * (size_t)count) ||
        (!one && pdu[5] != 2 * count)) {
        *bad = BAD_COUNT;
        return 0;
    }
    *bad = write_words(u, now_us, get16(pdu + 1), count, one ? pdu + 3 : pdu + 6);
    memcpy(reply + 1, pdu + 1, 4);
    return 5;
}

static size_t reply_both(struct az_unit *u, int64_t now_us, const uint8_t *pdu, size_t size, uint8_t *reply,
                         int *bad) {
    int n_read = size >= 10 ? get16(pdu + 3) : 0, n_write = size >= 10 ? get16(pdu + 7) : 0;
    if (n_read < 1 || n_read > 125 || n_write < 1 || n_write > 121 || size != 10 + 2 * (size_t)n_write ||
        pdu[9] != 2 * n_write) {
        *bad = BAD_COUNT;
        return 0;
    }
    *bad = write_words(u, now_us, get16(pdu + 5), n_write, pdu + 10);
    if (!*bad)
        *bad = read_words(u, now_us, get16(pdu + 1), n_read, reply + 2);
    reply[1] = (uint8_t)(2 * n_read);
    return 2 + 2 * (size_t)n_read;
}

static size_t reply_echo(const uint8_t *pdu, size_t size, uint8_t *reply, int *bad) {
    *bad = size < 3 || get16(pdu + 1) != 0 ? BAD_FUNCTION : 0;
    memcpy(reply, pdu, size);
    return size;
}

size_t az_reply(struct az_unit *u, int64_t now_us, const uint8_t *pdu, size_t size,
                uint8_t reply[AZ_PDU_MAX]) {
    az_update(u, now_us);
    if (u->config.mute || size == 0 || size > AZ_PDU_MAX)
        return 0;
    int bad = BAD_FUNCTION;
    size_t n = 0;
    if (pdu[0] == 3)
        n = reply_read(u, now_us, pdu, size, reply, &bad);
    else if (pdu[0] == 6 || pdu[0] == 0x10)
        n = reply_write(u, now_us, pdu, size, reply, &bad);
    else if (pdu[0] == 0x17)
        n = reply_both(u, now_us, pdu, size, reply, &bad);
    else if (pdu[0] == 8)
        n = reply_echo(pdu, size, reply, &bad);
    reply[0] = bad ? pdu[0] | 0x80 : pdu[0];
    if (!bad)
        return n;
    reply[1] = (uint8_t)bad;
    return 2;
}

void az_init(struct az_unit *u, const struct az_config *config, uint64_t key, double u_repeat_deg,
             double lost_motion_deg) {
    memset(u, 0, sizeof *u);
    u->config = *config;
    u->coordinates = !config->no_coordinates;
    u->fed_us = INT64_MAX;
    u->order_us = INT64_MIN / 2;
    plant_init(&u->plant, key, u_repeat_deg, lost_motion_deg, config->at_steps);
    put_item(u, REG_DIRECT + 2, 1);
    put_item(u, REG_DIRECT + 6, (int32_t)config->home_speed);
    put_item(u, REG_DIRECT + 8, (int32_t)config->home_accel);
    put_item(u, REG_DIRECT + 10, (int32_t)config->home_accel);
    put_item(u, REG_DIRECT + 12, 1000);
}

void az_update(struct az_unit *u, int64_t now_us) {
    int64_t limit_us = u->config.watchdog_ms * 1000LL;
    if (limit_us == 0 || u->fed_us == INT64_MAX || now_us - u->fed_us <= limit_us)
        return;
    int64_t expired_us = u->fed_us + limit_us;
    u->fed_us = INT64_MAX; /* it trips once; the next valid message arms it again */
    stop(u, expired_us);
    raise_alarm(u, ALARM_COMM_TIMEOUT, expired_us);
}

void az_feed(struct az_unit *u, int64_t now_us) {
    az_update(u, now_us);
    u->fed_us = now_us;
}
