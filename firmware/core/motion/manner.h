/* How the table turns to a heading. */
#ifndef MANNER_H
#define MANNER_H

#include <stdint.h>

struct turntable_manner {
    uint16_t speed; // steps/s
    uint32_t acceleration; // steps/s²
    uint32_t settle_us;
    uint8_t approach; // enum approach
};

// Set speed, acceleration, settling and approach. 0 selects the default; values out of range are limited.
void turntable_set_manner(struct turntable_manner request);
struct turntable_manner turntable_manner(void);

#endif
