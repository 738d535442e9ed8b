#include "fields.h"

struct payload payload_of(uint8_t *bytes, uint16_t size)
{
    return (struct payload){.bytes = bytes, .size = size, .whole = true};
}

bool more(const struct payload *from) { return from->at < from->size; }

uint8_t get_u8(struct payload *from)
{
    if (from->at >= from->size) {
        from->whole = false;
        return 0;
    }
    return from->bytes[from->at++];
}

uint16_t get_u16(struct payload *from)
{
    uint16_t low = get_u8(from);
    return low | (uint16_t)get_u8(from) << 8;
}

uint32_t get_u32(struct payload *from)
{
    uint32_t low = get_u16(from);
    return low | (uint32_t)get_u16(from) << 16;
}

int32_t get_i32(struct payload *from) { return (int32_t)get_u32(from); }

struct samples get_samples(struct payload *from)
{
    struct samples samples = {.count = get_u16(from)};
    samples.bytes = from->bytes + from->at;
    if (samples.count > from->size - from->at) {
        from->whole = false;
        samples.count = 0;
    }
    from->at += samples.count;
    return samples;
}

void put_u8(struct payload *to, uint8_t value)
{
    if (to->at >= to->size) {
        to->whole = false;
        return;
    }
    to->bytes[to->at++] = value;
}

void put_u16(struct payload *to, uint16_t value)
{
    put_u8(to, (uint8_t)value);
    put_u8(to, (uint8_t)(value >> 8));
}

void put_u32(struct payload *to, uint32_t value)
{
    put_u16(to, (uint16_t)value);
    put_u16(to, (uint16_t)(value >> 16));
}

void put_u64(struct payload *to, uint64_t value)
{
    put_u32(to, (uint32_t)value);
    put_u32(to, (uint32_t)(value >> 32));
}

void put_i16(struct payload *to, int16_t value) { put_u16(to, (uint16_t)value); }

void put_i32(struct payload *to, int32_t value) { put_u32(to, (uint32_t)value); }

void put_text(struct payload *to, const struct text *text)
{
    put_u8(to, text->size);
    for (uint8_t at = 0; at < text->size; at++)
        put_u8(to, (uint8_t)text->bytes[at]);
}

static void put_tail(struct payload *to, const void *bytes, uint16_t size, uint16_t period)
{
    to->tail = bytes;
    to->tail_at = to->at;
    to->tail_size = size;
    to->tail_period = period ? period : size;
}

void put_numbers(struct payload *to, const struct numbers *numbers)
{
    put_u8(to, numbers->count);
    put_tail(to, numbers->values, 4 * numbers->count, 0);
}

void put_samples(struct payload *to, const struct samples *samples)
{
    put_u16(to, samples->count);
    if (to->tail) {
        for (uint16_t at = 0; at < samples->count; at++)
            put_u8(to, samples->bytes[at]);
        return;
    }
    put_tail(to, samples->bytes, samples->count, samples->period);
}
