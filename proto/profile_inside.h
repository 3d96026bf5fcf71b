/*
 * profile_inside.h — shared by the files that read a profile; nobody else includes it.
 *
 * profile_keys.c holds the tables of keys, profile_steps.c parses conditions and sequences, profile_check.c
 * resolves names and refuses what cannot work, profile.c is the public face.
 * Checked    tests/unit/test_profile.c
 */
#ifndef PROTO_PROFILE_INSIDE_H
#define PROTO_PROFILE_INSIDE_H

#include "proto/profile.h"
#include "proto/yaml.h"

extern const struct yaml_key profile_keys[];

/* {reg: stat, mask: 0x6F, is: 0x21}; where `is` is left out it is the mask */
struct profile_masked {
    char reg[PROFILE_NAME];
    int mask, is;
    bool has_is;
};
int profile_parse_masked(struct yaml_reader *r, const struct yaml_node *node, struct profile_masked *masked);

/* Custom parsers of profile_steps.c; object is the struct their table describes. */
int profile_parse_done(struct yaml_reader *r, const struct yaml_node *node, void *profile);
int profile_parse_accept(struct yaml_reader *r, const struct yaml_node *node, void *profile);
int profile_parse_seq(struct yaml_reader *r, const struct yaml_node *node, void *profile);

/* Resolves names to indices and checks what a table of keys cannot: -ERR_INPUT with the mistakes listed. */
int profile_check(struct profile *p, struct err_list *errors);

#endif
