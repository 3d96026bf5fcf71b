/*
 * crc.h — CRC-32, the checksum under each row of a session.
 *
 * Polynomial 0x04C11DB7, reflected, start and end inverted: the one of zlib, gzip and Ethernet (ISO/IEC 8802-3, 3.2.9),
 * so that a reader in Python or R needs nothing of ours. crc32_add(0, ...) begins; its result goes into the next call.
 *
 * Promises   no flipped burst of 32 bits or fewer goes unnoticed; of any other damage one in 4e9.
 * Checked    tests/unit/test_crc.c
 */
#ifndef PROTO_CRC_H
#define PROTO_CRC_H

#include <stddef.h>
#include <stdint.h>

uint32_t crc32_add(uint32_t crc, const void *bytes, size_t size);

#endif
