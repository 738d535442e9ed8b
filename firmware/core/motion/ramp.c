#include "ramp.h"

#include "ramp_table.h" // ramp_table

static uint16_t root(uint32_t square)
{
    uint16_t found = 0;
    for (uint16_t bit = 0x8000; bit; bit >>= 1)
        if ((uint32_t)(found | bit) * (found | bit) <= square)
            found |= bit;
    return found;
}

struct ramp ramp_of(uint16_t steps, uint32_t acceleration, uint16_t speed)
{
    // first = 2e6 sqrt(2 / a) = sqrt(8e12 / a)
    uint16_t first = root((uint32_t)(8000000000000ULL / acceleration));
    uint32_t even = TICKS_PER_SECOND / speed;
    uint32_t top = (uint32_t)speed * speed / (2 * acceleration);
    // at a speed below that of the first step, there is no acceleration
    return (struct ramp){
        .left = steps,
        .top = top < RAMP_STEPS ? (uint16_t)top : RAMP_STEPS - 1,
        .first = first > even ? first : (uint16_t)even,
    };
}

uint16_t ramp_next(struct ramp *ramp)
{
    if (!ramp->left)
        return 0;
    uint16_t ticks = ((uint32_t)ramp->first * flash_u16(&ramp_table[ramp->index])) >> 16;
    ramp->left--;
    // the remaining steps must suffice for deceleration
    if (ramp->index + 1 < ramp->left && ramp->index < ramp->top)
        ramp->index++;
    else if (ramp->index >= ramp->left && ramp->left)
        ramp->index = ramp->left - 1;
    return ticks;
}

void ramp_halt(struct ramp *ramp)
{
    if (ramp->left > ramp->index + 1)
        ramp->left = ramp->index + 1;
}
