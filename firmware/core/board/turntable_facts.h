/* Constants of the turntable in the parts list of docs/how_to/firmware.md: 200 steps of 16 microsteps, belt 36 : 16.
 * Change MICROSTEPS for another gear. */
#ifndef TURNTABLE_FACTS_H
#define TURNTABLE_FACTS_H

#define MICROSTEPS 7200 // per turn of the table: 0.05 degrees each
#define MICRODEGREES_A_STEP (360000000L / MICROSTEPS)
#define FULL_STEPS 450
#define REACH_DEGREES 720 // limit of the cable in both directions
#define HOMING_LIMIT_DEGREES 750 // homing may exceed REACH_DEGREES, if the table was left at its limit
#define UNPROVEN_DEGREES 400 // limit of one Home towards the cam, until a Home has succeeded with the present wiring
#define MARK_WITHIN_DEGREES 200 // the level of the mark changes every 180 degrees
#define JOG_DEGREES 10 // largest jog
#define CRAWL_SPEED 900 // 45 degrees/s: first Home after a start
#define SPEED 3600 // steps/s: 180 degrees/s
#define HOMING_SPEED 9000 // 450 degrees/s: no pings on the way
#define CREEP_SPEED 1800 // towards the zero mark
#define MARK_DEGREES 120 // greatest distance from the edge of the cam to the mark
#define CREEP_DEGREES 220 // a table that turns the wrong way finds the mark between these two
#define ACCELERATION 80000 // steps/s²: 4 000 degrees/s²
#define BACKLASH_DEGREES 2 // passes a heading by this, to return counter-clockwise
#define LOST_STEPS 8 // tolerance at the mark for its edge; a motor that slips loses 64 at a time
#define MISSING_DEGREES 5 // the mark is missing if not seen this far past its position; 64 steps are 3.2
#define SETTLING_US 20000 // after a movement

#endif
