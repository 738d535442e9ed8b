/* The turntable of the parts list in docs/how_to/firmware.md: 200 steps of 16 microsteps, geared down by a belt 36 : 16.
 * Another gear means another line here. */
#ifndef TURNTABLE_FACTS_H
#define TURNTABLE_FACTS_H

#define MICROSTEPS 7200 // of a whole turn: a twentieth of a degree each
#define MICRODEGREES_A_STEP (360000000L / MICROSTEPS)
#define FULL_STEPS 450
#define REACH_DEGREES 720 // either way, as far as the cable winds
#define MARGIN_DEGREES 30 // that homing may go beyond, where the table was left at the end of its reach
#define SPEED 3600 // steps/s: 180 degrees a second
#define HOMING_SPEED 9000 // 450 degrees a second: it pings nothing on the way
#define CREEP_SPEED 1800 // onto the zero mark
#define CREEP_DEGREES 120 // that the mark may be away from where the cam changes
#define ACCELERATION 80000 // steps/s²: 4 000 degrees a second in a second
#define BACKLASH_DEGREES 2 // that it passes a heading by, to come back counter-clockwise
#define LOST_STEPS 8 // off the mark that are put down to its edge; a motor that slips loses 64 at a time
#define MISSING_DEGREES 5 // past its place, where a mark that has not come comes no more; 64 steps are 3.2
#define SETTLING_US 20000 // after a move

#endif
