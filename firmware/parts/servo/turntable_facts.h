/* Constants of a hobby servo with a range of 180 degrees; zero is its middle. */
#ifndef TURNTABLE_FACTS_H
#define TURNTABLE_FACTS_H

#define TURNING "servo" // as TURNING in the Makefile
#define MICROSTEPS 8000 // per turn: a step is half a microsecond of the pulse, 0.045 degrees
#define MICRODEGREES_A_STEP (360000000L / MICROSTEPS)
#define FULL_STEPS 0 // not a stepper
#define HOMING HOMING_ABSOLUTE
#define TURNTABLE_FEATURES 0
#define REACH_DEGREES 90
#define HOMING_LIMIT_DEGREES REACH_DEGREES
#define CRAWL_SPEED SPEED
#define SPEED 4000 // steps/s: 180 degrees/s, which small servos can follow
#define HOMING_SPEED SPEED
#define CREEP_SPEED SPEED
#define ACCELERATION 40000 // steps/s²: 1 800 degrees/s²
#define BACKLASH_DEGREES 0 // it measures the angle behind its gear, and has none to pass its ends by
#define LOST_STEPS 8
#define SETTLING_US 150000 // a servo lags behind its pulses

#endif
