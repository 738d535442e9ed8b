/* Constants of a 28BYJ-48 without another gear, in half steps, and without home switches.
 * Change MICROSTEPS to 4076 for motors with a gear of 63.68 : 1. */
#ifndef TURNTABLE_FACTS_H
#define TURNTABLE_FACTS_H

#define TURNING "28byj" // as TURNING in the Makefile
#define MICROSTEPS 4096 // half steps per turn
#define MICRODEGREES_A_STEP (360000000L / MICROSTEPS)
#define FULL_STEPS 2048
#define HOMING HOMING_BY_HAND
#define TURNTABLE_FEATURES 0
#define REACH_DEGREES 360 // limit of the cable in both directions
#define HOMING_LIMIT_DEGREES REACH_DEGREES // for jogs while the zero is unknown
#define CRAWL_SPEED SPEED
#define SPEED 600 // steps/s: 53 degrees/s
#define HOMING_SPEED SPEED
#define CREEP_SPEED SPEED
#define ACCELERATION 3000 // steps/s²
#define BACKLASH_DEGREES 5
#define LOST_STEPS 8
#define SETTLING_US 50000 // after a movement

#endif
