#include "kept.h"

#define LONG_DELTA 0xFFFF // means this many ticks, and that the next value is added to it

_Static_assert(KEPT_STORE >= 8 * KEPT_SIZE(ECHOES_MOST), "the protocol requires at least eight kept readings");

// Format of a reading: lower half of fired_us, temperature, number of echoes, ticks from each echo to the next.
static struct {
    uint32_t end;
    uint64_t fired_us; // of the newest
    uint16_t from, used; // the part of the store that is in use
    uint8_t count;
    uint8_t store[KEPT_STORE];
} kept;

struct cursor {
    uint16_t at;
};

static uint8_t take_u8(struct cursor *cursor)
{
    uint8_t byte = kept.store[cursor->at];
    cursor->at = cursor->at + 1 == KEPT_STORE ? 0 : cursor->at + 1;
    return byte;
}

static uint16_t take_u16(struct cursor *cursor)
{
    uint16_t low = take_u8(cursor);
    return low | (uint16_t)take_u8(cursor) << 8;
}

static void take(struct cursor *cursor, struct reading *reading)
{
    uint32_t low = take_u16(cursor);
    low |= (uint32_t)take_u16(cursor) << 16;
    // all readings are much younger than 71 minutes, after which the lower half wraps
    reading->fired_us = kept.fired_us - (uint32_t)((uint32_t)kept.fired_us - low);
    reading->temperature = (int16_t)take_u16(cursor);
    reading->echo_count = take_u8(cursor);
    uint32_t ticks = 0;
    for (uint8_t echo = 0; echo < reading->echo_count; echo++) {
        uint16_t delta;
        do
            ticks += delta = take_u16(cursor);
        while (delta == LONG_DELTA);
        reading->echoes[echo] = ticks;
    }
}

static void keep_u8(struct cursor *cursor, uint8_t byte)
{
    kept.store[cursor->at] = byte;
    cursor->at = cursor->at + 1 == KEPT_STORE ? 0 : cursor->at + 1;
    kept.used++;
}

static void keep_u16(struct cursor *cursor, uint16_t value)
{
    keep_u8(cursor, (uint8_t)value);
    keep_u8(cursor, (uint8_t)(value >> 8));
}

static void drop_oldest(void)
{
    struct cursor cursor = {(kept.from + 6) % KEPT_STORE};
    for (uint8_t echoes = take_u8(&cursor); echoes; echoes--)
        while (take_u16(&cursor) == LONG_DELTA)
            ;
    kept.used -= (cursor.at + KEPT_STORE - kept.from) % KEPT_STORE;
    kept.from = cursor.at;
    kept.count--;
}

void kept_clear(uint32_t next)
{
    kept.end = next;
    kept.from = kept.used = 0;
    kept.count = 0;
}

void kept_add(uint64_t fired_us, int16_t temperature, const uint32_t *echoes, uint8_t echo_count)
{
    while (kept.count == KEPT_MOST || kept.used + KEPT_SIZE(echo_count) > KEPT_STORE)
        drop_oldest();
    struct cursor cursor = {(kept.from + kept.used) % KEPT_STORE};
    keep_u16(&cursor, (uint16_t)fired_us);
    keep_u16(&cursor, (uint16_t)(fired_us >> 16));
    keep_u16(&cursor, (uint16_t)temperature);
    keep_u8(&cursor, echo_count);
    uint32_t before = 0;
    for (; echo_count; echo_count--, echoes++) {
        uint32_t delta = *echoes - before;
        before = *echoes;
        for (; delta >= LONG_DELTA; delta -= LONG_DELTA)
            keep_u16(&cursor, LONG_DELTA);
        keep_u16(&cursor, (uint16_t)delta);
    }
    kept.fired_us = fired_us;
    kept.end++;
    kept.count++;
}

uint32_t kept_first(void) { return kept.end - kept.count; }

uint32_t kept_end(void) { return kept.end; }

void kept_get(uint32_t number, struct reading *reading)
{
    struct cursor cursor = {kept.from};
    uint32_t older = number - kept_first();
    do
        take(&cursor, reading);
    while (older--);
    reading->number = number;
}

uint8_t kept_at_least(uint8_t echoes)
{
    uint16_t fit = KEPT_STORE / KEPT_SIZE(echoes);
    return fit < KEPT_MOST ? (uint8_t)fit : KEPT_MOST;
}
