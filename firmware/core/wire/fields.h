/* Encoding and decoding of message fields: little-endian, without padding.
 *
 * If a payload ends too soon or is full, `whole` becomes false and nothing is written. The first array is not copied: it
 * becomes the tail of the payload, which is sent from its present address. A second array must be short; it is copied.
 */
#ifndef FIELDS_H
#define FIELDS_H

#include <stdbool.h>
#include <stdint.h>

struct payload {
    uint8_t *bytes;
    uint16_t size; // length or capacity in bytes
    uint16_t at;
    bool whole;
    const uint8_t *tail; // is inserted at `tail_at`
    uint16_t tail_at;
    uint16_t tail_size;
    uint16_t tail_period; // the tail repeats after this many bytes
};

struct text {
    const char *bytes;
    uint8_t size;
};

struct numbers {
    const uint32_t *values; // little-endian, as all supported processors are
    uint8_t count;
};

struct samples {
    const uint8_t *bytes;
    uint16_t count;
    uint16_t period; // the bytes repeat after this many; 0: no repetition
};

struct payload payload_of(uint8_t *bytes, uint16_t size);

bool more(const struct payload *from); // whether bytes are left
uint8_t get_u8(struct payload *from);
uint16_t get_u16(struct payload *from);
uint32_t get_u32(struct payload *from);
int32_t get_i32(struct payload *from);
struct samples get_samples(struct payload *from); // not copied

void put_u8(struct payload *to, uint8_t value);
void put_u16(struct payload *to, uint16_t value);
void put_u32(struct payload *to, uint32_t value);
void put_u64(struct payload *to, uint64_t value);
void put_i16(struct payload *to, int16_t value);
void put_i32(struct payload *to, int32_t value);
void put_text(struct payload *to, const struct text *text);
void put_numbers(struct payload *to, const struct numbers *numbers);
void put_samples(struct payload *to, const struct samples *samples);

#endif
