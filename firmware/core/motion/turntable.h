/* The turntable: where it points, how it finds its zero, and how it gets somewhere.
 *
 * It comes to every heading from the same side, so that play in the gear makes no difference, and never turns beyond the
 * reach of the cable. Takes orders; is stepped by an interrupt and looked after by `turntable_work`.
 */
#ifndef TURNTABLE_H
#define TURNTABLE_H

#include <stdbool.h>
#include <stdint.h>

enum turntable_trouble {
    TROUBLE_NONE,
    TROUBLE_NO_MARK, // turned as far as the cable allows, and saw no zero mark
    TROUBLE_LOST_STEPS, // the zero mark came elsewhere than counted, or not at all
};

struct turntable_manner {
    uint16_t speed; // steps/s
    uint32_t acceleration; // steps/s²
    uint32_t settle_us;
    uint8_t approach; // enum approach
};

void turntable_reset(void);
// How to turn from now on: 0 is its own speed, or acceleration; what it cannot do is brought to what it can.
void turntable_set_manner(struct turntable_manner wish);
struct turntable_manner turntable_manner(void);
bool turntable_homed(void);
int32_t turntable_microdegrees(void); // 0 before it is homed
bool turntable_reaches(int64_t microdegrees);
int32_t turntable_nearest(int32_t microdegrees); // where a microstep lies

void turntable_home(void);
void turntable_turn(int32_t microdegrees); // to the nearest microstep; must be homed and within reach
void turntable_halt(void); // as soon as the ramp allows; a home that is stopped leaves it without its zero
void turntable_release(void); // without current it may be turned by hand: it must be homed again

// Goes on to the next leg of a move when one has ended; true while it turns or settles.
bool turntable_work(uint64_t now_us);
enum turntable_trouble turntable_trouble(void); // of the last move
int32_t turntable_lost(void); // microsteps found missing since the start, all together

// Called by the step interrupt after each step: ticks until the next, 0 to end.
uint16_t turntable_step(void);

#endif
