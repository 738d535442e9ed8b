/* Fields of messages as they lie on the wire: little-endian, nothing padded.
 *
 * Takes a payload and a value; a payload that ends too soon, or is full, is no longer `whole` and takes no further harm.
 * What is long is not copied: it is the payload's tail, sent from where it lies.
 */
#ifndef FIELDS_H
#define FIELDS_H

#include <stdbool.h>
#include <stdint.h>

struct payload {
    uint8_t *bytes;
    uint16_t size; // bytes there are, or room for them
    uint16_t at;
    bool whole;
    const uint8_t *tail; // goes between the bytes before and behind `tail_at`
    uint16_t tail_at;
    uint16_t tail_size;
    uint16_t tail_period; // from there on its bytes come again
};

struct text {
    const char *bytes;
    uint8_t size;
};

struct numbers {
    const uint32_t *values; // little-endian, as on every machine this is built for
    uint8_t count;
};

struct samples {
    const uint8_t *bytes;
    uint16_t count;
    uint16_t period; // where they come over and over: after how many; 0 where they do not
};

struct payload payload_of(uint8_t *bytes, uint16_t size);

bool more(const struct payload *from); // whether anything is left of it
uint8_t get_u8(struct payload *from);
uint16_t get_u16(struct payload *from);
uint32_t get_u32(struct payload *from);
int32_t get_i32(struct payload *from);
struct samples get_samples(struct payload *from); // they stay where they are

void put_u8(struct payload *to, uint8_t value);
void put_u16(struct payload *to, uint16_t value);
void put_u32(struct payload *to, uint32_t value);
void put_u64(struct payload *to, uint64_t value);
void put_i16(struct payload *to, int16_t value);
void put_i32(struct payload *to, int32_t value);
void put_text(struct payload *to, const struct text *text);
void put_numbers(struct payload *to, const struct numbers *numbers); // one of these two a message, once
void put_samples(struct payload *to, const struct samples *samples);

#endif
