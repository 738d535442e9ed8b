/* The last readings of a scan, packed tight, to be sent again when the host asks.
 *
 * They share one store: the fewer echoes they have, the more of them there is room for, up to 64.
 */
#ifndef KEPT_H
#define KEPT_H

#include <stdbool.h>
#include <stdint.h>

#define ECHOES_MOST 34 // of a reading
#define KEPT_STORE 616 // bytes
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
// The next one; its echoes are ticks like those of a reading, at most ECHOES_MOST.
void kept_add(uint64_t fired_us, int16_t temperature, const uint32_t *echoes, uint8_t echo_count);
uint32_t kept_first(void); // number of the oldest still there
uint32_t kept_end(void); // number the next one will have
void kept_get(uint32_t number, struct reading *reading); // one that is still there
uint8_t kept_promised(uint8_t echoes); // how many are kept at least where none has more echoes

#endif
