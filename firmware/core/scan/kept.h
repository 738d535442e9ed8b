/* The last readings of a scan, in compressed form, for Resend.
 *
 * They share one store: readings with few echoes need less space, so more of them are kept, up to 64.
 */
#ifndef KEPT_H
#define KEPT_H

#include <stdbool.h>
#include <stdint.h>

#include "board_facts.h" // ECHOES_MOST, KEPT_STORE

#define KEPT_MOST 64
#define KEPT_SIZE(echoes) (9 + 2 * (echoes)) // bytes of a reading, at most

struct reading {
    uint32_t number;
    uint64_t fired_us;
    int16_t temperature;
    uint8_t echo_count;
    uint32_t echoes[ECHOES_MOST]; // ticks of half a microsecond, earliest first, less than 2^17
};

void kept_clear(uint32_t next); // the number that the next reading will have
// Store the next reading. Echoes are in ticks, as in struct reading, at most ECHOES_MOST.
void kept_add(uint64_t fired_us, int16_t temperature, const uint32_t *echoes, uint8_t echo_count);
uint32_t kept_first(void); // number of the oldest kept reading
uint32_t kept_end(void); // number of the next reading
void kept_get(uint32_t number, struct reading *reading); // `number` must still be kept
uint8_t kept_at_least(uint8_t echoes); // number of readings kept at least, if none has more echoes

#endif
