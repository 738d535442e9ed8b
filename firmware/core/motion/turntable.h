/* Turns the table, finds its zero and checks the zero mark.
 *
 * Approaches every heading in the same direction, so that backlash has no effect, and never turns beyond the limits of
 * the cable. An interrupt makes the steps; `turntable_work` controls the movement.
 */
#ifndef TURNTABLE_H
#define TURNTABLE_H

#include <stdbool.h>
#include <stdint.h>

#include "messages.h" // enum zero

enum turntable_trouble {
    TROUBLE_NONE,
    TROUBLE_NO_MARK, // the cam changed, but no mark came; with one switch: the mark never changed
    TROUBLE_CAM, // the cam never changed
    TROUBLE_WRONG_WAY, // the mark came far from the cam, or on the other side of the switch
    TROUBLE_LIMIT, // homing has used the whole way that the cable allows
    TROUBLE_LOST_STEPS, // the zero mark was not at its position, or missing
};

void turntable_reset(void);
enum zero turntable_zero(void);
bool turntable_homed(void); // whether the zero is known
int32_t turntable_microdegrees(void); // 0 before it is homed

void turntable_home(void);
void turntable_stay(void); // end a halt, and clear the trouble of the last movement
void turntable_set_zero(void); // here; the mark is not checked until the next Home
void turntable_turn(int32_t microdegrees); // to the nearest microstep; must be homed and within reach
bool turntable_can_jog(int32_t microdegrees);
void turntable_jog(int32_t microdegrees); // by this angle, also while the zero is unknown
void turntable_halt(void); // as soon as the ramp allows; after a Home that was stopped, the zero is unknown
void turntable_release(void); // without current it can be turned by hand, so it must be homed again

// Set some of enum wiring, and keep that over a restart. The zero becomes unknown.
void turntable_invert(uint8_t change, uint8_t inverted);

// Starts the next leg of a movement when one has ended. True while turning or settling.
bool turntable_work(uint64_t now_us);
enum turntable_trouble turntable_trouble(void); // of the last movement
int32_t turntable_lost(void); // sum of microsteps missing at the mark since the start

// Called by an interrupt: the position, for a motor that has no steps.
int16_t turntable_steps(void);
// Called by the step interrupt after each step. Returns the ticks until the next, or 0 to end.
uint16_t turntable_step(void);

#endif
