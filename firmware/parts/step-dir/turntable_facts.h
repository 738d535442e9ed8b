/* Constants of the turntable in the parts list of docs/devices/firmware.md: 200 steps of 16 microsteps, belt 36 : 16.
 * Change MICROSTEPS for another gear. */
#ifndef TURNTABLE_FACTS_H
#define TURNTABLE_FACTS_H

#define TURNING "step-dir" // as TURNING in the Makefile
#define MICROSTEPS 7200 // per turn of the table: 0.05 degrees each
#define MICRODEGREES_A_STEP (360000000L / MICROSTEPS)
#define FULL_STEPS 450
#define HOMING HOMING_WITH_SWITCHES
#define TURNTABLE_FEATURES (FEATURE_HOME_MARK | FEATURE_LOST_STEPS)
#define REACH_DEGREES 720 // limit of the cable in both directions
#define HOMING_LIMIT_DEGREES 750 // homing may exceed REACH_DEGREES, if the table was left at its limit
#define CRAWL_SPEED 900 // 45 degrees/s: first Home after a start
#define SPEED 3600 // steps/s: 180 degrees/s
#define HOMING_SPEED 9000 // 450 degrees/s: no pings on the way
#define CREEP_SPEED 1800 // towards the zero mark
#define ACCELERATION 80000 // steps/s²: 4 000 degrees/s²
#define BACKLASH_DEGREES 2 // passes a heading by this, to return counter-clockwise
#define LOST_STEPS 8 // tolerance at the mark for its edge; a motor that slips loses 64 at a time
#define SETTLING_US 20000 // after a movement

#endif
