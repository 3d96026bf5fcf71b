#include "daemon/writer_private.h"

static int check_id(int64_t given, int64_t expected, struct err *e) {
    if (given == expected)
        return 0;
    return err_set(e, ERR_IO,
                   "row %lld was written as number %lld: is another program writing to this session?",
                   (long long)expected, (long long)given);
}

static int write_exchange(struct session *s, const struct record *r, struct err *e) {
    const struct queued_exchange *x = r->object;
    const char *reply = (const char *)r->bytes + x->request_size;
    return session_add_exchange(s, x->sent_us, x->done_us, r->key, r->bytes, x->request_size, reply,
                                x->reply_size, x->result, e);
}

int writer_row(struct session *s, struct record *r, struct err *e) {
    int result = 0;
    switch (r->kind) {
    case RECORD_TEXT:
        return session_set_text(s, r->key, r->bytes, e);
    case RECORD_CALIBRATION:
        return session_set_calibration(s, r->object, e);
    case RECORD_EXPOSURE:
        ((struct exposure *)r->object)->counts = r->bytes;
        result = session_add_exposure(s, r->object, e);
        return result < 0 ? result : check_id(((struct exposure *)r->object)->id, r->id, e);
    case RECORD_POINT:
        result = session_add_point(s, r->object, e);
        return result < 0 ? result : check_id(((struct point *)r->object)->id, r->id, e);
    case RECORD_BRACKET:
        return session_add_bracket(s, r->object, e);
    case RECORD_LINEARITY:
        return session_add_linearity(s, r->object, e);
    case RECORD_ESTIMATE:
        return session_add_estimate(s, r->us, r->id, r->object, e);
    case RECORD_SLOPES:
        return session_add_slopes(s, r->object, (size_t)r->id, e);
    case RECORD_JOINT:
        ((struct joint *)r->object)->statistical = r->bytes;
        ((struct joint *)r->object)->common = (double *)r->bytes + r->id;
        return session_add_joint(s, r->object, e);
    case RECORD_MODELS:
        return session_add_models(s, r->bytes, e);
    case RECORD_EVENT:
        return session_add_event(s, r->us, r->key, r->bytes, e);
    case RECORD_EXCHANGE:
        return write_exchange(s, r, e);
    default:
        return 0;
    }
}
